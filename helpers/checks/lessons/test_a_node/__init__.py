"""What the tasks of the lesson "Test a node" are judged by: the student's tests test the tests.

brake      a function, the bench, a flaky test, and colcon
lifecycle  a brake and a camera with a lifecycle, and the tests that find six bugs
shared     the student's tests with versions of ours, and tests of ours with what the student wrote
"""

from importlib import import_module

from helpers.checks.lessons.test_a_node.shared import tasks

__all__ = ['check', 'tasks']

# Each adds its tasks, in the order of the lesson.
for module in ('brake', 'lifecycle'):
    import_module(f'{__name__}.{module}')
check = tasks.check
