"""The workspace of a notebook, and the cell magic that writes its files."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePosixPath

from ros2_command.api import CommandError, command_of

from helpers.lesson import path_and_part
from helpers.machine import (
    BUILT,
    OWNED,
    build_environment,
    claim_workspace,
    files_of_person,
    from_wheels,
    name_beside,
    tools_of_a_build,
)
from helpers.notebook import BEGIN_EMPTY, ProgressBar, somebody_watches, uninterrupted
from helpers.ros import graph_environment
from helpers.workspace.build_output import BuildResult, read_result, without_folders
from helpers.workspace.processes import POLL_S, Process
from helpers.workspace.replaced import give_back, replaced
from helpers.workspace.sourcing import source, use
from helpers.workspace.wheels import fix_wheels

CMAKE_MODULES = Path(__file__).with_name('cmake')
# What colcon prints in a terminal and differs from run to run: 'Finished <<< my_package [1.06s]',
# and that the prefix of the wheels, which need not be one, is no colcon workspace.
MOVING = r'(?<=\w) \[-?[\d.]+s(, .*)?\]$|^\[-?[\d.]+s\] WARNING.*any .local_setup\..*\n'
MOVING += r'|^\[-?[\d.]+s\] (?=WARNING:|ERROR:)'
# A package in C++ for lessons: copy it into `src`.
SMALL_RCLCPP = Path(__file__).with_name('small_rclcpp')
TERMINAL_LIMIT_S = 60.0  # of the commands in a terminal that closes
CONFIGURE_SHARE = 0.4  # of a build's time, before make says how much it has done

# The parts of the files that several cells write, in a workspace.
PARTS = '.parts.json'

AS_LEFT = 'Your files are as you left them: {} in {}. To begin with an empty workspace: '
AS_LEFT += '`workspace.begin_anew()`. It keeps a copy.'
EMPTY = 'The workspace is empty: run the cells below its own again. {}'

_open_workspace: Workspace | None = None


class Workspace:
    """A colcon workspace of this notebook: `Workspace('make_a_package')`.

    It is in the folder `scratch` of this checkout, which git ignores. A person finds it as it was
    left; `begin_anew` empties it. A run without a person, as in CI, begins with an empty one. If
    another kernel has a workspace of this name, another folder is taken.

    `path` is the folder; all paths that this class takes and prints are relative to it.
    `terminals` are those that `start` has opened, by name.

    With `underlay`, another workspace that has been built, this one is an overlay of it: it is in
    a folder of the underlay, is built in a terminal that has sourced the underlay, and is closed
    with it. `%%write` goes on to write into the underlay.

    Raises ValueError for a name that is not letters, digits, `_` and `-`, or that of a folder of
    the underlay.
    """

    def __init__(self, name: str, underlay: Workspace | None = None) -> None:
        global _open_workspace
        if not re.fullmatch(r'[A-Za-z0-9_-]+', name):
            raise ValueError(
                'Name a workspace with letters, digits, _ and -, such as make_a_package, '
                f'not {name!r}.'
            )
        if underlay and name in ('src', 'build', 'install', 'log'):
            raise ValueError(f'{name!r} is a folder of the underlay: choose another name.')
        if underlay is None:
            if _open_workspace is not None:
                _open_workspace.close()
        elif name in underlay._overlays:
            underlay._overlays[name].close()
        self._underlay = underlay
        self._overlays: dict[str, Workspace] = {}
        self.path = underlay.path / name if underlay else claim_workspace(name)
        self._processes: dict[tuple[str, ...], Process] = {}
        self.terminals: dict[str, Process] = {}
        self._ran: list[tuple[str, str | Process]] = []  # in terminals
        # What the last sourcing gave, and the state of the folder `install` then.
        self._sourced: tuple[object, dict[str, str]] | None = None
        self._building: Build | None = None  # the last one
        self._parts: dict[str, list[str]] = {}  # of the files that several cells write
        if underlay is not None:
            self._empty()
            underlay._overlays[name] = self
        else:
            self._open()
            _open_workspace = self
        _register_in_ipython()

    def _open(self) -> None:
        """Go on with what a person has left, or begin with an empty folder."""
        give_back(self.path)
        is_left = somebody_watches() and not os.environ.get(BEGIN_EMPTY)
        if not is_left:
            self._put_aside()
            self._empty()
        elif files := files_of_person(self.path):
            print(AS_LEFT.format(_count(files), f'{self.path.parent.name}/{self.path.name}'))
            with contextlib.suppress(OSError, ValueError):
                self._parts = json.loads((self.path / PARTS).read_text(encoding='utf-8'))
        (self.path / 'src').mkdir(parents=True, exist_ok=True)
        if is_left:
            (self.path / OWNED).touch()

    def begin_anew(self) -> None:
        """End what runs in this workspace and empty it. What was in it is kept beside it."""
        self.close()
        count = _count(files_of_person(self.path))
        aside = self._put_aside()
        self._empty()
        (self.path / OWNED).touch()
        said = f'{count} and what was built are gone from it. A copy is in {aside}.'
        print(EMPTY.format(said if aside else 'There was nothing in it.'))

    def _put_aside(self) -> str | None:
        """Keep a person's files beside the workspace, and return where they are then."""
        if not (self.path / OWNED).exists() or not files_of_person(self.path):
            return None
        with uninterrupted():  # rmtree makes an OSError of an Interrupt
            for built in BUILT:
                shutil.rmtree(self.path / built, ignore_errors=True)
            aside = name_beside(self.path)
            self.path.rename(aside)
        return f'{aside.parent.name}/{aside.name}'

    def _empty(self) -> None:
        with uninterrupted():
            shutil.rmtree(self.path, ignore_errors=True)
            (self.path / 'src').mkdir(parents=True)
        self._parts = {}
        self._sourced = None

    # --- Files ---

    def file(self, relative_path: str | os.PathLike) -> Path:
        """Return the path of a file in this workspace. Raises ValueError if it is outside."""
        path = PurePosixPath(relative_path)
        if path.is_absolute() or '..' in path.parts or not path.parts:
            raise ValueError(
                'Give a path inside the workspace, for example src/my_package/package.xml, '
                f'not {str(relative_path)!r}.'
            )
        return self.path / path

    def write(self, relative_path: str | os.PathLike, text: str, part: int | None = None) -> None:
        """Write a file of the workspace, and the folders above it.

        With `part`, 1 or more, only this part of the file is written anew. An empty line separates
        the parts, two are before a class or a function of Python. Raises ValueError if the part
        before it was not written.
        """
        file = self.file(relative_path)
        name = file.relative_to(self.path).as_posix()
        parts = self._parts.get(name, []) if part is not None else []  # a whole file has none
        if part is not None:
            if not 1 <= part <= len(parts) + 1:
                raise ValueError(f'Write part {len(parts) + 1} of {relative_path} first.')
            parts = [*parts[: part - 1], text, *parts[part:]]
            text = parts[0] + ''.join(_line_before(each, file) + each for each in parts[1:])
        with uninterrupted():  # a file of which one half is written would be lost
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding='utf-8')
            self._parts[name] = parts
            (self.path / PARTS).write_text(json.dumps(self._parts), encoding='utf-8')

    def replaced(self, files: Mapping[str, str]) -> contextlib.AbstractContextManager[None]:
        """Give files other texts within a `with` block: {relative path: text}.

        After it they are as they were, a new one is gone; also if this process is killed within it.
        """
        return replaced(self.path, files)

    def print_tree(self, relative_path: str = 'src', hide: Sequence[str] = ()) -> None:
        """Print the files below a folder of the workspace. `hide` holds patterns such as '*.zsh'.

        A folder that holds only one folder is printed in one line with it. Raises ValueError if
        there is no such folder.
        """
        top = self.file(relative_path)
        if not top.is_dir():
            raise ValueError(f'There is no folder {relative_path!r} in this workspace.')
        print(f'{relative_path}/')
        _print_below(top, ('__pycache__', *hide), '  ')

    # --- Build ---

    def build(self, *packages: str, symlink_install: bool = False) -> BuildResult:
        """Run `colcon build` on all packages in `src`, or with `--packages-select` on these.

        A build that fails is a result, not an exception: print it. Raises RuntimeError if this
        machine lacks a tool, with the command that installs it.
        """
        return self.begin_build(*packages, symlink_install=symlink_install).result()

    def begin_build(self, *packages: str, symlink_install: bool = False) -> Build:
        """Begin a build as `build` does, and let the notebook go on meanwhile.

        Its `result()` waits for it, and so does whatever else needs the workspace: the next build,
        a terminal, a program. Raises RuntimeError as `build` does.
        """
        self._wait_for_build()
        with_cmake = any(self.path.glob('src/**/CMakeLists.txt'))
        for tool in tools_of_a_build(with_cmake):
            if not tool.found:
                raise RuntimeError(
                    f'Missing for this build: {tool.name}. Run `{tool.install}`, then run this '
                    'cell again.'
                )
        if with_cmake and from_wheels():
            fix_wheels()
        self._sourced = None
        command = ['colcon', 'build']
        command += ['--symlink-install'] if symlink_install else []
        command += ['--packages-select', *packages] if packages else []
        # An overlay is in the folder of its underlay, and no part of it.
        settings = ['--base-paths', 'src', '--event-handlers']
        settings += ['console_direct+', 'desktop_notification-', 'status-']
        # Without the first, CMake takes the newest Python on the PATH.
        python = [f'-DPython3_EXECUTABLE={sys.executable}', f'-DCMAKE_MODULE_PATH={CMAKE_MODULES}']
        settings += ['--cmake-args', *python]
        total = len(packages) or len(list(self.path.glob('src/**/package.xml'))) or 1
        colcon = self._colcon([*command[1:], *settings])
        self._building = Build(self.path, ' '.join(command), packages, total, colcon)
        return self._building

    def _wait_for_build(self) -> None:
        if self._building is not None:
            self._building.result()

    def _colcon(self, arguments: list[str]) -> Process:
        """Start colcon in the workspace."""
        # The entry point: the script `colcon` may be of another environment. As with the script,
        # no file of the workspace hides a module of Python (-P).
        main = 'import sys; from colcon_core.command import main; sys.exit(main())'
        command = [sys.executable, '-P', '-c', main, '--log-base', 'log', *arguments]
        environment = self._underlay.environment() if self._underlay else build_environment()
        # If it were killed, its compilers would go on without an owner: it builds to its end.
        return Process('colcon', command, environment, self.path, ends_with_kernel=False)

    # --- Use ---

    def environment(self) -> dict[str, str]:
        """Return the environment of a terminal that has sourced `install/setup.bash`.

        Raises RuntimeError if nothing has been built.
        """
        self._wait_for_build()
        state = _state(self.path / 'install')  # a check, a process apart, may have built, too
        if self._sourced is None or self._sourced[0] != state:
            self._sourced = state, source(self.path)
        return dict(self._sourced[1])

    def use(self) -> None:
        """Make what was built importable in this kernel, as `source install/setup.bash` would.

        A package of pure Python that was built again replaces the old one at the next import.
        Raises RuntimeError if a package with libraries (every interface package) was built again
        and has changed: a process cannot give a loaded library back. Then restart the kernel.
        """
        use(self.path / 'install', self.environment())

    # --- Run ---

    def run(self, package: str, executable: str, *arguments: str) -> Process:
        """Start an executable as `ros2 run` does, and return the running process.

        It has the sourced environment, and the domain id and discovery range of the open session,
        or of this kernel's next one. It ends with its `with` block, with `stop()`, when the same is
        run again, when the cell that starts it is interrupted, and with the kernel. If there is no
        such package or executable, it has printed what `ros2 run` prints, and has ended with 1.
        """
        environment = self.environment() | self._environment_of_nodes()
        key = (package, executable, *arguments)
        if key in self._processes:
            self._processes[key].stop()
        try:
            command, found = command_of(package, executable, environment), True
        except CommandError as error:
            command, found = ['/bin/sh', '-c', 'echo "$0"; exit 1', str(error)], False
        process = Process(executable, [*command, *arguments], environment, self.path)
        self._processes[key] = process
        if not found:
            process.wait()
        return process

    def terminal(self, commands: str, show: Callable[[str], object] | None = None) -> str:
        """Run commands in a new terminal, a bash in the folder of this workspace.

        Nothing of the workspace is sourced in it. It is in the domain of the open session, or of
        this kernel's next one. Its user is `you`. The user's settings of git do not count, and git
        sees no repository above the workspace.
        Return what the commands print, without this machine's folders and the times of colcon.
        `show` gets each line when it is there, so that an Interrupt loses none.

        Raises TimeoutError if they take longer than 60 s.
        """
        shown = 0

        def show_new() -> None:
            nonlocal shown
            lines = shell.lines
            for line in lines[shown:]:
                if text := self._plain(f'{line}\n'):
                    show(text)
            shown = len(lines)

        with self._bash('terminal', commands) as shell:
            end = time.monotonic() + TERMINAL_LIMIT_S
            try:
                while show and shell.running and time.monotonic() < end:
                    time.sleep(POLL_S)
                    show_new()
                shell.wait(max(0.0, end - time.monotonic()))
            except TimeoutError:
                raise TimeoutError(
                    f'After {TERMINAL_LIMIT_S:g} s the commands had not ended: this terminal was '
                    'closed. Write `timeout 5` before a command that goes on for ever, or give the '
                    'terminal a name: %%terminal listener.'
                ) from None
            finally:
                if show:
                    show_new()
                self._ran.append((commands, '\n'.join(shell.lines)))
        for workspace in (self, *self._overlays.values()):
            workspace._sourced = None  # the commands may have built
        return self._plain('\n'.join(shell.lines))

    def _plain(self, text: str) -> str:
        return re.sub(MOVING, '', without_folders(text, self.path), flags=re.M)

    def start(self, commands: str, name: str = 'terminal') -> Process:
        """Run commands in a new terminal that stays open, and return its process.

        It is as that of `terminal`, and nodes that run in it print no times before their lines. It
        ends with its `with` block, with `stop()`, when another one of this `name` is started, when
        the cell that starts it is interrupted, and with the kernel.
        """
        if name in self.terminals:
            self.terminals[name].stop()
        self.terminals[name] = self._bash(name, commands)
        self._ran.append((commands, self.terminals[name]))
        return self.terminals[name]

    @property
    def ran(self) -> list[tuple[str, str]]:
        """What was run in terminals so far: the commands, and what they have printed."""
        return [
            (commands, said if isinstance(said, str) else '\n'.join(said.lines))
            for commands, said in self._ran
        ]

    def _bash(self, name: str, commands: str) -> Process:
        self._wait_for_build()
        environment = build_environment() | self._environment_of_nodes()
        environment |= {
            'GIT_CONFIG_GLOBAL': os.devnull,
            'GIT_CONFIG_NOSYSTEM': '1',
            # If the workspace has no repository, git would find that of this checkout.
            'GIT_CEILING_DIRECTORIES': str(self.path.parent),
            'LOGNAME': 'you',
        }
        command = [shutil.which('bash') or '/bin/bash', '--norc', '-c', commands]
        return Process(name, command, environment, self.path, terminal=True)

    def _environment_of_nodes(self) -> dict[str, str]:
        return graph_environment() | {
            'ROS_LOG_DIR': str(self.path / 'log' / 'ros'),  # not the home: it may be read-only
            'PYTHONUNBUFFERED': '1',
            # Without the time stamp.
            'RCUTILS_CONSOLE_OUTPUT_FORMAT': '[{severity}] [{name}]: {message}',
        }

    def close(self) -> None:
        """End every process of this workspace. Its files stay until it is made again."""
        for overlay in self._overlays.values():
            overlay.close()
        for process in [*self._processes.values(), *self.terminals.values()]:
            process.stop()
        if self._building is not None:
            self._building.stop()
        self._processes.clear()
        self.terminals.clear()


def give_files_back() -> None:
    """Give back what a process that was killed has replaced in the open workspace."""
    if _open_workspace is not None:
        for workspace in (_open_workspace, *_open_workspace._overlays.values()):
            give_back(workspace.path)


class Build:
    """A build that was begun. `result()` waits until it has ended, with a progress bar."""

    stopped = False  # before it had ended

    def __init__(
        self, path: Path, command: str, packages: Sequence[str], total: int, colcon: Process
    ) -> None:
        self._path, self._command, self._packages, self._total = path, command, packages, total
        self._colcon = colcon
        self._result: BuildResult | None = None

    def result(self) -> BuildResult:
        """Return what was built. An Interrupt ends the build."""
        if self._result is not None:
            return self._result
        colcon, started = self._colcon, time.monotonic()
        try:
            with ProgressBar(lambda: _packages_done(colcon.lines) / self._total) as bar:
                while colcon.running:
                    time.sleep(POLL_S)
                    bar.update(time.monotonic() - started)
        except KeyboardInterrupt:
            self.stop()
            raise
        colcon.stop()
        self._result = read_result(self._path, self._command, self._packages, colcon.lines)
        return self._result

    def stop(self) -> None:
        """End it, as an Interrupt does."""
        with uninterrupted():
            if self._colcon.running:
                self.stopped = True
                self._colcon.stop()
                self._note_half_built()

    def _note_half_built(self) -> None:
        """Let colcon replace the copies of packages that it began and did not finish.

        If the change of a Python package from copies to links is interrupted, colcon 0.21.3 has
        removed its list of copies. Without this file it refuses to replace them by links.
        """
        begun, finished = (
            {line.split()[2] for line in self._colcon.lines if line.startswith(word)}
            for word in ('Starting >>>', 'Finished <<<')
        )
        for package in begun - finished:
            with contextlib.suppress(FileNotFoundError):  # it had no folder yet
                (self._path / 'build' / package / 'install.log').touch()


def _count(files: Sequence[Path]) -> str:
    return f'{len(files)} file{"" if len(files) == 1 else "s"}'


def _line_before(part: str, file: Path) -> str:
    is_top = file.suffix == '.py' and re.match(r'(async )?def |class |@', part)
    return '\n\n' if is_top else '\n'


def _state(install: Path) -> list[int]:
    return [path.stat().st_mtime_ns for path in (install, install / 'setup.bash') if path.exists()]


def _print_below(folder: Path, hide: Sequence[str], indent: str) -> None:
    def shown(folder: Path) -> list[Path]:
        found = [item for item in folder.iterdir() if not any(item.match(x) for x in hide)]
        return sorted(found, key=lambda item: (item.is_dir(), item.name))

    for item in shown(folder):
        name = item.name
        while item.is_dir() and len(below := shown(item)) == 1 and below[0].is_dir():
            item = below[0]
            name += f'/{item.name}'
        name = re.sub(r'\bpython3\.\d+\b', 'python3', name)  # the same on every machine
        print(f'{indent}{name}{"/" if item.is_dir() else ""}')
        if item.is_dir():
            _print_below(item, hide, f'{indent}  ')


def _packages_done(lines: Sequence[str]) -> float:
    """Return how many packages colcon has built, with the part of the current one."""
    done, part = 0, 0.0
    for line in lines:
        if line.startswith(('Finished <<<', 'Failed   <<<')):
            done, part = done + 1, 0.0
        elif re.match(r'-- Configuring done( \(|$)', line):
            part = CONFIGURE_SHARE
        elif made := re.match(r'\[ *(\d+)%\]', line):
            part = CONFIGURE_SHARE + (1 - CONFIGURE_SHARE) * int(made[1]) / 100
    return done + part


# --- In a notebook -------------------------------------------------------------------------------


def write(line: str, cell: str) -> None:
    """`%%write PATH`: write the rest of the cell to a file of the open workspace.

    Several cells can write a long file: `%%write PATH part 1`, `%%write PATH part 2`.
    """
    from IPython.core.error import UsageError

    if _open_workspace is None:
        raise UsageError("Open a workspace first: workspace = Workspace('my_lesson').")
    path, part = path_and_part(line)
    try:
        _open_workspace.write(path, cell, part)
    except (ValueError, OSError) as error:
        raise UsageError(str(error)) from error
    print(f'Wrote part {part} of {path}' if part else f'Wrote {path}')


def terminal(line: str, cell: str) -> None:
    """`%%terminal`: run the rest of the cell in a new terminal of the open workspace, and print.

    `%%terminal NAME`: the terminal stays open, and `workspace.terminals[NAME]` is its process.
    """
    from IPython.core.error import UsageError

    name = line.strip()
    if _open_workspace is None:
        raise UsageError("Open a workspace first: workspace = Workspace('my_lesson').")
    if not name:
        try:
            _open_workspace.terminal(cell, show=lambda text: print(text, end='', flush=True))
        except TimeoutError as error:
            raise UsageError(str(error)) from None
    else:
        _open_workspace.start(cell, name)


def _register_in_ipython() -> None:
    from IPython import get_ipython

    shell = get_ipython()
    if shell is None or 'terminal' in shell.magics_manager.magics['cell']:
        return
    shell.register_magic_function(write, 'cell')
    shell.register_magic_function(terminal, 'cell')
