"""Tests with planted bugs: what they say of the student's tests, whatever these do."""

import pytest

from helpers.trials import planted, run_tests
from helpers.workspace import Workspace

SPEED = 'def speed(distance_m):\n    return 0.25 if distance_m > 0.5 else 0.0\n'
CONFTEST = """import pytest

@pytest.fixture
def sensor():
    raise OSError('no camera')
"""
TESTS = """import os, threading

import pytest

from brake_pkg.speed import speed


def test_good():
    assert speed(0.2) == 0.0


def helped(metres):
    assert speed(metres) == 0.0


def test_assert():
    assert speed(0.2) == 0.0
    assert speed(2.0) == 1.5


def test_deep():
    helped(2.0)


def test_error():
    speed('far')


@pytest.mark.parametrize('again', range(3))
def test_row(again):
    assert again < 2


def test_fixture(sensor):
    pass


def test_missing(again):
    pass


def test_endless():
    threading.Event().wait()


def test_exit():
    os._exit(0)


@pytest.mark.skip
def test_skipped():
    pass
"""
SAID = {
    'good': 'all tests pass',
    'assert': 'test_assert fails, line 18 of test_speed.py: assert speed(2.0) == 1.5. '
    'assert 0.25 == 1.5',
    'deep': 'test_deep fails, line 13 of test_speed.py: assert speed(metres) == 0.0. '
    'assert 0.25 == 0.0',
    'error': "test_error fails, line 26 of test_speed.py: speed('far'). "
    "TypeError: '>' not supported between instances of 'str' and 'float'",
    'row': 'test_row[2] fails, line 31 of test_speed.py: assert again < 2. assert 2 < 2',
    'fixture': "test_fixture fails, line 5 of conftest.py: raise OSError('no camera'). "
    'OSError: no camera',
    'missing': 'test_missing fails, line 38 of test_speed.py: def test_missing(again). '
    "fixture 'again' not found",
    'endless': 'test_endless does not end. Line 43 of test_speed.py: threading.Event().wait()',
    'exit': 'test_exit ends Python itself',
    'skipped': 'no test has run',
    'nothing': 'there are no tests',
}


@pytest.fixture(scope='module')
def workspace():
    workspace = Workspace('test_planted')
    workspace.write('pytest.ini', '[pytest]\n')  # pytest looks for its settings no further up
    workspace.write('src/brake_pkg/brake_pkg/__init__.py', '')
    workspace.write('src/brake_pkg/brake_pkg/speed.py', SPEED)
    yield workspace
    workspace.close()


def runs_of(workspace, tests, versions, **options):
    workspace.write('src/brake_pkg/test/test_speed.py', tests)
    return run_tests(
        workspace, 'src/brake_pkg', 'test/test_speed.py', 'brake_pkg.speed', versions, **options
    )


@pytest.fixture(scope='module')
def runs(workspace):
    """Run each test of TESTS alone, all at the same time."""
    workspace.write('src/brake_pkg/test/conftest.py', CONFTEST)
    return runs_of(workspace, TESTS, dict.fromkeys(SAID, ''), only=True)


@pytest.mark.parametrize('name', SAID)
def test_a_run_says_in_words_what_happened(runs, name):
    assert runs[name].says == SAID[name]


@pytest.mark.parametrize('name', SAID)
def test_only_a_test_that_ran_finds_a_bug(runs, name):
    """A test that does not end, or ends Python, is no test that fails."""
    assert runs[name].passes == (name == 'good')
    assert runs[name].fails == (name in ('assert', 'deep', 'error', 'row'))


@pytest.mark.parametrize('old', ['0.5 m', '0'])
def test_a_bug_is_planted_where_its_text_is_once(old):
    with pytest.raises(AssertionError, match=old):
        planted(SPEED, old, '1')


def test_each_version_is_tested(workspace):
    tests = 'from brake_pkg.speed import speed\ndef test_wall():\n    assert speed(0.2) == 0.0\n'
    wrong = planted(SPEED, 'else 0.0', 'else 0.1')
    runs = runs_of(workspace, tests, {'yours': '', 'right': SPEED, 'wrong': wrong})
    assert {name: run.passes for name, run in runs.items()} == {
        'yours': True,
        'right': True,
        'wrong': False,
    }
    assert runs['wrong'].says.endswith('assert 0.1 == 0.0')


@pytest.mark.parametrize(
    ('tests', 'said'),
    [
        (
            'import os\nos._exit(0)\n',
            'the file of the tests ends Python itself',
        ),
        (
            'def test_wall(:\n    pass\n',
            'a file cannot be read: SyntaxError: invalid syntax (line 1 of test_speed.py)',
        ),
        (
            'from brake_pkg.speed import sped\n',
            "a file cannot be read: ImportError: cannot import name 'sped' from 'brake_pkg.speed'",
        ),
        (
            "import pytest\n@pytest.mark.parametrize('again', [1])\ndef test_wall():\n    pass\n",
            "a file cannot be read: In test_wall: function uses no argument 'again'",
        ),
    ],
)
def test_a_file_that_cannot_be_read_is_no_test_that_fails(workspace, tests, said):
    run = runs_of(workspace, tests, {'yours': ''})['yours']
    assert run.says.startswith(said)
    assert not run.passes
    assert not run.fails
