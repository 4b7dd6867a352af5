"""What the tasks of the lesson "Build a robot program" are judged by.

driving    a node that drives and stops, and its program
steering   what the laser says, where the robot is, and which way is free
parts      its action, job, battery and watchdog
whole      the whole node, and its route
shared     the tasks that all add to
"""

from importlib import import_module

from helpers.checks.lessons.build_a_robot_program.shared import tasks

__all__ = ['check', 'tasks']

# Each adds its tasks, in the order of the lesson.
for module in ('driving', 'steering', 'parts', 'whole'):
    import_module(f'{__name__}.{module}')
check = tasks.check
