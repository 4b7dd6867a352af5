"""What things cost, each beside what it is compared with. For an idle machine.

    python -m benchmarks                    all of them
    python -m benchmarks latency model      some of them

No number fails: a reader judges the ratios.
"""

import argparse
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import nbformat
import pandas as pd
import psutil

from benchmarks.latency import KINDS, RATES_HZ, latency_s
from helpers.fusion import fuse, simulate
from helpers.queue_model import explain, predict
from helpers.workspace import Workspace

ROOT = Path(__file__).resolve().parent.parent
IDLE_CORES = 0.1


class Row(NamedTuple):
    """A cost beside what it is compared with: both are several measurements, in seconds."""

    what: str
    seconds: Sequence[float]
    compared_with: str
    reference: Sequence[float]


def table(rows: Iterable[Row]) -> str:
    """Return the medians, in brackets the least and the most, and the ratio of the medians."""
    return pd.DataFrame(
        {
            'what': row.what,
            'median (least to most)': _written(row.seconds),
            'compared with': f'{row.compared_with}: {_written(row.reference)}',
            'ratio': f'{statistics.median(row.seconds) / statistics.median(row.reference):.2f}',
        }
        for row in rows
    ).to_string(index=False)


def _written(seconds: Sequence[float]) -> str:
    median = statistics.median(seconds)
    factor, unit = (1, 's') if median >= 1 else (1e3, 'ms') if median >= 1e-3 else (1e6, 'us')
    least, middle, most = (factor * each for each in (min(seconds), median, max(seconds)))
    return f'{middle:.3g} {unit}' + (f' ({least:.3g} to {most:.3g})' if len(seconds) > 1 else '')


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


def fusion(sizes: Sequence[int] = (600, 6_000, 60_000)) -> Iterable[Row]:
    """One step of the filter, in drives of different lengths."""
    costs = {}
    for steps in sizes:
        measurements = simulate(seed=9, seconds=steps / 50).measurements
        costs[steps] = [each / len(measurements) for each in seconds(fuse, measurements)]
    return growth('one of {} steps of the filter', costs)


def interface(sizes: Sequence[int] = (1, 10), rounds: int = 3) -> Iterable[Row]:
    """Build a package of services from nothing: that of the lesson on interfaces, and copies."""
    costs = {count: [_build_s(count) for _ in range(rounds)] for count in sizes}
    return growth('build a package of {} services', costs)


def _build_s(count: int) -> float:
    (path,) = (ROOT / 'notebooks').glob('*_use_a_message_in_your_own_interface.ipynb')
    texts = {}  # a file that the lesson writes twice keeps its last text
    for cell in nbformat.read(path, as_version=4).cells:
        if found := re.match(r'%%write (src/custom_interfaces/\S+)\n', cell.source):
            texts[found[1]] = cell.source[found.end() :]
    (service,) = (name for name in texts if name.endswith('.srv'))
    short = service.removeprefix('src/custom_interfaces/')
    copies = [short.replace('.srv', f'{number}.srv') for number in range(1, count)]
    texts |= {f'src/custom_interfaces/{copy}': texts[service] for copy in copies}
    cmake = 'src/custom_interfaces/CMakeLists.txt'
    listed = ' '.join(f'"{name}"' for name in [short, *copies])
    # The lesson leaves out one line, which the reader adds.
    texts[cmake] = texts[cmake].replace(f'"{short}"', f'{listed} DEPENDENCIES sensor_msgs')
    workspace = Workspace('benchmark')
    for name, text in texts.items():
        workspace.write(name, text)
    started = time.perf_counter()
    result = workspace.build()
    if not result.ok:
        raise RuntimeError(str(result))
    return time.perf_counter() - started


def set_up() -> Iterable[Row]:
    """The installation, with empty caches and with filled ones. A slow network slows it."""
    with tempfile.TemporaryDirectory() as folder:
        checkout = shutil.copytree(
            ROOT,
            Path(folder, 'checkout'),
            ignore=shutil.ignore_patterns('.*', 'notebooks', 'scratch'),
        )
        caches = {f'{tool}_CACHE_DIR': str(Path(folder, tool)) for tool in ('UV', 'PIP')}
        found = {'empty caches': [], 'filled caches': []}
        for _ in range(3):
            for caches_are, costs in found.items():
                if caches_are == 'empty caches':
                    for cache in caches.values():
                        shutil.rmtree(cache, ignore_errors=True)
                shutil.rmtree(checkout / '.venv', ignore_errors=True)
                costs += seconds(
                    lambda: subprocess.run(
                        ['tools/set_up.sh'], cwd=checkout, env=os.environ | caches, check=True
                    ),
                    rounds=1,
                )
        empty, filled = found.values()
        return [Row('set-up, empty caches', empty, 'filled caches', filled)]


def checks() -> Iterable[Row]:
    """`make test`, against the lessons under nbval alone. It takes half an hour."""
    found = {'make test': [], 'pytest -n 4 notebooks': []}
    for _ in range(3):
        for command, costs in found.items():
            words = [*([sys.executable, '-m'] if 'pytest' in command else []), *command.split()]
            run = partial(subprocess.run, words, cwd=ROOT, stdout=subprocess.DEVNULL, check=True)
            costs += seconds(run, rounds=1)
    (whole, all_s), (alone, notebooks_s) = found.items()
    return [Row(whole, all_s, alone, notebooks_s)]


BENCHMARKS = {b.__name__: b for b in (latency, model, fusion, interface, set_up, checks)}


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
