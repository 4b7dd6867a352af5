"""What the checks of packages, programs and launches share: read them, run them, and end them.

The words of a judge for a program:

    with run_python(workspace, 'talker.py', 'red') as talker:   or Program(workspace.start(...))
        talker.wait(lambda: len(heard) >= 2)    whether; raises Failed if the program ends meanwhile
        talker.says('red talks')                whether a line has this text
        talker.end(signal.SIGTERM)              whether the signal ends it
    talker.failed, talker.error                 whether it printed a traceback; its first error

`launch` runs a launch file, and `started` are its programs. `manifest` and `needed` read a
package.xml. helpers/workspace/first_error.py finds the first error in what all of these print.
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import sys
from collections.abc import Callable

from catkin_pkg.package import InvalidPackage, Package, parse_package

from helpers.checks.errors import Failed
from helpers.workspace import (
    DIED,
    TRACEBACK,
    Process,
    Workspace,
    error_in,
    wait_until,
    without_folders,
)

PROGRAM_S = 8.0  # for a program to start, to say something, to end
# Between a look whether the context is valid and its use, a signal may end it. Then a right program
# ends with an error, too, in which these texts stand (executors.py and context.py of rclpy 7.1.5).
RACES = (
    ('failed to initialize wait set: the given context is not valid',),  # spin()
    ('in try_shutdown', 'rcl_shutdown already called on the given context'),
)


# --- Packages


def manifest(workspace: Workspace, folder: str) -> Package:
    """Return what the package.xml in a folder, `src/my_package`, says.

    Raises Failed if there is none, or if it is not valid.
    """
    path = workspace.file(folder)
    if not (path / 'package.xml').is_file():
        raise Failed(f'there is no package {folder}', hint='')
    try:
        return parse_package(path)
    except InvalidPackage as error:
        reason = re.sub(r"^Error\(s\) in package '.*?':", '', ' '.join(str(error).split()))
        raise Failed(f'package.xml cannot be read: {reason.strip()}', hint='') from None


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


class Program:
    """A program of the student that runs. It ends with its `with` block at the latest."""

    def __init__(self, process: Process) -> None:
        self._process = process

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *exception) -> None:
        if self.running:
            os.kill(self.pid, signal.SIGCONT)  # one that was stopped could not end
        self._process.stop()

    @property
    def pid(self) -> int:
        """The id of its process, for a signal that does not end it."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.running

    @property
    def lines(self) -> list[str]:
        """What it has printed so far."""
        return self._process.lines

    @property
    def failed(self) -> bool:
        """Whether it has printed a traceback, but for one that rclpy makes by itself."""
        is_race = any(all(map(self.says, texts)) for texts in RACES)
        return self.says(TRACEBACK) and not is_race

    @property
    def error(self) -> str:
        """Its first error, with the student's line; without an error, the last line printed."""
        return error_in(self.lines)

    def says(self, text: str) -> bool:
        """Return whether it has printed a line with this text."""
        return any(text in line for line in self.lines)

    def wait(self, condition: Callable[[], object], limit_s: float = PROGRAM_S) -> bool:
        """Wait until a condition holds, at most `limit_s` seconds. Return whether it holds.

        Raises Failed, with its first error, if the program has ended by then.
        """
        holds = wait_until(lambda: condition() or not self.running, limit_s)
        if not self.running:
            raise Failed(f'the program ended by itself: {self.error}')
        return holds

    def has_ended(self, limit_s: float = PROGRAM_S) -> bool:
        """Wait until it ends by itself, at most `limit_s` seconds. Return whether it has ended."""
        return wait_until(lambda: not self.running, limit_s)

    def end(self, sent: signal.Signals = signal.SIGINT, limit_s: float = PROGRAM_S) -> bool:
        """Send it a signal, by default that of Ctrl+C. Return whether it has ended in time."""
        if self.running:
            os.kill(self._process.pid, sent)
        return self.has_ended(limit_s)

    def exit_code(self) -> int:
        """Return the exit code of a program that has ended, -N if signal N ended it."""
        return self._process.wait()


def run_python(workspace: Workspace, *words: str, name: str = 'the program') -> Program:
    """Run a file of the workspace with Python: `run_python(workspace, 'talker.py', 'red')`.

    Code runs as in a terminal: `run_python(workspace, '-c', 'import talker')`. The log of a file's
    nodes has no lines of the libraries below ROS, which would come between its own.
    """
    command = shlex.join([sys.executable, *words])
    if words[0] != '-c':
        command += ' --ros-args --disable-external-lib-logs'
    return Program(workspace.start(f'exec {command}', name))


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
