"""How nbval starts the kernels of the notebooks, and how hypothesis chooses its examples."""

import os
import signal
import tempfile
from itertools import count
from pathlib import Path

import pytest
from hypothesis import settings
from jupyter_client.manager import KernelManager

from helpers.checks.progress import FILE_VARIABLE
from tools.lessons.comparison import start_kernels_by

# No test reads or changes what the user of this checkout has solved. Kernels inherit it.
os.environ[FILE_VARIABLE] = ''

# What a shell starts in the background ignores Ctrl+C, below `nohup` also the end of a terminal.
# So would all processes that the tests start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

# `make test` tries the same examples every time: what passed yesterday passes in class. New ones:
# `make test PYTEST_ARGS='--hypothesis-profile=explore tests/test_queue_model.py'`, twenty times as
# many; what fails there becomes an @example. No deadline, for overloaded machines.
settings.register_profile('same', deadline=None, derandomize=True, print_blob=True)
settings.register_profile('explore', deadline=None, print_blob=True, max_examples=2000)
settings.load_profile('same')


def pytest_configure(config: pytest.Config) -> None:
    """Keep the sessions of other processes away, and let kernels talk over socket files.

    A terminal, which a lesson or a test opens, looks for sessions in all records of this user.

    jupyter_client chooses free TCP ports, closes them, and the kernel opens them again later. When
    several workers start kernels at once, two may choose the same port, and one kernel never
    answers. The folder is a short one, because the path of a socket file is limited to 107 bytes.
    A fixture would not do: pytest sets none up for the cells of a notebook.
    """
    folder = tempfile.TemporaryDirectory(prefix='kernels-')
    config.add_cleanup(folder.cleanup)
    sessions = tempfile.TemporaryDirectory(prefix='sessions-')
    config.add_cleanup(sessions.cleanup)
    os.environ['ROS2_SESSIONS'] = sessions.name
    number = count()

    def kernel_manager(**options) -> KernelManager:
        file = Path(folder.name, f'{next(number)}.json')
        return KernelManager(transport='ipc', connection_file=str(file), **options)

    config.add_cleanup(start_kernels_by(kernel_manager))
