"""What waits: for each thread, callback and coroutine what it waits for, and who could end that.

Only what was read is said. Code that computes, or sleeps for a while, waits for nothing.
"""

from __future__ import annotations

import ast
import contextlib
import queue
import re
import subprocess
import threading
from collections.abc import Callable
from concurrent import futures
from dataclasses import replace
from types import FrameType

import rclpy
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.client import Client
from rclpy.clock import Clock
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.publisher import Publisher
from rclpy.task import Future, Task
from rclpy.timer import Rate
from rclpy.wait_for_message import wait_for_message

from . import reading
from .blockers import (
    Blocker,
    Ender,
    blockers,
    clients_of,
    name_of,
    name_of_activity,
    nearly,
    of_clock,
    of_threads,
    of_topic,
    place_of,
    server_enders,
)
from .changers import changes, enders, methods_of
from .finding import Finding
from .loops import PEER_METHODS, exits, head, is_call, is_endless, may_end_by_itself
from .snapshot import (
    ENDS,
    SPINS,
    Activity,
    Snapshot,
    action_name,
    client_of_goal,
    executor_of,
    is_there,
    lock_of,
    threads_in,
    threads_of,
    timer_of,
)

LOCKS = (type(threading.Lock()), type(threading.RLock()))
RCLError = rclpy_implementation.RCLError
ENDLESS_S = 1e6
NOT_OF_A_LEARNER = ('/parameter_events', '/rosout', '/clock')


def find(snapshot: Snapshot) -> list[Finding]:
    """Return what waits, the stuck callbacks first, then the main thread, then all the others."""
    look = Look(snapshot)
    found = [finding for one in snapshot.activities if one.innermost if (finding := look.at(one))]
    main = threading.main_thread()
    return sorted(
        found,
        key=lambda finding: (
            not finding.stuck,
            finding.activity.task is None,
            finding.activity.thread is not main,
        ),
    )


class Look:
    """Finds the wait of an activity, once for each."""

    def __init__(self, snapshot: Snapshot) -> None:
        self.snapshot = snapshot
        self.known: dict[Activity, Finding | None] = {}
        self.open: list[Activity] = []  # those whose waits are looked for: a circle ends here

    def at(self, activity: Activity) -> Finding | None:
        if activity not in self.known:
            self.open.append(activity)
            self.known[activity] = None
            # What the program destroys meanwhile is not said: nothing stands still while we look.
            with contextlib.suppress(InvalidHandle, RCLError):
                found = self._look(activity)
                if found is not None:
                    found.enders = list(map(self._weigh, found.enders))
                self.known[activity] = found
            self.open.remove(activity)
        return self.known[activity]

    def _changers(self, waiter: Activity, *what: object) -> list[Ender]:
        return list(map(self._at_work, enders(self.snapshot, waiter, *what)))

    def _at_work(self, ender: Ender) -> Ender:
        """Add why the code that works on the end of a wait does not come to it."""
        stops = self._stops(ender.activity) if ender.activity is not None else ()
        return replace(ender, blockers=stops) if stops else ender

    def _weigh(self, ender: Ender) -> Ender:
        """Leave out what only takes long: a callback that works gives its thread back."""
        lasting = tuple(stop for stop in ender.blockers if self._lasts(stop))
        passing = [stop.text for stop in ender.blockers if stop not in lasting]
        now = f'not yet, for {"; ".join(passing)}' if passing and not lasting else ender.now
        return replace(ender, blockers=lasting, now=now)

    def _lasts(self, blocker: Blocker) -> bool:
        return all(self._stops(one) or is_endless(one) for one in blocker.holders)

    def _stops(self, activity: Activity) -> tuple[Blocker, ...]:
        """Return why something that runs does not come to its end: it waits itself."""
        for one in self.snapshot.activities:
            inner = one.thread is not None and one.thread is activity.thread
            if not one.innermost or not (one is activity or inner):
                continue
            if one in self.open:
                return (Blocker('circle', f'it waits, too, at {place_of(one)}', (one,)),)
            found = self.at(one)
            if found is not None and found.stuck:
                text = f'it waits for {found.what}, at {place_of(one)}'
                return (Blocker('held', text, (one,)),)
        return ()

    def _look(self, activity: Activity) -> Finding | None:
        if activity.suspended:
            own = next(iter(activity.own), None)
            name = ''
            if own is not None and isinstance(here := reading.expression_at(own), ast.Await):
                name = reading.last_name(here.value)
            return self._future(activity, activity.awaits, name)
        if not activity.own:
            return self._end_of_program(activity)
        innermost = activity.stack.index(activity.own[0])
        called = activity.stack[:innermost][::-1]
        found = self._of_library(activity, called) or self._of_line(activity)
        if found is None or found.limited or found.kind == 'sleep':
            found = self._of_loops(activity) or found
        return None if found is not None and found.kind == 'sleep' else found

    # --- Functions of libraries

    def _of_library(self, activity: Activity, called: list[FrameType]) -> Finding | None:
        for frame in called:
            read = KNOWN.get(frame.f_code)
            if read is None and frame.f_code in SPINS:
                read = Look.spin
            if read is None and frame.f_code.co_qualname == 'Session.wait_until':
                read = Look.predicate
            if read is not None:
                return read(self, activity, frame)
        return None

    def call(self, activity: Activity, frame: FrameType) -> Finding:
        client, timeout = frame.f_locals['self'], frame.f_locals.get('timeout_sec')
        return self._answer(activity, client, timeout is not None)

    def _answer(self, activity: Activity, client: object, limited: bool = False) -> Finding:
        what = f'the answer of {_server_of(client)}'
        found = list(map(self._at_work, server_enders(self.snapshot, client)))
        return Finding(activity, _kind(client), what, found, True, limited)

    def result(self, activity: Activity, frame: FrameType) -> Finding:
        client = client_of_goal(frame.f_locals['self'])
        return self._answer(activity, client)

    def peer(self, activity: Activity, frame: FrameType) -> Finding:
        timeout = frame.f_locals.get('timeout_sec')
        limited = timeout is not None and timeout < ENDLESS_S
        return self._server(activity, frame.f_locals['self'], limited)

    def _server(self, activity: Activity, client: object, limited: bool = False) -> Finding:
        ready = client.service_is_ready if isinstance(client, Client) else client.server_is_ready
        ends = server_enders(self.snapshot, client)[:1] if not ready() else []
        return Finding(activity, 'peer', f'{_server_of(client)} to be there', ends, True, limited)

    def rate(self, activity: Activity, frame: FrameType) -> Finding:
        timer = timer_of(frame.f_locals['self'])
        stops = blockers(self.snapshot, timer) if is_there(timer) else [_GONE]
        text = 'its timer would wake it, which an executor must run'
        ends = [Ender(text, tuple(stops), name='its timer', does='would wake it')]
        return Finding(activity, 'rate', 'the next time of a Rate', ends, True)

    def clock(self, activity: Activity, frame: FrameType) -> Finding:
        clock, until = frame.f_locals['self'], frame.f_locals['until']
        nodes = [node for node in self.snapshot.nodes if node.get_clock() is clock]
        stops = [stop for node in nodes for stop in of_clock(self.snapshot, node, clock)]
        left_s = (until - clock.now()).nanoseconds / 1e9
        text = 'the clock would reach it'
        ends = [Ender(text, tuple(stops), name='the clock', does='would reach it')]
        what = f'a time of its clock that is {left_s:.0f} s ahead'
        return Finding(activity, 'clock', what, ends, True, limited=not stops)

    def spin(self, activity: Activity, frame: FrameType) -> Finding:
        future = next(
            (
                one.f_locals['future']
                for one in activity.stack
                if one.f_code.co_name.endswith('until_future_complete')
                and isinstance(one.f_locals.get('future'), Future)
            ),
            None,
        )
        if future is not None:
            found = self._future(activity, future, self._argument(activity, future))
            found.spins = True
            found.limited = frame.f_locals.get('timeout_sec') is not None
            return found
        executor = activity.spins()
        text = "rclpy.shutdown(), or the executor's shutdown(), would end it"
        stops = [Blocker('spins', 'spin has no other end')] if activity.task else []
        limited = frame.f_locals.get('timeout_sec') is not None
        found = Finding(activity, 'spin', 'callbacks', [Ender(text, tuple(stops))], True, limited)
        found.enders += self._nothing_comes(executor)
        found.spins = True
        return found

    def _nothing_comes(self, executor: Executor | None) -> list[Ender]:
        """Return the subscriptions of an executor that no message can reach."""
        nodes = [
            node for node in self.snapshot.nodes if executor in self.snapshot.executors_of(node)
        ]
        return [
            Ender(f'{name_of(self.snapshot, one)}, would be called', tuple(stops))
            for node in nodes
            for one in node.subscriptions
            if one.topic_name not in NOT_OF_A_LEARNER
            and (stops := [*blockers(self.snapshot, one), *of_topic(one, node)])
        ]

    def _argument(self, activity: Activity, value: object) -> str:
        """Return the name by which the learner's line hands over a value."""
        here = reading.expression_at(activity.own[0])
        arguments = here.args + [word.value for word in here.keywords] if is_call(here) else []
        names = [
            reading.last_name(argument)
            for argument in arguments
            if reading.evaluate(argument, activity.own[0]) is value
        ]
        return next(iter(names), '')

    def message(self, activity: Activity, frame: FrameType) -> Finding:
        subscription, node = frame.f_locals.get('sub'), frame.f_locals['node']
        stops = of_topic(subscription, node) if subscription is not None else []
        limited = frame.f_locals.get('time_to_wait', -1) >= 0
        topic = frame.f_locals['topic']
        ends = [Ender('a publisher would send one', tuple(stops))]
        return Finding(activity, 'message', f'a message on {topic}', ends, True, limited)

    def predicate(self, activity: Activity, frame: FrameType) -> Finding | None:
        """Look at what a session of this course waits for: a function of the cell."""
        function = reading.function_of(frame.f_locals['predicate'].__code__)
        own = activity.own[0]
        atoms = list(ast.walk(function.body)) if isinstance(function, ast.Lambda) else []
        found = self._of_atoms(activity, own, atoms, ())
        text = reading.text_of(function.body) if isinstance(function, ast.Lambda) else 'a condition'
        return found or Finding(activity, 'variable', f'`{text}`')

    # --- What Python has to wait

    def event(self, activity: Activity, frame: FrameType) -> Finding:
        limited = frame.f_locals.get('timeout') is not None
        return self._by_name(activity, 'event', 'an Event to be set', {'set'}, limited)

    def condition(self, activity: Activity, frame: FrameType) -> Finding:
        limited = frame.f_locals.get('timeout') is not None
        methods = {'notify', 'notify_all'}
        return self._by_name(activity, 'condition', 'a Condition', methods, limited)

    def semaphore(self, activity: Activity, frame: FrameType) -> Finding:
        limited = frame.f_locals.get('timeout') is not None
        return self._by_name(activity, 'lock', 'a Semaphore', {'release'}, limited)

    def barrier(self, activity: Activity, frame: FrameType) -> Finding:
        barrier = frame.f_locals['self']
        if not barrier.n_waiting:  # all have come: this one is about to go on
            return Finding(activity, 'sleep', 'a Barrier that is open', limited=True)
        what = f'a Barrier: {barrier.n_waiting} of {barrier.parties} threads have come to it'
        return self._by_name(activity, 'event', what, {'wait', 'abort'}, False)

    def queue(self, activity: Activity, frame: FrameType) -> Finding:
        name = frame.f_code.co_name
        limited = frame.f_locals.get('timeout') is not None
        if name == 'put':
            size = frame.f_locals['self'].maxsize
            what = f'room in a queue that is full ({size})'
            return self._by_name(activity, 'queue', what, {'get', 'get_nowait'}, limited)
        if name == 'join':
            what = 'all that was put into a queue to be done'
            return self._by_name(activity, 'queue', what, {'task_done'}, limited)
        what = 'something in a queue that is empty'
        return self._by_name(activity, 'queue', what, {'put', 'put_nowait'}, limited)

    def _by_name(
        self, activity: Activity, kind: str, what: str, methods: set[str], limited: bool
    ) -> Finding:
        """Look for the code that calls a method of what the line names."""
        here = reading.expression_at(activity.own[0])
        owner = here.func.value if is_call(here) and isinstance(here.func, ast.Attribute) else here
        name = reading.last_name(owner)
        if name:
            what = f'{what} ({reading.text_of(owner)})'
        found = changes(self.snapshot, name, methods) if name else []
        verb = f'call {name}.{min(methods, key=len)}()'
        return Finding(activity, kind, what, self._changers(activity, found, verb), limited=limited)

    def join(self, activity: Activity, frame: FrameType) -> Finding:
        thread = frame.f_locals['self']
        limited = frame.f_locals.get('timeout') is not None
        what = f'the end of the thread {thread.name}'
        return Finding(activity, 'thread', what, [self._end_of(thread)], True, limited)

    def _end_of(self, thread: threading.Thread) -> Ender:
        text = f'the thread {thread.name} would end'
        runs = [one for one in self.snapshot.activities if one.thread is thread and one.innermost]
        if not runs:
            return Ender(text)
        one = runs[0]
        place = place_of(one)
        if any(frame.f_code in SPINS for other in self._of_thread(thread) for frame in other.stack):
            spins = 'it spins an executor, which ends only with rclpy.shutdown() or its shutdown()'
            return Ender(text, (Blocker('spins', spins),))
        found = self.at(one)
        if found is not None and found.stuck:
            waits = Blocker('held', f'it waits for {found.what}, at {place}', (one,))
            return Ender(text, (waits,), activity=one, does='would end')
        if loop := is_endless(one):
            stop = f'`{head(loop)}` in line {loop.lineno} has no end'
            return Ender(text, (Blocker('endless', stop),))
        return Ender(text, (), f'it is at {place}' if place else '')

    def _of_thread(self, thread: threading.Thread) -> list[Activity]:
        return [one for one in self.snapshot.activities if one.thread is thread]

    def pool(self, activity: Activity, frame: FrameType) -> Finding:
        pool = frame.f_locals['self']
        threads = threads_in(pool)
        busy = [self._end_of(thread) for thread in threads if self._is_busy(thread)]
        return Finding(activity, 'thread', 'the threads of a pool', busy, True)

    def _is_busy(self, thread: threading.Thread) -> bool:
        return any(one.own or one.task for one in self._of_thread(thread))

    def _end_of_program(self, activity: Activity) -> Finding | None:
        """Look at a main thread that has come to its end, and waits for other threads."""
        if activity.thread is not threading.main_thread():
            return None
        if not any(frame.f_code in ENDS for frame in activity.stack):
            return None
        left = [
            thread
            for thread in threading.enumerate()
            if thread is not activity.thread and not thread.daemon and self._is_busy(thread)
        ]
        ends = [self._end_of(thread) for thread in left]
        return Finding(activity, 'end', 'threads that have not ended', ends, True)

    def process(self, activity: Activity, frame: FrameType) -> Finding:
        process = frame.f_locals['self']
        limited = frame.f_locals.get('timeout') is not None
        args = process.args if isinstance(process.args, str) else ' '.join(map(str, process.args))
        what = f'the end of a process: {args}'
        return Finding(activity, 'process', what, limited=limited)

    def concurrent(self, activity: Activity, frame: FrameType) -> Finding:
        limited = frame.f_locals.get('timeout') is not None
        return Finding(activity, 'pool', 'the result of a function in a pool', limited=limited)

    # --- Futures

    def _future(self, activity: Activity, future: object, name: str) -> Finding:
        clients = clients_of(self.snapshot, future)
        if clients:
            return self._answer(activity, clients[0])
        if isinstance(future, Task):
            return self._task(activity, future)
        methods = {'set_result', 'set_exception', 'cancel'}
        found = changes(self.snapshot, name, methods) if name else []
        what = f'a future to be done ({name})' if name else 'a future to be done'
        ends = self._changers(activity, found, 'finish it')
        return Finding(activity, 'future', what, ends)

    def _task(self, activity: Activity, task: Task) -> Finding:
        executor = executor_of(task)
        stops = []
        if executor is None or not self.snapshot.spinners(executor):
            stops = [Blocker('not spun', 'nobody spins its executor')]
        elif held := [one for one in self.snapshot.held_by(executor) if one.task is not task]:
            stops = [of_threads(threads_of(executor), held)]
        else:
            inner = [one for one in self.snapshot.activities if one.task is task and one.innermost]
            for one in inner:
                found = self.at(one)
                if found is not None and found.stuck:
                    stops = [Blocker('held', f'it waits for {found.what}', (one,))]
        text = 'the executor would run the task to its end'
        ends = [Ender(text, tuple(stops), name='the task', does='would end')]
        return Finding(activity, 'future', 'a task of an executor', ends, True)

    # --- A line that waits in C

    def _of_line(self, activity: Activity) -> Finding | None:
        frame = activity.own[0]
        here = reading.expression_at(frame)
        thing = here
        if is_call(here):
            function = reading.evaluate(here.func, frame)
            if getattr(function, '__module__', None) == 'time' and function.__name__ == 'sleep':
                return Finding(activity, 'sleep', 'a while', limited=True)
            if getattr(function, '__name__', '') in ('input', 'raw_input'):
                return Finding(activity, 'input', 'somebody who types')
            if not isinstance(here.func, ast.Attribute):
                return None
            thing = here.func.value
            if here.func.attr == 'get' and self._is(thing, frame, queue.SimpleQueue):
                what = 'something in a queue that is empty'
                return self._by_name(activity, 'queue', what, {'put'}, bool(here.args))
            if here.func.attr != 'acquire':
                return None
        lock = reading.evaluate(thing, frame)
        if isinstance(lock, LOCKS) and (not is_call(here) or not (here.args or here.keywords)):
            return self._lock(activity, lock, thing)
        return None

    def _is(self, expression: ast.AST, frame: FrameType, kind: type) -> bool:
        return isinstance(reading.evaluate(expression, frame), kind)

    def enter_condition(self, activity: Activity, frame: FrameType) -> Finding:
        lock = lock_of(frame.f_locals['self'])
        return self._lock(activity, lock, reading.expression_at(activity.own[0]))

    def _lock(self, activity: Activity, lock: object, expression: ast.AST) -> Finding:
        name = reading.text_of(expression)
        ends = []
        for other, frame in self._holders(lock):
            where = f'in line {frame.f_lineno} of {frame.f_code.co_name}()'
            if other.thread is activity.thread and not other.suspended:
                text = f'it is the same thread, {where}: a Lock lets no thread in twice'
                stop = Blocker('itself', text, (activity,))
                line = f'the end of the `with` in line {frame.f_lineno}'
                text = 'who holds it would leave its `with`'
                ends.append(Ender(text, (stop,), name=line, does='would free it'))
                continue
            ends.append(self._leaves(other, where))
        if not ends:
            found = changes(self.snapshot, reading.last_name(expression), {'release'})
            ends = self._changers(activity, found, 'release it')
            name += '; no `with` that runs now holds it, so somebody has called acquire()'
        short = f'a lock ({reading.text_of(expression)})'
        return Finding(activity, 'lock', f'a lock ({name})', ends, short=short)

    def _leaves(self, holder: Activity, where: str) -> Ender:
        text = f'{name_of_activity(holder)}, {where}, would leave its `with`'
        stops = self._stops(holder)
        now = '' if stops else f'it is at {place_of(holder)}'
        return Ender(text, stops, now, holder, does='holds it', label='held by')

    def _holders(self, lock: object) -> list[tuple[Activity, FrameType]]:
        owner = re.search(r'owner=(\d+)', repr(lock))
        found = []
        for activity in self.snapshot.activities:
            for frame in activity.own:
                things = list(reading.entered(frame))
                things += [lock_of(thing) for thing in things]
                if any(thing is lock for thing in things):
                    found.append((activity, frame))
        if found or owner is None:
            return found
        ident = int(owner[1])
        return [
            (one, one.own[0])
            for one in self.snapshot.activities
            if one.thread and one.thread.ident == ident and one.innermost and one.own
        ]

    # --- A loop that asks again and again

    def _of_loops(self, activity: Activity) -> Finding | None:
        for frame in activity.own:
            for loop in reading.loops_around(frame):
                if not isinstance(loop, ast.While):
                    return None  # a `for` ends by itself
                atoms = [atom for test in exits(loop) for atom in ast.walk(test)]
                if any(may_end_by_itself(atom, frame) for atom in atoms):
                    return None
                found = self._of_atoms(activity, frame, atoms, loop)
                if found is not None:
                    found.loops = True
                    return found
        return None

    def _of_atoms(self, activity: Activity, frame: FrameType, atoms: list, loop) -> Finding | None:
        """Return the wait for what a condition names, if it names something that is known."""
        for atom in atoms:
            if not (is_call(atom) and isinstance(atom.func, ast.Attribute)):
                continue
            thing, method = reading.evaluate(atom.func.value, frame), atom.func.attr
            name = reading.last_name(atom.func.value)
            if isinstance(thing, Future) and method == 'done' and not thing.done():
                return self._future(activity, thing, name)
            if isinstance(thing, threading.Event) and not thing.is_set():
                sets = changes(self.snapshot, name, {'set'})
                found = self._changers(activity, sets, f'call {name}.set()')
                return Finding(activity, 'event', f'an Event to be set ({name})', found)
            if isinstance(thing, Client | ActionClient) and method in PEER_METHODS:
                return self._server(activity, thing)
            if isinstance(thing, Publisher) and method == 'get_subscription_count':
                return self._subscriber(activity, thing)
            if isinstance(thing, threading.Thread) and method == 'is_alive':
                what = f'the end of the thread {thing.name}'
                return Finding(activity, 'thread', what, [self._end_of(thing)], True)
        for atom in atoms:
            name = reading.last_name(atom) if isinstance(atom, ast.Attribute | ast.Name) else ''
            value = reading.evaluate(atom, frame)
            if not name or _is_of_library(value):
                continue
            found = changes(self.snapshot, name)
            if loop and any(
                change.filename == frame.f_code.co_filename
                and loop.lineno <= change.line <= loop.end_lineno
                for change in found
            ):
                continue
            ends = [
                *methods_of(self.snapshot, value),
                *self._changers(activity, found),
            ]
            if ends:
                what = f'`{reading.text_of(atom)}` to change'
                return Finding(activity, 'variable', what, ends)
        return None

    def _subscriber(self, activity: Activity, publisher: Publisher) -> Finding:
        name = publisher.topic_name
        stops = []
        if publisher.get_subscription_count() == 0:
            node = next(
                (node for node in self.snapshot.nodes if publisher in node.publishers), None
            )
            topics = [topic for topic, _ in node.get_topic_names_and_types()] if node else []
            stops = [Blocker('no peer', f'nobody subscribes to {name}{nearly(name, topics)}')]
        ends = [Ender('a subscription would be found', tuple(stops))]
        return Finding(activity, 'peer', f'a subscription to {name}', ends, True)


_GONE = Blocker('gone', 'it was destroyed')
KNOWN: dict[object, Callable] = {
    Client.call.__code__: Look.call,
    ActionClient.send_goal.__code__: Look.call,
    ClientGoalHandle.get_result.__code__: Look.result,
    ClientGoalHandle.cancel_goal.__code__: Look.result,
    Client.wait_for_service.__code__: Look.peer,
    ActionClient.wait_for_server.__code__: Look.peer,
    Rate.sleep.__code__: Look.rate,
    Clock.sleep_until.__code__: Look.clock,
    rclpy.spin.__code__: Look.spin,
    rclpy.spin_once.__code__: Look.spin,
    rclpy.spin_until_future_complete.__code__: Look.spin,
    wait_for_message.__code__: Look.message,
    threading.Event.wait.__code__: Look.event,
    threading.Condition.wait.__code__: Look.condition,
    threading.Condition.wait_for.__code__: Look.condition,
    threading.Condition.__enter__.__code__: Look.enter_condition,
    threading.Semaphore.acquire.__code__: Look.semaphore,
    threading.Barrier.wait.__code__: Look.barrier,
    threading.Thread.join.__code__: Look.join,
    queue.Queue.get.__code__: Look.queue,
    queue.Queue.put.__code__: Look.queue,
    queue.Queue.join.__code__: Look.queue,
    futures.Future.result.__code__: Look.concurrent,
    futures.ThreadPoolExecutor.shutdown.__code__: Look.pool,
    subprocess.Popen.wait.__code__: Look.process,
    subprocess.Popen.communicate.__code__: Look.process,
}


def _kind(client: object) -> str:
    return 'action' if isinstance(client, ActionClient) else 'service'


def _server_of(client: object) -> str:
    if isinstance(client, ActionClient):
        return f'the action {action_name(client)}'
    return f'the service {client.srv_name}'


def _is_of_library(value: object) -> bool:
    """Return whether a name stands for a module, a class or a function: nobody changes it."""
    return callable(value) or type(value).__name__ == 'module'


__all__ = ['Finding', 'find']
