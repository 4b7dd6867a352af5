"""A process that prints lines, and ends: with its block, with an Interrupt, with the kernel."""

from __future__ import annotations

import atexit
import contextlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from helpers.interrupts import uninterrupted
from helpers.workspace.folders import locks

STOP_TIMEOUT_S = 5.0
POLL_S = 0.02
# The process ends with the kernel, also when the kernel is killed: 1 is Linux's PR_SET_PDEATHSIG.
WITH_KERNEL = """
import ctypes, os, signal, sys
parent = int(sys.argv[1])
try:
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)
except (OSError, AttributeError):
    pass
if os.getppid() == parent:
    os.execv(sys.argv[2], sys.argv[2:])
"""

_started: set[Process] = set()  # and not stopped


class Process:
    """A running process and what it has printed. See `Workspace.run`.

    It ends with its `with` block, with `stop()`, when a cell is interrupted, and with the kernel.
    With `ends_with_kernel=False` it goes on when the kernel is killed.
    """

    def __init__(
        self,
        name: str,
        command: list[str],
        environment: dict[str, str],
        folder: Path,
        ends_with_kernel: bool = True,
    ) -> None:
        if ends_with_kernel:
            command = [sys.executable, '-I', '-S', '-c', WITH_KERNEL, str(os.getpid()), *command]
        self.name = name
        # Not a pipe, which would need a thread that reads it.
        self._output = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115
        if 'IPython' in sys.modules and (shell := sys.modules['IPython'].get_ipython()):
            shell.events.register('post_run_cell', _after_cell)  # once, however often this is said
        with uninterrupted():
            self._process = subprocess.Popen(
                command,
                env=environment,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=subprocess.STDOUT,
                # What goes on when the kernel is killed, such as a build, keeps its workspace
                # claimed.
                pass_fds=locks(),
                # Interrupting the kernel must not reach it: its owner ends it in order.
                start_new_session=True,
            )
            _started.add(self)

    @property
    def lines(self) -> list[str]:
        """What it has printed so far, stdout and stderr together, one string a line."""
        running, file = self.running, self._output.fileno()
        # At a place of its own: a read() would move the place where the process writes.
        text = os.pread(file, os.fstat(file).st_size, 0).decode(errors='replace')
        lines = text.split('\n')
        # The last line may not be complete yet.
        return lines[:-1] if running or not lines[-1] else lines

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.poll() is None

    def print_output(self, first: int | None = None) -> None:
        """Print what it has printed so far, or only the first lines of it."""
        for line in self.lines[:first]:
            print(line)

    def wait_for(self, text: str, timeout_s: float = 20.0) -> str:
        """Wait until a line contains `text`, and return this line.

        Raises TimeoutError where that takes longer, and RuntimeError where the process has ended.
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
                    f'Waited {timeout_s:g} s in vain for a line with {text!r} of {self.name}. '
                    f'{self._last()}'
                )
            time.sleep(POLL_S)

    def wait(self, timeout_s: float = 20.0) -> int:
        """Wait until it ends by itself, and return its exit code, -N where signal N ended it.

        Raises TimeoutError where that takes longer.
        """
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise TimeoutError(
                f'Waited {timeout_s:g} s in vain for the end of {self.name}. {self._last()}'
            ) from None

    def _last(self) -> str:
        # A traceback underlines a part of a line; its last line says what happened.
        lines = [line.strip() for line in self.lines if re.search(r'[^\s^~]', line)]
        if lines and re.match(r'[\w.]+(Error|Exception)\b', lines[-1]):
            return f'Its last line: {lines[-1]}'
        return f'Its last lines: {" / ".join(lines[-3:]) or "none"}'

    def stop(self) -> None:
        """End it as Ctrl+C does. One that does not end within a few seconds is killed."""
        with uninterrupted():
            if self.running:
                self._stop()
            _started.discard(self)

    def _stop(self) -> None:
        for sent, timeout_s in (
            (signal.SIGINT, STOP_TIMEOUT_S),
            (signal.SIGTERM, STOP_TIMEOUT_S / 5),
            # The last time also for what it has started, such as a compiler, and has left.
            (signal.SIGKILL, STOP_TIMEOUT_S),
        ):
            if self.running or sent == signal.SIGKILL:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(self._process.pid, sent)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(timeout_s)

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *exception) -> None:
        self.stop()


@atexit.register
def _stop_all() -> None:
    with uninterrupted():
        for process in list(_started):
            process.stop()


def _after_cell(result) -> None:
    """End the processes when a cell was interrupted, in its code or in IPython's (no result).

    The Interrupt may have come before who started one could keep it.
    """
    if result is None or isinstance(result.error_in_exec, KeyboardInterrupt):
        _stop_all()
