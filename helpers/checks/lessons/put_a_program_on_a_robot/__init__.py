"""What the tasks of the lesson "Put a program on a robot" are judged by.

starting   what is installed, and what starts it
testing    the student's tests, which test right programs and wrong ones
turtlebot  a TurtleBot 3
own_floor  a floor of the student's own
shared     the tasks that all add to
"""

from importlib import import_module

from helpers.checks.lessons.put_a_program_on_a_robot.shared import tasks

__all__ = ['check', 'tasks']

# Each adds its tasks, in the order of the lesson.
for module in ('starting', 'testing', 'turtlebot', 'own_floor'):
    import_module(f'{__name__}.{module}')
check = tasks.check
