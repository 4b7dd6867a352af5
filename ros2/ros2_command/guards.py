"""What a command must not do halfway, nor at the same time as another process."""

from __future__ import annotations

import contextlib
import faulthandler
import fcntl
import os
import random
import signal
import sys
import time
from collections.abc import Iterator

SHARED_MEMORY = '/dev/shm'
TURN_TIMEOUT_S = 5.0  # after which the message of Fast DDS is better than to wait longer
POLL_S = 0.01

_timed_out = False  # the last wait for a turn did


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Let Ctrl+C wait for the end of the block. It is for the main thread."""
    interrupts = []
    handler = signal.signal(signal.SIGINT, lambda number, frame: interrupts.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if interrupts:
            signal.raise_signal(signal.SIGINT)


@contextlib.contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """End the process of a command if the block takes longer, also if it holds the interpreter."""
    if os.path.basename(sys.argv[0]) != 'ros2':  # a program that uses this package
        yield
        return
    with open(os.devnull, 'w') as nowhere:
        faulthandler.dump_traceback_later(seconds, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


@contextlib.contextmanager
def new_threads_wait() -> Iterator[None]:
    """Let the threads that start in the block run only while this one waits.

    A participant of Fast DDS 2.14 first says who it is, to 32 ports in a row, and only then lets
    its threads take what comes (`RTPSParticipantImpl::enable`). On an idle machine the answers are
    there after 0.2 ms. They are thrown away, and come again only after up to 3 s. Threads of
    SCHED_BATCH do not interrupt each other, and here they share a processor.
    """
    before = _threads()
    processors, policy = os.sched_getaffinity(0), os.sched_getscheduler(0)
    priority = os.sched_getparam(0)
    with contextlib.suppress(OSError):  # a container may refuse it
        os.sched_setaffinity(0, {random.choice([*processors])})
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    try:
        yield
    finally:
        for thread in {0} | _threads() - before:
            with contextlib.suppress(OSError):  # it has ended
                os.sched_setaffinity(thread, processors)
                os.sched_setscheduler(thread, policy, priority)


def _threads() -> set[int]:
    return {int(name) for name in os.listdir('/proc/self/task')}


@contextlib.contextmanager
def one_process_at_a_time() -> Iterator[None]:
    """Wait for the turn of this process to make or to end a participant.

    Fast DDS numbers some ports in shared memory across all domains. It prints an error if one
    process wants the number that another one gives back at this moment. So all processes that know
    of it, ours and those that the README asks, hold a lock on the folder /dev/shm meanwhile. A
    process that was stopped may hold it for ever: once a wait has timed out, the next ones do not
    wait.
    """
    global _timed_out
    try:
        folder = os.open(SHARED_MEMORY, os.O_RDONLY)
    except OSError:  # no shared memory, no such port
        yield
        return
    try:
        deadline = time.monotonic() + (0.0 if _timed_out else TURN_TIMEOUT_S)
        while not (locked := _lock(folder)) and time.monotonic() < deadline:
            time.sleep(POLL_S)
        _timed_out = not locked
        yield
    finally:
        # A child that was forked meanwhile has the folder open, too: closing would not unlock it.
        fcntl.flock(folder, fcntl.LOCK_UN)
        os.close(folder)


def _lock(folder: int) -> bool:
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
