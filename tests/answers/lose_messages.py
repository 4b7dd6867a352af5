"""Answers to the tasks of lesson 02, as students give them."""

PUBLISHER = """
class MinimalPublisher(Node):
    def __init__(self, messages, qos):
        super().__init__('minimal_publisher')
        self.messages = messages
        self.publisher = self.create_publisher(String, 'topic', qos)
        self.timer = self.create_timer(PERIOD_S, self.timer_callback)
        self.count = 0

    def timer_callback(self):
"""
SUBSCRIBER = """
class SlowSubscriber(Node):
    def __init__(self, qos, **options):
        super().__init__('slow_subscriber')
        self.subscription = self.create_subscription(
            String, 'topic', self.listener_callback, qos, **options
        )

    def listener_callback(self, message):
"""
QUEUE = """
class MyQueue:
    def __init__(self, depth):
        self.depth = depth
        self.waiting = []
        self.lost = []

"""
COUNTER = """
class LossCounter(SlowSubscriber):
    def __init__(self, qos, **options):
        super().__init__(qos, **options)
        self.expected = 0
        self.missing = []

    def listener_callback(self, message):
        number = int(message.data.split()[-1])
"""
TALKER = """
%%write talker.py
import time

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import String


def wait_for_subscriber(publisher):
    while publisher.get_subscription_count() == 0:
        time.sleep(0.01)


rclpy.init()
""".lstrip()
END = "print('The talker has ended.')\n"


def body(head: str, lines: str, indent: int = 8) -> str:
    """Return the head, and below it the lines, indented."""
    return head + ''.join(f'{" " * indent}{line}\n' for line in lines.strip('\n').splitlines())


ANSWERS = {
    1: {
        'wrong': [
            body(PUBLISHER, "self.publisher.publish(String(data=f'Hello World: {self.count}'))"),
            body(
                PUBLISHER,
                """
self.publisher.publish(String(data=f'Hello World: {self.count}'))
self.count += 1
""",
            ),
            body(
                PUBLISHER,
                """
self.publisher.publish(String(data=f'Hello World: {self.count}'))
self.count += 1
if self.count > self.messages:
    self.timer.cancel()
""",
            ),
            body(
                PUBLISHER,
                """
self.count += 1
self.publisher.publish(String(data=f'Hello World: {self.count}'))
if self.count == self.messages:
    self.timer.cancel()
""",
            ),
            body(
                PUBLISHER,
                """
self.publisher.publish(String(data='Hello World: {self.count}'))
self.count += 1
if self.count == self.messages:
    self.timer.cancel()
""",
            ),
            body(
                PUBLISHER,
                """
self.publisher.publish(f'Hello World: {self.count}')
self.count += 1
if self.count == self.messages:
    self.timer.cancel()
""",
            ),
        ],
        'right': [
            body(
                PUBLISHER,
                """
if self.count < self.messages:
    self.publisher.publish(String(data='Hello World: ' + str(self.count)))
    self.count += 1
""",
            ),
            body(
                PUBLISHER,
                """
if self.count >= self.messages:
    self.timer.cancel()
    return
message = String()
message.data = 'Hello World: %d' % self.count
self.publisher.publish(message)
self.count = self.count + 1
""",
            ),
            body(
                PUBLISHER,
                """
self.publisher.publish(String(data='Hello World: {}'.format(self.count)))
self.count += 1
if self.messages == self.count:
    self.destroy_timer(self.timer)
""",
            ),
        ],
    },
    2: {
        'wrong': [
            body(SUBSCRIBER, 'time.sleep(CALLBACK_S)'),
            body(SUBSCRIBER, """self.get_logger().info(f'I heard: "{message.data}"')"""),
            body(
                SUBSCRIBER.replace('qos, **', '10, **'),
                """
self.get_logger().info(f'I heard: "{message.data}"')
time.sleep(CALLBACK_S)
""",
            ),
            body(
                SUBSCRIBER,
                """
self.get_logger().info(f'I heard: "{message}"')
time.sleep(CALLBACK_S)
""",
            ),
            body(
                SUBSCRIBER,
                """
self.get_logger().info(f'I heard: "{message.data}"')
time.sleep(0.2)
""",
            ),
            body(
                SUBSCRIBER.replace("'topic'", "'Topic'"),
                """
self.get_logger().info(f'I heard: "{message.data}"')
time.sleep(CALLBACK_S)
""",
            ),
            body(
                SUBSCRIBER,
                """
self.get_logger().warning(f'I heard: "{message.data}"')
time.sleep(2.0)
""",
            ),
        ],
        'right': [
            body(
                SUBSCRIBER,
                """
self.get_logger().info('I heard: "%s"' % message.data)
time.sleep(CALLBACK_S)
""",
            ),
            body(
                SUBSCRIBER,
                """
time.sleep(CALLBACK_S)
self.get_logger().info('I heard: "' + message.data + '"')
""",
            ),
            """
class SlowSubscriber(Node):
    def __init__(self, qos, **options):
        super().__init__('slow_subscriber')
        self.subscription = self.create_subscription(
            msg_type=String,
            topic='topic',
            callback=lambda message: self.listener_callback(message),
            qos_profile=qos,
            **options,
        )

    def listener_callback(self, message):
        text = message.data
        self.get_logger().info(f'I heard: "{text}"')
        end = time.monotonic() + CALLBACK_S
        while time.monotonic() < end:
            time.sleep(max(0, end - time.monotonic()))
""",
        ],
    },
    3: {
        'wrong': [
            """
def spin_apart(session, nodes):
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    session.spin(executor)
""",
            """
def spin_apart(session, nodes):
    for node in nodes:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
""",
            """
def spin_apart(session, nodes):
    for node in nodes:
        executor = SingleThreadedExecutor()
        executor.add_node(nodes[0])
        session.spin(executor)
""",
            """
def spin_apart(session, nodes):
    for node in nodes:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
    session.spin(executor)
""",
            """
def spin_apart(session, nodes):
    executors = [SingleThreadedExecutor() for node in nodes]
    for executor in executors:
        session.spin(executor)
""",
        ],
        'right': [
            """
def spin_apart(session, nodes):
    executors = [SingleThreadedExecutor() for _ in nodes]
    for executor, node in zip(executors, nodes):
        executor.add_node(node)
        session.spin(executor)
""",
            """
def spin_one(session, node):
    executor = SingleThreadedExecutor()
    session.spin(executor)
    executor.add_node(node)


def spin_apart(session, nodes):
    for node in nodes:
        spin_one(session, node)
""",
            """
def spin_apart(session, nodes):
    for i in range(len(nodes)):
        e = SingleThreadedExecutor()
        e.add_node(nodes[i])
        session.spin(e)
""",
        ],
    },
    4: {
        'wrong': [
            QUEUE
            + """
    def arrive(self, number):
        self.waiting.append(number)
        if len(self.waiting) == self.depth:
            self.lost.append(self.waiting.pop(0))

    def take(self):
        return self.waiting.pop(0)
""",
            QUEUE
            + """
    def arrive(self, number):
        if len(self.waiting) < self.depth:
            self.waiting.append(number)
        else:
            self.lost.append(number)

    def take(self):
        return self.waiting.pop(0)
""",
            QUEUE
            + """
    def arrive(self, number):
        if len(self.waiting) == self.depth:
            self.lost.append(self.waiting.pop(0))
        self.waiting.append(number)

    def take(self):
        return self.waiting.pop()
""",
            QUEUE
            + """
    def arrive(self, number):
        if len(self.waiting) == 10:
            self.lost.append(self.waiting.pop(0))
        self.waiting.append(number)

    def take(self):
        return self.waiting.pop(0)
""",
            QUEUE
            + """
    def arrive(self, number):
        if len(self.waiting) == self.depth:
            self.waiting.pop(0)
        self.waiting.append(number)

    def take(self):
        return self.waiting.pop(0)
""",
            QUEUE
            + """
    def arrive(self, number):
        if len(self.waiting) == self.depth:
            self.lost.append(self.waiting.pop(0))
        self.waiting.append(number)

    def take(self):
        return self.waiting[0]
""",
        ],
        'right': [
            QUEUE
            + """
    def arrive(self, number):
        self.waiting.append(number)
        if len(self.waiting) > self.depth:
            self.lost.append(self.waiting.pop(0))

    def take(self):
        return self.waiting.pop(0)
""",
            QUEUE
            + """
    def arrive(self, number):
        self.waiting = [*self.waiting, number]
        self.lost += self.waiting[: -self.depth]
        self.waiting = self.waiting[-self.depth :]

    def take(self):
        oldest = self.waiting[0]
        del self.waiting[0]
        return oldest
""",
            """
from collections import deque


class MyQueue:
    def __init__(self, depth):
        self.waiting = deque(maxlen=depth)
        self.lost = []

    def arrive(self, number):
        if len(self.waiting) == self.waiting.maxlen:
            self.lost.append(self.waiting[0])
        self.waiting.append(number)

    def take(self):
        return self.waiting.popleft()
""",
        ],
    },
    5: {
        'wrong': [
            'def smallest_depth(period_s, callback_s, messages):\n    return messages\n',
            'def smallest_depth(period_s, callback_s, messages):\n    return 1\n',
            'def smallest_depth(period_s, callback_s, messages):\n    return 31\n',
            """
def smallest_depth(period_s, callback_s, messages):
    depth = 1
    while losses(period_s, callback_s, depth, messages) > 0:
        depth += 1
    return depth - 1
""",
            """
def smallest_depth(period_s, callback_s, messages):
    for depth in range(1, messages):
        if losses(PERIOD_S, CALLBACK_S, depth, MESSAGES) == 0:
            return depth
""",
            """
def smallest_depth(period_s, callback_s, messages):
    depth = 1
    while losses(period_s, callback_s, depth, messages) > 0:
        pass
    return depth
""",
        ],
        'right': [
            """
def smallest_depth(period_s, callback_s, messages):
    for depth in range(1, messages + 1):
        if not losses(period_s, callback_s, depth, messages):
            return depth
""",
            """
from itertools import count


def smallest_depth(period_s, callback_s, messages):
    return next(d for d in count(1) if losses(period_s, callback_s, d, messages) == 0)
""",
            """
def smallest_depth(period_s, callback_s, messages):
    depth = messages
    while depth > 1 and losses(period_s, callback_s, depth - 1, messages) == 0:
        depth -= 1
    return depth
""",
        ],
    },
    6: {
        'wrong': [
            body(
                COUNTER,
                """
self.missing = range(self.expected, number)
self.expected = number + 1
super().listener_callback(message)
""",
            ),
            body(
                COUNTER,
                """
self.missing.extend(range(self.expected, number))
self.expected += 1
super().listener_callback(message)
""",
            ),
            body(
                COUNTER,
                """
self.missing.extend(range(self.expected, number + 1))
self.expected = number + 1
super().listener_callback(message)
""",
            ),
            body(
                COUNTER,
                """
if number != self.expected:
    self.missing.append(self.expected)
self.expected = number + 1
super().listener_callback(message)
""",
            ),
            body(
                COUNTER,
                """
if self.expected > 0:
    self.missing.extend(range(self.expected, number))
self.expected = number + 1
super().listener_callback(message)
""",
            ),
            body(
                COUNTER,
                """
self.missing.append(range(self.expected, number))
self.expected = number + 1
super().listener_callback(message)
""",
            ),
        ],
        'right': [
            body(
                COUNTER,
                """
while self.expected < number:
    self.missing.append(self.expected)
    self.expected += 1
self.expected += 1
super().listener_callback(message)
""",
            ),
            body(
                COUNTER,
                """
self.missing += [one for one in range(self.expected, number)]
self.expected = number + 1
super().listener_callback(message)
""",
            ),
            body(
                COUNTER,
                """
super().listener_callback(message)
for one in range(number):
    if one >= self.expected:
        self.missing.append(one)
self.expected = max(self.expected, number + 1)
""",
            ),
        ],
    },
    7: {
        'wrong': [
            TALKER + END,
            TALKER
            + """
node = Node('talker')
publisher = node.create_publisher(String, 'topic', 10)
wait_for_subscriber(publisher)
for number in range(1, 50):
    publisher.publish(String(data=f'Hello World: {number + 1}'))
publisher.wait_for_all_acked(Duration(seconds=10))
"""
            + END,
            TALKER
            + """
node = Node('talker')
publisher = node.create_publisher(String, 'topics', 10)
wait_for_subscriber(publisher)
for number in range(50):
    publisher.publish(String(data=f'Hello World: {number}'))
publisher.wait_for_all_acked(Duration(seconds=10))
"""
            + END,
            TALKER
            + """
node = Node('talker')
publisher = node.create_publisher(String, 'topic', 10)
for number in range(50):
    publisher.publish(String(data=f'Hello World: {number}'))
publisher.wait_for_all_acked(Duration(seconds=10))
"""
            + END,
            TALKER
            + """
publisher = create_publisher(String, 'topic', 10)
wait_for_subscriber(publisher)
for number in range(50):
    publisher.publish(String(data=f'Hello World: {number}'))
"""
            + END,
            TALKER
            + """
node = Node('talker')
publisher = node.create_publisher(String, 'topic', 10)
wait_for_subscriber(publisher)
publisher.publish(String(data='Hello World: 0'))
publisher.wait_for_all_acked(Duration(seconds=10))
"""
            + END,
        ],
        'right': [
            TALKER
            + """
talker = rclpy.create_node('talker')
publisher = talker.create_publisher(String, 'topic', qos_profile=10)
wait_for_subscriber(publisher)
message = String()
for i in range(0, 50):
    message.data = 'Hello World: ' + str(i)
    publisher.publish(message)
publisher.wait_for_all_acked(Duration(seconds=10))
"""
            + END,
            TALKER
            + """
class Talker(Node):
    def __init__(self):
        super().__init__('talker')
        self.publisher = self.create_publisher(String, '/topic', 10)

    def talk(self):
        wait_for_subscriber(self.publisher)
        for number in range(50):
            self.publisher.publish(String(data=f'Hello World: {number}'))
        self.publisher.wait_for_all_acked(Duration(seconds=10))


Talker().talk()
"""
            + END,
            TALKER
            + """
node = Node('talker')
publisher = node.create_publisher(String, 'topic', 100)
wait_for_subscriber(publisher)
number = 0
while number < 50:
    publisher.publish(String(data=f'Hello World: {number}'))
    number += 1
publisher.wait_for_all_acked(Duration(seconds=10))
node.destroy_node()
rclpy.shutdown()
"""
            + END,
        ],
    },
}
