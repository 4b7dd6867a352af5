"""What the tasks of the lesson "Run callbacks in parallel" are judged by."""

import threading
import time
from contextlib import contextmanager, nullcontext

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from std_msgs.msg import Int32, String

from helpers.checks.bench import Bench, must_be_called, must_define, must_have, one_cpu
from helpers.checks.errors import Failed, NeverEnds
from helpers.checks.points import all_of, cached, expect, in_turn, rows
from helpers.checks.tasks import Tasks
from helpers.ros import ros_session
from helpers.trials import callbacks_at_once

tasks = Tasks()
check = tasks.check

QUIET = SubscriptionEventCallbacks(use_default_callbacks=False)
DEPTH = 10  # of `camera_and_battery`
MORE_S = 0.3  # for a callback that no message has called


@tasks.add
def a_subscriber_with_a_group(SlowSubscriber, DEPTH, CALLBACK_S):
    def hears(group):
        must_define(SlowSubscriber, '__init__')
        with Bench() as bench:
            node, executor = SlowSubscriber(group), SingleThreadedExecutor()
            must_be_called(node, 'slow_subscriber')
            must_have(node, 'subscription')
            executor.add_node(node)
            bench.publisher('topic', String).publish(String(data='Hello World: 0'))
            begun_s, begun_cpu_s = time.monotonic(), time.thread_time()
            with sleeps() as slept_s:
                executor.spin_once(timeout_sec=CALLBACK_S / 2)  # nothing heard: it waits no longer
            took_s, cpu_s = time.monotonic() - begun_s, time.thread_time() - begun_cpu_s
            subscription = node.subscription
        if subscription.callback_group is not group:
            return 'its subscription is in another group'
        if handlers := len(subscription.event_handlers):
            return f'it has {handlers} event handlers: event_callbacks=QUIET takes them away'
        return all_of(
            expect(subscription.qos_profile.depth, DEPTH, 'its depth is'),
            took_s >= CALLBACK_S or 'no callback slept for CALLBACK_S seconds when a message came',
            cpu_s < CALLBACK_S / 2 or 'the callback does not sleep: it keeps a CPU busy',
            expect(sum(slept_s) or CALLBACK_S, CALLBACK_S, 'it sleeps for', within=0.001, unit='s'),
        )

    made = 'super().__init__(name), then self.subscription = self.create_subscription(...).'
    passed = 'Pass on the group that __init__ gets.'
    exclusive, reentrant = MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
    return [
        ('it receives and sleeps, in an exclusive group', lambda: hears(exclusive()), made),
        ('it receives and sleeps, in a reentrant group', lambda: hears(reentrant()), passed),
    ]


@contextmanager
def sleeps():
    """Yield a list to which each `time.sleep` adds its seconds."""
    sleep, slept_s = time.sleep, []
    time.sleep = lambda seconds: (slept_s.append(seconds), sleep(seconds))
    try:
        yield slept_s
    finally:
        time.sleep = sleep


@tasks.add
def four_combinations(combination, THREADS):
    def make(letter):
        with one_cpu():
            return combination(letter)

    def is_combination(letter, executor, group, at_once):
        with ros_session():
            names = [name_of(thing) for thing in make(letter)]
        if names != (right := [executor.__name__, group.__name__]):
            return expect(names, right, f'combination({letter!r}) gives')
        found = callbacks_at_once(lambda: make(letter))
        return expect(found, at_once, f'callbacks that run at the same time with {letter}:')

    single, multi = SingleThreadedExecutor, MultiThreadedExecutor
    exclusive, reentrant = MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
    hint = 'Look at its row of the table. Are there () after both names, and num_threads=THREADS?'
    return rows(
        is_combination,
        hint,
        ('combination A', 'A', single, exclusive, 1),
        ('combination B', 'B', single, reentrant, 1),
        ('combination C', 'C', multi, exclusive, 1),
        ('combination D', 'D', multi, reentrant, THREADS),
    )


def name_of(thing):
    if isinstance(thing, type):
        return f'the class {thing.__name__}'
    return type(thing).__name__


@tasks.add
def camera_and_battery(TwoTopics, make_my_executor):
    def called(*topics, cpus=one_cpu):
        """Send messages while the first picture is worked on.

        Return the topics of the calls until then, and of all calls when the work has ended.
        """
        must_define(TwoTopics, 'camera_callback', 'battery_callback')
        calls = []
        with Bench() as bench:
            gate = bench.gate()

            class Tried(TwoTopics):
                def camera_callback(self, message):
                    calls.append('camera')
                    gate.hold()

                def battery_callback(self, message):
                    calls.append('battery')

            with cpus():
                executor = make_my_executor()
            node = Tried()
            found = {made.topic_name.strip('/'): made for made in node.subscriptions}
            for topic in ('camera', 'battery'):
                if topic not in found:
                    raise Failed(f'there is no subscription on {topic}')
                depth = found[topic].qos_profile.depth
                if depth != DEPTH:
                    raise Failed(f'the depth of {topic} is {depth}, not {DEPTH}', hint='')
                without_event_handlers(node, found[topic])
            bench.spin(node, executor=executor)
            for topic in topics:
                bench.say(topic, Int32())
            until_then = [*calls]
            gate.open()
            bench.wait(lambda: len(calls) > len(topics), MORE_S)
            return until_then, [*calls]

    def battery_is_heard(*topics):
        heard, wanted = called(*topics)[0].count('battery'), topics.count('battery')
        if heard == wanted:
            return True
        found = f'meanwhile {heard} of {wanted} battery messages were received'
        needs_cpus = called(*topics, cpus=nullcontext)[0].count('battery') == wanted
        return f'on a computer with one CPU, {found}' if needs_cpus else found

    def one_picture():
        until_then, calls = called('camera', 'camera', 'camera')
        pictures = until_then.count('camera')
        return all_of(
            expect(pictures, 1, 'pictures that it worked on at the same time:'),
            expect(len(calls), 3, 'for three messages, calls of camera_callback:'),
        )

    hint = 'Which callback blocks which group? How many threads are still free?'
    more = 'camera', 'camera', 'battery', 'camera', 'battery'
    return [
        *rows(
            battery_is_heard,
            hint,
            ('the battery is received while the camera works', 'camera', 'battery'),
            ('even when more pictures wait', *more),
        ),
        ('the camera works on one picture at a time', one_picture, 'Which group forbids two?'),
    ]


def without_event_handlers(node, subscription):
    """Take them away: if all threads are held, those of a Reentrant group are never quiet."""
    for handler in subscription.event_handlers:
        node.remove_waitable(handler)
    subscription.event_handlers.clear()


@tasks.add
def wait_for_the_small_one(UnequalSubscriber):
    def finish_in_order(threads):
        with Bench() as bench:
            node = UnequalSubscriber()
            node.small_one_done = LateEvent(node.finished)
            bench.spin(node, threads=threads)
            bench.say('number', Int32(data=0))
            if node.finished:
                return 'number 0 finished before number 1 came'
            if node.small_one_done.is_set():
                return 'number 0 does not wait'
            bench.say('number', Int32(data=1))
        if None in node.small_one_done.limits_s:
            return 'wait() has no timeout: if number 1 never comes, a thread waits for ever'
        return expect(node.finished, [1, 0], 'they finished in the order')

    def sets_the_event():
        with ros_session():
            subscriber = UnequalSubscriber()
            subscriber.number_callback(Int32(data=2))
            if subscriber.small_one_done.is_set():
                return 'number 2 sets the event'
            subscriber.number_callback(Int32(data=1))
            return subscriber.small_one_done.is_set() or 'number 1 does not set the event'

    hint = 'Two ifs: one before append, one after it.'
    return [
        ('two threads: first 1, then 0', lambda: finish_in_order(2), hint),
        ('eight threads: first 1, then 0', lambda: finish_in_order(8), hint),
        ('only number 1 sets the event', sets_the_event, hint),
    ]


class LateEvent(threading.Event):
    """An Event after whose set() another thread goes on first, until it has finished something."""

    def __init__(self, finished):
        super().__init__()
        self.finished = finished
        self.limits_s = []

    def wait(self, timeout=None):
        """Wait for it, as every Event does, and note for how long at most."""
        self.limits_s.append(timeout)
        return super().wait(timeout)

    def set(self):
        """Set it, and let another thread finish, if none has: 1 s at most."""
        super().set()
        end_s = time.monotonic() + 1
        while not self.finished and time.monotonic() < end_s:
            time.sleep(POLL_S)


@tasks.add
def take_a_lock(LockingSubscriber):
    forty, fewer = two_trials(LockingSubscriber, 'count')

    def counts(trial, messages):
        found = trial().values['count']
        if found != messages:
            return f'the counter is too {"low" if found < messages else "high"}'
        return trial().never_goes_back

    return [
        *rows(
            counts,
            'Read and write in one block.',
            ('40 messages: the counter shows 40', forty, 40),
            ('24 messages: the counter shows 24', fewer, 24),
        ),
        (
            'the work still overlaps',
            lambda: work_overlaps(forty()),
            'What needs the lock, and what does not?',
        ),
    ]


@tasks.add
def an_odometer(Odometer):
    forty, fewer = two_trials(Odometer, 'total', 'longest')

    def shows(trial, count):
        if trial().name != 'odometer':
            return expect(trial().name, 'odometer', 'the name of the node is')
        for name, value in trial().first.items():
            if value != 0:
                return f'before the first distance, self.{name} is {value!r}, not 0'
        right = {'total': sum(range(1, count + 1)), 'longest': count}
        wrong = [name for name in right if trial().values[name] != right[name]]
        if wrong:
            return f'after {count} distances, wrong: self.{" and self.".join(wrong)}'
        return trial().never_goes_back

    def one_by_one():
        """Let it hear 5 and 3 in one thread, and note its numbers when it appends."""
        appended = []

        class Noted(list):
            def append(self, number):
                appended.append((node.total, node.longest))
                super().append(number)

        with Bench() as bench:
            node = Odometer()
            node.finished = Noted()
            bench.spin(node)
            bench.say('number', Int32(data=5), Int32(data=3))
        both = 'self.total, self.longest'
        return all_of(
            expect([*node.finished], [5, 3], '5 and 3 came: self.finished is'),
            expect(appended or right, right, f'when it appends, {both} are'),
        )

    right = [(5, 5), (8, 5)]
    compare = 'Compare with LockingSubscriber. super()?'
    reads = 'max(a, b) reads, too: keep it in the lock.'
    overlaps = 'What is inside the lock? In which group?'
    return [
        ('40 distances', lambda: in_turn(lambda: shows(forty, 40), one_by_one), compare),
        ('24 distances', lambda: shows(fewer, 24), reads),
        ('the work still overlaps', lambda: work_overlaps(forty()), overlaps),
    ]


def two_trials(node_class, *names):
    """Let a node hear 1 to 40, and another one 24 to 1: the longest comes first then."""

    @cached
    def forty():
        return hear_numbers(node_class, range(1, 41), names)

    @cached
    def fewer():
        forty()  # what it raises is found again, without another wait
        return hear_numbers(node_class, range(24, 0, -1), names)

    return forty, fewer


def work_overlaps(trial):
    calls = len(trial.at_work)
    if calls != 40:
        return expect(calls, 40, 'for 40 messages, calls of self.work():')
    return max(trial.at_work) > 1 or 'the calls of self.work() came one after the other'


# --- Threads that switch at the worst moments

STANDS_S = 2.0  # without another callback that ends, the others wait for what is held
POLL_S = 0.002


class Trial:
    """What a node of the student did with numbers: `values`, and how many were `at_work` each time.

    Its numbers only grow. `went_back` has what was written over a larger one.
    """

    def __init__(self, messages):
        self.values, self.at_work, self.went_back = {}, [], []
        self.name, self.first = '', {}  # of the node; the values before a message came
        self.node = None  # until it is made, nothing is held
        self._messages = messages
        self._places, self._held = set(), 0
        self._one_by_one = threading.Lock()
        self._waits_for = {}  # a watched lock, by the thread that waits for it

    @property
    def never_goes_back(self):
        """True, or a text that says what was written over what."""
        return (
            not self.went_back or f'a late thread writes over a newer number: {self.went_back[0]}'
        )

    def watch(self, name):
        """Return a property: the first callback that has read it is held, and one that writes it.

        So all others read and write in between, if no lock keeps them away.
        """

        def read(node):
            if name not in self.values:
                raise AttributeError(f'there is no self.{name} yet')
            value = self.values[name]
            self.hold(f'has read {name}')
            return value

        def write(node, value):
            self.hold(f'will write {name}')
            if value < self.values.get(name, value):
                self.went_back.append(f'self.{name} was {self.values[name]}, and is {value}')
            self.values[name] = value

        return property(read, write)

    def watch_locks(self, node):
        """Let the locks of a node say which thread has them, and which waits for them."""
        kinds = type(threading.Lock()), type(threading.RLock())
        owners = [*reversed(type(node).__mro__), node]
        named = {name: value for owner in owners for name, value in vars(owner).items()}
        for name, value in named.items():
            if type(value) in kinds:
                setattr(node, name, WatchedLock(value, self))

    def hold(self, place):
        """Hold the first callback that comes to a place, until all others end or wait for it."""
        with self._one_by_one:
            node = self.node
            if node is None or place in self._places:
                return
            self._places.add(place)
            self._held += 1
        me, ended, end_s = threading.get_ident(), -1, 0.0
        while self.node and not self._is_waited_for(me):
            if len(node.finished) != ended:
                ended, end_s = len(node.finished), time.monotonic() + STANDS_S
            if ended + self._held >= self._messages:
                break
            if time.monotonic() > end_s:  # a lock that we do not watch keeps the others away
                self.node = None
            time.sleep(POLL_S)
        with self._one_by_one:
            self._held -= 1

    def _is_waited_for(self, thread):
        return any(lock.holder == thread for lock in [*self._waits_for.values()])

    @contextmanager
    def waiting_for(self, lock):
        """Note that this thread waits for a lock."""
        self._waits_for[threading.get_ident()] = lock
        yield
        del self._waits_for[threading.get_ident()]


class WatchedLock:
    """A lock that knows its holder. The first callback that has given it back is held."""

    def __init__(self, lock, trial):
        self._lock, self._trial = lock, trial
        self.holder, self._depth = None, 0

    def acquire(self, *arguments, **options):
        """Wait for the lock, as the one that it holds does."""
        with self._trial.waiting_for(self):
            acquired = self._lock.acquire(*arguments, **options)
        if acquired:
            self.holder, self._depth = threading.get_ident(), self._depth + 1
        return acquired

    def release(self):
        """Give the lock back, and let others run."""
        if self._depth == 1:
            self.holder = None
        self._depth -= 1
        self._lock.release()
        self._trial.hold('has given a lock back')

    def locked(self):
        """Return whether somebody has it."""
        return self.holder is not None

    def __enter__(self):
        return self.acquire()

    def __exit__(self, *error):
        self.release()


def hear_numbers(node_class, numbers, names):
    """Let a node hear numbers in eight threads, which switch when it reads or writes `names`."""
    must_define(node_class, '__init__')
    trial, working = Trial(len(numbers)), []

    class Tried(node_class):
        def work(self):
            working.append(self)
            trial.at_work.append(len(working))
            super().work()
            working.pop()

    for name in names:
        setattr(Tried, name, trial.watch(name))
    with Bench() as bench:
        node = Tried()
        must_have(node, 'finished', *names)
        trial.name, trial.first = node.get_name(), {**trial.values}
        trial.watch_locks(node)
        trial.node = node
        bench.spin(node, threads=8)
        messages = [Int32(data=number) for number in numbers]
        bench.say('number', *messages, qos=100, at_once=True)
        if not bench.wait(lambda: len(node.finished) == len(messages), 8):
            found = f'of {len(messages)} callbacks, {len(node.finished)} finished'
            if place := bench.line_of_callback():
                raise NeverEnds(f'{found}: the others wait. Is a lock given back? {place}')
            raise Failed(found)
    return trial
