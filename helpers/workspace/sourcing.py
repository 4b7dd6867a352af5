"""What `source install/setup.bash` gives a terminal, for a kernel that already runs."""

from __future__ import annotations

import ctypes
import hashlib
import importlib
import os
import subprocess
import sys
from pathlib import Path

from helpers.machine import build_environment
from helpers.notebook import uninterrupted

SOURCE_TIMEOUT_S = 20.0

_loaded: dict[str, dict[str, str]] = {}  # package -> library -> hash, as this process loaded it


def source(workspace: Path) -> dict[str, str]:
    """Return the environment of a terminal that has sourced `install/setup.bash`.

    Raises RuntimeError if nothing has been built.
    """
    setup = workspace / 'install' / 'setup.bash'
    if not setup.is_file():
        raise RuntimeError('Nothing has been built: call build() first, and read its result.')
    with uninterrupted():
        answer = subprocess.run(
            ['bash', '--norc', '-c', 'source "$0" > /dev/null 2>&1; env -0', str(setup)],
            env=build_environment(),
            cwd=workspace,
            capture_output=True,
            timeout=SOURCE_TIMEOUT_S,
            check=True,
        )
    pairs = os.fsdecode(answer.stdout).split('\0')
    return dict(pair.split('=', 1) for pair in pairs if '=' in pair)


def use(install: Path, sourced: dict[str, str]) -> None:
    """Make the packages in `install` importable in this process. See `Workspace.use`."""
    libraries = _libraries(install)
    for package, files in libraries.items():
        hashes = {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}
        if _loaded.get(package, hashes) != hashes:
            raise RuntimeError(
                f'This kernel has loaded an older {package}: restart it, then run the notebook '
                'from its top.'
            )
        if package not in _loaded:
            _load(files)
            _loaded[package] = hashes
    # The ament index is in the first one; processes that a cell starts need both.
    for name in ('AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH'):
        if name in sourced:
            os.environ[name] = sourced[name]
    here = f'{install}{os.sep}'
    folders = sourced.get('PYTHONPATH', '').split(os.pathsep)
    sys.path[:] = [
        *(folder for folder in folders if folder.startswith(here)),
        *(folder for folder in sys.path if not folder.startswith(here)),
    ]
    importlib.invalidate_caches()
    for name, module in list(sys.modules.items()):
        file = getattr(module, '__file__', None) or ''
        if file.startswith(here) and name.partition('.')[0] not in libraries:
            del sys.modules[name]


def _libraries(install: Path) -> dict[str, list[Path]]:
    """Return the shared libraries of each package, those of `lib` before Python's extensions."""
    libraries = {}
    for package in sorted(install.iterdir()):
        files = sorted(package.glob('lib/*.so*')) + sorted(package.glob('**/site-packages/**/*.so'))
        if files:
            libraries[package.name] = files
    return libraries


def _load(files: list[Path]) -> None:
    """Load the libraries of a package into this process, each after those it needs."""
    waiting = [file for file in files if file.parent.name == 'lib']
    while waiting:
        again, errors = [], []
        for file in waiting:
            try:
                # Global: the type support of one package is found by the libraries of the next.
                ctypes.CDLL(str(file), mode=ctypes.RTLD_GLOBAL)
            except OSError as error:
                again.append(file)
                errors.append(str(error))
        if len(again) == len(waiting):
            raise RuntimeError(f'A library that was built cannot be loaded: {errors[0]}.')
        waiting = again
