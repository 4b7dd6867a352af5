"""The student's tests with versions of ours, and tests of ours with what the student wrote."""

from helpers.checks.errors import Failed
from helpers.checks.points import needs
from helpers.checks.tasks import Tasks
from helpers.trials import run_tests

tasks = Tasks()

PACKAGE = 'src/brake_pkg'


def all_pass(runs, names):
    """Return the test of a point: the student's tests must pass for these versions."""

    def test():
        wrong = [version for version in names if not runs()[version].passes]
        return not wrong or f'with {names[wrong[0]]} pytest: {runs()[wrong[0]].says}'

    return test


def is_caught(runs, version, pass_for_right_ones):
    """Return the test of a point: the student's tests must fail for this version.

    They must pass for the right versions: tests that fail for each version find no bug.
    """

    def test():
        needs(pass_for_right_ones, 'not judged: your tests must first pass for the right ones')
        return runs()[version].fails or f'pytest: {runs()[version].says}'

    return test


def run_ours(workspace, name, source, module, versions):
    """Run tests of ours beside the student's, each with its version. Their file goes again."""
    with workspace.replaced({f'{PACKAGE}/test/{name}': source}):
        return run_tests(workspace, PACKAGE, f'test/{name}', module, versions, only=True)


def ours_pass(runs, version):
    """Return the test of a point: tests of ours must pass, with what the student has written."""

    def test():
        run = runs()[version]
        if run.failed and run.failed[0].line_of_student:
            raise Failed(run.reason, hint='')
        return run.passes or run.reason

    return test
