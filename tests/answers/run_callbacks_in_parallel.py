"""Answers to the tasks of lesson 03, as students give them."""

SLOW = """
class SlowSubscriber(Node):
    def __init__(self, group):
        super().__init__('slow_subscriber')
        self.subscription = self.create_subscription(
            String,
            'topic',
            self.listener_callback,
            DEPTH,
            callback_group=group,
            event_callbacks=QUIET,
        )

    def listener_callback(self, message):
        time.sleep(CALLBACK_S)
"""
TWO_TOPICS = """
class TwoTopics(Node):
    def __init__(self):
        super().__init__('two_topics')
        camera_group = {camera}
        battery_group = {battery}
        self.create_subscription(
            Int32, 'camera', self.camera_callback, 10, callback_group=camera_group
        )
        self.create_subscription(
            Int32, 'battery', self.battery_callback, 10, callback_group=battery_group
        )

    def camera_callback(self, message): ...

    def battery_callback(self, message): ...


def make_my_executor():
    return {executor}
"""
EXCLUSIVE, REENTRANT = 'MutuallyExclusiveCallbackGroup()', 'ReentrantCallbackGroup()'


def two_topics(camera: str, battery: str, executor: str) -> str:
    """Return the answer with these groups and this executor."""
    return TWO_TOPICS.format(camera=camera, battery=battery, executor=executor)


UNEQUAL = """
class UnequalSubscriber(Node):
    def __init__(self):
        super().__init__('unequal_subscriber')
        self.small_one_done = threading.Event()
        self.finished = []
        self.subscription = self.create_subscription(
            Int32, 'number', self.number_callback, 10, callback_group=ReentrantCallbackGroup()
        )

    def number_callback(self, message):
"""
LOCKING = """
class LockingSubscriber(CountingSubscriber):
    def __init__(self):
        super().__init__()
        self.lock = threading.Lock()

    def number_callback(self, message):
"""
ODOMETER = """
class Odometer(Worker):
    def __init__(self):
        super().__init__('odometer')
        self.total = 0
        self.longest = 0
        self.finished = []
        self.lock = threading.Lock()
        self.subscription = self.create_subscription(
            Int32, 'number', self.distance_callback, 100, callback_group=ReentrantCallbackGroup()
        )

    def distance_callback(self, message):
"""


def body(head: str, lines: str) -> str:
    """Return the head, and below it the lines, indented."""
    return head + ''.join(f'        {line}\n' for line in lines.strip('\n').splitlines())


ANSWERS = {
    1: {
        'wrong': [
            SLOW.replace('            callback_group=group,\n', ''),
            SLOW.replace('            event_callbacks=QUIET,\n', ''),
            SLOW.replace('DEPTH', '1'),
            SLOW.replace('time.sleep(CALLBACK_S)', 'pass'),
            SLOW.replace("'topic'", "'number'"),
            SLOW.replace('callback_group=group', 'callback_group=ReentrantCallbackGroup()'),
            SLOW.replace('self.subscription = ', ''),
        ],
        'right': [
            SLOW.replace('self, message', 'self, msg'),
            SLOW.replace('self.listener_callback', 'lambda message: time.sleep(CALLBACK_S)'),
            SLOW.replace('String,', 'msg_type=String,')
            .replace("'topic'", "topic='/topic'")
            .replace('self.listener_callback,', 'callback=self.listener_callback,')
            .replace('DEPTH,', 'qos_profile=DEPTH,'),
        ],
    },
    2: {
        'wrong': [
            """
def combination(letter):
    return MultiThreadedExecutor(num_threads=THREADS), ReentrantCallbackGroup()
""",
            """
def combination(letter):
    executor = SingleThreadedExecutor() if letter in 'AC' else MultiThreadedExecutor(THREADS)
    group = MutuallyExclusiveCallbackGroup() if letter in 'AB' else ReentrantCallbackGroup()
    return executor, group
""",
            """
def combination(letter):
    executor = SingleThreadedExecutor() if letter in 'AB' else MultiThreadedExecutor(4)
    group = MutuallyExclusiveCallbackGroup() if letter in 'AC' else ReentrantCallbackGroup()
    return executor, group
""",
            """
def combination(letter):
    executor = SingleThreadedExecutor if letter in 'AB' else MultiThreadedExecutor
    group = MutuallyExclusiveCallbackGroup if letter in 'AC' else ReentrantCallbackGroup
    return executor, group
""",
            """
def combination(letter):
    executor = SingleThreadedExecutor() if letter in 'AB' else MultiThreadedExecutor(THREADS)
    group = MutuallyExclusiveCallbackGroup() if letter in 'AC' else ReentrantCallbackGroup()
    return group, executor
""",
        ],
        'right': [
            """
def combination(letter):
    executor = SingleThreadedExecutor() if letter in 'AB' else MultiThreadedExecutor(THREADS)
    group = MutuallyExclusiveCallbackGroup() if letter in 'AC' else ReentrantCallbackGroup()
    return executor, group
""",
            """
def combination(letter):
    if letter == 'A':
        return SingleThreadedExecutor(), MutuallyExclusiveCallbackGroup()
    elif letter == 'B':
        return SingleThreadedExecutor(), ReentrantCallbackGroup()
    elif letter == 'C':
        return MultiThreadedExecutor(num_threads=8), MutuallyExclusiveCallbackGroup()
    return MultiThreadedExecutor(num_threads=8), ReentrantCallbackGroup()
""",
            """
def combination(letter):
    executors = {'A': SingleThreadedExecutor, 'B': SingleThreadedExecutor}
    groups = {'A': MutuallyExclusiveCallbackGroup, 'C': MutuallyExclusiveCallbackGroup}
    many = lambda: MultiThreadedExecutor(num_threads=THREADS)
    return executors.get(letter, many)(), groups.get(letter, ReentrantCallbackGroup)()
""",
        ],
    },
    3: {
        'wrong': [
            two_topics('None', 'None', 'MultiThreadedExecutor(num_threads=2)'),
            two_topics(EXCLUSIVE, EXCLUSIVE, 'SingleThreadedExecutor()'),
            two_topics(REENTRANT, EXCLUSIVE, 'MultiThreadedExecutor(num_threads=4)'),
            two_topics(REENTRANT, 'camera_group', 'MultiThreadedExecutor(num_threads=4)'),
            two_topics(EXCLUSIVE, 'camera_group', 'MultiThreadedExecutor(num_threads=4)'),
            two_topics(EXCLUSIVE, EXCLUSIVE, 'MultiThreadedExecutor(num_threads=1)'),
            two_topics(EXCLUSIVE, EXCLUSIVE, 'MultiThreadedExecutor'),
            two_topics(
                'MutuallyExclusiveCallbackGroup',
                'MutuallyExclusiveCallbackGroup',
                'MultiThreadedExecutor(num_threads=2)',
            ),
        ],
        'right': [
            two_topics(EXCLUSIVE, REENTRANT, 'MultiThreadedExecutor(num_threads=4)'),
            two_topics('None', EXCLUSIVE, 'MultiThreadedExecutor(2)'),
            """
class TwoTopics(Node):
    def __init__(self):
        super().__init__('two_topics')
        for topic in ('camera', 'battery'):
            self.create_subscription(
                Int32,
                topic,
                self.camera_callback if topic == 'camera' else self.battery_callback,
                10,
                callback_group=MutuallyExclusiveCallbackGroup(),
                event_callbacks=QUIET,
            )

    def camera_callback(self, message): ...

    def battery_callback(self, message): ...


def make_my_executor():
    executor = MultiThreadedExecutor(num_threads=8)
    return executor
""",
        ],
    },
    4: {
        'wrong': [
            body(UNEQUAL, 'self.finished.append(message.data)\nself.small_one_done.set()'),
            body(
                UNEQUAL,
                """
self.finished.append(message.data)
if message.data == 0:
    self.small_one_done.wait(timeout=5)
if message.data == 1:
    self.small_one_done.set()
""",
            ),
            body(
                UNEQUAL,
                """
if message.data == 0:
    self.small_one_done.wait(timeout=5)
self.finished.append(message.data)
""",
            ),
            body(
                UNEQUAL,
                """
self.small_one_done.wait(timeout=5)
self.finished.append(message.data)
self.small_one_done.set()
""",
            ),
            body(
                UNEQUAL,
                """
if message.data == 0:
    self.small_one_done.wait(timeout=5)
self.finished.append(message.data)
self.small_one_done.set()
""",
            ),
            body(
                UNEQUAL,
                """
if message.data == 1:
    self.small_one_done.wait(timeout=5)
self.finished.append(message.data)
if message.data == 0:
    self.small_one_done.set()
""",
            ),
        ],
        'right': [
            body(
                UNEQUAL,
                """
number = message.data
if number == 0:
    self.small_one_done.wait(timeout=10)
self.finished.append(number)
if number == 1:
    self.small_one_done.set()
""",
            ),
            body(
                UNEQUAL,
                """
if message.data == 0:
    self.small_one_done.wait(5)
    self.finished.append(message.data)
elif message.data == 1:
    self.finished.append(message.data)
    self.small_one_done.set()
else:
    self.finished.append(message.data)
""",
            ),
            body(
                UNEQUAL,
                """
if not message.data:
    while not self.small_one_done.wait(timeout=0.5):
        pass
self.finished += [message.data]
if message.data == 1 and not self.small_one_done.is_set():
    self.small_one_done.set()
""",
            ),
        ],
    },
    5: {
        'wrong': [
            body(
                LOCKING,
                """
with self.lock:
    count = self.count
    self.work()
    self.count = count + 1
self.finished.append(message.data)
""",
            ),
            body(
                LOCKING,
                """
with self.lock:
    count = self.count
self.work()
with self.lock:
    self.count = count + 1
self.finished.append(message.data)
""",
            ),
            body(
                LOCKING,
                """
self.work()
with self.lock:
    count = self.count
with self.lock:
    self.count = count + 1
self.finished.append(message.data)
""",
            ),
            body(
                LOCKING,
                """
self.work()
self.count += 1
self.finished.append(message.data)
""",
            ),
            body(
                LOCKING,
                """
with self.lock:
    self.count = self.count + 1
self.finished.append(message.data)
""",
            ),
            body(
                LOCKING,
                """
self.work()
with threading.Lock():
    self.count = self.count + 1
self.finished.append(message.data)
""",
            ),
            body(
                LOCKING,
                """
count = self.count
self.work()
with self.lock:
    self.count = count + 1
self.finished.append(message.data)
""",
            ),
        ],
        'right': [
            body(
                LOCKING,
                """
with self.lock:
    self.count += 1
self.work()
self.finished.append(message.data)
""",
            ),
            body(
                LOCKING,
                """
self.work()
self.lock.acquire()
try:
    count = self.count
    self.count = count + 1
finally:
    self.lock.release()
self.finished.append(message.data)
""",
            ),
            body(
                LOCKING.replace('Lock()', 'RLock()'),
                """
self.work()
with self.lock:
    count = self.count
    count = count + 1
    self.count = count
    self.finished.append(message.data)
""",
            ),
        ],
    },
    6: {
        'wrong': [
            body(
                ODOMETER,
                """
self.work()
self.total += message.data
self.longest = max(self.longest, message.data)
self.finished.append(message.data)
""",
            ),
            body(
                ODOMETER,
                """
with self.lock:
    self.work()
    self.total += message.data
    self.longest = max(self.longest, message.data)
self.finished.append(message.data)
""",
            ),
            body(
                ODOMETER,
                """
self.work()
with self.lock:
    total = self.total
with self.lock:
    self.total = total + message.data
    self.longest = max(self.longest, message.data)
self.finished.append(message.data)
""",
            ),
            body(
                ODOMETER.replace('ReentrantCallbackGroup', 'MutuallyExclusiveCallbackGroup'),
                """
self.work()
with self.lock:
    self.total += message.data
    self.longest = max(self.longest, message.data)
self.finished.append(message.data)
""",
            ),
            body(
                ODOMETER,
                """
self.work()
with self.lock:
    self.total += message.data
    self.longest = min(self.longest, message.data)
self.finished.append(message.data)
""",
            ),
            body(
                ODOMETER.replace('            Int32', '            String'),
                """
self.work()
with self.lock:
    self.total += message.data
    self.longest = max(self.longest, message.data)
self.finished.append(message.data)
""",
            ),
        ],
        'right': [
            body(
                ODOMETER,
                """
distance = message.data
with self.lock:
    self.total = self.total + distance
    if distance > self.longest:
        self.longest = distance
self.work()
self.finished.append(distance)
""",
            ),
            body(
                ODOMETER.replace('self.lock', 'self.guard'),
                """
self.work()
self.guard.acquire()
self.total += message.data
self.longest = max(message.data, self.longest)
self.guard.release()
self.finished.append(message.data)
""",
            ),
            body(
                ODOMETER.replace(
                    'self.lock = threading.Lock()',
                    'self.lock = threading.Lock()\n        self.other = threading.Lock()',
                ),
                """
self.work()
with self.lock:
    self.total += message.data
with self.other:
    self.longest = max(self.longest, message.data)
self.finished.append(message.data)
""",
            ),
        ],
    },
}
