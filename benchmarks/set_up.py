"""What does the set-up cost from an empty cache, against one that installs JupyterLab alone?

Both run tools/set_up.sh in a copy of this project: with requirements.lock, and with those of its
lines that JupyterLab and the set-up need. They download: a slow network slows both.
"""

import os
import re
import shutil
import subprocess
import tempfile
from importlib.metadata import requires
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from benchmarks.lessons import ROOT
from benchmarks.table import Row, seconds

ROUNDS = 3
PROJECT = ('tools', 'helpers', 'pyproject.toml', 'LICENSE')


def needed_by(package: str) -> set[str]:
    """Return the names of an installed package and of all that it needs."""
    found, queue = set(), [Requirement(package)]
    while queue:
        wanted = queue.pop()
        if str(wanted) in found:
            continue
        found |= {str(wanted), canonicalize_name(wanted.name)}
        needed = map(Requirement, requires(wanted.name) or ())
        extras = wanted.extras or {''}
        queue += [
            each
            for each in needed
            if each.marker is None or any(each.marker.evaluate({'extra': e}) for e in extras)
        ]
    return found


def set_up(lock: str) -> None:
    """Set up a copy of the project with this lock, from empty caches."""
    with tempfile.TemporaryDirectory() as folder:
        checkout = Path(folder, 'checkout')
        checkout.mkdir()
        for name in PROJECT:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, checkout / name)
        (checkout / 'requirements.lock').write_text(lock)
        caches = {'UV_CACHE_DIR': f'{folder}/uv', 'PIP_CACHE_DIR': f'{folder}/pip'}
        subprocess.run([checkout / 'tools/set_up.sh'], env=os.environ | caches, check=True)


def measure() -> list[Row]:
    """Return the set-up against that of JupyterLab."""
    lock = (ROOT / 'requirements.lock').read_text()
    header, *pins = re.split(r'\n(?=[a-z])', lock.rstrip('\n'))
    wanted = needed_by('jupyterlab') | {'setuptools', 'uv'}
    less = [header, *(pin for pin in pins if re.match(r'[\w.-]+', pin)[0] in wanted), '']
    everything, alone = [], []
    for _ in range(ROUNDS):
        everything += seconds(lambda: set_up(lock), 1)
        alone += seconds(lambda: set_up('\n'.join(less)), 1)
    return [Row('set-up from empty caches', everything, 'JupyterLab alone', alone)]
