"""What things cost, each beside what it is compared with. For an idle machine.

    make bench                              all of them
    make bench ONLY="latency model"         some of them

No number fails: a reader judges the ratios.
"""

import argparse
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import psutil

from benchmarks.classroom import class_of_40
from benchmarks.latency import KINDS, RATES_HZ, latency_s
from helpers.queue_model import explain, predict

ROOT = Path(__file__).resolve().parent.parent
IDLE_CORES = 0.1


class Row(NamedTuple):
    """A cost beside what it is compared with: several measurements each, in seconds.

    With `unit` '' they are numbers without a unit.
    """

    what: str
    seconds: Sequence[float]
    compared_with: str
    reference: Sequence[float]
    unit: str = 's'


def table(rows: Iterable[Row]) -> str:
    """Return the medians, in brackets the least and the most, and the ratio of the medians."""
    return pd.DataFrame(
        {
            'what': row.what,
            'median (least to most)': _written(row.seconds, row.unit),
            'compared with': f'{row.compared_with}: {_written(row.reference, row.unit)}',
            'ratio': f'{statistics.median(row.seconds) / statistics.median(row.reference):.2f}',
        }
        for row in rows
    ).to_string(index=False)


def _written(seconds: Sequence[float], unit: str) -> str:
    median = statistics.median(seconds)
    factor = 1.0
    if unit and median < 1:
        factor, unit = (1e3, 'ms') if median >= 1e-3 else (1e6, 'us')
    least, middle, most = (factor * each for each in (min(seconds), median, max(seconds)))
    return f'{middle:.3g} {unit}'.rstrip() + (
        f' ({least:.3g} to {most:.3g})' if len(seconds) > 1 else ''
    )


def growth(what: str, costs: dict[int, Sequence[float]]) -> list[Row]:
    """Compare the cost at each size with that at the size before it. `what` has {} for the size."""
    return [
        Row(what.format(f'{more:,}'), costs[more], f'{less:,}', costs[less])
        for less, more in pairwise(costs)
    ]


def seconds(call: Callable, *arguments: object, rounds: int = 3) -> list[float]:
    """Return how long each of some calls took."""
    found = []
    for _ in range(rounds):
        started = time.perf_counter()
        call(*arguments)
        found.append(time.perf_counter() - started)
    return found


# --- What is measured ----------------------------------------------------------------------------


def latency(rates_hz: Sequence[int] = RATES_HZ, rounds: int = 16) -> Iterable[Row]:
    """From publish to callback: a session with a recorder, against a plain rclpy script."""
    for rate in rates_hz:
        found = {kind: [] for kind in KINDS}
        for turn in range(rounds):  # one run can be a fifth slower than the next: they take turns
            for kind in list(KINDS)[:: 1 if turn % 2 else -1]:
                found[kind].append(latency_s(kind, rate))
        script, *others = KINDS
        for kind in others:
            yield Row(f'{kind}, {rate} Hz', found[kind], script, found[script])


def model(sizes: Sequence[int] = (1_000, 10_000, 100_000, 1_000_000)) -> Iterable[Row]:
    """How `predict` and `explain` grow with the messages of a slow subscriber that loses some."""
    for threads in (1, 3):
        settings = 0.05, 0.2, 10, threads
        predicted = {size: seconds(predict, *settings, size) for size in sizes}
        explained = {
            size: seconds(explain, predict(*settings, size), 10, threads) for size in sizes
        }
        yield from growth(f'predict {{}} messages, threads: {threads}', predicted)
        yield from growth(f'explain {{}} messages, threads: {threads}', explained)


def checks() -> Iterable[Row]:
    """`make test`, against the lessons under nbval alone. It takes half an hour."""
    found = {'make test': [], 'pytest -n 4 --dist loadscope notebooks': []}
    for _ in range(3):
        for command, costs in found.items():
            words = [*([sys.executable, '-m'] if 'pytest' in command else []), *command.split()]
            run = partial(subprocess.run, words, cwd=ROOT, stdout=subprocess.DEVNULL, check=True)
            costs += seconds(run, rounds=1)
    (whole, all_s), (alone, notebooks_s) = found.items()
    return [Row(whole, all_s, alone, notebooks_s)]


def classroom() -> Iterable[Row]:
    """Lesson 02 in twelve kernels, each in turns in a class of 40 and out of it."""
    inside, without, delays, server_s = class_of_40()
    ratios = [one / other for one, other in zip(inside, without, strict=True)]
    return [
        Row('a cell of lesson 02 in a class of 40', inside, 'in no class', without),
        Row(
            f'the same, {len(ratios)} cells, each against itself',
            ratios,
            'in no class',
            [1.0],
            unit='',
        ),
        Row('from a hand to the page', delays, 'wanted', [1.0]),
        Row("the class's server, a minute", [server_s], 'a core', [60.0]),
    ]


BENCHMARKS = {b.__name__: b for b in (latency, model, checks, classroom)}


# --- The tool ------------------------------------------------------------------------------------


def busy_cores(pause_s: float = 2.0) -> float:
    """Return how many cores of this machine work while this process sleeps."""
    idle = psutil.cpu_times_percent(interval=pause_s)
    return (1 - (idle.idle + idle.iowait) / 100) * psutil.cpu_count()


def main(arguments: list[str] | None = None) -> None:
    """Run what the command line names."""
    parser = argparse.ArgumentParser(prog='make bench', description=__doc__.splitlines()[0])
    parser.add_argument('names', nargs='*', metavar='NAME', help=', '.join(BENCHMARKS))
    names = parser.parse_args(arguments).names or BENCHMARKS
    if unknown := sorted(set(names) - set(BENCHMARKS)):
        parser.error(f'{unknown[0]} is none of {", ".join(BENCHMARKS)}')
    rows, remarks = [], []
    for name in names:
        print(f'measuring: {name}', flush=True)
        busy = busy_cores()
        try:
            rows += BENCHMARKS[name]()
        except Exception as error:  # the others are measured all the same
            remarks.append(f'{name} failed: {error}')
        busy = max(busy, busy_cores())
        if busy > IDLE_CORES:
            remarks.append(f'{name} is not valid: something else used {busy:.1f} cores.')
    print(f'\n{table(rows)}' if rows else '', *remarks, sep='\n')


if __name__ == '__main__':
    main()
