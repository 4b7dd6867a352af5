"""A ROS session for a notebook cell: it opens rclpy, spins executors in threads, and cleans up.

A terminal has one process per node and Ctrl+C to end it. A notebook has one process for everything,
and cells that run twice or are interrupted. `ros_session` makes this safe and adds nothing else:
nodes, executors and callback groups are plain rclpy.
"""

from __future__ import annotations

import atexit
import contextlib
import fcntl
import gc
import os
import socket
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import thread as thread_pool
from dataclasses import dataclass
from traceback import clear_frames

from helpers.interrupts import uninterrupted
from helpers.progress_bar import ProgressBar

try:
    import rclpy
    from rcl_interfaces.msg import Log
    from rclpy.client import Client
    from rclpy.executors import Executor, ExternalShutdownException
    from rclpy.node import Node
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from rclpy.signals import SignalHandlerOptions
except ImportError as error:
    raise ImportError(
        f'rclpy cannot be imported in this Python ({error}): start JupyterLab with `make lab`, '
        'or see environment.md for the other ways to get ROS 2.'
    ) from error

CLOSE_TIMEOUT_S = 5.0
SHARED_MEMORY = '/dev/shm'
TURN_TIMEOUT_S = 5.0
POLL_S = 0.01
QUIET_ROUNDS = 20
DISCOVERY = ('LOCALHOST', 'SUBNET')
LOG_LEVELS = {10: 'DEBUG', 20: 'INFO', 30: 'WARN', 40: 'ERROR', 50: 'FATAL'}

_reserved = contextlib.ExitStack()
_domain_id: int | None = None
_open_session: Session | None = None


def reserve_domain_id() -> int:
    """Return a domain id (1 to 100) that belongs to this process until it ends.

    Raises RuntimeError where all of them are taken.
    """
    global _domain_id
    if _domain_id is None:
        from domain_coordinator import domain_id

        try:
            _domain_id = _reserved.enter_context(domain_id())
        except RuntimeError as error:
            raise RuntimeError(
                'All 100 ROS domain ids of this machine are in use: '
                'shut down the kernels that you no longer need, then run this cell again.'
            ) from error
    return _domain_id


@contextlib.contextmanager
def share_domain_id(domain_id: int) -> Iterator[int]:
    """Keep `reserve_domain_id` of all processes away from this id, which several may share.

    Raises ValueError where a process has reserved it for itself.
    """
    from domain_coordinator.impl import PORT_BASE

    # The coordinator holds the port of an id without this option. Two sockets can share a port
    # only where both have it.
    with socket.socket() as mark:
        mark.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            mark.bind(('', PORT_BASE + domain_id))
        except OSError:
            raise ValueError(
                f'Domain {domain_id} is reserved on this machine: agree on another one. '
                'No kernel reserves 0 and 101.'
            ) from None
        yield domain_id


def configure_discovery(discovery: str = 'LOCALHOST') -> None:
    """Let the nodes of this process be discovered on this machine only, or in its network.

    With 'SUBNET', ROS_STATIC_PEERS stays what it is.
    """
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = discovery
    # Both would widen or replace the range.
    os.environ.pop('ROS_LOCALHOST_ONLY', None)
    if discovery == 'LOCALHOST':
        os.environ.pop('ROS_STATIC_PEERS', None)


@dataclass
class LogRecord:
    """One message of `/rosout`."""

    level: str
    node: str
    text: str
    printed: bool = False

    def __str__(self) -> str:
        return f'[{self.level}] [{self.node}]: {self.text}'


class SessionClosedError(Exception):
    """Raised in a callback that still waits for the answer of a service when its session closes."""


class Session:
    """An open ROS graph: the context, the threads that spin, and the log. See `ros_session`."""

    def __init__(self, domain_id: int | None = None, discovery: str = 'LOCALHOST') -> None:
        self._domain_id, self._discovery = domain_id, discovery
        self._shared = contextlib.ExitStack()
        self._context = None
        self._closed = False
        self._ended_by_exception = False
        self._executors: list[Executor] = []
        self._spin_threads: list[threading.Thread] = []
        self._failures: list[BaseException] = []
        self._log: list[LogRecord] = []
        self._log_subscription = None

    def open(self) -> Session:
        """Initialise rclpy in the session's domain. A session that is still open is closed."""
        global _open_session
        if self._closed or self._context is not None:
            raise RuntimeError('A session opens once: make a new one with `ros_session()`.')
        if _open_session is not None:
            _open_session._clean_up()
        if rclpy.ok():  # a bare rclpy.init() of the notebook
            rclpy.shutdown()
        if self._domain_id is None:
            domain_id = reserve_domain_id()
        else:
            domain_id = self._shared.enter_context(share_domain_id(self._domain_id))
        configure_discovery(self._discovery)
        self._context = rclpy.get_default_context()
        _open_session = self
        try:
            self._initialise(domain_id)
        except BaseException as failure:  # interrupted: nobody will close it
            clear_frames(failure.__traceback__)
            self._clean_up()
            raise
        return self

    def _initialise(self, domain_id: int) -> None:
        rclpy.init(
            # The log goes to /rosout only: the console would show it again, and a file would need
            # a home that can be written.
            args=['--ros-args', '--disable-stdout-logs', '--disable-external-lib-logs'],
            domain_id=domain_id,
            # rclpy's own handlers would shut the context down when the notebook is interrupted.
            signal_handler_options=SignalHandlerOptions.NO,
        )
        with one_process_at_a_time():  # the first node makes the participant
            self._log_node = Node(
                '_session_log', enable_rosout=False, start_parameter_services=False
            )
        self._log_subscription = self._log_node.create_subscription(
            Log,
            '/rosout',
            lambda record: None,  # never spun: the session takes the records itself
            QoSProfile(depth=100_000, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        )
        # The first log call of a process looks at every imported module, for 0.1 s: not in a
        # callback that is being measured.
        self._log_node.get_logger().info('The session is open.')

    def __enter__(self) -> Session:
        return self.open()

    def __exit__(self, exception_type, exception, traceback) -> None:
        __tracebackhide__ = True
        if isinstance(exception, KeyboardInterrupt):
            # What was half made is in the frames alone, and the traceback keeps them.
            clear_frames(traceback)
        self._ended_by_exception = exception is not None
        try:
            self.close()
        except BaseException as failure:
            if exception is None:
                raise
            if failure is not exception:
                exception.add_note(f'While the session closed: {failure!r}')

    def spin(self, executor: Executor) -> None:
        """Spin an executor in a background thread, until the session closes.

        Raises TypeError for anything but an rclpy executor, ValueError for one that spins already,
        and RuntimeError where the session is closed.
        """
        if not isinstance(executor, Executor):
            raise TypeError(
                'session.spin needs an executor, for example SingleThreadedExecutor() or '
                f'MultiThreadedExecutor(num_threads=4), not {executor!r}.'
            )
        if self._context is None or self._closed:
            raise RuntimeError(
                'This session is not open: call session.spin inside its `with` block.'
            )
        if executor.context is not self._context:
            raise ValueError(
                'This executor belongs to another session: make it inside '
                '`with ros_session() as session:`.'
            )
        if executor in self._executors:
            raise ValueError('This executor spins already: call session.spin once per executor.')
        name = f'spin {len(self._executors) + 1}'
        thread = threading.Thread(target=self._spin, args=(executor,), name=name, daemon=True)
        with uninterrupted():
            self._executors.append(executor)
            self._spin_threads.append(thread)
            thread.start()

    def _spin(self, executor: Executor) -> None:
        try:
            executor.spin()
        except (ExternalShutdownException, SessionClosedError):
            pass  # the cell itself called rclpy.shutdown(), or left a callback that waits
        except BaseException as failure:
            self._failures.append(failure)

    def wait_until(
        self,
        predicate: Callable[[], bool],
        timeout_s: float = 30.0,
        progress: Callable[[], float] | None = None,
    ) -> None:
        """Wait until the predicate holds.

        `progress` returns the part that is done, 0 to 1. It is shown as a bar once the wait has
        taken 2 s; the bar disappears at the end.

        Raises TimeoutError when `timeout_s` seconds are over, and the exception of a callback as
        soon as one has failed.
        """
        __tracebackhide__ = True  # IPython shows the cell, and the callback that failed
        started = time.monotonic()
        # Nobody sets it: an interruptible pause between two looks at the predicate.
        pause = threading.Event()
        with ProgressBar(progress) as bar:
            while not predicate():
                self.raise_if_failed()
                waited_s = time.monotonic() - started
                if waited_s > timeout_s:
                    raise TimeoutError(
                        f'Waited {timeout_s:g} s in vain: is every executor spinning, and is every '
                        'node added to one?'
                    )
                bar.update(waited_s)
                pause.wait(POLL_S)

    def wait_until_quiet(self, executor: Executor, timeout_s: float = 30.0) -> bool:
        """Wait until nothing happens in an executor any more, timers and time-outs apart.

        The executor gets one empty task after the other. It is quiet when it has done
        `QUIET_ROUNDS` of them and nothing else: then it passes over whatever is left. It is also
        quiet when all its threads are held by callbacks that wait for an answer or an Event. No
        clock decides, so a busy machine only takes longer. Returns whether a thread is free.

        Raises ValueError where the executor does not spin in this session, and what `wait_until`
        raises.
        """
        __tracebackhide__ = True
        if executor not in self._executors:
            raise ValueError('This executor does not spin: call session.spin(executor) first.')
        task, rounds, states = executor.create_task(int), 0, set()

        def is_quiet() -> bool:
            nonlocal task, rounds, states
            states = self._states(executor)
            if 'working' in states:
                rounds = 0
            elif task.done():
                task, rounds = executor.create_task(int), rounds + 1
            elif 'free' not in states:
                rounds += 1
            return rounds >= QUIET_ROUNDS

        self.wait_until(is_quiet, timeout_s)
        return 'free' in states

    def _states(self, executor: Executor) -> set[str]:
        """Return what the threads that run an executor's callbacks do: work, wait, or nothing."""
        pool = getattr(executor, '_executor', None)
        states = set()
        if pool is None:
            threads = [self._spin_threads[self._executors.index(executor)]]
        else:
            threads = list(pool._threads)
            if len(threads) < pool._max_workers:  # the pool starts a thread when it needs one
                states.add('free')
        frames = sys._current_frames()
        # A thread that has ended, after a failure, has no frame.
        for code in (frames[t.ident].f_code for t in threads if t.ident in frames):
            if code.co_filename == threading.__file__:
                states.add('waiting')
            elif (
                code.co_filename == thread_pool.__file__
                or code is Executor._wait_for_ready_callbacks.__code__
            ):
                states.add('free')
            else:
                states.add('working')
        return states

    def raise_if_failed(self) -> None:
        """Raise the first exception that left a callback, with its own traceback."""
        __tracebackhide__ = True
        self._collect_failures()
        if self._failures:
            raise self._failures[0]

    def _collect_failures(self) -> None:
        # A MultiThreadedExecutor raises a callback's exception at a later spin, or never.
        for executor in self._executors:
            for task in list(getattr(executor, '_futures', ())):
                failure = task.exception() if task.done() else None
                if failure is None or isinstance(failure, SessionClosedError):
                    continue
                if failure not in self._failures:
                    self._failures.append(failure)

    def log(self, node: str | None = None) -> list[LogRecord]:
        """Return the records of `/rosout` so far, oldest first, of one node or of all."""
        if self._log_subscription is not None:
            handle = self._log_subscription.handle
            with handle:
                while (taken := handle.take_message(Log, False)) is not None:
                    message = taken[0]
                    level = LOG_LEVELS.get(message.level, str(message.level))
                    self._log.append(LogRecord(level, message.name, message.msg))
        return [record for record in self._log if node in (None, record.node)]

    def print_log(self, node: str | None = None) -> None:
        """Print the records of `/rosout` so far, oldest first, of one node or of all."""
        for record in self.log(node):
            record.printed = True
            print(record)

    def close(self) -> None:
        """Stop and destroy everything that this session opened.

        Raises the first exception that left a callback, or RuntimeError where a callback does not
        end within `CLOSE_TIMEOUT_S`.
        """
        __tracebackhide__ = True
        if self._context is None or self._closed:
            return
        deadline = time.monotonic() + CLOSE_TIMEOUT_S
        interrupt = None
        while not self._closed:
            try:
                self._clean_up(deadline)
            except KeyboardInterrupt as error:  # clean up first
                interrupt = error
        # By node, because the executor's order of nodes is chance.
        for record in sorted(self._log, key=lambda record: record.node):
            if record.level in ('WARN', 'ERROR', 'FATAL') and not record.printed:
                record.printed = True
                print(record)
        if interrupt is not None:
            raise interrupt
        if self._failures:
            raise self._failures[0]
        stuck = [thread.name for thread in self._threads() if thread.is_alive()]
        if stuck:
            raise RuntimeError(
                f'{len(stuck)} callback(s) did not end within {CLOSE_TIMEOUT_S:g} s: let every '
                'callback end, or restart the kernel.'
            )

    def _clean_up(self, deadline: float | None = None) -> None:
        """Do the steps of `close`; every step can be repeated after an interrupt."""
        global _open_session
        if self._closed:
            return
        deadline = deadline or time.monotonic() + CLOSE_TIMEOUT_S
        for executor in self._executors:
            # Ends its spin. Executor.shutdown() does not wait for that end before it destroys what
            # the spin uses.
            executor._is_shutdown = True
            executor.wake()
        for thread in self._spin_threads:
            self._join(thread, deadline)
        for executor in self._executors:
            # rclpy leaves the threads of the pool to the garbage collector.
            pool = getattr(executor, '_executor', None)
            if pool is not None:
                pool.shutdown(wait=False, cancel_futures=True)
        for thread in self._threads():
            self._join(thread, deadline)
        self._collect_failures()
        for executor in self._executors:
            # A coroutine that was never started would warn when it is collected.
            for task, *_ in list(getattr(executor, '_tasks', ())):
                if not task.executing():
                    task.cancel()
            executor.shutdown(timeout_sec=0)
        self.log()
        self._log_subscription = None
        destroy_nodes(self._context)
        rclpy.try_shutdown()
        self._shared.close()
        self._closed = True
        if _open_session is self:
            _open_session = None

    def _join(self, thread: threading.Thread, deadline: float) -> None:
        """Wait for the end of a thread. A call in it that waits for an answer fails.

        After an interrupt or a failure, the cell will not set the Event at which a callback waits.
        """
        thread.join(min(2 * POLL_S, max(0.0, deadline - time.monotonic())))
        while thread.is_alive() and time.monotonic() < deadline:
            self._end_calls()
            if self._ended_by_exception:
                _end_wait(thread)
            thread.join(25 * POLL_S)  # less often than POLL_S: to look for calls takes long

    def _end_calls(self) -> None:
        for client in _find(Client, self._context):
            for future in list(client._pending_requests.values()):
                with warnings.catch_warnings(action='ignore'):  # a done callback that fails
                    future.set_exception(SessionClosedError('The session closes: no answer.'))
                future.exception()  # or rclpy says that nobody has read it

    def _threads(self) -> list[threading.Thread]:
        pools = [getattr(executor, '_executor', None) for executor in self._executors]
        return self._spin_threads + [
            thread for pool in pools if pool is not None for thread in list(pool._threads)
        ]


def destroy_nodes(context: rclpy.Context) -> None:
    """Destroy all nodes of a context, also those that nobody knows any more."""
    nodes = list(_find(Node, context))
    with one_process_at_a_time():  # the last node ends the participant
        for node in nodes:
            _destroy(node)


def _destroy(node: Node) -> None:
    for destroy in (
        node.destroy_node,
        lambda: Node.destroy_node(node),  # past a mistake in an own destroy_node
        # A node whose __init__ failed or was interrupted has only some of its parts: destroy_node
        # misses one before it comes to the handle.
        lambda: node.handle.destroy_when_not_in_use(),
    ):
        with contextlib.suppress(Exception):
            destroy()


@contextlib.contextmanager
def one_process_at_a_time() -> Iterator[None]:
    """Wait for the turn of this process to make or to end a participant.

    Fast DDS counts some ports in shared memory through all domains. It reports an error, in the
    middle of a cell, where one process wants the number that another one is just giving back, and
    takes the next number. After `TURN_TIMEOUT_S` it is nobody's turn: the error is better than to
    wait for a process that was stopped.
    """
    try:
        folder = os.open(SHARED_MEMORY, os.O_RDONLY)
    except OSError:  # no shared memory, no such port
        yield
        return
    try:
        deadline = time.monotonic() + TURN_TIMEOUT_S
        while time.monotonic() < deadline:
            with contextlib.suppress(BlockingIOError):
                fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            time.sleep(POLL_S)
        yield
    finally:
        # A child that was forked meanwhile has the folder open, too: closing would not unlock it.
        fcntl.flock(folder, fcntl.LOCK_UN)
        os.close(folder)


def _end_wait(thread: threading.Thread) -> None:
    """Set the Event at which a thread waits, if it would wait longer than a session does."""
    frame = sys._current_frames().get(thread.ident)
    while frame is not None and frame.f_code is not threading.Event.wait.__code__:
        frame = frame.f_back
    if frame is not None:
        event, timeout_s = frame.f_locals['self'], frame.f_locals['timeout']
        if timeout_s is None or timeout_s > CLOSE_TIMEOUT_S:
            event.set()


def _find(kind: type, context: rclpy.Context) -> Iterator:
    """Yield all nodes or clients of a context."""
    for thing in gc.get_objects():
        if issubclass(type(thing), kind) and getattr(thing, 'context', None) is context:
            yield thing


def ros_session(domain_id: int | None = None, discovery: str = 'LOCALHOST') -> Session:
    """Return a ROS session, to be used as `with ros_session() as session:`.

    Inside it, rclpy is initialised, in a domain that no other kernel of this machine hears. At its
    end, and also when a cell is interrupted or run again, all executors, threads, nodes and the
    context are gone. The first exception of a callback is raised at the end of the `with`.

    To talk to others, agree with them on a domain id (0 to 101): `ros_session(domain_id=42)` hears
    the programs of this machine that use it, `ros_session(domain_id=42, discovery='SUBNET')` also
    those of other machines. The other side sets ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE.

    Raises TypeError or ValueError for anything else.
    """
    if domain_id is not None and (isinstance(domain_id, bool) or not isinstance(domain_id, int)):
        raise TypeError(f'domain_id must be a whole number from 0 to 101, not {domain_id!r}.')
    if domain_id is not None and not 0 <= domain_id <= 101:
        raise ValueError(f'domain_id must be a whole number from 0 to 101, not {domain_id}.')
    if discovery not in DISCOVERY:
        raise ValueError(f"discovery must be 'LOCALHOST' or 'SUBNET', not {discovery!r}.")
    if discovery == 'SUBNET' and domain_id is None:
        raise ValueError(
            "discovery='SUBNET' needs the domain id that the other machines use, for example "
            "ros_session(domain_id=42, discovery='SUBNET')."
        )
    return Session(domain_id, discovery)


def current_session() -> Session:
    """Return the open session. Raises RuntimeError where there is none."""
    if _open_session is None:
        raise RuntimeError('No session is open: do this inside `with ros_session() as session:`.')
    return _open_session


def graph_environment() -> dict[str, str]:
    """Return the variables with which another process joins the open session.

    Without a session they are those of the next `ros_session()` of this kernel.
    """
    session = _open_session
    domain_id = session._context.get_domain_id() if session else reserve_domain_id()
    discovery = session._discovery if session else 'LOCALHOST'
    environment = {'ROS_DOMAIN_ID': str(domain_id), 'ROS_AUTOMATIC_DISCOVERY_RANGE': discovery}
    if discovery == 'SUBNET' and 'ROS_STATIC_PEERS' in os.environ:
        environment['ROS_STATIC_PEERS'] = os.environ['ROS_STATIC_PEERS']
    return environment


@atexit.register
def _close_at_exit() -> None:
    if _open_session is not None:
        _open_session._clean_up()
