"""What the checks of programs share: run them, and say exactly what went wrong.

A program or a launch says a lot when it fails. These functions find the first error in it: its
file, its line, its text. builds.py does it for builds.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from catkin_pkg.package import InvalidPackage, Package, parse_package

from helpers.checks.errors import Failed, is_students
from helpers.workspace import DIED, Process, Workspace, without_folders

POLL_S = 0.02
TRACEBACK = 'Traceback (most recent call last)'
FRAME = re.compile(r'\s*File "(.*?)", line (\d+)')
CHAINED = re.compile(r'During handling of|The above exception')
OF_A_PROGRAM = re.compile(r'\[[^\]\s]+-\d+\] ')  # what launch writes before a program's lines


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


def error_in(lines: Sequence[str]) -> str:
    """Return the first error of a program: exception, text, and the line of the workspace.

    Of a program without a traceback it is the last line, or 'it printed nothing'. Lines of a launch
    may have the name of their program in front.
    """
    start = next((number for number, line in enumerate(lines) if TRACEBACK in line), None)
    if start is None:
        said = [line.strip() for line in lines if line.strip()]
        return said[-1] if said else 'it printed nothing'
    program = OF_A_PROGRAM.match(lines[start])
    prefix = program[0] if program else ''
    own = [line.removeprefix(prefix) for line in lines[start:] if line.startswith(prefix)]
    said, place, inside, chained = '', '', False, True
    for number, line in enumerate(own):
        if TRACEBACK in line:
            if not chained:
                break
            inside, place = True, ''
        elif CHAINED.match(line):
            chained = True
        elif inside and (frame := FRAME.match(line)):
            if _is_own(frame[1]):
                code = own[number + 1].strip() if number + 1 < len(own) else ''
                place = f'Line {frame[2]} of {Path(frame[1]).name}: {code}'
        elif inside and line and not line[0].isspace():
            said, inside, chained = line, False, False
    if not said:
        return place or 'it ends with a traceback'
    return f'{said}{"" if not place or said[-1] in ".!?" else "."} {place}'.strip()


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


def error_of_launch(text: str) -> str:
    """Return the first error of a launch or of one of its programs, or nothing if there is none."""
    lines = [line for line in text.splitlines() if line.strip()]
    if any(TRACEBACK in line for line in lines):
        return error_in(lines)
    if lines and not started(text):
        return lines[-1]
    if dead := re.search(rf'\[(\S+-\d+)\]: {DIED}', text):
        said = [line for line in lines if line.startswith(f'[{dead[1]}] ')]
        return f'{dead[1]} has died. {said[-1] if said else "It printed nothing"}'
    return ''


def _is_own(file: str) -> bool:
    """Return whether a file is the learner's: no library, no script that colcon has made."""
    if re.search(r'/lib/\w+/\w+$', file) or Path(file).name.startswith('.'):
        return False
    # What a terminal of the workspace prints has no folders of this machine.
    in_workspace = re.match(r'(\w+/)?(src|install|build)/', file)
    return bool(in_workspace) or is_students(file)
