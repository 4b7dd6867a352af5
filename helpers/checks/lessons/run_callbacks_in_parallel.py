"""What the tasks of the lesson "Run callbacks in parallel" are judged by."""

import threading
import time

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from std_msgs.msg import Int32, String

from helpers.checks.bench import Bench, must_define, must_have
from helpers.checks.errors import Failed
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks
from helpers.ros import ros_session
from helpers.trials import callbacks_at_once

tasks = Tasks()
check = tasks.check

QUIET = SubscriptionEventCallbacks(use_default_callbacks=False)


@tasks.add
def a_subscriber_with_a_group(SlowSubscriber, DEPTH, CALLBACK_S):
    def hears(group):
        must_define(SlowSubscriber, '__init__')
        with Bench() as bench:
            node, executor = SlowSubscriber(group), SingleThreadedExecutor()
            must_have(node, 'subscription')
            executor.add_node(node)
            bench.publisher('topic', String).publish(String(data='Hello World: 0'))
            begun_s = time.monotonic()
            executor.spin_once(timeout_sec=CALLBACK_S / 2)  # nothing heard: it waits no longer
            took_s = time.monotonic() - begun_s
            subscription = node.subscription
            depth, handlers = subscription.qos_profile.depth, len(subscription.event_handlers)
        if subscription.callback_group is not group:
            return 'its subscription is in another group'
        if depth != DEPTH:
            return f'its depth is {depth}'
        if handlers:
            return f'it has {handlers} event handlers: event_callbacks=QUIET takes them away'
        slow = took_s >= CALLBACK_S
        return slow or 'no callback slept for CALLBACK_S seconds when a message came'

    made = 'super().__init__(name), then self.subscription = self.create_subscription(...).'
    passed = 'Pass on the group that __init__ gets.'
    exclusive, reentrant = MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
    return [
        ('it receives and sleeps, in an exclusive group', lambda: hears(exclusive()), made),
        ('it receives and sleeps, in a reentrant group', lambda: hears(reentrant()), passed),
    ]


@tasks.add
def four_combinations(combination, THREADS):
    def is_combination(letter, *kinds, at_once):
        with ros_session():
            made = combination(letter)
            if [type(thing) for thing in made] != [*kinds]:
                names = ' and '.join(map(name_of, made))
                return f'combination({letter!r}) gives {names}'
        found = callbacks_at_once(lambda: combination(letter))
        text = f'with {letter}, {found} callbacks ran at the same time, not {at_once}'
        return found == at_once or text

    single, multi = SingleThreadedExecutor, MultiThreadedExecutor
    exclusive, reentrant = MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
    threads = 'MultiThreadedExecutor(num_threads=THREADS)'

    return [
        (
            'combination A',
            lambda: is_combination('A', single, exclusive, at_once=1),
            'The first row of the table.',
        ),
        (
            'combination B',
            lambda: is_combination('B', single, reentrant, at_once=1),
            'Are () there after both names?',
        ),
        ('combination C', lambda: is_combination('C', multi, exclusive, at_once=1), threads),
        ('combination D', lambda: is_combination('D', multi, reentrant, at_once=THREADS), threads),
    ]


def name_of(thing):
    if isinstance(thing, type):
        return f'the class {thing.__name__}'
    return type(thing).__name__


@tasks.add
def camera_and_battery(TwoTopics, make_my_executor):
    def called(*topics):
        """Send messages while the first picture is worked on. Return the topics of the calls."""
        gate, calls = threading.Event(), []

        def call(topic):
            calls.append(topic)
            if topic == 'camera':  # the camera works until the gate opens
                gate.wait(timeout=30)

        with Bench() as bench:
            executor, node = make_my_executor(), TwoTopics()
            found = {made.topic_name.strip('/'): made for made in node.subscriptions}
            for topic in ('camera', 'battery'):
                if topic not in found:
                    raise Failed(f'there is no subscription on {topic}')
                found[topic].callback = lambda _, topic=topic: call(topic)
            bench.spin(node, executor=executor)
            for topic in topics:
                bench.say(topic, Int32())
            tried = [*calls]
            gate.set()
        return tried

    def battery_is_heard(*topics):
        heard, wanted = called(*topics).count('battery'), topics.count('battery')
        return heard == wanted or f'meanwhile {heard} of {wanted} battery messages were received'

    def one_picture():
        pictures = called('camera', 'camera', 'camera').count('camera')
        return pictures == 1 or f'it worked on {pictures} pictures at the same time'

    hint = 'Which callback blocks which group? How many threads are still free?'
    return [
        (
            'the battery is received while the camera works',
            lambda: battery_is_heard('camera', 'battery'),
            hint,
        ),
        (
            'even when more pictures wait',
            lambda: battery_is_heard('camera', 'camera', 'battery', 'camera', 'battery'),
            hint,
        ),
        ('the camera works on one picture at a time', one_picture, 'Which group forbids two?'),
    ]


@tasks.add
def wait_for_the_small_one(UnequalSubscriber):
    def finish_in_order(threads):
        with Bench() as bench:
            node = bench.spin(UnequalSubscriber(), threads=threads)
            bench.say('number', Int32(data=0))
            if node.finished:
                return 'number 0 finished before number 1 came'
            if node.small_one_done.is_set():
                return 'number 0 does not wait'
            bench.say('number', Int32(data=1))
        return node.finished == [1, 0] or f'they finished in the order {node.finished}'

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


@tasks.add
def take_a_lock(LockingSubscriber):
    forty = cached(lambda: hear_numbers(LockingSubscriber, 40, 'count'))

    def counts(count, trial):
        found = trial.node.read('count')
        return found == count or f'the counter is too {"low" if found < count else "high"}'

    block = 'Read and write in one block.'
    return [
        ('40 messages: the counter shows 40', lambda: counts(40, forty()), block),
        (
            '24 messages: the counter shows 24',
            lambda: counts(24, hear_numbers(LockingSubscriber, 24, 'count')),
            block,
        ),
        (
            'the work still overlaps',
            lambda: work_overlaps(forty()),
            'What needs the lock, and what does not?',
        ),
    ]


@tasks.add
def an_odometer(Odometer):
    forty = cached(lambda: hear_numbers(Odometer, 40, 'total', 'longest'))

    def shows(count, trial):
        right = {'total': sum(range(count)), 'longest': count - 1}
        wrong = [name for name in right if trial.node.read(name) != right[name]]
        return not wrong or f'after {count} distances, wrong: self.{" and self.".join(wrong)}'

    return [
        ('40 distances', lambda: shows(40, forty()), 'Compare with LockingSubscriber. super()?'),
        (
            '24 distances',
            lambda: shows(24, hear_numbers(Odometer, 24, 'total', 'longest')),
            'max(a, b) reads, too: keep it in the lock.',
        ),
        (
            'the work still overlaps',
            lambda: work_overlaps(forty()),
            'What is inside the lock? In which group?',
        ),
    ]


def work_overlaps(trial):
    if len(trial.at_work) != 40:
        return f'self.work() was called {len(trial.at_work)} times for 40 messages'
    return max(trial.at_work) > 1 or 'the calls of self.work() came one after the other'


# --- Threads that switch at the worst moments: after each read, and after a lock is released

SWITCH_S = 0.005


class SlowLock:
    """A lock after whose release another thread takes its turn."""

    def __init__(self, lock):
        self.lock = lock

    def acquire(self, *arguments, **options):
        """Wait for the lock, as the one that it holds does."""
        return self.lock.acquire(*arguments, **options)

    def release(self):
        """Give the lock back, and let another thread run."""
        self.lock.release()
        time.sleep(SWITCH_S)

    def __enter__(self):
        return self.acquire()

    def __exit__(self, *error):
        self.release()


def read_slowly(name):
    """Return a property that is read slowly, so that another thread reads it meanwhile, too."""

    def read(node):
        value = node.read(name)
        time.sleep(SWITCH_S)
        return value

    return property(read, lambda node, value: vars(node).update({name: value}))


class Trial:
    """A node of the student that has heard numbers, and how many were at work at each call."""

    def __init__(self, node, at_work):
        self.node, self.at_work = node, at_work


def hear_numbers(node_class, count, *names):
    """Let a node hear numbers in eight threads, which switch whenever it reads `names`."""
    must_define(node_class, '__init__')
    working, at_work = [], []

    class Tried(node_class):
        def __init__(self):
            super().__init__()
            for name, value in list(vars(self).items()):
                if type(value) in (type(threading.Lock()), type(threading.RLock())):
                    setattr(self, name, SlowLock(value))

        def read(self, name):
            if name not in vars(self):
                raise AttributeError(f'there is no self.{name} yet')
            return vars(self)[name]

        def work(self):
            working.append(self)
            at_work.append(len(working))
            super().work()
            working.pop()

    for name in names:
        setattr(Tried, name, read_slowly(name))
    with Bench() as bench:
        node = bench.spin(Tried(), threads=8)
        must_have(node, 'finished')
        numbers = [Int32(data=number) for number in range(count)]
        bench.say('number', *numbers, qos=100, at_once=True)
        if not bench.wait(lambda: len(node.finished) == count, 8):
            raise Failed(f'of {count} callbacks, {len(node.finished)} finished')
    return Trial(node, at_work)
