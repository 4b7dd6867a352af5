"""What an answer needs: more time than other tests, however pytest was started."""

import faulthandler

import pytest
from _pytest.faulthandler import fault_handler_stderr_fd_key

LIMIT_S = 1800  # an answer builds a workspace, or drives a robot on two floors


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Begin the time-out again, with a longer limit: pyproject.toml has that of other tests.

    pytest has begun its own before, with the same timer, and ends it after the test.
    """
    if float(item.config.getini('faulthandler_timeout')):
        stderr = item.config.stash[fault_handler_stderr_fd_key]
        faulthandler.dump_traceback_later(LIMIT_S, file=stderr, exit=True)
