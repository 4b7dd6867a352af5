"""Processes that run beside a block, the `ros2` command among them."""

import contextlib
import signal
import subprocess
import sys
from pathlib import Path

from waits import LIMIT_S

ROS2 = Path(sys.executable).with_name('ros2')


@contextlib.contextmanager
def process(*command, **options):
    """Run a process beside the block, and end it as Ctrl+C does."""
    pipes = dict.fromkeys(('stdin', 'stdout', 'stderr'), subprocess.PIPE)
    started = subprocess.Popen([*map(str, command)], text=True, **(pipes | options))
    try:
        yield started
    finally:
        started.send_signal(signal.SIGINT)
        try:
            started.communicate(timeout=LIMIT_S)
        except (subprocess.TimeoutExpired, ValueError):
            started.kill()


def ros2(*words, **options):
    return process(ROS2, *words, **options)


def python(script, *arguments, **options):
    return process(sys.executable, '-c', script, *arguments, **options)
