"""What the checks of packages, programs and launches share: read them, run them, and end them.

first_error.py finds the first error in what they print.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable

from catkin_pkg.package import InvalidPackage, Package, parse_package

from helpers.checks.errors import Failed
from helpers.checks.first_error import error_in
from helpers.workspace import DIED, Process, Workspace, without_folders

POLL_S = 0.02


# --- Packages


def manifest(workspace: Workspace, folder: str) -> Package:
    """Return what the package.xml in a folder, `src/my_package`, says.

    Raises Failed if there is none, or if it is not valid.
    """
    path = workspace.file(folder)
    if not (path / 'package.xml').is_file():
        raise Failed(f'there is no package {folder}')
    try:
        return parse_package(path)
    except InvalidPackage as error:
        reason = re.sub(r"^Error\(s\) in package '.*?':", '', ' '.join(str(error).split()))
        raise Failed(f'package.xml cannot be read: {reason.strip()}') from None


def needed(package: Package, moment: str) -> set[str]:
    """Return the names that a package.xml gives for a moment: 'build' (with its tools) or 'run'."""
    if moment == 'build':
        depends = package.build_depends + package.buildtool_depends
    else:
        depends = package.exec_depends
    return {depend.name for depend in depends}


# --- Programs


def sourced(workspace: Workspace, commands: str) -> str:
    """Run commands in a new terminal that has sourced the workspace. Return what they print."""
    return workspace.terminal(f'source install/setup.bash\n{commands}')


def open_terminal(workspace: Workspace, name: str) -> Process:
    """Return the terminal that a cell of the lesson has opened. Raises Failed if none has."""
    if name not in workspace.terminals:
        raise Failed(f'there is no terminal {name}: run the cell of the task first')
    return workspace.terminals[name]


def wait_until(condition: Callable[[], object], limit_s: float) -> bool:
    """Wait until a condition holds, at most `limit_s` seconds. Return whether it holds."""
    end = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(POLL_S)
    return True


def line_of(process: Process, text: str, limit_s: float = 20.0) -> str:
    """Wait for a line of a program with a text, and return it.

    Raises Failed, with what the program says instead, if it ends before, or takes longer.
    """
    try:
        return process.wait_for(text, limit_s)
    except RuntimeError:
        raise Failed(f'{process.name} has ended: {error_in(process.lines)}') from None
    except TimeoutError as error:
        raise Failed(str(error)) from None


def launch(
    workspace: Workspace, words: str, is_done: Callable[[str], bool], limit_s: float = 40.0
) -> str:
    """Run `ros2 launch` until what it prints is enough, a program dies, or it ends.

    Return what it has printed until then, without this machine's folders. What its programs say
    when they are ended is not a part of it.
    """
    with workspace.start(
        f'source install/setup.bash\nros2 launch {words}', 'the launch'
    ) as process:

        def is_over() -> bool:
            text = '\n'.join(process.lines)
            return not process.running or DIED in text or is_done(text)

        wait_until(is_over, limit_s)
        text = '\n'.join(process.lines)
        process.interrupt()
    return without_folders(text, workspace.path)


def started(text: str) -> list[str]:
    """Return the programs that a launch says it has started, sorted."""
    return sorted(re.findall(r'\[(\S+)-\d+\]: process started', text))
