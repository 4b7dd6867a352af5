"""What a robot did: where it was, what it was told, what it saw, and what happened."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from helpers.robot.floor import Floor

if TYPE_CHECKING:
    import pandas as pd


class Step(NamedTuple):
    """The robot after a step of its physics: pose on the floor, speed (m/s), turning (rad/s)."""

    t_s: float
    x: float
    y: float
    yaw: float
    v: float
    w: float


class Command(NamedTuple):
    """A command, and when it arrived: speed (m/s) and turning rate (rad/s), as they were sent."""

    t_s: float
    v: float
    w: float


class Scan(NamedTuple):
    """A scan: its number, the stamp of its message, and its ranges (beams,), float32, in m.

    Beam k looks `first + k * step` (rad) to the left.
    """

    seq: int
    t_s: float
    stamp_ns: int
    ranges: np.ndarray
    first: float
    step: float

    def drawn(self, count: int, most_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Return angles and ranges (count,) for a picture, from the right to the left.

        What is unknown is 0 there, and what is farther than `most_m` ends there.
        """
        angles = self.first + self.step * np.arange(len(self.ranges))
        turned = np.remainder(angles + np.pi, 2 * np.pi) - np.pi
        order = np.argsort(turned, kind='stable')
        few = order[np.linspace(0, len(order) - 1, min(count, len(order))).round().astype(int)]
        known = np.nan_to_num(self.ranges[few], nan=0.0, posinf=most_m, neginf=0.0)
        return turned[few], known.clip(0, most_m)


class Event(NamedTuple):
    """Something that happened. Kinds: 'bump', 'watchdog', 'camera', 'ignored'."""

    t_s: float
    kind: str
    text: str


@dataclass
class DriveRecord:
    """The drive of a robot so far. The lists grow while it drives, and can be read meanwhile.

    All `t_s` are seconds since the robot's start, which was at `started_s` of `time.monotonic()`,
    the clock of recordings. In sim time `started_s` is None, and second 0 has the stamp 1 s.
    """

    floor: Floor
    started_s: float | None = None
    poses: list[Step] = field(default_factory=list)
    commands: list[Command] = field(default_factory=list)
    scans: list[Scan] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def table(self, name: str) -> pd.DataFrame:
        """Return one of the lists, such as 'poses', as a table with a row for each entry."""
        import pandas as pd  # slow to load, and a robot that runs as a program makes no table

        return pd.DataFrame(getattr(self, name))
