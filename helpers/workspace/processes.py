"""A process that prints lines, and ends: with its block, an Interrupt of its cell, the kernel."""

from __future__ import annotations

import atexit
import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import psutil

from helpers.machine import locks_of_workspaces
from helpers.notebook import uninterrupted
from helpers.ros import NOT_OF_A_LESSON, nearly, remove_dead_segments

STOP_TIMEOUT_S = 5.0
GROUP_S = 0.2  # for a group that was killed to be gone
DIED = 'process has died'  # what a launch prints of a program
LAUNCH_ENDS_S = 15.0  # it waits 5 s, and once more, for a program that does not end
POLL_S = 0.02
# The process ends with the kernel, also when the kernel is killed: 1 is Linux's PR_SET_PDEATHSIG.
# In a terminal, so do all that it has started: its window closes, which is a SIGHUP.
WITH_KERNEL = """
import ctypes, os, signal, sys
parent, window = int(sys.argv[1]), sys.argv[2]
try:
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)
except (OSError, AttributeError):
    pass
if window:
    os.open(window, os.O_RDWR)
if os.getppid() == parent:
    os.execv(sys.argv[3], sys.argv[3:])
"""

_started: set[Process] = set()  # and not stopped
_of_this_cell: set[Process] = set()


class Process:
    """A running process and what it has printed. See `Workspace.start`.

    It ends with its `with` block, with `stop()`, when the cell that starts it is interrupted, and
    with the kernel.
    With `ends_with_kernel=False` it goes on when the kernel is killed. With `terminal=True` it has
    a terminal of its own, which closes with the kernel, and takes all programs in it along.
    """

    def __init__(
        self,
        name: str,
        command: list[str],
        environment: dict[str, str],
        folder: Path,
        ends_with_kernel: bool = True,
        terminal: bool = False,
    ) -> None:
        self._window = os.openpty() if terminal else None
        if ends_with_kernel:
            window = os.ttyname(self._window[1]) if self._window else ''
            starter = [sys.executable, '-I', '-S', '-c', WITH_KERNEL, str(os.getpid()), window]
            command = [*starter, *command]
        self.name, self._environment = name, environment
        self._complete: list[str] = []  # the lines that it has printed
        self._begun = 0  # where the line begins that may not be complete
        # Not a pipe, which would need a thread that reads it.
        self._output = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115
        if 'IPython' in sys.modules and (shell := sys.modules['IPython'].get_ipython()):
            shell.events.register('post_run_cell', _after_cell)  # once, however often this is said
        self._owner = os.getpid()
        with uninterrupted():
            self._process = subprocess.Popen(
                command,
                env=environment,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=subprocess.STDOUT,
                # A process that outlives the kernel, such as a build, keeps its workspace
                # locked.
                pass_fds=locks_of_workspaces(),
                # Interrupting the kernel must not reach it: its owner ends it in order.
                start_new_session=True,
            )
            _started.add(self)
            _of_this_cell.add(self)

    @property
    def pid(self) -> int:
        """The id of the process; what it has started has others."""
        return self._process.pid

    @property
    def lines(self) -> list[str]:
        """What it has printed so far, stdout and stderr together, one string a line."""
        running, file = self.running, self._output.fileno()
        # pread, because read() would move the position at which the process writes. What is in
        # complete lines is read once: this is asked fifty times a second.
        size = os.fstat(file).st_size
        *complete, rest = os.pread(file, size - self._begun, self._begun).split(b'\n')
        self._begun = size - len(rest)
        self._complete += [line.decode(errors='replace') for line in complete]
        # The last line may not be complete yet.
        last = [] if running or not rest else [rest.decode(errors='replace')]
        return [*self._complete, *last]

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        if os.getpid() != self._owner:  # in a check, which runs in a copy of the kernel
            return psutil.pid_exists(self._process.pid) and not _is_zombie(self._process.pid)
        return self._process.poll() is None

    def wait_for(self, text: str, timeout_s: float = 20.0) -> str:
        """Wait until a line contains `text`, and return this line.

        Raises TimeoutError if that takes longer, and RuntimeError if the process has ended.
        """
        deadline = time.monotonic() + timeout_s
        while True:
            running = self.running  # before the look: what ends has printed its last line
            for line in self.lines:
                if text in line:
                    return line
            if not running:
                raise RuntimeError(
                    f'{self.name} ended with code {self.wait()} before a line with {text!r}. '
                    f'{self._last()}'
                )
            if time.monotonic() > deadline:
                raise TimeoutError(
                    f'Waited {timeout_s:g} s, but {self.name} did not print {text!r}. '
                    f'{". ".join([self._last(), *_lonely_topics(self._environment)])}'
                )
            time.sleep(POLL_S)

    def wait(self, timeout_s: float = 20.0) -> int:
        """Wait until it ends by itself, and return its exit code, -N if signal N ended it.

        Raises TimeoutError if that takes longer.
        """
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise TimeoutError(
                f'Waited {timeout_s:g} s, but {self.name} did not end. {self._last()}'
            ) from None

    def _last(self) -> str:
        # A traceback underlines a part of a line; its last line says what happened.
        lines = [line.strip() for line in self.lines if re.search(r'[^\s^~]', line)]
        if lines and re.match(r'[\w.]+(Error|Exception)\b', lines[-1]):
            return f'Its last line: {lines[-1]}'
        return f'Its last lines: {" / ".join(lines[-3:]) or "none"}'

    def interrupt(self, limit_s: float = LAUNCH_ENDS_S) -> None:
        """Press Ctrl+C, and wait until it has ended, at most `limit_s` seconds. Nothing is killed.

        So a launch has the time to end its programs. Were it killed meanwhile, they would go on.
        """
        end_s = time.monotonic() + limit_s
        if self.running:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGINT)
        while self.running and time.monotonic() < end_s:
            time.sleep(POLL_S)

    def stop(self) -> None:
        """End it as Ctrl+C does. One that does not end within a few seconds is killed."""
        with uninterrupted():
            if self.running:
                self._stop()
            remove_dead_segments()  # if it was killed, or one that it has started
            for end in self._window or ():
                os.close(end)
            self._window = None
            _started.discard(self)

    def _stop(self) -> None:
        for sent, timeout_s in (
            (signal.SIGINT, STOP_TIMEOUT_S),
            (signal.SIGTERM, STOP_TIMEOUT_S / 5),
            # SIGKILL also ends what it has started and left, such as a compiler.
            (signal.SIGKILL, STOP_TIMEOUT_S),
        ):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, sent)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(timeout_s)
        # Until the others of its group have ended, too, their shared memory is in use.
        end = time.monotonic() + GROUP_S
        with contextlib.suppress(ProcessLookupError):
            while time.monotonic() < end:
                os.killpg(self._process.pid, 0)
                time.sleep(POLL_S)

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *exception) -> None:
        self.stop()


def _is_zombie(pid: int) -> bool:
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    return True


def _lonely_topics(environment: dict[str, str]) -> Iterator[str]:
    """Yield a sentence for each topic in the graph of a process to which one side is missing."""
    ros2 = shutil.which('ros2', path=environment.get('PATH'))
    if ros2 is None or 'ROS_DOMAIN_ID' not in environment:
        return
    command = [ros2, 'topic', 'list', '--verbose']
    listing = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=20)
    published, _, subscribed = listing.stdout.partition('Subscribed topics:')
    sides = [set(re.findall(r'^ \* (/\S+)', part, re.M)) for part in (published, subscribed)]
    for own, others, there in ((*sides, 'publisher'), (*sides[::-1], 'subscription')):
        missing = {'publisher': 'subscription', 'subscription': 'publisher'}[there]
        for name in sorted(own.difference(others, NOT_OF_A_LESSON)):
            near = nearly(name, sorted(others - own))
            yield f'The topic {name} has a {there} and no {missing}.{near}'.rstrip('.')


@atexit.register
def _stop_all() -> None:
    _stop_each(_started)


def _stop_each(processes: set[Process]) -> None:
    with uninterrupted():
        for process in list(processes):
            process.stop()


def _after_cell(result) -> None:
    """End the processes of a cell that was interrupted, in its code or in IPython's (no result).

    The Interrupt may have come before a variable held the process.
    """
    if result is None or isinstance(result.error_in_exec, KeyboardInterrupt):
        _stop_each(_of_this_cell)
    _of_this_cell.clear()


def end_together(processes: Iterable[Process], limit_s: float = STOP_TIMEOUT_S) -> None:
    """Press Ctrl+C in all of them, and wait until they have ended, at most `limit_s` seconds."""
    processes = [*processes]
    for process in processes:
        process.interrupt(limit_s=0)
    wait_until(lambda: not any(process.running for process in processes), limit_s)


def wait_until(condition: Callable[[], object], limit_s: float) -> bool:
    """Wait until a condition holds, at most `limit_s` seconds. Return whether it holds."""
    end = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(POLL_S)
    return True


def show_launch(process: Process, pattern: str) -> None:
    """Print the lines of a launch that have a pattern, sorted by program.

    What differs from run to run is left out: commands, and numbers of processes.
    """
    text = re.sub(r", cmd '.*'", '', '\n'.join(process.lines))
    text = re.sub(r'(?<=\[pid )\d+', '...', text)
    lines = re.findall(rf'^.*?\[(\w+-\d+)\](.*(?:{pattern}).*)', text, re.MULTILINE)
    for program, said in sorted(lines, key=lambda line: line[0]):
        print(f'[{program}]{said}')
