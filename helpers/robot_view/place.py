"""A guess of a place: where a robot ends that drives straight ahead, or a point on a floor."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from helpers.guesses import number_of
from helpers.robot import RADIUS_M, DriveRecord, Floor, Pose, Robot
from helpers.robot_view.picture import edges, floor_in_words, floor_picture, is_lane
from helpers.robot_view.replay import Drive, thinned

SCRIPTS = (Path(__file__).with_name('place.js'),)
PATH = 200  # points of a path in a picture, at most
HITS = {'wall', 'the wall', 'hits', 'hit', 'it hits the wall', 'no', 'false', '0'}


@dataclass(frozen=True)
class Place:
    """Where the robot ends that starts at `start` (the floor's own start) and drives straight on.

    A value is the distance (m) from its middle to what is ahead, as its laser measures it. `line_m`
    is such a distance, of a line in the picture, and `line` what the line is called.

    Raises ValueError where nothing is ahead.
    """

    floor: Floor
    line_m: float | None = None
    start: Pose | None = None
    line: str = 'limit: {:g} m'

    scripts = SCRIPTS
    asks = 'Put your robot where it ends: click there, drag it, or press the arrow keys.'

    def __post_init__(self) -> None:
        if not math.isfinite(self.ahead_m):
            raise ValueError(f'On the floor {self.floor.name} nothing is ahead of the robot.')

    @property
    def forms(self) -> str:
        return (
            'Typed in place of the dots: the metres from its middle to the wall, such as 1.2, or '
            "'wall' if it hits it."
        )

    @property
    def axis(self) -> tuple[float, float]:
        """The metres before what is ahead, up to where the robot starts."""
        return 0.0, self.ahead_m

    @property
    def begin(self) -> Pose:
        return self.start or self.floor.start

    @property
    def ahead_m(self) -> float:
        """How far what is ahead is from where the robot starts (m)."""
        x, y, yaw = self.begin
        (distance,), _ = self.floor.ranges(x, y, np.array([yaw]))
        return float(distance)

    def record(self) -> dict:
        return {
            'kind': 'place',
            'start': [round(number, 3) for number in self.begin],
            'ahead': round(self.ahead_m, 3),
            'radius': RADIUS_M,
            'line': self.line_m,
            'label': self.line.format(self.line_m) if self.line_m else '',
        }

    def picture(self) -> str:
        return floor_picture(self.floor, [self.begin[:2]], self.begin, as_lane=is_lane(self.floor))

    def words(self) -> str:
        line = self.line.partition(':')[0]
        line = f' A line, {line}, is {self.line_m:g} m before the wall.' if self.line_m else ''
        return floor_in_words(self.floor) + line

    def read(self, typed: object) -> float:
        """Return metres of 0.3, '0.3 m', 'wall', or False, which says that it does not stop."""
        text = typed.strip().casefold() if isinstance(typed, str) else ''
        if typed is False or text in HITS:
            return RADIUS_M
        number = number_of(text.removesuffix('before the wall').strip() if text else typed, 'm')
        if number is None:
            raise ValueError(f'{typed!r} is no place. {self.forms}')
        if not 0 <= number <= self.ahead_m:
            raise ValueError(
                f'{typed!r} is no place: the robot starts {self.ahead_m:g} m before the wall. '
                f'{self.forms}'
            )
        return max(float(number), RADIUS_M)

    def told(self, value: float) -> float:
        return round(value, 1)  # many are one bar

    def outcome(self, measured: Robot | DriveRecord, run: object, tolerance: float) -> dict:
        """Return where a robot ended, what it hit, and why.

        `run` is the drive as `watch` has shown it, if it was: it knows the scans that were used.
        """
        record = getattr(measured, 'record', measured)
        drive = run if getattr(run, 'record_', None) is record else Drive(record, '')
        return drive.ended(self)

    def answer(self, outcome: dict) -> str:
        return f'{"in" if outcome["hit"] else "before"} {outcome["what"]}'

    def distance_m(self, x: float, y: float) -> float:
        """Return how far what is ahead is from a point on the way (m)."""
        x0, y0, yaw = self.begin
        return self.ahead_m - ((x - x0) * math.cos(yaw) + (y - y0) * math.sin(yaw))


@dataclass(frozen=True)
class Point:
    """A point on a floor, as the robot sees it that stands at the start of the floor.

    A value is [x, y] (m): x ahead of this robot, y to its left. `marks` are other such points, by
    their names in the picture.
    """

    floor: Floor
    marks: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    scripts = SCRIPTS
    axis = None
    asks = 'Put your point on the floor: click there, drag it, or press the arrow keys.'
    forms = (
        'Typed in place of the dots: (x, y) in metres from the start, x ahead and y to its left, '
        'such as (1.5, -0.5).'
    )

    @property
    def plane(self) -> tuple[float, float, float, float]:
        """From where to where the floor is drawn (x, y, x, y in m), on the floor."""
        return edges(self.floor)

    def record(self) -> dict:
        return {
            'kind': 'place',
            'start': [round(number, 3) for number in self.floor.start],
            'plane': [round(number, 3) for number in self.plane],
            'marks': {name: [*point] for name, point in self.marks.items()},
        }

    def picture(self) -> str:
        start = self.floor.start
        return floor_picture(self.floor, [start[:2]], start)

    def words(self) -> str:
        width, height = self.floor.size_m
        marks = [f' {name} is at {x:g}, {y:g}.' for name, (x, y) in self.marks.items()]
        floor = (
            f'The floor {self.floor.name}, {width:g} m by {height:g} m, from above, with the robot.'
        )
        return floor + ''.join(marks)

    def read(self, typed: object) -> list[float]:
        """Return [x, y] of two numbers, such as (1.5, -0.5), '1,5 -0,5' or {'x': 1.5, 'y': -0.5}.

        Raises ValueError for anything else, and for a point that is not on the floor.
        """
        found = typed
        if isinstance(typed, str):
            # A comma is a decimal point, too, if two numbers are left.
            found = re.findall(r'[-+]?\d+(?:[.,]\d+)?', typed)
            found = found if len(found) == 2 else re.findall(r'[-+]?\d+(?:\.\d+)?', typed)
        elif isinstance(typed, Mapping):
            found = [typed.get('x'), typed.get('y')]
        elif hasattr(typed, 'tolist'):
            found = typed.tolist()
        numbers = [number_of(one, 'm') for one in found] if _are_two(found) else [None]
        if None in numbers or not all(map(math.isfinite, numbers)):
            raise ValueError(f'{typed!r} is no point. {self.forms}')
        left, low, right, high = self.plane
        x, y = self.on_floor(*numbers)
        if not (left <= x <= right and low <= y <= high):
            raise ValueError(f'{typed!r} is not on this floor. {self.forms}')
        return [round(number, 2) for number in numbers]

    def on_floor(self, x: float, y: float) -> tuple[float, float]:
        """Return where on the floor a point is that is seen from the robot."""
        x0, y0, yaw = self.floor.start
        return (
            x0 + x * math.cos(yaw) - y * math.sin(yaw),
            y0 + x * math.sin(yaw) + y * math.cos(yaw),
        )

    def share(self, value: Sequence[float]) -> tuple[float, float]:
        """Return where on the picture of the floor a point is, from 0, 0 to 1, 1."""
        x, y = self.on_floor(*value)
        left, low, right, high = self.plane
        return round((x - left) / (right - left), 3), round((y - low) / (high - low), 3)

    def told(self, value: Sequence[float]) -> list[float]:
        grain = 0.5 if max(self.floor.size_m) > 4 else 0.1  # many are one bar
        return [round(grain * round(number / grain), 1) for number in value]

    def outcome(self, measured: Sequence, run: object, tolerance: float) -> dict:
        """Return where it is, and the path that led there.

        `measured` is a point, or a path (n, 2) whose end it is, both as the robot sees them.
        """
        path = np.reshape(np.asarray(measured, float), (-1, 2)).round(3)
        return {
            'at': path[-1].tolist(),
            'path': thinned(path.tolist(), PATH),
            'tolerance': tolerance,
        }

    def answer(self, outcome: Mapping) -> str:
        """Return on which side of the start it is: that is the same in each run."""
        x, y = outcome['at']
        far = max(outcome['tolerance'], RADIUS_M)
        sides = [
            'ahead of the start' if x > far else 'behind the start' if x < -far else '',
            'to its left' if y > far else 'to its right' if y < -far else '',
        ]
        return ', '.join(filter(None, sides)) or 'where the robot starts'


def _are_two(found: object) -> bool:
    return isinstance(found, Sequence) and not isinstance(found, str) and len(found) == 2
