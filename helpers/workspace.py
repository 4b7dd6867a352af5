"""A colcon workspace for a notebook: write its files, build it, read the error, use it, run it.

What builds is the real `colcon build`, and what runs is a real process. This module adds what a
terminal gives and a running kernel lacks: a clean environment, the effect of
`source install/setup.bash`, and an end for every process.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import fcntl
import hashlib
import importlib.metadata
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import textwrap
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from helpers.interrupts import uninterrupted
from helpers.progress_bar import ProgressBar
from helpers.session import graph_environment
from helpers.text import wrap

ROOT = Path(__file__).resolve().parent.parent
BUILD_TIMEOUT_S = 600.0
STOP_TIMEOUT_S = 5.0
POLL_S = 0.02
CONFIGURE_SHARE = 0.4  # of a build's time, before make says how much it has done

_locks: dict[Path, int] = {}  # the workspaces of this process, each with the file that locks it
_open_workspace: Workspace | None = None
_loaded: dict[str, dict[str, str]] = {}  # package -> library -> hash, as this process loaded it


# --- The environment of a build ------------------------------------------------------------------


def _from_wheels() -> bool:
    """Return whether ROS 2 comes from the wheels in this Python environment."""
    try:
        importlib.metadata.version('ros-rclpy')
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def mend_wheels(prefix: Path | None = None) -> int:
    """Make the CMake files of the ROS 2 wheels fit this machine. Return how many were changed.

    The wheels were built in a container, and 20 of their CMake files name its folders, such as
    /opt/python/cp311-cp311/include/python3.11. CMake stops at a folder that does not exist. Here
    these are replaced by the folders of this Python and this NumPy. A second call finds nothing.

    Raises RuntimeError where a file needs it and cannot be written.
    """
    import numpy

    folders = {
        rb'/opt/python/[^/";]+/include/python[^/";]+': sysconfig.get_path('include'),
        rb'/opt/python/[^";]+/numpy/(?:_core|core)/include': numpy.get_include(),
    }
    changed = 0
    for file in Path(prefix or sys.prefix).glob('share/*/cmake/*Export.cmake'):
        old = new = file.read_bytes()
        for pattern, folder in folders.items():
            new = re.sub(pattern, lambda _, folder=folder: os.fsencode(folder), new)
        if new == old:
            continue
        # A new file, because uv may have linked the old one to its cache. Its name is the process's
        # own, because two kernels may do this at once.
        written = file.with_name(f'{file.name}.{os.getpid()}')
        try:
            written.write_bytes(new)
            shutil.copymode(file, written)
            written.replace(file)
        except OSError as error:
            with contextlib.suppress(OSError):
                written.unlink()
            raise RuntimeError(
                'The CMake files of the ROS 2 wheels name folders of another machine, and '
                f'{file.parent.parent.parent} cannot be written: use an environment of your own, '
                'made with `make lab`.'
            ) from error
        changed += 1
    return changed


def _environment() -> dict[str, str]:
    """Return the environment of a build or a node, without what was inherited by chance."""
    unwanted = (
        # Settings of colcon, make, CMake and the compiler that would change what a lesson shows.
        r'COLCON_|CMAKE_(?!PREFIX_PATH$)|MAKE|MFLAGS|DESTDIR|VERBOSE$|C?(PP|XX)?FLAGS$|CFLAGS$'
        r'|LDFLAGS$|(C|CPLUS|C_INCLUDE|CPLUS_INCLUDE|LIBRARY|PKG_CONFIG)_?PATH$|NINJA|CCACHE_'
        # The language of messages, and what pytest and Python tell their children.
        # ipykernel asks for colours: then no line of CMake starts with "CMake Error".
        r'|LC_|LANG|CLICOLOR|FORCE_COLOR|PYTEST|PYTHON(?!PATH$)|RCUTILS_|ROS_DOMAIN_ID'
        r'|ROS_STATIC_PEERS'
        r'|ROS_LOCALHOST_ONLY|ROS_AUTOMATIC_DISCOVERY_RANGE'
    )
    environment = {k: v for k, v in os.environ.items() if not re.match(unwanted, k)}
    # Where several jobs write, the lines of one stay together. No -l, which colcon would add: on a
    # busy machine it lets make start one job at a time.
    cores = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count()
    environment |= {'LC_ALL': 'C.UTF-8', 'MAKEFLAGS': f'-j{cores} -O', 'PYTHONUTF8': '1'}
    here = Path(sys.executable).parent
    environment['PATH'] = f'{here}{os.pathsep}{os.environ.get("PATH", os.defpath)}'
    if sys.prefix != sys.base_prefix:
        environment['VIRTUAL_ENV'] = sys.prefix
    if _from_wheels():
        # Another ROS 2 that is sourced has no part in it.
        for name in list(environment):
            if re.match(r'AMENT_|CMAKE_PREFIX_PATH|PYTHONPATH|ROS_|RMW_|FASTDDS_|FASTRTPS_', name):
                del environment[name]
        environment['AMENT_PREFIX_PATH'] = sys.prefix
        libraries = environment.get('LD_LIBRARY_PATH', '').split(os.pathsep)
        environment['LD_LIBRARY_PATH'] = os.pathsep.join(
            folder for folder in libraries if Path(folder).is_relative_to(sys.prefix)
        )
    return environment


def missing_tools(environment: dict[str, str] | None = None, cmake: bool = True) -> str:
    """Return one sentence on the first tool that a build lacks, or ''.

    `cmake` says whether a package is built with CMake: one of pure Python needs colcon only.
    """
    environment = environment or _environment()
    python = f'{sys.version_info.major}.{sys.version_info.minor}'

    def found(command: str) -> bool:
        return shutil.which(command, path=environment['PATH']) is not None

    if not importlib.util.find_spec('colcon_core'):
        return (
            'colcon is not installed: run `python -m pip install colcon-common-extensions` in the '
            'environment of this kernel.'
        )
    if not cmake:
        return ''
    if not found(environment.get('CXX', 'c++')) or not found(environment.get('CC', 'cc')):
        return 'There is no C++ compiler: run `sudo apt install g++`, then run this cell again.'
    if not found('cmake'):
        return 'There is no CMake: run `sudo apt install cmake`, then run this cell again.'
    if not found('make'):
        return 'There is no make: run `sudo apt install make`, then run this cell again.'
    if not any(
        (Path(sysconfig.get_path(kind)) / 'Python.h').is_file()
        for kind in ('include', 'platinclude')
    ):
        return (
            f'The headers of Python {python} are missing: run `sudo apt install python{python}-dev`'
            ', then run this cell again.'
        )
    return ''


# --- The result of a build -----------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class BuildResult:
    """What `colcon build` did. Its text has no times and no machine's folders, so it is comparable.

    `packages` holds 'finished', 'failed' or 'aborted' for each package, in the order of their
    dependencies. `errors` are the lines that matter, `warnings` are colcon's own. `log` is the file
    with every line that the failed package printed (or the last package).
    """

    ok: bool
    seconds: float
    failed: str | None
    packages: dict[str, str]
    errors: list[str]
    log: Path
    command: str
    warnings: list[str] = field(default_factory=list)
    log_name: str = ''

    def __str__(self) -> str:
        done = {'finished': 'Finished <<< ', 'failed': 'Failed   <<< ', 'aborted': 'Aborted  <<< '}
        lines = [self.command, *self.warnings]
        for package, state in self.packages.items():
            if package == self.failed:
                lines += [f'--- stderr: {package}', *self.errors, '---']
            lines.append(f'{done[state]}{package}')
        if not self.packages:
            lines += self.errors
        lines.append('')
        names = {s: [p for p, state in self.packages.items() if state == s] for s in done}
        lines.append(f'Summary: {_packages(len(names["finished"]))} finished')
        for state in ('failed', 'aborted'):
            if names[state]:
                count = _packages(len(names[state]))
                lines.append(f'  {count} {state}: {" ".join(names[state])}')
        if not self.ok and self.failed:
            lines.append(f'Every line: {self.log_name}')
        return '\n'.join(lines)

    __repr__ = __str__


STANDARD_LIBRARY = '.../lib/python3/'
# Where the lines of one program's message end and those of another begin.
STARTS = r'CMake |Traceback |g?make(\[\d+\])?: |ninja: |FAILED: |error: '


def _packages(count: int) -> str:
    return f'{count} package' if count == 1 else f'{count} packages'


def lines_that_matter(text: str) -> list[str]:
    """Return the lines of a failed build's stderr that say what is wrong, as a short list.

    Kept are: CMake's errors with the line of your CMakeLists.txt; of a Python traceback the last
    frame and the exception; the compiler's and linker's errors; what setup.py says at its end.
    Not kept is what only reports that something before it has failed.
    """
    lines = text.splitlines()
    kept: list[str] = []
    index = 0
    while index < len(lines):
        line = lines[index]
        end = index + 1
        if line.startswith('CMake Error'):
            while end < len(lines) and (not lines[end].strip() or lines[end].startswith(' ')):
                end += 1
            # "Call Stack" stands at the margin and has its own indented lines.
            if end < len(lines) and lines[end].startswith('Call Stack'):
                end += 1
                while end < len(lines) and lines[end].startswith(' '):
                    end += 1
            block = _cmake_error(lines[index:end])
        elif line.startswith('Traceback (most recent call last)'):
            while end < len(lines) and (not lines[end].strip() or lines[end].startswith(' ')):
                end += 1
            # An exception's text may have more lines, and another traceback may follow it.
            while end < len(lines) and lines[end].strip() and not re.match(STARTS, lines[end]):
                end += 1
            block = _traceback(lines[index:end])
            rest = '\n'.join(lines[end : end + 2])
            if re.match(r'\s*(During handling of|The above exception was)', rest):
                block = []  # the last one is what ended the program
        elif re.match(r'\S.*?:\d+:(\d+:)? (fatal )?error: ', line):
            while end < len(lines) and re.match(r' *\d* \| |\S.*: note: ', lines[end]):
                end += 1
            block = [x for x in lines[index:end] if ': note: ' not in x]
        elif re.match(
            r'error: |ERROR|\S*ld(\.\w+)?: .*(undefined|cannot find|recompile)|.*: undefined ref',
            line,
        ):
            block = [line]
        else:
            block = []
        if not set(block) <= set(kept):
            kept += block
        index = end
        # The jobs beside it may end or not: what the first one printed is what is sure.
        if kept and re.match(r'(g?make)(\[\d+\])?: \*\*\* ', line):
            break
    return kept or [line for line in lines if line.strip()][-8:]


def _cmake_error(block: list[str]) -> list[str]:
    """Shorten one error of CMake: its text, and the line of the CMakeLists.txt that led to it."""
    stack = next((i for i, x in enumerate(block) if x.startswith('Call Stack')), len(block))
    body = textwrap.dedent('\n'.join(block[1:stack])).strip('\n')
    # CMake breaks lines where the name of a folder happens to end: join, and break again. What was
    # indented, such as the frames of a traceback, it left as it was.
    told: list[str] = []
    for paragraph in re.split(r'\n\s*\n', body):
        if paragraph.startswith(' '):
            told += paragraph.splitlines()
        elif text := ' '.join(paragraph.split()):
            told.append(text)
    # It ran a program, which failed: what the program said is what matters.
    program = next(
        (i for i, x in enumerate(told) if re.search(r'returned error code \d+', x)), None
    )
    if program is not None:
        told = told[program + 1 :]
        tracebacks = [i for i, x in enumerate(told) if x.startswith('Traceback (')]
        if tracebacks:
            told = _traceback(told[tracebacks[-1] :])
        if not told:
            return []
    short = [part for x in told for part in ([x] if x.startswith(' ') else wrap(x))]
    mine = [x.strip() for x in block[stack + 1 :] if x.strip().startswith('CMakeLists.txt')]
    return [block[0], *(f'  {x}' for x in short), *(f'  called from {x}' for x in mine[-1:])]


def _traceback(block: list[str]) -> list[str]:
    """Shorten a traceback to the last frame outside Python's own library, and the exception."""
    frames = [i for i, x in enumerate(block) if x.startswith('  File "')]
    if not frames:
        return block
    told = next(i for i in range(frames[-1] + 1, len(block) + 1)
                if i == len(block) or not block[i].startswith(' '))  # fmt: skip
    last = next((i for i in reversed(frames) if STANDARD_LIBRARY not in block[i]), frames[-1])
    frame = [block[last]]
    for line in block[last + 1 : told]:
        if line.startswith('  File "'):
            break
        # Python 3.11 and newer underline the expression, others do not.
        if not re.fullmatch(r'[\s^~]+', line):
            frame.append(line)
    return [block[0], *(['  ...'] if len(frames) > 1 else []), *frame, *block[told:]]


# --- A running executable ------------------------------------------------------------------------

# The process ends with the kernel, also when the kernel is killed: 1 is Linux's PR_SET_PDEATHSIG.
_WITH_KERNEL = """
import ctypes, os, signal, sys
parent = int(sys.argv[1])
try:
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)
except (OSError, AttributeError):
    pass
if os.getppid() == parent:
    os.execv(sys.argv[2], sys.argv[2:])
"""


def _start(
    name: str, command: list[str], environment: dict[str, str], folder: Path, lines: list[str]
) -> tuple[subprocess.Popen, threading.Thread]:
    """Start a command, and a thread that adds each line it prints to `lines`."""
    process = subprocess.Popen(
        command,
        env=environment,
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        encoding='utf-8',
        errors='replace',
        # What goes on when the kernel is killed, such as a build, keeps its workspace claimed.
        pass_fds=tuple(_locks.values()),
        # Interrupting the kernel must not reach it: its owner ends it in order.
        start_new_session=True,
    )

    def read() -> None:
        for line in process.stdout:
            lines.append(line.rstrip('\n'))

    reader = threading.Thread(target=read, name=f'read {name}', daemon=True)
    reader.start()
    return process, reader


class Process:
    """A running executable and what it has printed. See `Workspace.run`."""

    def __init__(
        self, name: str, command: list[str], environment: dict[str, str], folder: Path
    ) -> None:
        self.name = name
        self._lines: list[str] = []
        self._reader = None
        self._process: subprocess.Popen | None = None
        if not command:
            return
        command = [sys.executable, '-I', '-S', '-c', _WITH_KERNEL, str(os.getpid()), *command]
        self._process, self._reader = _start(name, command, environment, folder, self._lines)

    @property
    def lines(self) -> list[str]:
        """What it has printed so far, stdout and stderr together, one string a line."""
        return list(self._lines)

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process is not None and self._process.poll() is None

    @property
    def returncode(self) -> int | None:
        """Its exit code, None while it runs, -N where signal N ended it."""
        return 1 if self._process is None else self._process.poll()

    def print_output(self, first: int | None = None, last: int | None = None) -> None:
        """Print what it has printed so far, or only the first or the last lines."""
        lines = self.lines
        for line in lines[:first] if first is not None else lines[-(last or len(lines)) :]:
            print(line)

    def wait_for(self, text: str, count: int = 1, timeout_s: float = 20.0) -> str:
        """Wait until `count` lines contain `text`, and return the last of them.

        Raises TimeoutError where that takes longer, and RuntimeError where the process has ended.
        """

        def told() -> list[str]:
            return [line for line in self.lines if text in line]

        lines = 'a line' if count == 1 else f'{count} lines'
        self._wait(lambda: len(told()) >= count, timeout_s, f'{lines} with {text!r}')
        return told()[count - 1]

    def wait(self, timeout_s: float = 20.0) -> int:
        """Wait until it ends by itself, and return its exit code. Raises TimeoutError."""
        self._wait(lambda: not self.running, timeout_s, 'its end')
        if self._reader is not None:
            self._reader.join(STOP_TIMEOUT_S)
        return self.returncode

    def _wait(self, predicate: Callable[[], bool], timeout_s: float, what: str) -> None:
        started = time.monotonic()
        pause = threading.Event()
        while not predicate():
            if not self.running:
                if self._reader is not None:
                    self._reader.join(STOP_TIMEOUT_S)
                if predicate():
                    return
                raise RuntimeError(
                    f'{self.name} ended with code {self.returncode} before {what}. {self._last()}'
                )
            if time.monotonic() - started > timeout_s:
                raise TimeoutError(
                    f'Waited {timeout_s:g} s in vain for {what} of {self.name}. {self._last()}'
                )
            pause.wait(POLL_S)

    def _last(self) -> str:
        # A traceback underlines a part of a line; its last line says what happened.
        lines = [line.strip() for line in self.lines if re.search(r'[^\s^~]', line)]
        if lines and re.match(r'[\w.]+(Error|Exception)\b', lines[-1]):
            return f'Its last line: {lines[-1]}'
        return f'Its last lines: {" / ".join(lines[-3:]) or "none"}'

    def stop(self) -> None:
        """End it as Ctrl+C does. One that does not end within a few seconds is killed."""
        if self._process is None:
            return
        for sent, timeout_s in (
            (signal.SIGINT, STOP_TIMEOUT_S),
            (signal.SIGTERM, STOP_TIMEOUT_S / 5),
            (signal.SIGKILL, STOP_TIMEOUT_S),
        ):
            if not self.running:
                break
            # The group, for it may have started processes of its own.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, sent)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(timeout_s)
        self._reader.join(STOP_TIMEOUT_S)

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *exception) -> None:
        self.stop()

    def __repr__(self) -> str:
        return f'{self.name}: {"running" if self.running else "ended"}'


# --- The workspace -------------------------------------------------------------------------------


class Workspace:
    """A colcon workspace of this notebook, empty when it is made: `Workspace('lesson_06')`.

    It lies in the folder `scratch` of this checkout, which git ignores. Where another kernel has a
    workspace of this name, another folder is taken, so that the two do not meet. `path` is the
    folder; all paths that this class takes and prints are relative to it.

    Raises ValueError for a name that is not letters, digits, `_` and `-`.
    """

    def __init__(self, name: str) -> None:
        global _open_workspace
        if not isinstance(name, str) or not re.fullmatch(r'[A-Za-z0-9_-]+', name):
            raise ValueError(
                f'A workspace is named with letters, digits, _ and -, for example '
                f"Workspace('lesson_06'), not {name!r}."
            )
        if _open_workspace is not None:
            _open_workspace.close()
        self.path = _claim(name)
        self._processes: dict[tuple[str, ...], Process] = {}
        self._sourced: dict[str, str] | None = None
        _empty(self.path)
        (self.path / 'src').mkdir(parents=True)
        _open_workspace = self
        _register_in_ipython()

    def __repr__(self) -> str:
        return f'Workspace({self.path.name!r})'

    # --- Files ---

    def file(self, relative_path: str | os.PathLike) -> Path:
        """Return the path of a file in this workspace. Raises ValueError where it is outside."""
        path = PurePosixPath(relative_path)
        if path.is_absolute() or '..' in path.parts or not path.parts:
            raise ValueError(
                'Give a path inside the workspace, for example src/my_package/package.xml, '
                f'not {str(relative_path)!r}.'
            )
        return self.path / path

    def write(self, relative_path: str | os.PathLike, text: str) -> None:
        """Write a file of the workspace, and the folders above it."""
        file = self.file(relative_path)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding='utf-8')

    def print_tree(self, relative_path: str = 'src', hide: Sequence[str] = ()) -> None:
        """Print the files below a folder of the workspace. `hide` holds patterns such as '*.zsh'.

        A folder with nothing but one folder stands in one line with it.
        """
        top = self.file(relative_path)
        if not top.is_dir():
            raise ValueError(f'There is no folder {relative_path!r} in this workspace.')
        hide = ('__pycache__', *hide)

        def children(folder: Path) -> list[Path]:
            found = [x for x in folder.iterdir() if not any(x.match(p) for p in hide)]
            return sorted(found, key=lambda x: (x.is_dir(), x.name))

        def show(item: Path, depth: int) -> None:
            name = item.name
            while item.is_dir() and len(below := children(item)) == 1 and below[0].is_dir():
                item = below[0]
                name += f'/{item.name}'
            name = name.replace(
                f'python{sys.version_info.major}.{sys.version_info.minor}', 'python3'
            )
            print(f'{"  " * depth}{name}{"/" if item.is_dir() else ""}')
            if item.is_dir():
                for child in children(item):
                    show(child, depth + 1)

        print(f'{relative_path}/')
        for child in children(top):
            show(child, 1)

    # --- Build ---

    def build(self, *packages: str, cmake_args: Sequence[str] = ()) -> BuildResult:
        """Run `colcon build` on all packages, or with `--packages-select` on these.

        A build that fails is a result, not an exception: print it. Raises RuntimeError where this
        machine lacks a tool, with the command that installs it; TypeError and ValueError for what
        is not the name of a package.
        """
        for package in packages:
            if not isinstance(package, str):
                raise TypeError(f'A package is given by its name, a text, not {package!r}.')
            if not re.fullmatch(r'[A-Za-z][\w-]*', package):
                raise ValueError(f'{package!r} is not the name of a package.')
        environment = _environment()
        with_cmake = any(self.path.glob('src/**/CMakeLists.txt'))
        if lacking := missing_tools(environment, with_cmake):
            raise RuntimeError(lacking)
        if with_cmake and _from_wheels():
            mend_wheels()
        command = ['colcon', 'build', *(['--packages-select', *packages] if packages else [])]
        settings = ['--event-handlers', 'console_direct+', 'desktop_notification-', 'status-']
        # Without it, CMake takes the newest Python on the PATH.
        settings += ['--cmake-args', f'-DPython3_EXECUTABLE={sys.executable}', *cmake_args]
        started = time.monotonic()
        output = self._colcon([*command[1:], *settings], environment, packages)
        self._sourced = None
        return self._result(' '.join(command), output, packages, time.monotonic() - started)

    def _colcon(self, arguments: list[str], environment: dict[str, str], packages) -> list[str]:
        """Run colcon in the workspace with a progress bar, and return the lines it printed."""
        lines: list[str] = []
        # The entry point, because the script `colcon` may be of another environment.
        main = 'import sys; from colcon_core.command import main; sys.exit(main())'
        command = [sys.executable, '-c', main, '--log-base', 'log', *arguments]
        total = max(1, len(packages) or len(list(self.path.glob('src/**/package.xml'))))

        def progress() -> float:
            """The packages that are done, and the part of the current one."""
            done, part = 0, 0.0
            for line in list(lines):
                if line.startswith(('Finished <<<', 'Failed   <<<')):
                    done, part = done + 1, 0.0
                elif line == '-- Configuring done' or line.startswith('-- Configuring done ('):
                    part = CONFIGURE_SHARE
                elif made := re.match(r'\[ *(\d+)%\]', line):
                    part = CONFIGURE_SHARE + (1 - CONFIGURE_SHARE) * int(made[1]) / 100
            return (done + part) / total

        started = time.monotonic()
        process = None
        try:
            with uninterrupted():
                process, reader = _start('colcon', command, environment, self.path, lines)
            with ProgressBar(progress) as bar:
                while reader.is_alive() or process.poll() is None:
                    reader.join(POLL_S)
                    waited_s = time.monotonic() - started
                    bar.update(waited_s)
                    if waited_s > BUILD_TIMEOUT_S:
                        raise TimeoutError(
                            f'colcon did not end within {BUILD_TIMEOUT_S:g} s: read '
                            f'{self.path / "log/latest_build/logger_all.log"}.'
                        )
        finally:
            if process is not None and process.poll() is None:  # interrupted, or too slow
                os.killpg(process.pid, signal.SIGINT)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(STOP_TIMEOUT_S)
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)  # a compiler that goes on
                process.wait()
        return lines

    def _result(self, command: str, output: list[str], asked, seconds: float) -> BuildResult:
        log = self.path / 'log' / 'latest_build'
        events = log / 'events.log'
        text = events.read_text(encoding='utf-8', errors='replace') if events.is_file() else ''
        packages = dict.fromkeys(re.findall(r'^\[.*?\] \((.+?)\) JobQueued', text, re.M), 'aborted')
        # colcon and Python write this: [1.12] (my_package) JobEnded: {..., 'rc': 0}
        ended = r"^\[.*?\] \((.+?)\) JobEnded: .*'rc': ('?\w+'?)\}"
        for package, code in re.findall(ended, text, re.MULTILINE):
            packages[package] = {'0': 'finished', "'SIGINT'": 'aborted'}.get(code, 'failed')
        failed = next((p for p, state in packages.items() if state == 'failed'), None)
        own = [
            self._plain(found[1])
            for line in output
            # Since Python 3.13 colcon's seconds are negative.
            if (found := re.match(r'\[-?\d[\d.]*s\] ((?:WARNING|ERROR):.*)', line))
            # The prefix of the wheels is no colcon workspace, and need not be.
            and "doesn't contain any 'local_setup.*' files" not in line
        ]
        errors: list[str] = []
        log_file = log / (failed or next(reversed(packages), '')) / 'stdout_stderr.log'
        if failed:
            stderr = (log / failed / 'stderr.log').read_text(encoding='utf-8', errors='replace')
            errors = lines_that_matter(self._plain(stderr))
            if any('CalledProcessError' in line for line in errors):
                # colcon asks setup.py in a process whose output it does not give to the package.
                _, start, told = '\n'.join(output).partition('Traceback (most recent')
                told = told.partition('Traceback (most recent')[0]
                errors = lines_that_matter(self._plain(f'{start}{told}')) or errors
        elif not packages and asked:
            known = sorted(folder.parent.name for folder in self.path.glob('src/**/package.xml'))
            own = [line for line in own if 'ignoring unknown package' not in line]
            there = f'only {", ".join(known)}' if known else 'it is empty'
            errors = [f'Nothing was built: src/ has no package {" or ".join(asked)}, {there}.']
        elif not packages and not own:
            errors = ['Nothing was built: src/ has no package.']
        missing = [name for name in asked if name not in packages]
        return BuildResult(
            ok=bool(packages) and not missing and set(packages.values()) == {'finished'},
            seconds=seconds,
            failed=failed,
            packages=packages,
            errors=errors,
            warnings=own,
            log=log_file,
            command=command,
            log_name=log_file.relative_to(self.path).as_posix(),
        )

    def _plain(self, text: str) -> str:
        """Write this machine's folders as they are the same everywhere: '...' for a prefix."""
        folders = {
            f'{self.path}/': '',
            str(self.path): '.',
            sysconfig.get_path('purelib') + '/': '',
            sysconfig.get_path('stdlib') + '/': STANDARD_LIBRARY,
            sys.prefix: '...',
            sys.base_prefix: '...',
        }
        for folder, name in folders.items():
            # CMake may break a line in the middle of a folder's name where that has a space.
            pattern = r'\s+'.join(re.escape(part) for part in folder.split(' '))
            text = re.sub(pattern, lambda _, name=name: name, text)
        return text

    # --- Use ---

    def environment(self) -> dict[str, str]:
        """Return the environment of a terminal that has sourced `install/setup.bash`.

        Raises RuntimeError where nothing has been built.
        """
        setup = self.path / 'install' / 'setup.bash'
        if not setup.is_file():
            raise RuntimeError('Nothing has been built: call build() first, and read its result.')
        if self._sourced is None:
            environment = _environment()
            if ' ' in sys.executable:  # colcon's setup.bash does not quote it
                environment['COLCON_PYTHON_EXECUTABLE'] = getattr(
                    sys, '_base_executable', sys.executable
                )
            with uninterrupted():
                answer = subprocess.run(
                    ['bash', '--norc', '-c', 'source "$0" > /dev/null 2>&1; env -0', str(setup)],
                    env=environment,
                    cwd=self.path,
                    capture_output=True,
                    timeout=STOP_TIMEOUT_S * 4,
                    check=True,
                )
            pairs = os.fsdecode(answer.stdout).split('\0')
            self._sourced = dict(pair.split('=', 1) for pair in pairs if '=' in pair)
        return dict(self._sourced)

    def use(self) -> None:
        """Make what was built importable in this kernel, as `source install/setup.bash` would.

        A package of pure Python that was built again replaces the old one at the next import.
        Raises RuntimeError where a package with libraries (every interface package) was built again
        and has changed: a process cannot give a loaded library back. Then restart the kernel.
        """
        sourced = self.environment()
        libraries = _libraries(self.path / 'install')
        for package, files in libraries.items():
            hashes = {file.name: _hash(file) for file in files}
            if _loaded.get(package, hashes) != hashes:
                raise RuntimeError(
                    f'{package} has changed, and this kernel has loaded the old one: restart the '
                    'kernel, then run the notebook from its top.'
                )
            if package not in _loaded:
                _load(files)
                _loaded[package] = hashes
        # rcl looks for the type support's libraries in this variable at run time.
        for name in ('AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH'):
            if name in sourced:
                os.environ[name] = sourced[name]
        here = str(self.path / 'install')
        sys.path[:] = [x for x in sys.path if not x.startswith(f'{here}{os.sep}')]
        folders = sourced.get('PYTHONPATH', '').split(os.pathsep)
        sys.path[:0] = [x for x in folders if x.startswith(here)]
        importlib.invalidate_caches()
        for name, module in list(sys.modules.items()):
            file = getattr(module, '__file__', None) or ''
            if file.startswith(here) and name.partition('.')[0] not in libraries:
                del sys.modules[name]

    # --- Run ---

    def run(self, package: str, executable: str, *arguments: str, sourced: bool = True) -> Process:
        """Start an executable as `ros2 run` does, and return the running process.

        It has the sourced environment, and the open session's domain id and discovery range (this
        kernel's, where no session is open). What it prints is collected.
        It ends with its `with` block, with `stop()`, when the same is run again, when a cell is
        interrupted, and with the kernel. `sourced=False` leaves `install/setup.bash` out.

        Where the package or the executable is not there, the process has printed what `ros2 run`
        prints, and has ended with 1.
        """
        environment = self.environment() if sourced else _environment()
        environment |= graph_environment() | {
            'ROS_LOG_DIR': str(self.path / 'log' / 'ros'),  # not the home: it may be read-only
            'PYTHONUNBUFFERED': '1',
            # Without the time stamp.
            'RCUTILS_CONSOLE_OUTPUT_FORMAT': '[{severity}] [{name}]: {message}',
        }
        key = (package, executable, *arguments)
        if key in self._processes:
            self._processes.pop(key).stop()
        command, told = _find_executable(package, executable, environment)
        command = [*command, *arguments] if command else []
        with uninterrupted():
            process = Process(executable, command, environment, self.path)
            self._processes[key] = process
        process._lines += told
        return process

    def close(self) -> None:
        """End every process of this workspace. Its files stay until it is made again."""
        for process in self._processes.values():
            if process.running:
                process.stop()
        self._processes.clear()


def _find_executable(
    package: str, executable: str, environment: dict[str, str]
) -> tuple[list[str], list[str]]:
    """Return the command of an executable, or no command and what `ros2 run` says then."""
    for prefix in environment.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        marker = Path(prefix) / 'share/ament_index/resource_index/packages' / package
        if not prefix or not marker.is_file():
            continue
        file = Path(prefix) / 'lib' / package / executable
        if not file.is_file() or not os.access(file, os.X_OK):
            return [], ['No executable found']
        with file.open('rb') as opened:
            first_line = opened.readline()
        # The first line of a script cannot name an interpreter whose path has a space.
        named = first_line.startswith(b'#!') and os.fsencode(sys.executable) in first_line
        if named and ' ' in sys.executable:
            return [sys.executable, str(file)], []
        return [str(file)], []
    return [], [f"Package '{package}' not found"]


def _libraries(install: Path) -> dict[str, list[Path]]:
    """Return the shared libraries of each package, those of `lib` before Python's extensions."""
    found = {}
    for package in sorted(install.iterdir()):
        files = sorted(package.glob('lib/*.so*')) + sorted(package.glob('**/site-packages/**/*.so'))
        if files:
            found[package.name] = files
    return found


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


def _hash(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _claim(name: str) -> Path:
    """Return a folder for a workspace that no other process uses while this one lives."""
    scratch = _scratch()
    for number in range(1, 100):
        path = scratch / (name if number == 1 else f'{name}_{number}')
        if path in _locks:
            return path
        lock = os.open(scratch / f'.{path.name}.lock', os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            continue
        _locks[path] = lock  # held until this process ends
        return path
    raise RuntimeError(f'99 kernels have a workspace {name!r}: shut down those you do not need.')


def _scratch() -> Path:
    """Return the folder of all workspaces: in the checkout where that can be written."""
    elsewhere = f'ros2_notebooks_{os.getuid()}'
    for folder in (
        ROOT / 'scratch',
        Path(tempfile.gettempdir()) / elsewhere,
        Path('/tmp') / elsewhere,
    ):
        # rosidl's CMake functions break at an accent, and packages of others at a space.
        if not re.fullmatch(r'[A-Za-z0-9_./-]+', str(folder)):
            continue
        try:
            folder.mkdir(mode=0o755 if folder.parent == ROOT else 0o700, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            if folder.stat().st_uid == os.getuid():
                return folder
        except OSError:  # read-only, or another user's
            continue
    raise RuntimeError(
        'There is no folder for a workspace: neither this checkout nor /tmp can be written. Set '
        'TMPDIR to a folder of yours whose name has no spaces and accents, and restart the kernel.'
    )


def _empty(folder: Path) -> None:
    if folder.exists():
        with uninterrupted():  # rmtree makes an OSError of an Interrupt
            shutil.rmtree(folder)


# --- In a notebook -------------------------------------------------------------------------------


def write(line: str, cell: str) -> None:
    """`%%write PATH`: write the rest of the cell to a file of the open workspace."""
    from IPython.core.error import UsageError

    if _open_workspace is None:
        raise UsageError("Open a workspace first: workspace = Workspace('my_lesson').")
    path = line.strip().strip('\'"')
    try:
        _open_workspace.write(path, cell)
    except (ValueError, OSError) as error:
        raise UsageError(str(error)) from error
    print(f'Wrote {path}')


def _after_cell(result) -> None:
    """End the processes when a cell was interrupted."""
    if isinstance(result.error_in_exec, KeyboardInterrupt) and _open_workspace is not None:
        _open_workspace.close()


def _register_in_ipython() -> None:
    try:
        from IPython import get_ipython
    except ImportError:
        return
    shell = get_ipython()
    if shell is None or 'write' in shell.magics_manager.magics['cell']:
        return
    shell.register_magic_function(write, 'cell')
    shell.events.register('post_run_cell', _after_cell)


@atexit.register
def _close_at_exit() -> None:
    if _open_workspace is not None:
        _open_workspace.close()
