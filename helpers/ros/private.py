"""What a session does inside of rclpy, and of the Python that it runs in.

A new version may take away a private name. So a comment beside each says what has it, and in which
version that was read: tests/test_private.py looks whether it is still there.
"""

from __future__ import annotations

import ctypes
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import thread as thread_pool
from types import FrameType
from typing import NamedTuple

from rclpy.client import Client
from rclpy.executors import Executor
from rclpy.node import Node

from helpers.notebook import frames


def end_spin(executor: Executor) -> None:
    """Let the spin of an executor end. Executor.shutdown() destroys what the spin still uses."""
    executor._is_shutdown = True  # private: an executor, rclpy 7.1.6
    executor.wake()


def _pool_of(executor: Executor) -> ThreadPoolExecutor | None:
    """Return the pool that runs the callbacks of a MultiThreadedExecutor. Others have none."""
    # private: a MultiThreadedExecutor, rclpy 7.1.6
    return getattr(executor, '_executor', None)


def pool_threads(executor: Executor) -> list[threading.Thread]:
    pool = _pool_of(executor)
    # private: a ThreadPoolExecutor, Python 3.11.7
    return [] if pool is None else list(pool._threads)


def end_pool(executor: Executor) -> None:
    """Let the threads of the pool end. rclpy leaves that to the garbage collector."""
    pool = _pool_of(executor)
    if pool is not None:
        pool.shutdown(wait=False, cancel_futures=True)


def failures_in_pool(executor: Executor) -> list[BaseException]:
    """Return what the callbacks raised that a pool ran: rclpy raises it at a later spin, or never.

    An exception that rclpy has raised itself is no longer among them.
    """
    # private: a MultiThreadedExecutor, rclpy 7.1.6
    futures = list(getattr(executor, '_futures', ()))
    tasks = [task for task in futures if task.done()]
    return [task.exception() for task in tasks if task.exception() is not None]


def cancel_tasks(executor: Executor) -> None:
    """Cancel what never started: its coroutine would warn when it is collected."""
    for task, *_ in list(executor._tasks):  # private: an executor, rclpy 7.1.6
        if not task.executing():
            task.cancel()


def fail_calls(client: Client, failure: Exception) -> None:
    """Let all calls of a client that wait for an answer raise this exception."""
    # private: a client, rclpy 7.1.6
    for future in list(client._pending_requests.values()):
        with warnings.catch_warnings(action='ignore'):  # a done callback that fails
            future.set_exception(failure)
        future.exception()  # or rclpy warns that it was not read


def end_lifecycle(node: Node) -> None:
    """Destroy the state machine of a lifecycle node, which keeps the node and its participant.

    rclpy leaves that to the garbage collector.
    """
    machine = getattr(node, '_state_machine', None)  # private: a lifecycle node, rclpy 7.1.6
    if machine is not None:
        machine.destroy_when_not_in_use()


def states_of(executor: Executor, spin_thread: threading.Thread) -> set[str]:
    """Return what the threads that run an executor's callbacks do: 'working', 'waiting', 'free'."""
    pool = _pool_of(executor)
    threads = [spin_thread] if pool is None else pool_threads(executor)
    states = {_state(frame) for _, frame in frames(threads)}
    # private: a ThreadPoolExecutor, Python 3.11.7
    if pool is not None and len(threads) < pool._max_workers:
        states.add('free')  # the pool starts a thread when it needs one
    return states


def _state(frame: FrameType) -> str:
    code = frame.f_code
    if code.co_filename == threading.__file__:
        return 'waiting'
    # private: an executor, rclpy 7.1.6
    idle_in_spin = code is Executor._wait_for_ready_callbacks.__code__
    if idle_in_spin or code.co_filename == thread_pool.__file__:
        return 'free'
    return 'working'


class Wait(NamedTuple):
    """The Event at which a thread waits, for how long (None: without end), and for an answer?"""

    event: threading.Event
    timeout_s: float | None
    in_call: bool


def wait_of(thread: threading.Thread) -> Wait | None:
    """Return the wait of a thread: only its frame of `Event.wait` knows which Event it is.

    `in_call` says that it waits in `Client.call`. The executor that took the answer may have ended
    before it could wake the thread.
    """
    for _, frame in frames([thread]):
        while frame is not None and frame.f_code is not threading.Event.wait.__code__:
            frame = frame.f_back
        if frame is not None:
            caller = frame.f_back
            in_call = caller is not None and caller.f_code is Client.call.__code__
            return Wait(frame.f_locals['self'], frame.f_locals['timeout'], in_call)
    return None


def break_off(thread: threading.Thread, error: type[Exception]) -> None:
    """Raise an error in a thread at its next line of Python, if it does not wait."""
    if any(_state(frame) == 'working' for _, frame in frames([thread])):
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(thread.ident), ctypes.py_object(error)
        )
