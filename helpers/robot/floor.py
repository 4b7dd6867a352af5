"""The floor that a robot drives on: walls and boxes, where it starts, and places with a name."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

HEADINGS = {'>': 0.0, '^': math.pi / 2, '<': math.pi, 'v': -math.pi / 2}
WALL, BOX, FREE = '#', 'o', ' '
BOX_SIZE_M = 0.3


class Block(NamedTuple):
    """A wall or a box: a rectangle along the axes (m)."""

    x0: float
    y0: float
    x1: float
    y1: float
    kind: str = 'wall'

    def distance(self, x: float, y: float) -> float:
        """Return how far a point is from the block (m), 0 inside."""
        return math.hypot(max(self.x0 - x, 0.0, x - self.x1), max(self.y0 - y, 0.0, y - self.y1))


class Pose(NamedTuple):
    """A place on a floor (m), and where one looks from it (rad, from x to the left)."""

    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class Floor:
    """A floor seen from above: x to the right, y up, 0, 0 in its lower left corner (m).

    `walls` has the walls and the boxes, `size_m` is width and height, `start` the pose in which a
    robot starts, and `places` has the points (x, y) with a name. Beyond its edge nothing is.
    """

    walls: tuple[Block, ...]
    size_m: tuple[float, float]
    start: Pose
    name: str = 'floor'
    places: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @classmethod
    def from_text(cls, text: str, cell_m: float = 0.5, name: str = 'floor') -> Floor:
        """Return the floor of a text, one character a square of `cell_m` metres.

        `#` is a wall, `o` a box of 0.3 m in the middle of its square, a space is free, and one of
        `>`, `<`, `^`, `v` is where the robot starts and looks. Any other letter or digit is a place
        with this name, each once. Empty lines before and after do not count.

        Raises ValueError, with a sentence that says what to change, for anything else, and where
        the robot cannot leave its square or cannot come to a place.
        """
        if not (math.isfinite(cell_m) and cell_m >= 0.3):
            raise ValueError(f'A square of a floor has 0.3 m or more, for the robot, not {cell_m}.')
        rows = _rows(text)
        marks = {
            (column, row): mark
            for row, line in enumerate(reversed(rows))
            for column, mark in enumerate(line)
        }
        _check(marks)
        start = next(square for square, mark in marks.items() if mark in HEADINGS)

        def middle(square: tuple[int, int]) -> tuple[float, float]:
            return (square[0] + 0.5) * cell_m, (square[1] + 0.5) * cell_m

        half = BOX_SIZE_M / 2
        boxes = [middle(square) for square, mark in marks.items() if mark == BOX]
        return cls(
            walls=(
                *_walls(rows, cell_m),
                *(Block(x - half, y - half, x + half, y + half, 'box') for x, y in boxes),
            ),
            size_m=(len(rows[0]) * cell_m, len(rows) * cell_m),
            start=Pose(*middle(start), HEADINGS[marks[start]]),
            name=name,
            places={
                mark: middle(square)
                for square, mark in marks.items()
                if mark.isalnum() and mark not in (BOX, *HEADINGS)
            },
        )

    def clearance(self, x: float, y: float) -> float:
        """Return how far a point is from the nearest wall or box (m), infinite where none is."""
        return min((block.distance(x, y) for block in self.walls), default=math.inf)

    @cached_property
    def _edges(self) -> tuple[np.ndarray, ...]:
        """Return of all blocks the edges x0, y0, x1, y1, each (blocks,)."""
        return tuple(np.array([block[i] for block in self.walls], float) for i in range(4))

    def ranges(self, x: float, y: float, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far one sees from a point in each direction, and which of `walls` one sees.

        `angles` (n,) are in rad. The distances (n,) in m are infinite where nothing is, and the
        numbers (n,) are then -1. From inside of a block, the distances are 0.
        """
        if not self.walls:
            return np.full(len(angles), np.inf), np.full(len(angles), -1)
        # A ray is inside of a block while it is between both pairs of edges. One along an edge
        # touches it: no direction is exactly 0.
        x0, y0, x1, y1 = self._edges
        cos, sin = np.cos(angles)[:, np.newaxis], np.sin(angles)[:, np.newaxis]
        along_x = 1 / np.where(np.abs(cos) < 1e-12, 1e-12, cos)
        along_y = 1 / np.where(np.abs(sin) < 1e-12, 1e-12, sin)
        a, b = (x0 - x) * along_x, (x1 - x) * along_x
        c, d = (y0 - y) * along_y, (y1 - y) * along_y
        enter = np.maximum(np.minimum(a, b), np.minimum(c, d))
        leave = np.minimum(np.maximum(a, b), np.maximum(c, d))
        seen = np.where((leave >= enter) & (leave >= 0), np.maximum(enter, 0), np.inf)
        nearest = seen.argmin(axis=1)
        distance = seen[np.arange(len(angles)), nearest]
        return distance, np.where(np.isinf(distance), -1, nearest)


def _rows(text: str) -> list[str]:
    rows = re.sub(r'\A(\s*\n)+|\s*\Z', '', text).split('\n')
    for number, row in enumerate(rows, 1):
        if len(row) != len(rows[0]):
            raise ValueError(
                f'All lines of a floor are equally long: line 1 has {len(rows[0])} characters, '
                f'line {number} has {len(row)}.'
            )
    return rows


def _check(marks: dict[tuple[int, int], str]) -> None:
    for mark in marks.values():
        if mark not in (WALL, BOX, FREE, *HEADINGS) and not mark.isalnum():
            raise ValueError(
                f'{mark!r} means nothing on a floor: use # for a wall, o for a box, a space, one '
                'of > < ^ v for the start, and a letter or digit for a place.'
            )
    starts = [square for square, mark in marks.items() if mark in HEADINGS]
    if len(starts) != 1:
        raise ValueError(
            f'This floor has {len(starts) or "no"} start{"s" * (len(starts) > 1)}: write one of '
            '> < ^ v where the robot starts, once.'
        )
    places = [mark for mark in marks.values() if mark.isalnum() and mark not in (BOX, *HEADINGS)]
    reached = _reached(marks, starts[0])
    if len(reached) == 1:
        raise ValueError('The robot cannot leave its start: leave a square beside it free.')
    away = sorted(
        mark for square, mark in marks.items() if mark in places and square not in reached
    )
    if away:
        raise ValueError(f'No way leads from the start to {away[0]}: leave a door in the walls.')


def _reached(marks: dict[tuple[int, int], str], start: tuple[int, int]) -> set[tuple[int, int]]:
    """Return the squares to which a way leads."""
    reached, new = {start}, [start]
    while new:
        x, y = new.pop()
        for square in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if marks.get(square, WALL) not in (WALL, BOX) and square not in reached:
                reached.add(square)
                new.append(square)
    return reached


def _walls(rows: list[str], cell_m: float) -> list[Block]:
    """Return the walls. Squares side by side are one, and so are equal walls of two rows."""
    begun: dict[tuple[int, int, int], int] = {}  # left, right and upper edge: lower edge
    for y, row in enumerate(reversed(rows)):
        for run in re.finditer('#+', row):
            begun[*run.span(), y + 1] = begun.pop((*run.span(), y), y)
    return [
        Block(x0 * cell_m, y0 * cell_m, x1 * cell_m, y1 * cell_m)
        for (x0, x1, y1), y0 in begun.items()
    ]


EMPTY = Floor((), (10.0, 10.0), Pose(5.0, 5.0, 0.0), 'empty')

# 3.25 m to the wall: 6 s at 0.5 m/s, three times as long as a queue of ten scans needs to be full.
CORRIDOR = Floor.from_text(
    """
##########
#        #
# >      #
#        #
##########
""",
    name='corridor',
)

ROOMS = Floor.from_text(
    """
####################
#        #         #
# A      #      B  #
#                  #
#   o         o    #
#        #         #
#        #    o    #
####  ########  ####
#        #         #
#    o   #         #
# >            C   #
#        #   o     #
#        #         #
####################
""",
    name='rooms',
)

FLOORS = {floor.name: floor for floor in (EMPTY, CORRIDOR, ROOMS)}
