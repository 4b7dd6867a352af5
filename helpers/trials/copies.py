"""Runs of a lesson at the same time: each in a copy of the kernel, in a domain of its own.

A drive, or a queue that fills, mostly waits. So some of them take no longer than the longest one,
and what they are compared by is the same: no node of one run hears those of another.
"""

from __future__ import annotations

import ctypes
import gc
import os
import pickle
import signal
import sys
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.connection import Connection, Pipe, wait
from typing import NoReturn, TypeVar

from helpers.notebook import uninterrupted
from helpers.ros import change_domain_id, fork, leave_ros, remove_dead_segments

Name, Result = TypeVar('Name', bound=Hashable), TypeVar('Result')
PR_SET_PDEATHSIG = 1  # linux/prctl.h
POLL_S = 0.2  # after which an Interrupt is noticed
END_S = 10.0  # for a copy to end its programs


def in_copies(runs: Mapping[Name, Callable[[], Result]], most: int = 6) -> dict[Name, Result]:
    """Call functions at the same time, each in a copy of this kernel, and return what they return.

    A copy, made by `fork`, has every object of the notebook. What it prints or changes is gone with
    it. What its function returns comes back, so that must be something that pickle takes: numbers,
    texts, tables. What it shows, such as the replay of a drive, is shown when all have ended, in
    their order. A session that is open here is closed before. At most `most` copies run at a time.

    Raises what a function raises, and RuntimeError for a copy that ends without an answer.
    """
    leave_ros()
    left, results = [*runs.items()], {}
    with _copies() as running:
        while left or running:
            while left and len(running) < most:
                _start(*left.pop(0), running)
            for answers in wait([*running], POLL_S):
                with uninterrupted():
                    results[running[answers]] = _answer_of(answers, running[answers])
                    _reap(answers)
                    del running[answers]
    for name in runs:
        _show(results[name][1])
    return {name: results[name][0] for name in runs}


class _Answers(Connection):
    """The end of a pipe to which a copy sends its answer, with the copy's id."""

    pid = 0


@contextmanager
def _copies() -> Iterator[dict[_Answers, Hashable]]:
    """Keep the copies that run. Those that still do when this ends early get Ctrl+C, and end."""
    running: dict[_Answers, Hashable] = {}
    try:
        yield running
    finally:
        with uninterrupted():
            for answers in running:
                os.kill(answers.pid, signal.SIGINT)
            end = time.monotonic() + END_S
            for answers in running:
                _end(answers.pid, end)
                answers.close()
            if running:
                remove_dead_segments()


def _start(
    name: Hashable, function: Callable[[], object], running: dict[_Answers, Hashable]
) -> None:
    """Start a copy, and note it among those that run: an Interrupt finds it there."""
    receiver, sender = Pipe(duplex=False)
    answers = _Answers(os.dup(receiver.fileno()), writable=False)
    receiver.close()
    parent = os.getpid()
    with uninterrupted():
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # until the copy has its handler
        try:
            answers.pid = fork()
            if answers.pid == 0:
                _be_copy(function, sender, parent)
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        running[answers] = name
    sender.close()


def _show(bundles: list[tuple[dict, dict]]) -> None:
    if bundles:
        from IPython.display import display

        for data, metadata in bundles:
            display(data, metadata=metadata, raw=True)


def _answer_of(answers: _Answers, name: Hashable) -> tuple[object, list]:
    """Return what a copy has returned, and what it has shown."""
    try:
        is_result, answer = answers.recv()
    except EOFError:
        raise RuntimeError(f'The run {name} ended without an answer.') from None
    if is_result:
        return answer
    raise answer


def _end(pid: int, end: float) -> None:
    while os.waitpid(pid, os.WNOHANG) == (0, 0):
        if time.monotonic() > end:
            os.kill(pid, signal.SIGKILL)
        time.sleep(0.02)


def _reap(answers: _Answers) -> None:
    os.waitpid(answers.pid, 0)
    answers.close()


def _be_copy(function: Callable[[], object], sender: Connection, parent: int) -> NoReturn:
    """Run a function as a process without a kernel, send what it returns or raises, and end."""
    try:
        os.setsid()  # an Interrupt of the kernel's group must not reach it: its owner sends one
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            return
        gc.freeze()  # the objects of the kernel: a collection would only copy their pages
        shown = _leave_kernel()
        change_domain_id()
        try:
            answer = True, (function(), shown)
        except BaseException as error:
            answer = False, error
        try:
            told = pickle.dumps(answer)
        except Exception as error:  # pickle raises various ones
            what = 'returns' if answer[0] else 'raises'
            told = pickle.dumps((False, RuntimeError(f'No copy can send what it {what}: {error}')))
        sender.send_bytes(told)
    finally:
        os._exit(0)


def _leave_kernel() -> list[tuple[dict, dict]]:
    """Forget that this is a kernel: its sockets are its parent's, and nobody sees what is printed.

    Returns a list that gets what is shown from now on: data and metadata, by types of media.
    """
    nothing = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):
        os.dup2(nothing, number)
    sys.stdout = sys.stderr = open(1, 'w', closefd=False)  # noqa: SIM115
    shown: list[tuple[dict, dict]] = []
    if 'IPython' in sys.modules and (shell := sys.modules['IPython'].get_ipython()):
        type(shell).clear_instance()
        from IPython import display

        def keep(*objects: object, **_: object) -> None:
            shown.extend(shell.display_formatter.format(each) for each in objects)

        display.display = keep
    return shown
