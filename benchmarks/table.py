"""The rows of `make bench`, and the seconds of a call."""

import statistics
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple


class Row(NamedTuple):
    """A cost beside what it is compared with: both are several measurements, in seconds.

    The ratio of the table is that of the medians.
    """

    what: str
    seconds: Sequence[float]
    compared_with: str
    reference: Sequence[float]

    @property
    def ratio(self) -> float:
        """How many times the reference the cost is."""
        return statistics.median(self.seconds) / statistics.median(self.reference)

    def cells(self) -> list[str]:
        """Return the four cells of the row."""
        return [
            self.what,
            _written(self.seconds),
            f'{self.compared_with}: {_written(self.reference)}',
            f'{self.ratio:.2f}',
        ]


def growth(name: str, costs: dict[int, Sequence[float]]) -> list[Row]:
    """Compare the cost at each size with that at the size before it. `name` has {} for the size."""
    sizes = sorted(costs)
    return [
        Row(name.format(f'{more:,}'), costs[more], f'{less:,}', costs[less])
        for less, more in pairwise(sizes)
    ]


def seconds(call: Callable[[], object], rounds: int) -> list[float]:
    """Return how long each of some calls took."""
    found = []
    for _ in range(rounds):
        started = time.perf_counter()
        call()
        found.append(time.perf_counter() - started)
    return found


def print_table(rows: Sequence[Row]) -> None:
    """Print the rows: the median, and in brackets the least and the most."""
    cells = [['', 'median (least to most)', 'compared with', 'ratio'], *(r.cells() for r in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for what, cost, reference, ratio in cells:
        print(
            f'{what:{widths[0]}}  {cost:{widths[1]}}  {reference:{widths[2]}}  {ratio:>{widths[3]}}'
        )


def _written(measured: Sequence[float]) -> str:
    median = statistics.median(measured)
    factor, unit = next(
        (factor, unit)
        for factor, unit, least in ((1, 's', 1), (1e3, 'ms', 1e-3), (1e6, 'us', 0))
        if median >= least
    )
    least, most = (f'{factor * end:.3g}' for end in (min(measured), max(measured)))
    spread = f' ({least} to {most})' if len(measured) > 1 else ''
    return f'{factor * median:.3g} {unit}{spread}'
