"""Runs the processes of a launch file, prints what they print, and ends them."""

from __future__ import annotations

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
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from ros2_command.launch.plan import Process

SIGNALS = {signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP}
READ_BYTES = 65536
POLL_S = 0.02  # between two looks whether a process group has ended


def launch(plan: list[Process]) -> int:
    """Run processes until all have ended, and return the exit status."""
    return _in_child(lambda end: asyncio.run(_Launcher().run(plan, end)))


def _in_child(work: Callable[[int], int]) -> int:
    """Work in a child process, in a session of its own, and return its status.

    The signals that come here go to the child. If this process is killed, the child sees the end of
    the pipe that `work` gets, and can still end what it has started.
    """
    read, write = os.pipe()
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # until there is something to do with them
    child = os.fork()
    if child == 0:
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
    """Runs all processes, and decides when all is to end."""

    def __init__(self) -> None:
        self.ending = asyncio.Event()
        self.ends: list[asyncio.Task] = []  # that are to be waited for
        self.tells = True  # that processes get SIGINT
        self.status = 0
        self.log_file = _open_log()

    async def run(self, plan: list[Process], end: int) -> int:
        """Start what the plan says, and return the exit status when all has ended.

        It ends everything when the pipe `end` is closed.
        """
        loop = asyncio.get_running_loop()
        for number in SIGNALS:
            loop.add_signal_handler(number, self.on_signal, number)

        def on_end() -> None:
            self.ending.set()
            loop.remove_reader(end)

        loop.add_reader(end, on_end)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        if self.log_file:
            folder = os.path.dirname(self.log_file.name)
            self.log('INFO', 'launch', f'All log files can be found below {folder}')
        self.log('INFO', 'launch', 'Default logging verbosity is set to INFO')
        runners = [
            _Runner(self, process, f'{process.name}-{number}')
            for number, process in enumerate(plan, 1)
        ]
        await asyncio.gather(*(runner.run() for runner in runners))
        self.ending.set()
        await asyncio.gather(*self.ends)
        return self.status

    def log(self, level: str, name: str, message: str) -> None:
        """Print and log a message of the launcher."""
        self.write(f'[{level}] [{name}]: {message}', on_screen=True, in_log=True)

    def write(self, line: str, on_screen: bool, in_log: bool) -> None:
        """Write a line on the screen, into the log file, or both."""
        try:
            if on_screen:
                print(line, flush=True)
        except OSError:  # nobody reads on
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            self.ending.set()
        if in_log and self.log_file:
            with contextlib.suppress(OSError):
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


class _Runner:
    """Runs one process of a launch file, once or again and again."""

    def __init__(self, launcher: _Launcher, process: Process, name: str) -> None:
        self.launcher, self.process, self.name = launcher, process, name
        self.rest: dict[IO[bytes], bytes] = {}  # what was read of a line so far, by pipe

    def log(self, level: str, message: str) -> None:
        """Print and log a message about the process."""
        self.launcher.log(level, self.name, message)

    async def run(self) -> None:
        """Run it, and again if it respawns, until all is to end."""
        process, ending = self.process, self.launcher.ending
        for runs in itertools.count(1):
            await self.run_once()
            if not process.respawn or 0 <= process.respawn_max_retries < runs:
                return
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(ending.wait(), process.respawn_delay)
            if ending.is_set():
                return

    async def run_once(self) -> None:
        """Start a process, and wait for its end."""
        launcher, loop = self.launcher, asyncio.get_running_loop()
        try:
            started = subprocess.Popen(
                self.process.command,
                env=self.process.environment,
                process_group=0,  # so that a signal reaches also what the process starts
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
        except OSError as error:
            self.log('ERROR', f'exception occurred while executing process: {error}')
            return
        ending = asyncio.create_task(self.end(started))
        self.log('INFO', f'process started with pid [{started.pid}]')
        on_screen = {
            started.stdout: self.process.output != 'log',
            started.stderr: True,
        }
        for pipe in on_screen:
            os.set_blocking(pipe.fileno(), False)
            self.rest[pipe] = b''
            loop.add_reader(pipe, self.read, pipe, on_screen[pipe])
        await _end_of(started.pid)
        status = started.wait()
        for pipe in on_screen:
            while self.read(pipe, on_screen[pipe]):
                pass  # what it wrote before its end is all there
            loop.remove_reader(pipe)
            pipe.close()  # something that it has started may have it open
        started.stdin.close()
        try:
            os.killpg(started.pid, 0)
            launcher.ends.append(ending)  # of what it has started and left
        except ProcessLookupError:
            ending.cancel()
        if status == 0:
            self.log('INFO', f'process has finished cleanly [pid {started.pid}]')
        else:
            words = ' '.join(word for word in self.process.command if word.strip())
            death = f"[pid {started.pid}, exit code {status}, cmd '{words}']"
            self.log('ERROR', f'process has died {death}.')
        if self.process.required and not launcher.ending.is_set():
            required = f'process[{self.name}] was required: shutting down launched system'
            launcher.log('INFO', 'launch', required)
            launcher.ending.set()

    def read(self, pipe: IO[bytes], on_screen: bool) -> bool:
        """Print the whole lines of what was written. Return whether there may be more now."""
        try:
            data = os.read(pipe.fileno(), READ_BYTES)
        except BlockingIOError:
            return False
        *lines, self.rest[pipe] = (self.rest[pipe] + data).split(b'\n')
        if not data:
            asyncio.get_running_loop().remove_reader(pipe)
            if self.rest[pipe]:
                lines.append(self.rest[pipe])
            self.rest[pipe] = b''
        for line in lines:
            text = f'[{self.name}] {line.decode(errors="replace")}'
            self.launcher.write(text, on_screen, in_log=self.process.output != 'screen')
        return bool(data)

    async def end(self, started: subprocess.Popen) -> None:
        """When all is to end: send SIGINT, and what is stronger while something of it is left."""
        await self.launcher.ending.wait()
        until_term, until_kill = self.process.sigterm_timeout, self.process.sigkill_timeout
        if started.returncode is None and self.launcher.tells:
            self.log('INFO', f"sending signal 'SIGINT' to process[{self.name}]")
        if await _is_gone(started.pid, signal.SIGINT, float(until_term)):
            return
        self.escalate(started, until_term, 'SIGINT', 'SIGTERM')
        if await _is_gone(started.pid, signal.SIGTERM, float(until_kill)):
            return
        both = float(until_term) + float(until_kill)
        self.escalate(started, str(both), 'SIGTERM', 'SIGKILL')
        await _is_gone(started.pid, signal.SIGKILL, float(until_kill))

    def escalate(self, started: subprocess.Popen, waited_s: str, before: str, now: str) -> None:
        """Say that a signal was not enough, unless only what the process has started is left."""
        if started.returncode is None:
            self.log(
                'ERROR',
                f"process[{self.name}] failed to terminate '{waited_s}' seconds after receiving "
                f"'{before}', escalating to '{now}'",
            )
            self.log('INFO', f"sending signal '{now}' to process[{self.name}]")


async def _end_of(pid: int) -> None:
    """Wait until a process has ended."""
    loop = asyncio.get_running_loop()
    ended, descriptor = asyncio.Event(), os.pidfd_open(pid)
    loop.add_reader(descriptor, ended.set)
    await ended.wait()
    loop.remove_reader(descriptor)
    os.close(descriptor)


async def _is_gone(group: int, number: signal.Signals, timeout_s: float) -> bool:
    """Send a signal to a process group, and return whether nothing of it is left in time."""
    deadline = time.monotonic() + timeout_s
    try:
        os.killpg(group, number)
        while time.monotonic() < deadline:
            await asyncio.sleep(POLL_S)
            os.killpg(group, 0)
    except ProcessLookupError:
        return True
    return False


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
