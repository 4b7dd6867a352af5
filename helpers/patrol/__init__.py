"""Robots that are driven by the program that a learner writes in the last lessons, `patrol_pkg`.

These lessons show the drives, and judge their tasks by them. Something can go wrong on the way:
a cable is unplugged, the laser is blind, a program is ended.

    program   its folder, its modules as they are now, its action, its route
    floors    floors for it
    drives    in simulated time and in this process: a part of it, or its whole node
    launches  as it is started: beside a robot in simulated time, or in real time
"""

from helpers.patrol.drives import (
    CIRCLE,
    CUT,
    DEGREES,
    SNAKE,
    Cable,
    Ear,
    Tour,
    drive,
    estimated,
    round_tour,
    steered,
)
from helpers.patrol.floors import CELLAR, CLOSE, LAST, ON_THE_WAY, write_route_of_cellar
from helpers.patrol.launches import (
    ALL_END,
    ENDS,
    LAUNCH,
    driven_live,
    ended_by,
    killed_alone,
    launched,
    printed,
)
from helpers.patrol.program import PACKAGE, SIM, action, module, route_of

__all__ = [
    'ALL_END',
    'CELLAR',
    'CIRCLE',
    'CLOSE',
    'CUT',
    'DEGREES',
    'ENDS',
    'LAST',
    'LAUNCH',
    'ON_THE_WAY',
    'PACKAGE',
    'SIM',
    'SNAKE',
    'Cable',
    'Ear',
    'Tour',
    'action',
    'drive',
    'driven_live',
    'ended_by',
    'estimated',
    'killed_alone',
    'launched',
    'module',
    'printed',
    'round_tour',
    'route_of',
    'steered',
    'write_route_of_cellar',
]
