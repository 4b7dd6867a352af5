"""The packages that a lesson writes, for the benchmarks that build them."""

import re
from pathlib import Path

import nbformat

from helpers.workspace import Workspace

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / 'notebooks'


def workspace_of(lesson: str, *packages: str, name: str) -> Workspace:
    """Return an empty workspace, with some packages as the lesson leaves them.

    `lesson` is its number, such as '08'.
    """
    workspace = Workspace(f'benchmark_{name}')
    (path,) = FOLDER.glob(f'{lesson}_*.ipynb')
    for cell in nbformat.read(path, as_version=4).cells:
        # A file that the lesson writes twice keeps its last text.
        found = re.match(r'%%write (src/(\w+)/\S+)\n', cell.source)
        if found and found[2] in packages:
            workspace.write(found[1], cell.source[found.end() :])
    return workspace


def build(workspace: Workspace, *packages: str, **options) -> float:
    """Build packages and return the seconds. Raises RuntimeError where the build fails."""
    result = workspace.build(*packages, **options)
    if not result.ok:
        raise RuntimeError(str(result))
    return result.seconds
