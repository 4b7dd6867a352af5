"""Runs the student's tests with right and with wrong versions of what they test.

A good test passes for each right version, and fails for each in which a bug was planted.

    runs = run_tests(workspace, 'src/brake_pkg', 'test/test_speed.py', 'brake_pkg.speed',
                     {'right': RIGHT, 'wrong': planted(RIGHT, '<=', '<')})
    runs['right'].passes, runs['wrong'].says
"""

from __future__ import annotations

import json
import linecache
import os
import shlex
from dataclasses import dataclass, field
from pathlib import Path

from helpers.notebook import own_line
from helpers.workspace import error_of_pytest

RUNNER = Path(__file__).with_name('planted_runner.py')
LONGEST = 160  # characters of a message


@dataclass
class Failure:
    """A test that failed: its name, the line of the student, and what pytest says.

    One that never `ran` failed before: in a fixture, or because an argument is no fixture.
    `places` are where Python was, the innermost first.
    """

    test: str
    ran: bool
    file: str
    line: int
    message: str
    places: list[tuple[str, int]] = field(default_factory=list)

    @property
    def line_of_student(self) -> str:
        """The innermost line of the student, `Line 7 of brake.py: ...`, or nothing."""
        return own_line(self.places)

    @property
    def reason(self) -> str:
        """What a test of ours has found, whose name and lines the student has never seen."""
        message = ' '.join(self.message.partition('\n')[0].split())
        said = message.removeprefix('AssertionError: ')[:LONGEST]
        place = self.line_of_student
        return f'{said}{"" if said[-1:] in (".", "!", "?") else "."} {place}' if place else said

    def __str__(self) -> str:
        source = linecache.getline(self.file, self.line).strip()
        name = os.path.basename(self.file)
        place = f', line {self.line} of {name}: {source.rstrip(":")}' if source else ''
        message = ' '.join(self.message.splitlines()[0].split()) if self.message else ''
        # pytest repeats the line of an assert, with its values.
        return f'{self.test} fails{place}. {message[:LONGEST]}'.rstrip('. ')


@dataclass
class TestRun:
    """What pytest says of one version: how many tests passed, which failed, or what is wrong."""

    passed: int = 0
    failed: list[Failure] = field(default_factory=list)
    problem: str = ''

    @property
    def passes(self) -> bool:
        """Whether there were tests, and all have passed."""
        return self.passed > 0 and not self.failed and not self.problem

    @property
    def fails(self) -> bool:
        """Whether a test ran and failed. Tests that cannot run do not find a bug."""
        return any(failure.ran for failure in self.failed)

    @property
    def reason(self) -> str:
        """The result of tests of ours in words."""
        return self.failed[0].reason if self.failed and not self.problem else self.says

    @property
    def says(self) -> str:
        """The result in words."""
        if self.problem:
            return self.problem
        return str(self.failed[0]) if self.failed else 'all tests pass'


def planted(source: str, old: str, new: str) -> str:
    """Return the source with a bug in it: new text in place of the old, which is there once."""
    assert source.count(old) == 1, old
    return source.replace(old, new)


def run_tests(
    workspace,
    package: str,
    tests: str,
    module: str,
    versions: dict[str, str],
    only: bool = False,
    most_failures: int = 1,
    sourced: bool = False,
) -> dict[str, TestRun]:
    """Run a file of tests with each version of a module: its source, '' for the student's own.

    `package` is the folder of the package in the workspace, `tests` a file in it. With `only`, the
    name of each version chooses the tests that it is for. A run ends after `most_failures`.
    With `sourced` the tests find what the workspace has installed; the package's own source first.
    """
    arguments = [f'--maxfail={most_failures}', f'{package}/{tests}']
    task = {
        'path': package,
        'module': module,
        'arguments': arguments,
        'versions': {
            name: {'source': source, 'keyword': name if only else ''}
            for name, source in versions.items()
        },
    }
    workspace.write('.versions.json', json.dumps(task))
    for file in (workspace.path / package).rglob('*.py'):
        linecache.checkcache(str(file))
    runner = shlex.quote(str(RUNNER))
    command = f'PYTEST_DISABLE_PLUGIN_AUTOLOAD=1 python -B {runner} .versions.json'
    if sourced:
        command = f'source install/setup.bash\n{command}'
    printed = workspace.terminal(command)
    try:
        results = json.loads(printed.splitlines()[-1])
    except (IndexError, ValueError):
        return dict.fromkeys(versions, TestRun(problem=f'pytest does not run: {printed[-200:]}'))
    return {name: _test_run(result, workspace.path) for name, result in results.items()}


def _test_run(result: dict, folder: Path) -> TestRun:
    if result['code'] < 0:
        test = result['test'] or 'the file of the tests'
        if result['code'] == -2:
            return TestRun(problem=f'{test} ends Python itself')
        place = own_line((str(folder / file), int(line)) for file, line in result['places'])
        return TestRun(problem=f'{test} does not end. {place}'.rstrip('. '))
    failed = [
        Failure(
            **entry
            | {
                'file': str(folder / entry['file']),
                'places': [(str(folder / file), line) for file, line in entry['places']],
            }
        )
        for entry in result['failed']
    ]
    run = TestRun(result['passed'], failed)
    if result['problems']:
        run.problem = f'a file cannot be read: {error_of_pytest(result["problems"][0])}'
    elif result['code'] == 5:
        run.problem = 'there are no tests'
    elif not run.passed and not run.failed:
        run.problem = 'no test has run'
    return run
