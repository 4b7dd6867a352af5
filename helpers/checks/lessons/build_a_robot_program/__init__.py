"""What the tasks of the lesson "Build a robot program" are judged by.

driving    a node that drives, a program that ends, a wall
steering   the functions of logic.py
parts      the parts of the node: where it is, its action, job, battery, watchdog
whole      the whole node, and where it comes
starting   what is installed, and what starts it
testing    the student's tests, which test right programs and wrong ones
turtlebot  a TurtleBot 3
shared     what several of these look at
"""

from helpers.checks.lessons.build_a_robot_program import (
    driving,
    parts,
    starting,
    steering,
    testing,
    turtlebot,
    whole,
)
from helpers.checks.lessons.build_a_robot_program.shared import tasks

# Each of the modules adds its tasks.
__all__ = [
    'check',
    'driving',
    'parts',
    'starting',
    'steering',
    'tasks',
    'testing',
    'turtlebot',
    'whole',
]

check = tasks.check
