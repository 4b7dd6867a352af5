"""What all tests of the command share."""

import os
import shlex
import signal
import tempfile

import pytest
from domain_coordinator import domain_id

from ros2_command.main import main

# What a shell starts in the background ignores Ctrl+C, below `nohup` also the end of a terminal.
# So would all processes that the tests start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_configure(config: pytest.Config) -> None:
    """Keep the sessions of this user's other processes away from the tests."""
    folder = tempfile.TemporaryDirectory(prefix='sessions-')
    config.add_cleanup(folder.cleanup)
    os.environ['ROS2_SESSIONS'] = folder.name


@pytest.fixture(scope='module')
def domain():
    """Reserve a domain for the commands of a test module."""
    with domain_id() as free, pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_DOMAIN_ID', str(free))
        patch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        patch.setenv('COLUMNS', '100')
        yield free


@pytest.fixture
def own_domain(domain, monkeypatch):
    """Reserve a domain for one test, in which nobody else is."""
    with domain_id() as free:
        monkeypatch.setenv('ROS_DOMAIN_ID', str(free))
        yield free


@pytest.fixture
def run(domain, capfd):
    """Return a function that runs a command here, and returns its status and what it prints."""

    def run(command):
        status = main(shlex.split(command))
        return status, *capfd.readouterr()

    return run
