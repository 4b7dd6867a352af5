"""What the tests of the container share."""

import pytest

IMAGE = 'localhost/ros2_notebooks'
LIMITS = '--ulimit nofile=1024:1024 --ulimit nproc=1000:1000'


def leave_out(why: str) -> None:
    """Skip a test, and say so."""
    pytest.skip(f'LEFT OUT: the container, because {why}.')
