"""Run the benchmarks and print one table.

    python -m benchmarks                    all of them
    python -m benchmarks latency model      some of them

No number fails: a reader judges the ratios.
"""

import argparse
import importlib
import os
import time

from benchmarks.table import print_table

# The first and the last two take minutes. Each has a function `measure` that returns rows.
NAMES = ('latency', 'recorder', 'model', 'fusion', 'two_threads', 'interface', 'set_up', 'checks')
IDLE_CORES = 0.1


def busy_cores(pause_s: float = 2.0) -> float:
    """Return how many cores of this machine work while this process sleeps."""

    def idle_and_all() -> tuple[int, int]:
        with open('/proc/stat') as file:
            ticks = [int(number) for number in file.readline().split()[1:9]]
        return ticks[3] + ticks[4], sum(ticks)

    idle, total = idle_and_all()
    time.sleep(pause_s)
    idle_later, total_later = idle_and_all()
    return (1 - (idle_later - idle) / (total_later - total)) * len(os.sched_getaffinity(0))


def main() -> None:
    """Run what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('names', nargs='*', metavar='NAME', help=', '.join(NAMES))
    names = parser.parse_args().names or NAMES
    if unknown := set(names) - set(NAMES):
        parser.error(f'{unknown.pop()} is none of {", ".join(NAMES)}')
    rows, remarks = [], []
    for name in names:
        print(f'measuring: {name}', flush=True)
        busy = busy_cores()
        try:
            rows += importlib.import_module(f'benchmarks.{name}').measure()
        except Exception as error:  # the others are measured all the same
            remarks.append(f'{name} failed: {error}')
        busy = max(busy, busy_cores())
        if busy > IDLE_CORES:
            remarks.append(f'{name} is not valid: something else used {busy:.1f} cores.')
    print()
    print_table(rows)
    print(*remarks, sep='\n')


if __name__ == '__main__':
    main()
