"""From publish to callback: a session with a recorder, beside a plain rclpy script.

    make bench                       at 20, 200 and 1000 Hz, some minutes on an idle machine
    make bench ONLY="20 200"         at these rates

No number fails: a reader judges the ratios.
"""

import argparse
from collections.abc import Sequence
from statistics import median

import pandas as pd
import psutil

from benchmarks.latency import KINDS, RATES_HZ, latency_s

ROUNDS = 16
IDLE_CORES = 0.1


def measure(rate_hz: int, rounds: int = ROUNDS) -> dict[str, list[float]]:
    """Return the median latency of each run of each kind, in seconds.

    One run can be a fifth slower than the next, so the kinds take turns.
    """
    latencies = {kind: [] for kind in KINDS}
    for turn in range(rounds):
        for kind in list(KINDS)[:: 1 if turn % 2 else -1]:
            latencies[kind].append(latency_s(kind, rate_hz))
    return latencies


def table(rate_hz: int, latencies: dict[str, Sequence[float]]) -> pd.DataFrame:
    """Return for each kind the median, the least and the most, and the ratio to the first kind."""
    first = median(next(iter(latencies.values())))
    return pd.DataFrame(
        {
            'rate': f'{rate_hz} Hz',
            'kind': kind,
            'median (least to most), us': '{:.0f} ({:.0f} to {:.0f})'.format(
                *(1e6 * value for value in (median(runs), min(runs), max(runs)))
            ),
            'ratio': f'{median(runs) / first:.2f}',
        }
        for kind, runs in latencies.items()
    )


def busy_cores(pause_s: float = 2.0) -> float:
    """Return how many cores of this machine work while this process sleeps."""
    idle = psutil.cpu_times_percent(interval=pause_s)
    return (1 - (idle.idle + idle.iowait) / 100) * psutil.cpu_count()


def main(arguments: list[str] | None = None) -> None:
    """Measure at the rates of the command line."""
    parser = argparse.ArgumentParser(prog='make bench', description=__doc__.splitlines()[0])
    parser.add_argument('rates', nargs='*', type=int, metavar='HZ', default=RATES_HZ)
    rates = parser.parse_args(arguments).rates
    busy = busy_cores()
    tables = []
    for rate in rates:
        print(f'measuring at {rate} Hz', flush=True)
        tables.append(table(rate, measure(rate)))
    print(pd.concat(tables).to_string(index=False))
    busy = max(busy, busy_cores())
    if busy > IDLE_CORES:
        print(f'Not valid: something else used {busy:.1f} cores.')


if __name__ == '__main__':
    main()
