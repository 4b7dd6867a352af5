"""Run a launch file."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import datetime
import itertools
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

from helpers.ros2 import _index
from helpers.ros2 import _launch_file as files
from helpers.ros2._commands import CommandError, command, flag, option
from helpers.ros2._graph import join_domain

SIGNALS = {signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP}
READ_BYTES = 65536
POLL_S = 0.02  # between two looks whether a process group has ended


@command(
    flag('-s --show-args --show-arguments', 'Show the arguments of the launch file'),
    flag('-a --show-all-subprocesses-output', 'Show all output, whatever the file says'),
    option('package_name', 'Package, or path of the launch file', _index.complete_packages),
    option('launch_file_name', 'Name of the launch file', nargs='?'),
    option('launch_arguments', 'Its arguments', nargs='*', metavar='name:=value'),
)
def _launch(args: argparse.Namespace) -> int:
    """Run a launch file."""
    words = list(args.launch_arguments)
    if os.path.isfile(args.package_name):
        path = Path(args.package_name)
        words[:0] = [args.launch_file_name] * (args.launch_file_name is not None)
    else:
        path = _find(args.package_name, args.launch_file_name)
    variables = dict(map(_pair, words))
    root = files.read(path)
    if args.show_args:
        _show_arguments(root)
        return 0
    join_domain()  # the nodes are where this command would look for them
    scope = files.Scope(root.file, variables, dict(os.environ), [])
    try:
        # All of it is worked out before anything starts: a mistake leaves nothing half done.
        plan = list(files.work_out(root.children, scope))
        for process in plan if args.show_all_subprocesses_output else ():
            process.output = 'both'
        return _in_child(lambda end: asyncio.run(_Launcher().run(plan, end)))
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
        share = files.share_of(package)
    except ValueError as error:
        raise CommandError(f'Package \'{package}\' not found: "{error}"') from None
    for file in sorted(share.rglob('*')):
        if file.name == name and file.is_file():
            return file
    raise CommandError(
        f"file '{name}' was not found in the share directory of package '{package}' which is at "
        f"'{share}'"
    )


def _show_arguments(root: files.Element) -> None:
    declared: dict[str, files.Element] = {}
    for element in _arguments(root):
        declared.setdefault(element.attributes['name'], element)
    print("Arguments (pass arguments as '<name>:=<value>'):")
    for name, element in declared.items():
        described = element.attributes.get('description', 'no description given')
        print(f"\n    '{name}':\n        {described}")
        if 'default' in element.attributes:
            print(f"        (default: '{element.attributes['default']}')")
    if not declared:
        print('\n  No arguments.')


def _arguments(parent: files.Element) -> Iterator[files.Element]:
    """Yield each `arg` below an element, and in the files that it includes."""
    for element in parent.children:
        if element.tag == 'arg':
            yield element
        elif element.tag == 'include':
            # As the real command: what needs an argument to be found is not looked into.
            with contextlib.suppress(CommandError, ValueError, RecursionError):
                scope = files.Scope(element.file, {}, dict(os.environ), [])
                yield from _arguments(files.read(Path(scope.text(element.attributes['file']))))
        else:
            yield from _arguments(element)


def _in_child(work: Callable[[int], int]) -> int:
    """Work in a child process, in a session of its own, and return its status.

    The signals that come here go to the child. If this process is killed, the child sees the end of
    the pipe that `work` gets, and can still end what it has started.
    """
    read, write = os.pipe()
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # until there is something to do with them
    child = os.fork()
    if not child:
        os.close(write)
        os.setsid()
        return work(read)

    def forward(number: int, frame: Any) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, number)

    os.close(read)
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # by nohup, which then counts
            signal.signal(number, forward)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


class _Launcher:
    """Runs processes, prints what they print, and ends them."""

    def __init__(self) -> None:
        self.ending = asyncio.Event()
        self.ends: list[asyncio.Task] = []  # that are to be waited for
        self.tells = True  # that processes get SIGINT
        self.status = 0
        self.log_file = _open_log()

    async def run(self, plan: list[files.Process], end: int) -> int:
        """Start what the plan says, and return the exit status when all has ended.

        It ends everything when the pipe `end` is closed.
        """
        loop = asyncio.get_running_loop()
        for number in SIGNALS:
            loop.add_signal_handler(number, self.on_signal, number)
        loop.add_reader(end, lambda: self.ending.set() or loop.remove_reader(end))
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        if self.log_file:
            folder = os.path.dirname(self.log_file.name)
            self.log('INFO', 'launch', f'All log files can be found below {folder}')
        self.log('INFO', 'launch', 'Default logging verbosity is set to INFO')
        processes = [
            _Process(self, entry, f'{entry.name}-{number}') for number, entry in enumerate(plan, 1)
        ]
        await asyncio.gather(*(process.run() for process in processes))
        self.ending.set()
        await asyncio.gather(*self.ends)
        return self.status

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
            self.ending.set()
        with contextlib.suppress(OSError):
            if log and self.log_file:
                print(f'{time.time():.7f} {line}', file=self.log_file, flush=True)

    def on_signal(self, number: signal.Signals) -> None:
        """Act on a signal for the launcher."""
        if number == signal.SIGINT:
            again = ' again, ignoring...' if self.ending.is_set() else ''
            self.log('WARNING', 'launch', f'user interrupted with ctrl-c (SIGINT){again}')
            self.tells = not sys.stdin.isatty()
        else:
            name = signal.Signals(number).name
            self.log('ERROR', 'launch', f'user interrupted with {name}, terminating...')
            self.status = 1
        self.ending.set()


class _Process:
    """An entry of a launch file, and its runs."""

    def __init__(self, launcher: _Launcher, entry: files.Process, name: str) -> None:
        self.launcher, self.entry, self.name = launcher, entry, name
        self.rest: dict[IO[bytes], bytes] = {}  # what was read of a line so far, by pipe

    def log(self, level: str, message: str) -> None:
        """Print and log a message about the process."""
        self.launcher.log(level, self.name, message)

    async def run(self) -> None:
        """Run it, and again if it respawns, until all is to end."""
        entry, ending = self.entry, self.launcher.ending
        for runs in itertools.count(1):
            await self.run_once()
            if not entry.respawn or 0 <= entry.respawn_max_retries < runs:
                return
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(ending.wait(), entry.respawn_delay)
            if ending.is_set():
                return

    async def run_once(self) -> None:
        """Start a process, and wait for its end."""
        entry, launcher, loop = self.entry, self.launcher, asyncio.get_running_loop()
        try:
            # A group of its own, so that a signal reaches also what the process starts.
            run = subprocess.Popen(
                entry.command, env=entry.environment, process_group=0,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            )  # fmt: skip
        except OSError as error:
            self.log('ERROR', f'exception occurred while executing process: {error}')
            return
        ending = asyncio.create_task(self.end(run))
        self.log('INFO', f'process started with pid [{run.pid}]')
        for pipe in (run.stdout, run.stderr):
            os.set_blocking(pipe.fileno(), False)
            self.rest[pipe] = b''
            loop.add_reader(pipe, self.read, pipe, entry.output != 'log' or pipe is run.stderr)
        exited, end = asyncio.Event(), os.pidfd_open(run.pid)
        loop.add_reader(end, exited.set)
        await exited.wait()
        loop.remove_reader(end)
        os.close(end)
        status = run.wait()
        for pipe in (run.stdout, run.stderr):
            while self.read(pipe, entry.output != 'log' or pipe is run.stderr):
                pass  # what it wrote before its end is all there
            loop.remove_reader(pipe)
            pipe.close()  # something that it has started may have it open
        run.stdin.close()
        try:
            os.killpg(run.pid, 0)
            launcher.ends.append(ending)  # of what it has started and left
        except ProcessLookupError:
            ending.cancel()
        if status == 0:
            self.log('INFO', f'process has finished cleanly [pid {run.pid}]')
        else:
            words = ' '.join(filter(str.strip, entry.command))
            said = f"process has died [pid {run.pid}, exit code {status}, cmd '{words}']."
            self.log('ERROR', said)
        if entry.required and not launcher.ending.is_set():
            required = f'process[{self.name}] was required: shutting down launched system'
            launcher.log('INFO', 'launch', required)
            launcher.ending.set()

    def read(self, pipe: IO[bytes], screen: bool) -> bool:
        """Print the whole lines of what was written. Return whether there may be more now."""
        try:
            data = os.read(pipe.fileno(), READ_BYTES)
        except BlockingIOError:
            return False
        *lines, self.rest[pipe] = (self.rest[pipe] + data).split(b'\n')
        if not data:
            asyncio.get_running_loop().remove_reader(pipe)
            lines = [self.rest[pipe]] if self.rest[pipe] else []
            self.rest[pipe] = b''
        for line in lines:
            text = f'[{self.name}] {line.decode(errors="replace")}'
            self.launcher.write(text, screen, self.entry.output != 'screen')
        return bool(data)

    async def end(self, run: subprocess.Popen) -> None:
        """When all is to end: send SIGINT, and what is stronger while something of it is left."""
        await self.launcher.ending.wait()
        first, second = self.entry.sigterm_timeout, self.entry.sigkill_timeout
        both, before = float(first) + float(second), None
        for name, waited, limit in (
            ('SIGINT', '0', float(first)),
            ('SIGTERM', first, float(second)),
            ('SIGKILL', both, float(second)),
        ):
            if before and run.returncode is None:
                self.log(
                    'ERROR',
                    f"process[{self.name}] failed to terminate '{waited}' seconds after receiving "
                    f"'{before}', escalating to '{name}'",
                )
            if run.returncode is None and (before or self.launcher.tells):
                self.log('INFO', f"sending signal '{name}' to process[{self.name}]")
            before, deadline = name, time.monotonic() + limit
            try:
                os.killpg(run.pid, signal.Signals[name])
                while time.monotonic() < deadline:
                    await asyncio.sleep(POLL_S)
                    os.killpg(run.pid, 0)
            except ProcessLookupError:  # nothing of its group is left
                return


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
