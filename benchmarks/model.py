"""How do `predict` and `explain` grow with the messages?"""

from benchmarks.table import Row, growth, seconds
from helpers.queue_model import explain, predict

SIZES = (1_000, 10_000, 100_000, 1_000_000)
# A slow subscriber that loses messages, and two threads that share the work and lose fewer.
RUNS = {'1 thread': 1, '3 threads': 3}
PERIOD_S, CALLBACK_S, DEPTH = 0.05, 0.2, 10


def measure() -> list[Row]:
    """Return both functions, for both runs."""
    rows = []
    for name, threads in RUNS.items():
        predicted, explained = {}, {}
        for size in SIZES:
            rounds = 3 if size > 100_000 else 5

            def run(size=size, threads=threads):
                return predict(PERIOD_S, CALLBACK_S, DEPTH, threads, size)

            predicted[size] = seconds(run, rounds)
            table = run()
            explained[size] = seconds(
                lambda table=table, threads=threads: explain(table, DEPTH, threads), rounds
            )
        rows += growth(f'predict {{}} messages, {name}', predicted)
        rows += growth(f'explain {{}} messages, {name}', explained)
    return rows
