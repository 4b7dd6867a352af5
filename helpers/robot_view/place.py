"""A guess of a place: where a robot ends that drives straight ahead."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from helpers.guesses import number_of
from helpers.robot import RADIUS_M, DriveRecord, Floor, Pose, Robot
from helpers.robot_view.picture import floor_in_words, floor_picture, is_lane
from helpers.robot_view.replay import Drive

HITS = {'wall', 'the wall', 'hits', 'hit', 'it hits the wall', 'no', 'false', '0'}


@dataclass(frozen=True)
class Place:
    """Where the robot ends that starts at `start` (the floor's own start) and drives straight on.

    A value is the distance (m) from its middle to what is ahead, as its laser measures it. `line_m`
    is such a distance, of a line in the picture.

    Raises ValueError where nothing is ahead.
    """

    floor: Floor
    line_m: float | None = None
    start: Pose | None = None

    scripts = (Path(__file__).with_name('place.js'),)
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
            'label': f'limit: {self.line_m:g} m' if self.line_m else '',
        }

    def picture(self) -> str:
        return floor_picture(self.floor, [self.begin[:2]], self.begin, as_lane=is_lane(self.floor))

    def words(self) -> str:
        line = f' A line is {self.line_m:g} m before the wall.' if self.line_m else ''
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
