"""What the tasks of the lesson "Lose messages" are judged by."""

import math
import os
import signal
import threading
import time
from collections.abc import Iterable
from numbers import Integral

import psutil
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

from helpers.checks.bench import Bench, must_have, override
from helpers.checks.errors import Failed, sentence
from helpers.checks.points import all_of, cached, expect, rows
from helpers.checks.programs import run_python
from helpers.checks.tasks import Tasks
from helpers.recording import explain, predict
from helpers.ros import ros_session

tasks = Tasks()
check = tasks.check


@tasks.add
def publish_numbers(MinimalPublisher, PERIOD_S):
    def publishes(messages):
        with Bench() as bench:
            heard = bench.hear('topic', String)
            node = MinimalPublisher(messages, 10)
            must_have(node, 'publisher', 'timer')
            bench.spin(node)
            bench.wait(lambda: len(heard) >= messages)
            bench.wait(lambda: len(heard) > messages, 6 * PERIOD_S)
        right = [f'Hello World: {number}' for number in range(messages)]
        texts = [message.data for message in heard]
        return expect(texts, right, f'with messages={messages}, these were received:')

    def one_each_period():
        with ros_session():
            node, published = MinimalPublisher(3, 7), []
            must_have(node, 'publisher', 'timer')
            node.publisher.publish = published.append
            node.timer_callback()
            period_s = node.timer.timer_period_ns / 1e9
            depth = node.publisher.qos_profile.depth
        return all_of(
            expect(len(published), 1, 'the number of messages that one call publishes is'),
            expect(period_s, PERIOD_S, 'the period of its timer is', within=0.0001, unit='s'),
            expect(depth, 7, 'with qos=7, the depth is'),
        )

    hint = 'An f-string writes the number. Compare self.count with self.messages after you count.'
    return [
        ('three messages: 0, 1, 2, and no more', lambda: publishes(3), hint),
        ('five messages: 0 to 4, and no more', lambda: publishes(5), 'Which text is next?'),
        ('one message each period, with qos', one_each_period, 'The timer calls again: no loop.'),
    ]


@tasks.add
def a_slow_subscriber(SlowSubscriber):
    def hear(*texts, callback_s=0.0):
        """Return what the node logs, and a `Took` for each of its callbacks."""
        override(SlowSubscriber, CALLBACK_S=callback_s)
        with Bench() as bench:
            node, executor = SlowSubscriber(10), SingleThreadedExecutor()
            must_have(node, 'subscription')
            topic, callback, took = node.subscription.topic_name, node.subscription.callback, []

            def call(message):
                took.append(Took(bench, lambda: callback(message)))

            node.subscription.callback = call
            executor.add_node(node)
            for text in texts:
                bench.publisher('topic', String).publish(String(data=text))
            for _ in texts:
                executor.spin_once(timeout_sec=1)
            log = bench.log('slow_subscriber')
        if not took:
            raise Failed(f'a message on topic did not come: it receives {topic}')
        return log, took

    def logs(*texts):
        log, _ = hear(*texts)
        right = [f'[INFO] [slow_subscriber]: I heard: "{text}"' for text in texts]
        return expect(log, right, 'its log is')

    def sleeps_once():
        _, [once] = hear('Hello World: 1', callback_s=0.7)
        if not 0.7 <= once.took_s <= 1.2:
            return f'with CALLBACK_S = 0.7 the callback took {once.took_s:.1f} s'
        if once.slept_s < 0.35:
            return 'with CALLBACK_S = 0.7 the callback is busy all the time, and does not sleep'
        return once.logged_s < 0.35 or 'it sleeps first, and logs then'

    def sleeps():
        found = sleeps_once()
        return found is True or sleeps_once()  # a busy computer may be late, but hardly twice

    def subscription(*arguments, **options):
        with ros_session():
            node = SlowSubscriber(*arguments, **options)
            must_have(node, 'subscription')
            return node.subscription.qos_profile.depth, node.subscription.raw

    def depths():
        found = [subscription(depth)[0] for depth in (3, 10)]
        return expect(found, [3, 10], 'with qos 3 and 10, the depths are')

    def passes_options_on():
        _, raw = subscription(10, raw=True)
        return raw or 'SlowSubscriber(10, raw=True) makes a subscription without raw=True'

    quotes = 'The text has quotation marks: I heard: "..."'
    call = 'create_subscription(type, topic, callback, qos, **options)'
    return [
        ('it logs "Hello World: 7"', lambda: logs('Hello World: 7'), f'At INFO. {quotes}'),
        ('it logs each message', lambda: logs('one', 'two'), 'message.data is the text.'),
        ('the callback takes CALLBACK_S seconds', sleeps, 'time.sleep takes seconds.'),
        ('qos is its depth', depths, call),
        ('it passes **options on', passes_options_on, 'The same call: ..., qos, **options).'),
    ]


class Took:
    """How long a callback took and slept, and when its log was seen: seconds from its start."""

    def __init__(self, bench, callback):
        self.logged_s = math.inf
        ended = threading.Event()

        def look():
            while not ended.wait(0.01):
                if bench.log('slow_subscriber'):
                    self.logged_s = time.monotonic() - begun_s
                    return

        watcher = threading.Thread(target=look)
        begun_s, before_s = time.monotonic(), awake_s()
        watcher.start()
        try:
            callback()
        finally:
            self.took_s = time.monotonic() - begun_s
            self.slept_s = self.took_s - (awake_s() - before_s)
            ended.set()
            watcher.join()


def awake_s():
    """Return how long this thread has run, or waited for a CPU (s): it has slept the rest."""
    try:
        with open('/proc/thread-self/schedstat') as file:
            run_ns, waited_ns, _ = map(int, file.read().split())
    except OSError:  # not each Linux counts how long a thread waits
        return time.thread_time()
    return (run_ns + waited_ns) / 1e9


@tasks.add
def two_executors(spin_apart):
    def none_waits_for_another(count):
        ticked = [threading.Event() for _ in range(count)]

        def tick(number):
            ticked[number].set()
            ticked[(number + 1) % count].wait(timeout=3)  # until the next node has ticked

        with Bench() as bench:
            nodes = [Node(f'node_{number}') for number in range(count)]
            for number, node in enumerate(nodes):
                node.create_timer(0.01, lambda number=number: tick(number))
            spin_apart(bench.session, nodes)
            bench.wait(lambda: all(event.is_set() for event in ticked), 1)
            idle = sum(not event.is_set() for event in ticked)
            executors = {node.executor for node in nodes}
            for event in ticked:
                event.set()
        if idle:
            return f'of {count} nodes, {idle} did nothing while another one was busy'
        return expect(len(executors), count, f'the number of executors for {count} nodes is')

    hint = 'Three lines in a loop: make an executor, add the node, let the session spin.'
    return rows(
        none_waits_for_another,
        hint,
        ('two nodes run at the same time', 2),
        ('three nodes run at the same time', 3),
    )


@tasks.add
def be_the_queue(MyQueue):
    plan = [(5, 2), (4, 3)]  # five come, two are taken; four come, three are taken

    def like_the_real_one(depth, plan):
        queue, taken, come = MyQueue(depth), [], 0
        for coming, taking in plan:
            for number in range(come, come + coming):
                queue.arrive(number)
            come += coming
            for _ in range(taking):
                try:
                    taken.append(queue.take())
                except IndexError as error:
                    return f'0 to {come - 1} came, {taken or "none"} were taken: {sentence(error)}'
        real = real_queue(depth, plan)
        if taken != real:
            return f'your queue gives {taken}, the real one {real}'
        pushed_out = [number for number in range(come) if number not in real]
        lost = queue.lost
        if isinstance(lost, Iterable) and all(isinstance(number, int) for number in lost):
            lost = sorted(lost)  # in any order
        return expect(lost, pushed_out, f'0 to {come - 1} came, and self.lost is')

    first = 'Is there room? If not, which one goes?'
    oldest = 'list.pop(0) removes the oldest.'
    return [
        ('depth 3', lambda: like_the_real_one(3, plan), first),
        ('depth 10', lambda: like_the_real_one(10, [(14, 4), (9, 10)]), 'Use self.depth.'),
        ('depth 1', lambda: like_the_real_one(1, [(3, 1), (1, 1)]), oldest),
    ]


def real_queue(depth, plan):
    """Send the messages of a plan through a subscription. Return the numbers that it hears."""
    heard, come = [], 0
    with Bench() as bench:
        node, executor = Node('queue'), SingleThreadedExecutor()
        node.create_subscription(String, 'topic', lambda m: heard.append(int(m.data)), depth)
        executor.add_node(node)
        for coming, taking in plan:
            texts = [String(data=str(number)) for number in range(come, come + coming)]
            bench.say('topic', *texts, qos=depth, at_once=True)
            come, goal = come + coming, len(heard) + taking
            while len(heard) < goal:
                executor.spin_once(timeout_sec=1)  # runs one callback
    return heard


@tasks.add
def deep_enough(smallest_depth):
    def is_smallest(*run):
        depth = smallest_depth(*run)
        case = f'smallest_depth{run} is {depth!r}'
        if not isinstance(depth, Integral) or depth < 1:
            return f'{case}, and a depth is a whole number from 1 up'
        period_s, callback_s, messages = run
        if lost := losses(period_s, callback_s, depth, messages):
            return f'{case}, and {lost} are lost'
        spare = depth > 1 and not losses(period_s, callback_s, depth - 1, messages)
        return not spare or f'{case}, but {depth - 1} loses none, either'

    hint = 'A while loop raises the depth by one as long as something is lost.'
    return [
        ('six messages of the level', lambda: is_smallest(1, 3.5, 6), hint),
        ('our 41 messages', lambda: is_smallest(0.05, 0.2, 41), hint),
        ('a callback that is fast enough', lambda: is_smallest(0.05, 0.01, 100), 'Begin with 1.'),
    ]


def losses(period_s, callback_s, depth, messages):
    """Return how many messages the model loses with one thread."""
    run = predict(period_s, callback_s, depth, threads=1, messages=messages)
    return explain(run, depth, threads=1).lost


@tasks.add
def count_the_losses(LossCounter):
    def finds(numbers, right):
        override(LossCounter, CALLBACK_S=0.02)
        with Bench() as bench:
            node, executor = LossCounter(100, callback_group=None), SingleThreadedExecutor()
            executor.add_node(node)
            texts = [String(data=f'Hello World: {number}') for number in numbers]
            bench.say('topic', *texts, qos=100, at_once=True)
            begun_s = time.monotonic()
            for _ in numbers:
                executor.spin_once(timeout_sec=1)
            took_s = time.monotonic() - begun_s
            logged = len(bench.log('slow_subscriber'))
        if took_s < 0.02 * len(numbers):
            return 'it does not do what a slow subscriber does'
        if logged > len(numbers):
            return f'for {len(numbers)} messages it calls super() {logged} times'
        must_have(node, 'missing')
        missing = [*node.missing] if isinstance(node.missing, Iterable) else node.missing
        return expect(missing, right, f'{numbers} came, and self.missing is')

    between = 'From self.expected up to this number, without it: range(...).'
    return [
        ('0, 1, 3: 2 is missing', lambda: finds([0, 1, 3], [2]), between),
        ('0, 4, 5, 7: four are missing', lambda: finds([0, 4, 5, 7], [1, 2, 3, 6]), between),
        ('0, 1, 2: none is missing', lambda: finds([0, 1, 2], []), 'Which one comes after 0?'),
        ('2, 3: 0 and 1 are missing', lambda: finds([2, 3], [0, 1]), 'The publisher began with 0.'),
    ]


# It tells the stopped talker that it is there, and is stopped itself before it has got a message.
SUBSCRIBER = """
import os, rclpy, signal, sys, time
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node('late_listener')
while not node.count_publishers('topic'):
    time.sleep(0.01)
os.kill(int(sys.argv[1]), signal.SIGSTOP)
node.create_subscription(String, 'topic', print, 100)
time.sleep(0.2)
os.kill(os.getpid(), signal.SIGSTOP)
try:
    time.sleep(60)
except KeyboardInterrupt:
    node.destroy_node()
    rclpy.try_shutdown()
"""
# It prints the depth and the text of each message that it publishes.
PUBLISHED = 'published:'
TELLS = """
import runpy
from rclpy.publisher import Publisher

publish = Publisher.publish

def tell(self, message):
    if self.topic_name == '/topic':
        print('published:', self.qos_profile.depth, message.data)
    publish(self, message)

Publisher.publish = tell
runpy.run_path({file!r}, run_name='__main__')
"""
LISTENER = 'the listener'  # a program with the name of the talker would end it
LONGER_THAN_PUBLISHING_S = 2.0
LONGER_THAN_A_PAUSE_S = 1.0  # in place of a wait
WAITS_AT_MOST_S = 12.0


@tasks.add(limit_s=60)
def a_program_of_its_own(workspace, file):
    def comes(bench, talker):
        """Wait until the talker publishes texts, or has ended. Raises Failed for another topic."""
        bench.wait(lambda: topics_of_texts(bench.tester) or not talker.running, 10)
        topics = topics_of_texts(bench.tester)
        if topics and '/topic' not in topics:
            raise Failed(f'it publishes on {", ".join(topics)}, not on /topic')
        # Names of nodes come later than their topics.
        if topics and not bench.wait(lambda: 'talker' in bench.tester.get_node_names(), 2):
            names = {*bench.tester.get_node_names()} - {bench.tester.get_name()}
            raise Failed(f'its node is {", ".join(sorted(names))}, not talker')

    def ends_well(talker):
        """Wait for the end of the talker. Raises Failed if it does not end, or with an error."""
        if not talker.has_ended(WAITS_AT_MOST_S):
            raise Failed('the program does not end')
        if talker.exit_code():
            raise Failed(talker.error)

    @cached
    def last_ten():
        """Subscribe, and spin only when the program has ended."""
        heard = []
        with Bench() as bench:
            node, executor = Node('late_listener'), SingleThreadedExecutor()
            executor.add_node(node)
            with run_python(workspace, file) as talker:
                comes(bench, talker)
                node.create_subscription(String, 'topic', lambda m: heard.append(m.data), 10)
                ends_well(talker)
            bench.spin(node, executor=executor)
            bench.quiet()
        if heard == [f'Hello World: {number}' for number in range(40, 50)]:
            return True
        numbers = ', '.join(text.removeprefix('Hello World: ') for text in heard) or 'none'
        return f'with depth 10, these were received: {numbers}; right is 40 to 49'

    def publishes_all():
        """Run the program so that it prints what it publishes: a queue may lose messages."""
        last_ten()  # what raises there would raise here, too
        with Bench() as bench:
            bench.hear('topic', String)
            with run_python(workspace, '-c', TELLS.format(file=file)) as talker:
                ends_well(talker)
        said = [line.split(maxsplit=2)[1:] for line in talker.lines if line.startswith(PUBLISHED)]
        texts, depths = [text for _, text in said], [int(depth) for depth, _ in said]
        if texts != (right := [f'Hello World: {number}' for number in range(50)]):
            return expect(texts, right, 'it publishes')
        if min(depths) < 10:
            return f'the depth of its publisher is {min(depths)}, not 10'
        return True

    def too_early(talker):
        ends_well(talker)
        return 'it ends before a subscriber is there'

    def waits_for_all():
        """Keep a subscriber from getting anything: the program must not end."""
        last_ten()
        with Bench() as bench, run_python(workspace, file) as talker:
            # Two programs that begin at once in one domain may choose the same port.
            comes(bench, talker)
            if bench.wait(lambda: not talker.running, LONGER_THAN_A_PAUSE_S):
                return too_early(talker)
            with run_python(
                workspace, '-c', SUBSCRIBER, str(talker.pid), name=LISTENER
            ) as listener:
                bench.wait(lambda: is_stopped(listener) or not talker.running, 10)
                if not talker.running or not is_stopped(listener):
                    return too_early(talker)
                os.kill(talker.pid, signal.SIGCONT)
                early = talker.has_ended(LONGER_THAN_PUBLISHING_S)
                says_so = talker.says('The talker has ended.')
            if early:
                ends_well(talker)
        if early:
            return 'it ended although a slow subscriber had not got the messages'
        return not says_so or 'it says that it has ended before all messages have arrived'

    numbers = 'Which numbers does range(50) give?'
    last = 'Call publisher.wait_for_all_acked(Duration(seconds=10)) last.'
    return [
        ('depth 10 keeps the last ten', last_ten, numbers),
        ('it publishes all fifty numbers', publishes_all, 'First wait, then publish.'),
        ('it ends when all have arrived', waits_for_all, last),
    ]


def topics_of_texts(node):
    topics = node.get_topic_names_and_types()
    return [name for name, types in topics if 'std_msgs/msg/String' in types]


def is_stopped(program):
    return psutil.Process(program.pid).status() == psutil.STATUS_STOPPED
