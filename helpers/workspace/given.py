"""Files of somebody else that lessons put into a workspace."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

from helpers.workspace.workspace import Workspace

COLLEAGUE = Path(__file__).with_name('colleague.sh')
FLEET = Path(__file__).with_name('fleet.sh')
TRY_NEAREST = Path(__file__).with_name('try_nearest.cpp')


def play_colleague(workspace: Workspace) -> None:
    """Make a repository with three packages on the server, with the branches jazzy and humble."""
    workspace.terminal(f'bash {quote(str(COLLEAGUE))}')


def write_fleet(workspace: Workspace) -> None:
    """Write the package fleet_pkg anew: a driver that goes straight ahead until a wall is near."""
    workspace.terminal(f'bash {quote(str(FLEET))}')


def write_try_nearest(workspace: Workspace) -> None:
    """Write the small program that calls the library scan_tools with numbers."""
    text = TRY_NEAREST.read_text(encoding='utf-8')
    workspace.write('src/scan_tools/src/try_nearest.cpp', text)
