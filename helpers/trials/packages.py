"""What becomes of packages when one edits, builds, runs and deletes."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable

import pandas as pd

from helpers.workspace import BuildResult, Process, Workspace, error_in, wait_until

LIBRARY_FILE = 'src/scan_tools/CMakeLists.txt'


def play(workspace: Workspace, moves: Iterable[str]) -> str:
    """Play the moves with a package of one small program. Return what its runs have printed.

    A move is 'edit', which gives the program its next letter to print, 'build', 'run' or 'delete'.
    A run that fails is a '-'.
    """
    workspace.terminal("""rm -rf build/letter_pkg install/letter_pkg src/letter_pkg; cd src
        ros2 pkg create letter_pkg --build-type ament_python --node-name letter""")
    letters, printed = iter('ABCDEFGHIJ'), ''
    for move in ['edit', *moves]:
        if move == 'edit':
            text = f'def main():\n    print({next(letters)!r})\n'
            workspace.write('src/letter_pkg/letter_pkg/letter.py', text)
        elif move == 'build':
            workspace.build('letter_pkg')
        elif move == 'run':
            said = workspace.terminal('source install/setup.bash\nros2 run letter_pkg letter')
            printed += said if len(said) == 1 else '-'
        elif move == 'delete':
            workspace.terminal('rm -rf build/letter_pkg install/letter_pkg')
    return printed


def times_printed(process: Process, start_s: float = 0.0) -> pd.Series:
    """Return the time of each message that a terminal has printed, by its number."""
    pattern = re.compile(r'Hello World: (\d+)" at ([\d.]+)')
    pairs = pattern.findall('\n'.join(process.lines))
    return pd.Series({int(number): float(t) for number, t in pairs if float(t) >= start_s})


def as_table(talking: Process, listening: Process) -> pd.DataFrame:
    """Return what a talker and a listener have printed as a table, such as a recording gives.

    It waits until both have printed the last message of the talker, which is the 41st.
    """
    talking.wait_for('World: 40')
    published = times_printed(talking)
    wait_until(lambda: 40 in times_printed(listening, published.min()), 10)
    heard = times_printed(listening, published.min())
    table = pd.DataFrame({'published_s': published, 'started_s': heard}) - published.min()
    table = table.rename_axis('seq').reset_index()
    return table.assign(finished_s=table['started_s'] + 0.2, thread=None)


def imports(workspace: Workspace, module: str) -> bool | str:
    """Return whether a terminal that has sourced the workspace can import a module, or why not."""
    lines = workspace.terminal(f"""
        source install/setup.bash
        python -c 'import {module}; print("found")'
    """).splitlines()
    return lines[-1:] == ['found'] or error_in(lines)


def make_three_changes(workspace: Workspace) -> tuple[set[str], set[str]]:
    """Make the changes A, B and C. Return which take effect at once, and which after a build."""
    setup = 'src/brake/brake/setup.py'
    files = {'B': 'share/brake/config/fast.yaml', 'C': 'lib/brake/stop'}
    install = workspace.file('install/brake')

    def in_effect():
        letters = {letter for letter, file in files.items() if (install / file).exists()}
        return letters | ({'A'} if imports(workspace, 'brake_tools.word') is True else set())

    given = workspace.file(setup).read_text()
    marker = "('share/' + package_name, ['package.xml']),"
    changed = given.replace(marker, f"{marker} ('share/brake/config', ['config/fast.yaml']),")
    changed = changed.replace("['brake =", "['stop = brake.brake:main', 'brake =")
    workspace.write('src/brake/brake_tools/brake_tools/word.py', "WORD = 'new'\n")
    workspace.write('src/brake/brake/config/fast.yaml', 'speed: 1.0\n')
    for file in files.values():
        (install / file).unlink(missing_ok=True)
    with workspace.replaced({setup: changed}):
        at_once = in_effect()
        workspace.build('brake', symlink_install=True)  # the change of brake_tools is A
        return at_once, in_effect()


def build_anew(workspace: Workspace, *packages: str, library: str | None = None) -> BuildResult:
    """Build packages from an empty `install`, and return the result.

    With `library`, this text is the CMakeLists.txt of scan_tools for the time of the build.
    """
    for folder in ('install', 'build/try_library', 'build/look'):
        shutil.rmtree(workspace.file(folder), ignore_errors=True)
    with workspace.replaced({LIBRARY_FILE: library} if library else {}):
        return workspace.build(*packages)
