"""How nbval starts the kernels of the notebooks, and how hypothesis chooses its examples."""

import os
import tempfile
from itertools import count
from pathlib import Path

import nbval.kernel
import pytest
from hypothesis import settings
from jupyter_client.manager import KernelManager

from helpers.progress import FILE_VARIABLE

# No test reads or changes what the user of this checkout has solved. Kernels inherit it.
os.environ[FILE_VARIABLE] = ''

# `make test` tries the same examples every time: what passed yesterday passes in class. New ones:
# `make test PYTEST_ARGS='--hypothesis-profile=explore tests/test_queue_law.py tests/test_fuzz.py'`,
# twenty times as many; what fails there becomes an @example. No deadline, for overloaded machines.
settings.register_profile('same', deadline=None, derandomize=True, print_blob=True)
settings.register_profile('explore', deadline=None, print_blob=True, max_examples=2000)
settings.load_profile('same')


@pytest.fixture(scope='session', autouse=True)
def kernels_without_ports():
    """Let kernels talk over socket files.

    jupyter_client chooses free TCP ports, closes them, and the kernel opens them again later. When
    several workers start kernels at once, two may choose the same port, and one kernel never
    answers. The folder is a short one, because the path of a socket file is limited to 107 bytes.
    """
    with tempfile.TemporaryDirectory(prefix='kernels-') as folder:
        number = count()

        def kernel_manager(**options) -> KernelManager:
            file = Path(folder, f'{next(number)}.json')
            return KernelManager(transport='ipc', connection_file=str(file), **options)

        original, nbval.kernel.KernelManager = nbval.kernel.KernelManager, kernel_manager
        yield
        nbval.kernel.KernelManager = original
