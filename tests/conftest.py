"""Fixtures of more than one test module."""

import gc

import pytest
import support.examples  # noqa: F401


def pytest_collection_finish() -> None:
    """Leave what was imported alone: it lives as long as this process.

    Each session that closes looks through Python's objects, which took a fifth of the tests' time.
    """
    gc.freeze()


@pytest.fixture(scope='module')
def script():
    """Return the script of the replays."""
    from support.javascript import Script  # only what tests a replay loads its engine

    return Script()
