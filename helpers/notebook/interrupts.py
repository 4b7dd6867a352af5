"""What an Interrupt must not cut in two, and what it must end."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from types import FrameType

from helpers.notebook.own_code import is_students, places

MOMENT_S = 0.1
MESSAGE = re.compile(r'/(msg|srv|action)/_\w+\.py$')  # a module that rosidl generates
RCLPY = '/rclpy/'


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Let an Interrupt wait for the end of the block.

    A process or a thread needs an owner that ends it: an Interrupt in the middle of
    `subprocess.Popen` or of `Thread.start` would leave it without one. A session that closes has to
    end all that it has begun.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread is interrupted
        return
    interrupts = []
    handler = signal.signal(signal.SIGINT, lambda *_: interrupts.append(True))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if interrupts:
            signal.raise_signal(signal.SIGINT)


@contextlib.contextmanager
def at_each_signal(call: Callable[[], None]) -> Iterator[None]:
    """Call a function, in a thread, when a signal comes, such as that of an Interrupt.

    Python handles a signal when the main thread is back from C. The wait of rcl comes back only if
    something is there: the function has to make it so.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # a signal is none of its business
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)

    def watch() -> None:
        while reader.recv(1):
            call()

    thread = threading.Thread(target=watch, name='signals', daemon=True)
    thread.start()
    before = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        writer.close()
        thread.join()
        reader.close()


class PatientInterrupt:
    """A handler of SIGINT that lets some things end first, then calls `interrupt` with the signal.

    Python cannot repeat an import of NumPy or PyYAML that was cut in two: from then on each cell
    would fail. A message that rclpy is just taking would become a RuntimeError, 'Unable to convert
    call argument', in place of the KeyboardInterrupt. A second Interrupt does not wait, nor one in
    a module that the student has written.
    """

    def __init__(self, interrupt: Callable[[int, FrameType | None], object]) -> None:
        self._interrupt = interrupt
        self._again: threading.Timer | None = None
        self._asked = False  # the signal is that of the timer

    def __call__(self, number: int, frame: FrameType | None) -> None:
        pressed_again = self._again is not None and not self._asked
        if _must_end(frame) and not pressed_again:
            self._asked = False
            self._again = threading.Timer(MOMENT_S, self._ask, (number,))
            self._again.daemon = True
            self._again.start()
            return
        self.forget()
        self._interrupt(number, frame)

    def _ask(self, number: int) -> None:
        self._asked = True
        os.kill(os.getpid(), number)

    def forget(self) -> None:
        """Let an Interrupt that waits come no more. Between two cells it would break the kernel."""
        if self._again is not None:
            self._again.cancel()
        self._again, self._asked = None, False


def _must_end(frame: FrameType | None) -> bool:
    """Return whether this frame imports a module, or makes or reads a message for rclpy's C code.

    A module that the student has written is none that must end.
    """
    in_message = False
    for file, _ in places(frame):
        if file.startswith('<frozen importlib') or (in_message and RCLPY in file):
            return True
        in_message = MESSAGE.search(file) is not None
        if not in_message and is_students(file):
            return False
    return False


def run_command(run: Callable[[str], int], command: str) -> int:
    """Run a `!command`. An Interrupt ends the cell, too: IPython itself ends the command only."""
    if threading.current_thread() is not threading.main_thread():
        return run(command)
    interrupts = []

    def handle(number: int, frame: FrameType | None) -> None:
        again = threading.Timer(MOMENT_S, os.kill, (os.getpid(), number))
        interrupts.append(again)
        # private: a process of pexpect, pexpect 4.9.0
        if _runs('_spawnpty', frame):  # it would lose the process that it starts
            again.start()
        else:
            before(number, frame)

    before = signal.signal(signal.SIGINT, handle)
    try:
        return run(command)
    finally:
        signal.signal(signal.SIGINT, before)
        for again in interrupts:
            again.cancel()
        if interrupts:
            raise KeyboardInterrupt


def _runs(function: str, frame: FrameType | None) -> bool:
    while frame is not None and frame.f_code.co_name != function:
        frame = frame.f_back
    return frame is not None
