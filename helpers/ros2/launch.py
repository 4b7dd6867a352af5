"""Run a launch file."""

from __future__ import annotations

import argparse
import contextlib
import datetime
import heapq
import itertools
import os
import selectors
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import IO, Any

from helpers.ros2 import _index
from helpers.ros2 import _launch_file as files
from helpers.ros2 import _substitutions as subs
from helpers.ros2._commands import Parser
from helpers.ros2._errors import CommandError
from helpers.ros2._graph import join_domain

SIGNALS = {signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP, signal.SIGCHLD}
GRACE_S = 5.0  # between the signals for what is left of a launcher that was killed
READ_BYTES = 65536


def add_arguments(parser: Parser) -> None:
    """Add the arguments of `ros2 launch`, as far as files in XML and YAML need them."""
    terminal = sys.stdin.isatty()
    parser.flag('-n --noninteractive', 'There is no terminal that interrupts', default=not terminal)
    parser.flag('-s --show-args --show-arguments', 'Show the arguments of the launch file')
    parser.flag('-a --show-all-subprocesses-output', 'Show all output, whatever the file says')
    parser.option('--launch-prefix', 'Command before every executable')
    package = 'Name of the package, or path of the launch file'
    parser.option('package_name', package, _index.complete_packages)
    parser.option('launch_file_name', 'Name of the launch file', _complete_files, nargs='?')
    words = {'nargs': '*', 'default': [], 'metavar': 'name:=value'}
    parser.option('launch_arguments', 'Its arguments', **words)
    parser.set_defaults(run=_run)


def _complete_files(parsed_args: argparse.Namespace, **kwargs: Any) -> list[str]:
    package = parsed_args.package_name
    share = _index.prefix_of(package) / 'share' / package
    return [file.name for file in share.rglob('*launch*') if file.suffix in ('.xml', '.yaml')]


def _run(args: argparse.Namespace) -> int:
    words = list(args.launch_arguments)
    if os.path.isfile(args.package_name):
        path = Path(args.package_name)
        words[:0] = [args.launch_file_name] * (args.launch_file_name is not None)
    else:
        path = _find(args.package_name, args.launch_file_name)
    if args.launch_prefix:
        words.append(f'launch-prefix:={args.launch_prefix}')
    variables = dict(map(_pair, words))
    root = files.read(path)
    if args.show_args:
        _show_arguments(root)
        return 0
    if args.show_all_subprocesses_output:
        os.environ['OVERRIDE_LAUNCH_PROCESS_OUTPUT'] = 'both'
    join_domain()  # the nodes are where this command would look for them
    scope = files.Scope(root.file, variables, dict(os.environ), [])
    try:
        # All of it is worked out before anything starts: a mistake leaves nothing half done.
        plan = list(files.work_out(root.children, scope))
        return _Launcher(args.noninteractive, scope.written).run(plan)
    finally:
        for file in scope.written:
            Path(file).unlink(missing_ok=True)


def _pair(word: str) -> tuple[str, str]:
    name, separator, value = word.partition(':=')
    if not (name and separator and value):
        raise CommandError(f"malformed launch argument '{word}', expected format '<name>:=<value>'")
    return name, value


def _find(package: str, name: str | None) -> Path:
    """The file of this name, in whatever folder of the package's share folder it is."""
    try:
        share = subs.prefix_of(package) / 'share' / package
    except ValueError as error:
        raise CommandError(f'Package \'{package}\' not found: "{error}"') from None
    found = [file for file in share.rglob('*') if file.name == name and file.is_file()]
    if len(found) != 1:
        what = 'was found more than once' if found else 'was not found'
        more = f': {[str(file) for file in found]}' if found else f" which is at '{share}'"
        raise CommandError(
            f"file '{name}' {what} in the share directory of package '{package}'{more}"
        )
    return found[0]


def _show_arguments(root: files.Element) -> None:
    declared: dict[str, tuple[files.Element, bool]] = {}

    def collect(elements: list[files.Element], conditional: bool) -> None:
        for element in elements:
            doubt = conditional or bool({'if', 'unless'} & element.attributes.keys())
            if element.tag == 'arg':
                declared.setdefault(element.attributes['name'], (element, doubt))
            elif element.tag == 'include':
                # As the real command: what needs an argument to be found is not looked into.
                with contextlib.suppress(CommandError, ValueError, RecursionError):
                    scope = files.Scope(element.file, {}, dict(os.environ), [])
                    path = Path(scope.text(element.attributes['file']))
                    collect(files.read(path).children, doubt)
            else:
                collect(element.children, doubt or element.tag == 'timer')

    collect(root.children, False)
    print("Arguments (pass arguments as '<name>:=<value>'):")
    for name, (element, doubt) in declared.items():
        given = element.attributes
        choices = [child.attributes['value'] for child in element.children]
        described = given.get('description', f'One of: {choices}' * bool(choices))
        if choices and 'description' in given:
            described += '.' * (not described.endswith('.')) + f' Valid choices are: {choices}'
        print(f"\n    '{name}':{'*' * doubt}\n        {described or 'no description given'}")
        if 'default' in given:
            print(f'        (default: {subs.describe(subs.parse(given["default"]))})')
    if not declared:
        print('\n  No arguments.')
    elif any(doubt for _, doubt in declared.values()):
        print('\n* argument(s) which are only used if specific conditions occur')


class _Launcher:
    """Runs processes, prints what they print, and ends them: with one loop, without threads."""

    def __init__(self, noninteractive: bool, written: list[str]):
        self.noninteractive = noninteractive
        self.written = written  # files of parameters, which the guard has to know
        self.told = 0
        self.selector = selectors.DefaultSelector()
        self.running: dict[int, _Process] = {}  # by process id
        self.waiting: list[tuple[float, int, Callable[[], None]]] = []  # when, and then what
        self.count = itertools.count(1)
        self.ending = False
        self.status = 0
        self.log_file = _open_log()

    def run(self, plan: list) -> int:
        """Start what the plan says, and return the exit status when all has ended."""
        self.guard = _guard()
        receive, send = socket.socketpair()
        send.setblocking(False)
        ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # by nohup, which then counts
        numbers = SIGNALS - {signal.SIGHUP} if ignored else SIGNALS
        handlers = {number: signal.signal(number, lambda *_: None) for number in numbers}
        wakeup = signal.set_wakeup_fd(send.fileno(), warn_on_full_buffer=False)
        self.selector.register(receive, selectors.EVENT_READ, lambda: self.on_signals(receive))
        try:
            if self.log_file:
                folder = os.path.dirname(self.log_file.name)
                self.log('INFO', 'launch', f'All log files can be found below {folder}')
            self.log('INFO', 'launch', 'Default logging verbosity is set to INFO')
            self.start(plan)
            while self.running or (self.waiting and not self.ending):
                pause = max(0.0, self.waiting[0][0] - time.monotonic()) if self.waiting else None
                for key, _ in self.selector.select(pause):
                    key.data()
                while self.waiting and self.waiting[0][0] <= time.monotonic():
                    heapq.heappop(self.waiting)[2]()
        finally:
            signal.set_wakeup_fd(wakeup)
            for number, handler in handlers.items():
                signal.signal(number, handler)
            os.close(self.guard)
        return self.status

    def start(self, plan: Iterable) -> None:
        """Start what a plan says."""
        if self.ending:
            return
        try:
            plan = list(plan)
        except CommandError as error:  # of a timer
            self.log('ERROR', 'launch', str(error))
            self.status = 1
            self.shut_down()
            return
        for path in self.written[self.told :]:
            self.tell_guard(path)
        self.told = len(self.written)
        for entry in plan:
            if isinstance(entry, str):
                self.log('INFO', 'launch.user', entry)
        for entry in plan:
            if isinstance(entry, files.Timer):
                self.later(entry.period, lambda entry=entry: self.start(entry.then()))
            elif isinstance(entry, files.Process):
                _Process(self, entry, f'{entry.name}-{next(self.count)}').start()

    def later(self, seconds: float, then: Callable[[], None]) -> None:
        """Have a function called after this time."""
        heapq.heappush(self.waiting, (time.monotonic() + seconds, id(then), then))

    def tell_guard(self, line: str | int) -> None:
        """Say what has begun or ended, see `_guard`."""
        with contextlib.suppress(BrokenPipeError):
            os.write(self.guard, f'{line}\n'.encode())

    def log(self, level: str, name: str, message: str) -> None:
        """Print and log a message of the launcher."""
        self.write(f'[{level}] [{name}]: {message}', True, True)

    def write(self, line: str, screen: bool, log: bool) -> None:
        """Write a line on the screen, into the log file, or both."""
        try:
            if screen:
                print(line, flush=True)
        except OSError:  # nobody reads on
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            self.shut_down()
        with contextlib.suppress(OSError):
            if log and self.log_file:
                print(f'{time.time():.7f} {line}', file=self.log_file, flush=True)

    def on_signals(self, receive: socket.socket) -> None:
        """Act on the signals that came."""
        for number in receive.recv(READ_BYTES):
            if number == signal.SIGCHLD:
                for process in list(self.running.values()):
                    if process.popen.poll() is not None:
                        process.on_exit()
            elif number == signal.SIGINT:
                again = ' again, ignoring...' if self.ending else ''
                self.log('WARNING', 'launch', f'user interrupted with ctrl-c (SIGINT){again}')
                self.shut_down(self.noninteractive)
            else:
                name = signal.Signals(number).name
                self.log('ERROR', 'launch', f'user interrupted with {name}, terminating...')
                self.status = 1
                self.shut_down()

    def shut_down(self, tell: bool = True) -> None:
        """Begin to end all processes. `tell`: a line says that they get SIGINT."""
        if not self.ending:
            self.ending = True
            for process in list(self.running.values()):
                process.shut_down(tell)


class _Process:
    """An entry of a launch file, and the process that is its present run."""

    def __init__(self, launcher: _Launcher, entry: files.Process, name: str):
        self.launcher, self.entry, self.name = launcher, entry, name
        self.starts = 0
        self.rest: dict[IO[bytes], bytes] = {}  # what was read of a line so far, by pipe

    def start(self) -> None:
        """Start a run."""
        entry = self.entry
        if self.launcher.ending:
            return
        self.starts += 1
        try:
            # A group of its own, so that a signal reaches also what the process starts.
            self.popen = subprocess.Popen(
                ' '.join(entry.command) if entry.shell else entry.command,
                shell=entry.shell, cwd=entry.cwd, env=entry.environment, process_group=0,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            )  # fmt: skip
        except OSError as error:
            self.log('ERROR', f'exception occurred while executing process: {error}')
            return
        self.launcher.tell_guard(self.popen.pid)
        self.launcher.running[self.popen.pid] = self
        self.log('INFO', f'process started with pid [{self.popen.pid}]')
        for pipe in (self.popen.stdout, self.popen.stderr):
            os.set_blocking(pipe.fileno(), False)
            self.rest[pipe] = b''
            read = partial(self.on_output, pipe)
            self.launcher.selector.register(pipe, selectors.EVENT_READ, read)

    def log(self, level: str, message: str) -> None:
        """Print and log a message about the process."""
        self.launcher.log(level, self.name, message)

    def on_output(self, pipe: IO[bytes]) -> bool:
        """Print the whole lines of what was written. Return whether there may be more now."""
        if pipe.closed:
            return False
        try:
            data = os.read(pipe.fileno(), READ_BYTES)
        except BlockingIOError:
            return False
        if not data:
            self.launcher.selector.unregister(pipe)
            pipe.close()
        *lines, self.rest[pipe] = (self.rest[pipe] + data).split(b'\n')
        if pipe.closed and self.rest[pipe]:
            lines.append(self.rest[pipe])
        output = self.entry.output
        screen = output != 'log' or pipe is self.popen.stderr
        for line in lines:
            text = f'[{self.name}] {line.decode(errors="replace")}'
            self.launcher.write(text, screen, output != 'screen')
        return not pipe.closed

    def on_exit(self) -> None:
        """Say how the run has ended, and start the next one if there is to be one."""
        launcher, entry, run = self.launcher, self.entry, self.popen
        del launcher.running[run.pid]
        for pipe in (run.stdout, run.stderr):
            while self.on_output(pipe):  # what it wrote before its end is all there
                pass
            if not pipe.closed:  # something that it started has the pipe open
                launcher.selector.unregister(pipe)
                pipe.close()
        run.stdin.close()
        if run.returncode == 0:
            self.log('INFO', f'process has finished cleanly [pid {run.pid}]')
        else:
            command = ' '.join(filter(str.strip, entry.command))
            self.log(
                'ERROR',
                f"process has died [pid {run.pid}, exit code {run.returncode}, cmd '{command}'].",
            )
        if not _send(run.pid, 0):
            launcher.tell_guard(run.pid)
        if entry.required and not launcher.ending:
            required = f'process[{self.name}] was required: shutting down launched system'
            launcher.log('INFO', 'launch', required)
            launcher.shut_down()
        if entry.respawn and not 0 <= entry.respawn_max_retries < self.starts:
            launcher.later(entry.respawn_delay, self.start)

    def shut_down(self, tell: bool) -> None:
        """Send SIGINT now, and what is stronger later."""
        self.signal('SIGINT', self.popen, tell)
        first = self.entry.sigterm_timeout
        both = float(first) + float(self.entry.sigkill_timeout)
        for seconds, before, name in ((first, 'SIGINT', 'SIGTERM'), (both, 'SIGTERM', 'SIGKILL')):
            self.launcher.later(
                float(seconds), partial(self.escalate, self.popen, seconds, before, name)
            )

    def escalate(self, run: subprocess.Popen, seconds: str | float, before: str, name: str) -> None:
        """Send a stronger signal, if the process has not ended."""
        if run.returncode is None:
            self.log(
                'ERROR',
                f"process[{self.name}] failed to terminate '{seconds}' seconds after receiving "
                f"'{before}', escalating to '{name}'",
            )
            self.signal(name, run, True)

    def signal(self, name: str, run: subprocess.Popen, tell: bool) -> None:
        """Send a signal to the process and to what it has started."""
        if tell:
            self.log('INFO', f"sending signal '{name}' to process[{self.name}]")
        with contextlib.suppress(ProcessLookupError):
            os.killpg(run.pid, signal.Signals[name])


def _open_log() -> IO[str] | None:
    """Open the log file in a folder of its own, or return None if it cannot be written."""
    home = os.environ.get('ROS_HOME') or os.path.join('~', '.ros')
    base = Path(os.environ.get('ROS_LOG_DIR') or os.path.join(home, 'log')).expanduser()
    now = datetime.datetime.now().strftime('%Y-%m-%d-%H-%M-%S-%f')
    folder = base.absolute() / f'{now}-{socket.gethostname()}-{os.getpid()}'
    try:
        folder.mkdir(parents=True)
        file = (folder / 'launch.log').open('a', encoding='utf-8')
        latest = base / 'latest'
        if latest.is_symlink() or not latest.exists():
            latest.unlink(missing_ok=True)
            latest.symlink_to(folder, target_is_directory=True)
    except OSError:
        return None
    return file


def _guard() -> int:
    """Fork a process that ends what the launcher leaves behind, also if the launcher is killed.

    Returns a file descriptor. What is written there in lines: the id of a process group when it
    begins and when it has ended, the path of a file to remove. Closed, it is the launcher's end.
    """
    read, write = os.pipe()
    if os.fork():
        os.close(read)
        return write
    try:
        os.setsid()  # no Ctrl+C, and no signal for the launcher's group, comes here
        os.close(write)
        for descriptor in range(3):
            os.dup2(os.open(os.devnull, os.O_RDWR), descriptor)
        begun: set[str] = set()
        for line in os.fdopen(read, encoding='utf-8'):
            begun ^= {line.rstrip()}
        for path in (path for path in begun if not path.isdigit()):
            Path(path).unlink(missing_ok=True)
        groups = [int(group) for group in begun if group.isdigit()]
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            groups = [group for group in groups if _send(group, number)]
            deadline = time.monotonic() + GRACE_S
            while groups and time.monotonic() < deadline:
                time.sleep(0.05)
                groups = [group for group in groups if _send(group, 0)]
    finally:
        os._exit(0)


def _send(group: int, number: int) -> bool:
    """Send a signal to a process group, and return whether there is one."""
    try:
        os.killpg(group, number)
    except (ProcessLookupError, PermissionError):
        return False
    return True
