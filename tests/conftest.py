"""Fixtures of more than one test module."""

import gc

import pytest
from hypothesis import settings

# `make test` tries the same examples every time: what passed yesterday passes in class. New ones:
# `make test PYTEST_ARGS='--hypothesis-profile=explore tests/test_queue_model.py'`, twenty times as
# many; what fails there becomes an @example. No deadline, for overloaded machines.
settings.register_profile('same', deadline=None, derandomize=True, print_blob=True)
settings.register_profile('explore', deadline=None, print_blob=True, max_examples=2000)
settings.load_profile('same')


def pytest_collection_finish() -> None:
    """Leave what was imported alone: it lives as long as this process.

    Each session that closes looks through Python's objects, which took a fifth of the tests' time.
    """
    gc.freeze()


@pytest.fixture(scope='module')
def one_class(tmp_path_factory):
    """Yield a class, open at the first step of its lesson."""
    from support.classes import running_class  # only what tests a class loads its server

    with running_class(tmp_path_factory.mktemp('class')) as one:
        one.go(1)
        yield one


@pytest.fixture
def opened(one_class):
    """Yield a class that was told nothing."""
    one_class.do('forget')
    return one_class


@pytest.fixture(scope='module')
def script():
    """Return the script of the replays."""
    from support.javascript import Script  # only what tests a replay loads its engine

    return Script()
