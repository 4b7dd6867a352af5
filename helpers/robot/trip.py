"""A drive that turns to both sides, for what a filter has to follow."""

from __future__ import annotations

import math
import time

from helpers.notebook import ProgressBar
from helpers.robot.robot import Robot


def trip(robot: Robot, *executors, seconds: float = 60.0) -> None:
    """Drive a robot in sim time to and fro, to the left and to the right.

    `simulate` of `helpers.fusion` drives the same way.
    """
    tenths, started_s = round(seconds * 10), time.monotonic()
    with ProgressBar(lambda: tenth / tenths) as bar:
        for tenth in range(tenths):
            t = tenth / 10
            v = 0.5 * min(t, 2) + 0.75 * (math.sin(0.4 * t) - math.sin(0.8)) * (t > 2)
            robot.command(v, 0.05 + 0.3 * math.sin(0.2 * t))
            robot.run(0.1, *executors)
            bar.update(time.monotonic() - started_s)
