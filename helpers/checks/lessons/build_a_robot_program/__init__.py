"""What the tasks of the lesson "Build a robot program" are judged by.

driving    a node that drives and stops, and its program
steering   what the laser says, where the robot is, and which way is free
parts      its action, job, battery and watchdog
whole      the whole node, and its route
starting   what is installed, and what starts it
testing    the student's tests, which test right programs and wrong ones
turtlebot  a TurtleBot 3
own_floor  a floor of the student's own
shared     what several of these look at
"""

from importlib import import_module

from helpers.checks.lessons.build_a_robot_program.shared import tasks

__all__ = ['check', 'tasks']

MODULES = 'driving steering parts whole starting testing turtlebot own_floor'

# Each adds its tasks, in the order of the lesson.
for module in MODULES.split():
    import_module(f'{__name__}.{module}')
check = tasks.check
