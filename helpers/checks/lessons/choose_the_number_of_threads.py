"""What the tasks of the lesson "Choose the number of threads" are judged by."""

import math
import threading
import time

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from std_msgs.msg import Int32

from helpers.checks.bench import Bench, must_be_called, must_define, must_have, periods_of
from helpers.checks.points import all_of, expect, rows
from helpers.checks.tasks import Tasks
from helpers.recording import explain, predict
from helpers.ros import ros_session

tasks = Tasks()
check = tasks.check

QUIET = SubscriptionEventCallbacks(use_default_callbacks=False)
ENDS_S = 0.3  # for a callback that waits for nothing
GATE_S = 60
BUSY = 500  # times in ENDS_S: a callback that asks without a pause, on any machine
SPINS_S = 5.0  # for two calls of spin_once, of 0.1 s each


@tasks.add
def a_gate(GatedSubscriber):
    def holds(messages, depth, group, **events):
        must_define(GatedSubscriber, '__init__')
        with Bench() as bench:
            node, begun, ended = GatedSubscriber(depth, group, **events), [], []
            must_be_called(node, 'gated_subscriber')
            must_have(node, 'gate', 'subscription')
            if not isinstance(node.gate, threading.Event):
                return f'self.gate is a {type(node.gate).__name__}, not a threading.Event'
            if GatedSubscriber(depth, group, **events).gate is node.gate:
                return 'two of these nodes have the same gate'
            gate = node.gate = WatchedGate()
            subscription, callback = node.subscription, node.subscription.callback

            def call(message):
                begun.append(message.data)
                callback(message)
                ended.append(message.data)

            subscription.callback = call
            bench.spin(node, threads=4)
            bench.say('number', *numbers(messages), at_once=True)
            bench.wait(lambda: len(begun) == messages)
            # A callback may also look at the gate again and again, so it is never quiet.
            bench.wait(lambda: ended, ENDS_S)
            held = messages - len(ended)
            node.gate.set()
            bench.wait(lambda: len(ended) == messages)
            found_depth, handlers = subscription.qos_profile.depth, subscription.event_handlers
        if found_depth != depth or subscription.callback_group is not group:
            return f'depth {depth} and its group were asked for, but not passed on'
        if handlers and not events:
            return 'without events, it has event handlers: events=QUIET is the default'
        if events and not handlers:
            return 'event_callbacks=events is not passed on'
        if gate.asked > BUSY:
            return 'it asks is_set() without a pause: that takes a whole CPU'
        if held < messages:
            return f'{messages - held} of {messages} callbacks ended before the gate was opened'
        if gate.longest_s > GATE_S or gate.longest_s < GATE_S and not gate.asked:
            return expect(gate.longest_s, GATE_S, 'it waits at the gate for at most', unit='s')
        return expect(len(ended), messages, 'messages received after the gate was opened:')

    wait = 'self.gate.wait(timeout=60) in the callback.'
    call = 'create_subscription(type, topic, callback, depth, callback_group=, event_callbacks=)'
    exclusive, reentrant = MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
    return [
        ('four messages are held, then received', lambda: holds(4, 10, reentrant()), wait),
        (
            'one, with another depth, group and events',
            lambda: holds(1, 3, exclusive(), events=None),
            call,
        ),
    ]


class WatchedGate(threading.Event):
    """An Event that knows for how long somebody would wait for it, and how often it was asked."""

    def __init__(self):
        super().__init__()
        self.longest_s, self.asked = 0.0, 0

    def wait(self, timeout=None):
        """Wait for it, as every Event does."""
        self.longest_s = max(self.longest_s, math.inf if timeout is None else timeout)
        return super().wait(timeout)

    def is_set(self):
        """Return whether it is set."""
        self.asked += 1
        return super().is_set()


def numbers(count):
    return [Int32(data=number) for number in range(count)]


@tasks.add
def the_law(heard_after_burst):
    def law_holds(threads, group, in_flight, depth, more):
        answer = heard_after_burst(in_flight, depth, more)
        heard = hear_burst(threads, group(), in_flight, depth, more)
        case = f'in flight {in_flight}, depth {depth}, {more} more: {heard} were received'
        return expect(answer, heard, f'{case}, and your function returns')

    hint = 'The queue keeps at most depth messages, and not more than come.'
    exclusive, reentrant = MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
    return rows(
        law_holds,
        hint,
        ('8 threads, reentrant, depth 10', 8, reentrant, 8, 10, 50),
        ('8 threads, reentrant, few more', 8, reentrant, 8, 10, 5),
        ('8 threads, exclusive, depth 20', 8, exclusive, 1, 20, 50),
        ('single-threaded, depth 3', 1, reentrant, 1, 3, 20),
    )


def hear_burst(threads, group, in_flight, depth, more):
    """Fill the threads, publish `more` messages, open the gate. Return how many were received."""
    with Bench() as bench:
        node, gate = Node('gated_subscriber'), bench.gate()
        options = {'callback_group': group, 'event_callbacks': QUIET}
        node.create_subscription(Int32, 'number', gate.hold, depth, **options)
        bench.spin(node, threads=threads)
        for number in range(in_flight):
            bench.say('number', Int32(data=number), at_once=True)
            gate.wait_until_entered(number + 1)
        if more:
            bench.say('number', *numbers(more), at_once=True)
        gate.open()
        bench.quiet()
    return len(gate.entered)


@tasks.add
def deep_enough_for_a_burst(depth_for_burst):
    def deep_enough(messages, threads):
        depth = depth_for_burst(messages, threads)
        case = f'depth_for_burst({messages}, {threads}) is {depth}'
        if not isinstance(depth, int) or depth < 1:
            return f'{case}, and a depth is a whole number from 1 up'
        in_flight = min(threads, messages)
        more = messages - in_flight

        def heard(depth):
            return hear_burst(threads, ReentrantCallbackGroup(), in_flight, depth, more)

        if (count := heard(depth)) < messages:
            return f'{case}: {count} of {messages} were received'
        return depth == 1 or heard(depth - 1) < messages or f'{case}, but {depth - 1} would do'

    hint = 'A message that a thread takes at once needs no place.'
    return [
        ('30 messages, 2 threads', lambda: deep_enough(30, 2), hint),
        ('20 messages, 4 threads', lambda: deep_enough(20, 4), hint),
        (
            '3 messages, 4 threads',
            lambda: all_of(deep_enough(3, 4), deep_enough(2, 6)),
            'A depth is at least 1.',
        ),
    ]


@tasks.add
def publish_numbers(NumberPublisher):
    def numbers_come(messages, period_s):
        must_define(NumberPublisher, '__init__')
        with Bench() as bench:
            heard = bench.hear('number', Int32)
            node = NumberPublisher(messages, period_s)
            must_be_called(node, 'number_publisher')
            must_have(node, 'publisher')
            topic = node.publisher.topic_name
            if topic != '/number':
                return f'it publishes on {topic}, not on /number'
            periods = periods_of(node)
            if not periods:
                return 'it has no timer'
            bench.spin(node)
            bench.wait(lambda: len(heard) >= messages)
            bench.wait(lambda: len(heard) > messages, 6 * period_s)
        found = [message.data for message in heard]
        return all_of(
            expect(found, [*range(messages)], 'it published'),
            expect(periods, [period_s], 'the periods (s) of its timers are'),
        )

    hint = 'Count in self.count; self.timer.cancel() stops the timer.'
    return [
        ('five messages, every 0.01 s', lambda: numbers_come(5, 0.01), hint),
        ('three messages, every 0.05 s', lambda: numbers_come(3, 0.05), 'Int32(data=self.count)'),
    ]


@tasks.add
def work_at_once(WorkingSubscriber, DEPTH):
    def works_at_once(threads, messages):
        must_define(WorkingSubscriber, '__init__')
        with Bench() as bench:
            gate = bench.gate()
            node = WorkingSubscriber(lambda: gate.hold())  # not with a message
            must_be_called(node, 'working_subscriber')
            must_have(node, 'subscription')
            depth = node.subscription.qos_profile.depth
            handlers = len(node.subscription.event_handlers)
            bench.spin(node, threads=threads)
            bench.say('number', *numbers(messages), qos=20, at_once=True)
            bench.quiet()
            at_once = len(gate.entered)
            gate.open()
            bench.quiet()
            calls = len(gate.entered)
        return all_of(
            expect(depth, DEPTH, 'its depth is'),
            expect(handlers, 0, 'the number of its event handlers is'),
            expect(at_once, min(threads, messages), f'with {threads} threads, at work at once:'),
            expect(calls, messages, f'for messages: {messages}, calls of work():'),
        )

    hint = 'callback_group=ReentrantCallbackGroup(), event_callbacks=QUIET'
    return [
        ('4 threads: four work at once', lambda: works_at_once(4, 6), hint),
        ('2 threads: two work at once', lambda: works_at_once(2, 6), hint),
        ('one message: work() is called once', lambda: works_at_once(4, 1), 'self.work() with ().'),
    ]


@tasks.add
def threads_for_a_camera(threads_needed):
    def keeps_up(rate_hz, callback_s, reserve):
        threads = threads_needed(rate_hz, callback_s, reserve)
        longest_s = callback_s * (1 + reserve)
        case = f'threads_needed{(rate_hz, callback_s, reserve)} is {threads}'
        if not isinstance(threads, int):
            return f'{case}, and that is not an int'
        if lost := losses(rate_hz, longest_s, threads):
            return f'{case}: {lost} of 2000 are lost'
        spare = threads > 1 and not losses(rate_hz, longest_s, threads - 1)
        return not spare or f'{case}, but {threads - 1} would do'

    hint = 'How many messages come while one callback runs? math.ceil rounds up.'
    return rows(
        keeps_up,
        hint,
        ('30 Hz, 0.15 s, reserve 0.0', 30, 0.15, 0.0),
        ('22 Hz, 0.1 s, reserve 0.0', 22, 0.1, 0.0),
        ('10 Hz, 0.05 s, reserve 0.0', 10, 0.05, 0.0),
        ('20 Hz, 0.2 s, reserve 0.0', 20, 0.2, 0.0),
        ('20 Hz, 0.19 s, reserve 0.2', 20, 0.19, 0.2),
        ('25 Hz, 0.2 s, reserve 0.0', 25, 0.2, 0.0),
        ('21 Hz, 0.1 s, reserve 0.1', 21, 0.1, 0.1),
    )


def losses(rate_hz, callback_s, threads):
    """Return how many of 2000 messages the model loses, with depth 10."""
    model = predict(1 / rate_hz, callback_s, 10, threads, messages=2000)
    return explain(model, 10, threads).lost


@tasks.add
def waiting_or_computing(cpu_part):
    def part_of(work, most, beside=None):
        """Let the function measure `work`, and perhaps another thread compute `beside` it."""
        parts, of_all_threads, end = [], [], threading.Event()

        def measured():
            cpu_s, all_s, time_s = time.thread_time(), time.process_time(), time.monotonic()
            work()
            taken_s = time.monotonic() - time_s
            parts.append((time.thread_time() - cpu_s) / taken_s)
            of_all_threads.append((time.process_time() - all_s) / taken_s)

        def go_on():
            while beside and not end.is_set():
                beside()

        helper = threading.Thread(target=go_on)
        helper.start()
        try:
            part = cpu_part(measured)
        finally:
            end.set()
            helper.join()
        if len(parts) != 1:
            return f'work() was called {len(parts)} times'
        least = 0.7 * parts[0]  # on a busy computer, a sum gets only a part of a CPU
        # On a busy computer, the other thread gets only a part of a CPU, too.
        limit = min(most, of_all_threads[0] / 2) if beside else most
        fits = isinstance(part, float) and least <= part <= limit
        return fits or f'it returns {part!r}, and right is {least:.1f} to {most}'

    def sleep():
        time.sleep(0.3)

    def compute():
        sum(range(5_000_000))

    def compute_a_little():
        sum(range(1000))

    hint = 'Subtract each clock before from the clock after, then divide.'
    return [
        ('a sleep: nearly 0', lambda: part_of(sleep, 0.1), hint),
        ('a sum: much more', lambda: part_of(compute, 1.01), hint),
        (
            'a sleep, while another thread computes: nearly 0',
            lambda: part_of(sleep, 0.1, compute_a_little),
            'time.process_time() counts all threads.',
        ),
    ]


@tasks.add
def spin_it_yourself(spin_until):
    def spins_until(make_executor, messages):
        heard, asked = [], []
        with ros_session():
            executor, node = make_executor(), Node('checked')
            publisher = node.create_publisher(Int32, 'number', 100)

            def callback(message):  # the next one comes when this one is heard
                heard.append(message.data)
                publisher.publish(Int32(data=message.data + 1))

            def done():
                asked.append(1)
                return len(heard) >= messages or len(asked) > 50

            node.create_subscription(Int32, 'number', callback, 100)
            executor.add_node(node)
            publisher.publish(Int32(data=0))
            spin_until(executor, done)
            executor.shutdown()
        if not asked:
            return 'done() was never called'
        return expect(len(heard), messages, 'messages received when it ended:')

    def stops_at_once():
        asked = []

        def done():
            asked.append(1)
            assert len(asked) < 20, 'it spins although all is done'
            return True

        with ros_session():
            spin_until(SingleThreadedExecutor(), done)
        return bool(asked) or 'done() was never called'

    def ends_while_nothing_comes():
        asked = []

        def done():
            asked.append(1)
            return len(asked) > 2

        with ros_session():
            executor = SingleThreadedExecutor()
            thread = threading.Thread(target=spin_until, args=(executor, done), daemon=True)
            thread.start()
            thread.join(SPINS_S)
            waits = thread.is_alive()
            executor.shutdown(1)  # which wakes it
            thread.join(1)
        if waits:
            return 'while no message comes, spin_once waits for ever: its time-out is missing'
        return len(asked) > 2 or 'it ended before done() was true'

    hint = 'while not done(): ...'
    single = SingleThreadedExecutor
    return [
        ('SingleThreadedExecutor, 3 messages', lambda: spins_until(single, 3), hint),
        ('EventsExecutor, 5 messages', lambda: spins_until(EventsExecutor, 5), hint),
        ('it ends if all is done', stops_at_once, 'Call done: done(), not done.'),
        (
            'it asks done() again while no message comes',
            ends_while_nothing_comes,
            'executor.spin_once(timeout_sec=0.1)',
        ),
    ]
