"""A ROS session for a notebook cell: it opens rclpy, spins executors in threads, and cleans up.

A terminal has one process per node and Ctrl+C to end it. A notebook has one process for everything,
and cells that run twice or are interrupted. `ros_session` makes this safe and adds nothing else:
nodes, executors and callback groups are plain rclpy.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import signal
import threading
import time
from collections.abc import Callable, Iterator
from itertools import chain
from traceback import clear_frames

from helpers.notebook import ProgressBar, at_each_signal, uninterrupted
from helpers.ros.domain import (
    check_domain,
    configure_discovery,
    domain_variables,
    one_process_at_a_time,
    reserve_domain_id,
    share_domain_id,
)
from helpers.ros.fields import check_fields
from helpers.ros.session_record import recorded

try:
    import rclpy
    from rclpy.action import ActionClient, ActionServer
    from rclpy.client import Client
    from rclpy.exceptions import InvalidHandle
    from rclpy.executors import Executor, ExternalShutdownException
    from rclpy.node import Node
    from rclpy.publisher import Publisher
    from rclpy.service import Service
    from rclpy.signals import SignalHandlerOptions, uninstall_signal_handlers
    from rclpy.subscription import Subscription

    from helpers.ros import connections, private
    from helpers.ros.rosout import Record, Rosout
    from helpers.waits import explain_callbacks
except ImportError as error:
    raise ImportError(
        f'rclpy cannot be imported in this Python ({error}): start JupyterLab with `make lab`, '
        'or see environment.md for the other ways to get ROS 2.'
    ) from error

check_fields()

CLOSE_TIMEOUT_S = 5.0
BREAK_OFF_S = 1.0
LOG_NODE = '_session_log'
POLL_S = 0.01
QUIET_ROUNDS = 20
QUIET_POLL_S = 0.001  # a round is an empty task of the executor, and takes less than this
SAY_AFTER_S = 5.0
MADE_BY_NODES = Publisher, Subscription, Client, Service
# What rclpy raises for a thing that is destroyed, and for one that was only half made.
ALREADY_DESTROYED = InvalidHandle, AttributeError

_open_session: Session | None = None


def ros_session(domain_id: int | None = None, discovery: str = 'LOCALHOST') -> Session:
    """Return a ROS session, to be used as `with ros_session() as session:`.

    Inside it, rclpy is initialised, in a domain that no other kernel of this machine hears. At its
    end, and also when a cell is interrupted or run again, all executors, threads, nodes and the
    context are gone. The first exception of a callback is raised at the end of the `with`.

    To talk to others, agree with them on a domain id (0 to 101): `ros_session(domain_id=42)` hears
    the programs of this machine that use it, `ros_session(domain_id=42, discovery='SUBNET')` also
    those of other machines. The other side sets ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE.

    Raises ValueError for anything else.
    """
    check_domain(domain_id, discovery)
    return Session(domain_id, discovery)


def current_session() -> Session:
    """Return the open session. Raises RuntimeError if there is none."""
    if _open_session is None:
        raise RuntimeError('No session is open: do this inside `with ros_session() as session:`.')
    return _open_session


def graph_environment() -> dict[str, str]:
    """Return the variables with which another process joins the open session.

    Without a session they are those of the next `ros_session()` of this kernel.
    """
    if _open_session is None:
        return domain_variables(reserve_domain_id(), 'LOCALHOST')
    return _open_session.environment


def leave_ros() -> None:
    """Close the open session, or end a bare rclpy.init() of the notebook, with rclpy's own thread.

    Then this process can be forked: `rclpy.try_shutdown()` leaves a thread that waits for signals,
    and a copy of this process, which has no such thread, would wait for its end for ever.
    """
    if _open_session is not None:
        _open_session._clean_up()
    rclpy.try_shutdown()
    uninstall_signal_handlers()


class SessionClosedError(Exception):
    """Raised in a callback that still waits, or loops without end, when its session closes."""


class Session:
    """An open ROS graph: the context, the threads that spin, and the log. See `ros_session`."""

    def __init__(self, domain_id: int | None, discovery: str) -> None:
        self._domain_id, self._discovery = domain_id, discovery
        self._shared = contextlib.ExitStack()
        self._context = None
        self._closed = False
        self._ended_by_exception = False
        self._spinning: dict[Executor, threading.Thread] = {}
        self._failures: list[BaseException] = []
        self._endless: list[threading.Thread] = []
        self._rosout: Rosout | None = None

    # --- Opening

    def __enter__(self) -> Session:
        """Initialise rclpy in the session's domain. A session that is still open is closed."""
        global _open_session
        if self._context is not None:
            raise RuntimeError('A session opens once: make a new one with `ros_session()`.')
        leave_ros()
        if self._domain_id is None:
            self._domain_id = reserve_domain_id()
        else:
            self._shared.enter_context(share_domain_id(self._domain_id))
        configure_discovery(self._discovery)
        self.environment = domain_variables(self._domain_id, self._discovery)
        try:
            with uninterrupted():
                # For the ros2 command, which looks where a session is open.
                self._shared.enter_context(recorded(self.environment, 'open'))
                self._context = rclpy.get_default_context()
                _open_session = self
                self._initialise()
                self._shared.enter_context(at_each_signal(self._wake))
        except BaseException as failure:  # __exit__ will not run
            clear_frames(failure.__traceback__)
            self._clean_up()
            raise
        return self

    def _initialise(self) -> None:
        rclpy.init(
            # The log goes to /rosout only: the console would show it again, and a file would need
            # a home that can be written.
            args=['--ros-args', '--disable-stdout-logs', '--disable-external-lib-logs'],
            domain_id=self._domain_id,
            # rclpy's own handlers would shut the context down when the notebook is interrupted.
            signal_handler_options=SignalHandlerOptions.NO,
        )
        with one_process_at_a_time():  # the first node makes the participant
            node = Node(LOG_NODE, enable_rosout=False, start_parameter_services=False)
        self._rosout = Rosout(node)

    @property
    def node(self) -> Node:
        """The session's own node: it hears the log, and can be asked who else is there."""
        return self._rosout.node

    def _wake(self) -> None:
        # The executors that a cell spins itself, too: `rclpy.spin(node)`.
        for executor in find(Executor, self._context):
            executor.wake()

    # --- Spinning

    def spin(self, executor: Executor) -> None:
        """Spin an executor in a background thread, until the session closes.

        Raises TypeError for anything but an rclpy executor, ValueError for one that spins already
        or belongs to another session, and RuntimeError if the session is not open.
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
        if executor in self._spinning:
            raise ValueError('This executor spins already: call session.spin once per executor.')
        name = f'spin {len(self._spinning) + 1}'
        thread = threading.Thread(target=self._spin, args=(executor,), name=name, daemon=True)
        with uninterrupted():
            self._spinning[executor] = thread
            thread.start()

    def _spin(self, executor: Executor) -> None:
        # JupyterLab interrupts all processes of the kernel. One that a callback starts, for example
        # a pool's, inherits this: an Interrupt before it can refuse would break the pool for good.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            executor.spin()
        except (ExternalShutdownException, SessionClosedError):
            pass  # the cell itself called rclpy.shutdown(), or left a callback that waits
        except BaseException as failure:
            self._failures.append(failure)

    def _raise_failure(self) -> None:
        """Raise the first exception that left a callback, with its own traceback."""
        __tracebackhide__ = True
        self._collect_failures()
        if self._failures:
            raise self._failures[0]

    def _collect_failures(self) -> None:
        for executor in self._spinning:
            for failure in private.failures_in_pool(executor):
                if failure not in self._failures and not isinstance(failure, SessionClosedError):
                    self._failures.append(failure)

    # --- Waiting

    def wait_until(
        self,
        predicate: Callable[[], bool],
        timeout_s: float = 30.0,
        progress: Callable[[], float] | None = None,
        status: Callable[[], str] | None = None,
        poll_s: float = POLL_S,
    ) -> None:
        """Wait until the predicate holds. It is asked every `poll_s` seconds.

        `progress` returns the part that is done, 0 to 1. It is shown as a bar once the wait has
        taken 2 s; the bar disappears at the end. `status` returns a sentence on what has come.

        If something is not connected, or a callback waits, a person who watches the cell sees it
        after 5 s. The TimeoutError says it, too.

        Raises TimeoutError when `timeout_s` seconds are over, and the exception of a callback as
        soon as one has failed.
        """
        __tracebackhide__ = True  # IPython shows the cell, and the callback that failed
        started, explained = time.monotonic(), False
        # It is never set: an interruptible pause between two looks at the predicate.
        pause = threading.Event()
        with ProgressBar(progress) as bar:
            while not predicate():
                self._raise_failure()
                if not (self._context.ok() or predicate()):
                    raise RuntimeError('rclpy was shut down: nothing can come any more.')
                waited_s = time.monotonic() - started
                if waited_s > timeout_s:
                    raise TimeoutError(self._why(f'Gave up after {timeout_s:g} s.', status))
                bar.update(waited_s)
                if waited_s > SAY_AFTER_S and not explained:
                    explained = True
                    if self._findings():
                        bar.say(self._why(f'Waited {SAY_AFTER_S:g} s so far.', status))
                pause.wait(poll_s)

    def _why(self, first: str, status: Callable[[], str] | None) -> str:
        none = ['Everything that was made is connected and spins, and no callback waits.']
        return '\n'.join([first, *([status()] if status else []), *(self._findings() or none)])

    def _findings(self) -> list[str]:
        nodes = [node for node in find(Node, self._context) if is_used(node)]
        nodes = [node for node in nodes if node.get_name() != LOG_NODE]
        callbacks = ''
        with contextlib.suppress(Exception):  # what explains a wait must not end it
            callbacks = explain_callbacks()
        return [*connections.findings(nodes, self._spinning), *([callbacks] if callbacks else [])]

    def wait_until_quiet(self, executor: Executor, timeout_s: float = 30.0) -> bool:
        """Wait until nothing happens in an executor any more, timers and time-outs apart.

        The executor gets one empty task after the other. It is quiet when it has done
        `QUIET_ROUNDS` of them and nothing else: then it passes over whatever is left. It is also
        quiet when all its threads are held by callbacks that wait for an answer or an Event. No
        clock decides, so a busy machine only takes longer. Returns whether a thread is free.

        Raises ValueError if the executor does not spin in this session, and what `wait_until`
        raises.
        """
        __tracebackhide__ = True
        if executor not in self._spinning:
            raise ValueError('This executor does not spin: call session.spin(executor) first.')
        task, rounds, states = executor.create_task(int), 0, set()

        def is_quiet() -> bool:
            nonlocal task, rounds, states
            states = private.states_of(executor, self._spinning[executor])
            if 'working' in states:
                rounds = 0
            elif task.done():
                task, rounds = executor.create_task(int), rounds + 1
            elif 'free' not in states:
                rounds += QUIET_POLL_S / POLL_S  # an answer may be on its way: 0.2 s
            return rounds >= QUIET_ROUNDS

        self.wait_until(is_quiet, timeout_s, poll_s=QUIET_POLL_S)
        return 'free' in states

    # --- The log

    def print_log(self, node: str | None = None) -> None:
        """Print the records of `/rosout` so far, oldest first, of one node or of all."""
        self._rosout.print(node)

    def records(self) -> list[Record]:
        """Return the records of `/rosout` so far, oldest first."""
        return self._rosout.take()

    # --- Closing

    def at_close(self, callback: Callable[[], None]) -> None:
        """Call something when the session closes and its nodes are gone. It must not raise."""
        self._shared.callback(callback)

    def __exit__(self, exception_type, exception, traceback) -> None:
        __tracebackhide__ = True
        with uninterrupted():
            if isinstance(exception, KeyboardInterrupt):
                # The traceback keeps the frames, and they keep what was half made.
                clear_frames(traceback)
            self._ended_by_exception = exception is not None
            try:
                self._close()
            except BaseException as failure:
                if exception is None:
                    raise
                if failure is not exception:
                    exception.add_note(f'While the session closed: {failure!r}')

    def _close(self) -> None:
        """Clean up, then raise what went wrong: a failure, or a callback without end."""
        __tracebackhide__ = True
        if self._closed:
            return
        self._clean_up()
        self._rosout.print_warnings()
        if self._failures:
            raise self._failures[0]
        if self._endless:
            stuck = any(thread.is_alive() for thread in self._endless)
            raise RuntimeError(
                f'{len(self._endless)} callback(s) did not end within {CLOSE_TIMEOUT_S:g} s: '
                f'every callback must end{"; restart the kernel" if stuck else ""}.'
            )

    def _clean_up(self) -> None:
        """End all that this session has started."""
        global _open_session
        if self._closed:
            return
        self._end_threads(time.monotonic() + CLOSE_TIMEOUT_S)
        self._collect_failures()
        for executor in self._spinning:
            private.cancel_tasks(executor)
            executor.shutdown(timeout_sec=0)
        if self._rosout is not None:
            self._rosout.close()
        self._failures += destroy_nodes(self._context)
        rclpy.try_shutdown()
        uninstall_signal_handlers()
        self._shared.close()
        self._closed = True
        if _open_session is self:
            _open_session = None

    def _end_threads(self, deadline: float) -> None:
        for executor in self._spinning:
            private.end_spin(executor)
        for thread in self._spinning.values():
            self._join(thread, deadline)
        for executor in self._spinning:
            private.end_pool(executor)
        for thread in self.threads():
            self._join(thread, deadline)
        self._endless = [thread for thread in self.threads() if thread.is_alive()]
        for thread in self._endless:
            private.break_off(thread, SessionClosedError)
            thread.join(BREAK_OFF_S)

    def _join(self, thread: threading.Thread, deadline: float) -> None:
        """Wait for the end of a thread. A call in it that waits for an answer fails.

        After an interrupt or a failure, the cell will not set the Event at which a callback waits.
        """
        thread.join(min(2 * POLL_S, max(0.0, deadline - time.monotonic())))
        started = time.monotonic()
        while thread.is_alive() and time.monotonic() < deadline:
            if self._ended_by_exception and time.monotonic() > started + BREAK_OFF_S:
                private.break_off(thread, SessionClosedError)
            wait = private.wait_of(thread)
            for client in find(Client, self._context):
                private.fail_calls(client, SessionClosedError('The session closes.'))
            if wait is not None and (wait.in_call or self._ends_wait(wait, deadline)):
                wait.event.set()
            thread.join(25 * POLL_S)  # less often than POLL_S: to look for calls takes long

    def _ends_wait(self, wait: private.Wait, deadline: float) -> bool:
        """Whether a wait ends now: a short one ends by itself, unless it comes again and again."""
        left_s = deadline - time.monotonic()
        is_long = wait.timeout_s is None or wait.timeout_s > left_s - CLOSE_TIMEOUT_S / 2
        return self._ended_by_exception and is_long

    def threads(self) -> list[threading.Thread]:
        """Return the threads that run callbacks."""
        pools = [private.pool_threads(executor) for executor in self._spinning]
        return [*self._spinning.values(), *(thread for pool in pools for thread in pool)]


def is_used(node: Node) -> bool:
    """Return whether a node can be asked: one that was destroyed cannot."""
    try:
        with node.handle:
            return True
    except InvalidHandle:
        return False


def destroy_nodes(context: rclpy.Context) -> list[Exception]:
    """Destroy all nodes of a context, also those that no variable holds any more.

    Python collects the node of `Node('talker').create_publisher(...)`. What it has made stays, and
    keeps the participant. Returns the failures.
    """
    things = _objects(Node, *MADE_BY_NODES)
    nodes = [thing for thing in things if isinstance(thing, Node)]
    kept = {id(end) for node in nodes if hasattr(node, 'handle') for end in _made_by(node)}
    failures: list[Exception] = []
    with one_process_at_a_time():  # the last node ends the participant
        for node in _of(context, nodes):
            failures += _destroy(node)
        for thing in things:
            if isinstance(thing, MADE_BY_NODES) and id(thing) not in kept:
                failures += _failure(thing.destroy)
    return failures


def _made_by(node: Node) -> Iterator:
    return chain(node.publishers, node.subscriptions, node.clients, node.services)


def _destroy(node: Node) -> list[Exception]:
    """Destroy a node. Returns the failures."""
    own = hasattr(node, 'handle') and type(node).destroy_node is not Node.destroy_node
    return [
        # An executor that the cell spins itself holds what it found ready, while a variable holds
        # the executor.
        *_failure(lambda: node.executor.shutdown(timeout_sec=0)),
        *_failure(lambda: _destroy_actions(node)),
        *_failure(lambda: private.end_lifecycle(node)),
        *_failure(node.destroy_node, () if own else ALREADY_DESTROYED),
        *(_failure(lambda: Node.destroy_node(node)) if own else []),  # if its own one failed
        # A node whose __init__ failed or was interrupted has only some of its parts: destroy_node
        # misses one before it comes to the handle.
        *_failure(lambda: node.handle.destroy_when_not_in_use()),
    ]


def _failure(
    destroy: Callable[[], object], expected: tuple[type[Exception], ...] = ALREADY_DESTROYED
) -> list[Exception]:
    """Destroy something, and return what that raises and is not expected."""
    try:
        destroy()
    except expected:
        return []
    except Exception as failure:  # whatever it is, the rest must be destroyed, too
        return [failure]
    return []


def _destroy_actions(node: Node) -> None:
    """Destroy what destroy_node leaves, and with it the participant while a variable holds it."""
    for waitable in list(node.waitables):
        if isinstance(waitable, ActionClient | ActionServer):
            waitable.destroy()


def find(kind: type, context: rclpy.Context) -> Iterator:
    """Yield all that is of this kind in a context: nodes, clients, executors."""
    return _of(context, _objects(kind))


def _of(context: rclpy.Context, things: list) -> Iterator:
    return (thing for thing in things if getattr(thing, 'context', None) is context)


def _objects(*kinds: type) -> list:
    """Return all objects of these kinds. rclpy keeps no list of them, but each refers to its class.

    So Python's collector finds them: it looks through all that the kernel has, in C.
    """
    classes = set().union(*map(_with_subclasses, kinds))
    return [thing for thing in gc.get_referrers(*classes) if issubclass(type(thing), kinds)]


def _with_subclasses(kind: type) -> set[type]:
    return {kind}.union(*map(_with_subclasses, kind.__subclasses__()))


@atexit.register
def _close_at_exit() -> None:
    if _open_session is not None:
        _open_session._clean_up()
