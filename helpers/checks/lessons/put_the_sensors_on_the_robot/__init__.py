"""What the tasks of the lesson "Put the sensors on the robot" are judged by.

sensors    where the sensors are: the description, its static transforms, and what they are for
filters    the parameters of two filters
lookup     transforms at a time, and scans that wait for one
bringup    what is launched, and what the wheels know
shared     what several of these look at
"""

from importlib import import_module

from helpers.checks.lessons.put_the_sensors_on_the_robot.shared import tasks

__all__ = ['check', 'tasks']

# Each adds its tasks, in the order of the lesson.
for module in ('sensors', 'filters', 'lookup', 'bringup'):
    import_module(f'{__name__}.{module}')
check = tasks.check
