"""What the tasks of the lesson "Keep what is fresh" are judged by.

brakes     what a scan says, how old it is, and a brake that works with the newest one
silence    what notices that no scan comes: a watchdog, events, a QoS
shared     the tasks that both add to
"""

from importlib import import_module

from helpers.checks.lessons.keep_what_is_fresh.shared import tasks

__all__ = ['check', 'tasks']

# Each adds its tasks, in the order of the lesson.
for module in ('brakes', 'silence'):
    import_module(f'{__name__}.{module}')
check = tasks.check
