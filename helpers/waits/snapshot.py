"""What runs in this process at one moment: threads, callbacks, coroutines that wait, executors."""

from __future__ import annotations

import gc
import inspect
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import thread as thread_pool
from dataclasses import dataclass, field
from types import CodeType, FrameType

from rclpy.action import ActionClient, ActionServer
from rclpy.action.client import ClientGoalHandle
from rclpy.callback_groups import CallbackGroup
from rclpy.client import Client
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future, Task
from rclpy.timer import Rate, Timer

from . import reading

# private: an executor, rclpy 7.1.6
HANDLER = Executor._make_handler.__code__
SPINS = {
    method.__code__
    for kind in (Executor, SingleThreadedExecutor, MultiThreadedExecutor)
    for name, method in vars(kind).items()
    if name.lstrip('_').startswith('spin') and inspect.isfunction(method)
}
# private: an action server, rclpy 7.1.6
EXECUTES_GOAL = {ActionServer._execute_goal.__code__}
# private: threading, Python 3.11.7
ENDS = {threading._shutdown.__code__}
# private: concurrent.futures.thread, Python 3.11.7
ENDS.add(thread_pool._python_exit.__code__)
RUNS_TASK = Task.__call__.__code__


@dataclass(eq=False)
class Activity:
    """Code that runs or waits: of a thread, or a coroutine that is suspended.

    `stack` has its frames, the innermost first. Where a callback spins, and so runs another one,
    each of them is an activity; `innermost` says that nothing runs inside of it.
    """

    stack: list[FrameType]
    thread: threading.Thread | None = None
    task: Task | None = None
    entity: object = None
    innermost: bool = True
    awaits: object = None  # a future, for a coroutine that is suspended

    @property
    def own(self) -> list[FrameType]:
        """Return the frames of the learner's code, the innermost first."""
        return [frame for frame in self.stack if reading.is_own(frame)]

    @property
    def suspended(self) -> bool:
        return self.thread is None

    def spins(self) -> Executor | None:
        """Return the executor that this code spins itself."""
        for frame in self.stack:
            if frame.f_code in SPINS:
                return frame.f_locals.get('self')
        return None


@dataclass(eq=False)
class Snapshot:
    """All of it. `ignore` are the threads that look, not the ones that are looked at."""

    main_frame: FrameType | None = None
    ignore: tuple[int, ...] = ()
    activities: list[Activity] = field(default_factory=list)

    def __post_init__(self) -> None:
        things = _objects(Node, Executor, Client)
        self.nodes = [thing for thing in things if isinstance(thing, Node) and is_there(thing)]
        self.nodes.sort(key=lambda node: node.get_fully_qualified_name())
        self.executors = [thing for thing in things if isinstance(thing, Executor)]
        self.clients = [thing for thing in things if isinstance(thing, Client)]
        for thread, frame in _frames(self.main_frame):
            if thread.ident not in self.ignore:
                self.activities += _split(thread, frame)
        for executor in self.executors:
            self.activities += _suspended(executor)

    # --- Who has what

    def entities(self) -> Iterator[tuple[Node, object]]:
        """Yield all that has a callback, with its node."""
        for node in self.nodes:
            for things in (
                *(node.subscriptions, node.timers, node.services, node.clients),
                *(node.guards, node.waitables),
            ):
                for thing in things:
                    yield node, thing

    def node_of(self, entity: object) -> Node | None:
        return next((node for node, thing in self.entities() if thing is entity), None)

    def executors_of(self, node: Node) -> list[Executor]:
        """Return the executors that a node is in: one, or none."""
        # private: an executor, rclpy 7.1.6
        return [executor for executor in self.executors if node in executor._nodes]

    def holder_of(self, group: CallbackGroup | None) -> tuple[object, Activity | None]:
        """Return what a group lets run at the moment, and the activity of it."""
        # private: a MutuallyExclusiveCallbackGroup, rclpy 7.1.6
        entity = getattr(group, '_active_entity', None)
        found = (activity for activity in self.activities if activity.entity is entity)
        return entity, next(found, None) if entity is not None else None

    # --- Who works for an executor

    def spinners(self, executor: Executor) -> list[Activity]:
        """Return what spins an executor at this moment."""
        return [activity for activity in self.activities if activity.spins() is executor]

    def held_by(self, executor: Executor) -> list[Activity]:
        """Return the callbacks that hold the threads of an executor. If one is free, none."""
        spinners = self.spinners(executor)
        pool = pool_of(executor)
        if pool is None:
            if not spinners or any(spinner.innermost for spinner in spinners):
                return []
            threads = {spinner.thread for spinner in spinners}
            runs = [one for one in self.activities if one.thread in threads and one.innermost]
            return [one for one in runs if one.task is not None]
        # private: a ThreadPoolExecutor, Python 3.11.7
        threads, most = list(pool._threads), pool._max_workers
        runs = [one for one in self.activities if one.thread in threads and one.task is not None]
        busy = {one.thread for one in runs}
        return [one for one in runs if one.innermost] if len(busy) >= most else []


def pool_of(executor: Executor) -> ThreadPoolExecutor | None:
    """Return the pool that runs the callbacks of a MultiThreadedExecutor. Others have none."""
    # private: a MultiThreadedExecutor, rclpy 7.1.6
    return getattr(executor, '_executor', None)


def threads_of(executor: Executor) -> int:
    """Return how many threads run its callbacks."""
    pool = pool_of(executor)
    return 1 if pool is None else pool._max_workers  # private: a ThreadPoolExecutor, Python 3.11.7


def is_there(thing: object) -> bool:
    """Return whether a node or what it has made can be used: it may be destroyed."""
    try:
        with thing.handle:
            return True
    except (InvalidHandle, AttributeError):
        return False


def action_name(client: ActionClient) -> str:
    """Return the name of an action as its client was given it."""
    return client._action_name  # private: an action client, rclpy 7.1.6


def client_of_goal(handle: ClientGoalHandle) -> ActionClient:
    return handle._action_client  # private: a goal handle, rclpy 7.1.6


def executor_of(task: Task) -> Executor | None:
    return task._executor()  # private: a task, rclpy 7.1.6


def timer_of(rate: Rate) -> Timer:
    return rate._timer  # private: a rate, rclpy 7.1.6


def threads_in(pool: ThreadPoolExecutor) -> list[threading.Thread]:
    return list(pool._threads)  # private: a ThreadPoolExecutor, Python 3.11.7


def lock_of(condition: object) -> object:
    """Return the lock of a Condition, None for anything else."""
    return getattr(condition, '_lock', None)  # private: a Condition, Python 3.11.7


def pending(client: object) -> list[Future]:
    """Return the futures of a client, or an action client, that wait for an answer."""
    if isinstance(client, ActionClient):
        requests = [
            client._pending_goal_requests,  # private: an action client, rclpy 7.1.6
            client._pending_cancel_requests,  # private: an action client, rclpy 7.1.6
            client._pending_result_requests,  # private: an action client, rclpy 7.1.6
        ]
    else:
        requests = [client._pending_requests]  # private: a client, rclpy 7.1.6
    return [future for futures in requests for future in list(futures.values())]


def done_callbacks(future: Future) -> list:
    return list(future._callbacks)  # private: a future, rclpy 7.1.6


def code_of(callback: object) -> CodeType | None:
    """Return the code of a callback: a function, a method, a partial."""
    while hasattr(callback, 'func'):
        callback = callback.func
    callback = getattr(callback, '__func__', callback)
    if not hasattr(callback, '__code__'):
        callback = getattr(type(callback), '__call__', None)  # noqa: B004 - its code is wanted
    return getattr(inspect.unwrap(callback), '__code__', None) if callback else None


def callback_of(entity: object) -> object:
    """Return what an entity calls, None for a client."""
    if isinstance(entity, ActionServer):
        return entity._execute_callback  # private: an action server, rclpy 7.1.6
    return getattr(entity, 'callback', None)


def _objects(*kinds: type) -> list:
    """Return all objects of these kinds. rclpy keeps no list of them; the collector knows them."""
    classes = set().union(*map(_with_subclasses, kinds))
    return [thing for thing in gc.get_referrers(*classes) if issubclass(type(thing), kinds)]


def _with_subclasses(kind: type) -> set[type]:
    return {kind}.union(*map(_with_subclasses, kind.__subclasses__()))


def _frames(main_frame: FrameType | None) -> list[tuple[threading.Thread, FrameType]]:
    collects = gc.isenabled()
    try:
        # Before Python 3.11.9, a collection that frees a threading.local hangs in the next call:
        # https://github.com/python/cpython/issues/106883
        gc.disable()
        # private: sys, Python 3.11.7
        current = sys._current_frames()  # noqa: SLF001 - documented, in spite of its name
    finally:
        if collects:
            gc.enable()
    if main_frame is not None:
        current[threading.main_thread().ident] = main_frame
    threads = {thread.ident: thread for thread in threading.enumerate()}
    main = threading.main_thread()
    threads.setdefault(main.ident, main)  # it has ended, and waits for the others
    return [(thread, current[ident]) for ident, thread in threads.items() if ident in current]


def _split(thread: threading.Thread, frame: FrameType) -> list[Activity]:
    """Return the activities of a thread, the innermost first: each callback that it is in."""
    found, stack = [], []
    while frame is not None:
        stack.append(frame)
        if frame.f_code is RUNS_TASK:
            task = frame.f_locals.get('self')
            found.append(Activity(stack, thread, task, _entity(stack), innermost=not found))
            stack = []
        frame = frame.f_back
    return [*found, Activity(stack, thread, innermost=not found)]


def _entity(stack: list[FrameType]) -> object:
    for frame in stack:
        if frame.f_code in HANDLER.co_consts:
            return frame.f_locals.get('entity')
        # A goal is executed in a task of its own, which no group protects.
        owner = frame.f_locals.get('self') if frame.f_code in EXECUTES_GOAL else None
        if isinstance(owner, ActionServer):
            return owner
    return None


def _tasks_of(executor: Executor) -> list[Task]:
    """Return the tasks that an executor keeps: in a list of tuples, from rclpy 7.1.9 on in a dict.

    https://github.com/ros2/rclpy/pull/1560
    """
    kept = [part for part in vars(executor).values() if isinstance(part, list | dict)]
    things = [thing[0] if isinstance(thing, tuple) else thing for part in kept for thing in [*part]]
    return list(dict.fromkeys(thing for thing in things if isinstance(thing, Task)))


def _suspended(executor: Executor) -> Iterator[Activity]:
    """Yield the coroutines that an executor will continue."""
    for task in _tasks_of(executor):
        coroutine = task._handler  # private: a task, rclpy 7.1.6
        stack, awaits = [], None
        while coroutine is not None:
            frame = getattr(coroutine, 'cr_frame', None) or getattr(coroutine, 'gi_frame', None)
            if frame is not None:
                stack.append(frame)
                if frame.f_code is Future.__await__.__code__:
                    awaits = frame.f_locals.get('self')
            coroutine = getattr(coroutine, 'cr_await', None) or getattr(
                coroutine, 'gi_yieldfrom', None
            )
        if awaits is not None:
            stack = stack[::-1]
            yield Activity(stack, task=task, entity=_entity(stack), awaits=awaits)
