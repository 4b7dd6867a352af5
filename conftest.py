"""How nbval starts the kernels of the notebooks."""

import os
import tempfile
from itertools import count
from pathlib import Path

import nbval.kernel
import pytest
from jupyter_client.manager import KernelManager

from helpers.progress import FILE_VARIABLE

# No test reads or changes what the user of this checkout has solved. Kernels inherit it.
os.environ[FILE_VARIABLE] = ''


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
