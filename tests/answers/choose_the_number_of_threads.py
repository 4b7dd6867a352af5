"""Answers to the tasks of lesson 04, as students give them."""

GATED = """
class GatedSubscriber(Node):
    def __init__(self, depth, group, events=QUIET):
        super().__init__('gated_subscriber')
        self.gate = threading.Event()
        self.subscription = self.create_subscription(
            Int32,
            'number',
            self.number_callback,
            depth,
            callback_group=group,
            event_callbacks=events,
        )

    def number_callback(self, message):
        self.gate.wait(timeout=60)
"""
PUBLISHER = """
class NumberPublisher(Node):
    def __init__(self, messages, period_s):
        super().__init__('number_publisher')
        self.messages = messages
        self.publisher = self.create_publisher(Int32, 'number', DEPTH)
        self.timer = self.create_timer(period_s, self.timer_callback)
        self.count = 0

    def timer_callback(self):
        self.publisher.publish(Int32(data=self.count))
        self.count += 1
        if self.count == self.messages:
            self.timer.cancel()
"""
WORKING = """
class WorkingSubscriber(Node):
    def __init__(self, work):
        super().__init__('working_subscriber')
        self.work = work
        self.subscription = self.create_subscription(
            Int32,
            'number',
            self.number_callback,
            DEPTH,
            callback_group=ReentrantCallbackGroup(),
            event_callbacks=QUIET,
        )

    def number_callback(self, message):
        self.work()
"""


def law(returned: str) -> str:
    """Return the function of task 2 with this result."""
    return f'def heard_after_burst(in_flight, depth, more):\n    return {returned}\n'


def depth(returned: str) -> str:
    """Return the function of task 3 with this result."""
    return f'def depth_for_burst(messages, threads):\n    return {returned}\n'


def rule(returned: str) -> str:
    """Return the function of task 6 with this result."""
    return f'def threads_needed(rate_hz, callback_s, reserve=0.0):\n    return {returned}\n'


ANSWERS = {
    1: {
        'wrong': [
            GATED.replace('            callback_group=group,\n', ''),
            GATED.replace('            event_callbacks=events,\n', ''),
            GATED.replace('            depth,', '            10,'),
            GATED.replace('self.gate.wait(timeout=60)', 'pass'),
            GATED.replace('self.gate.wait(timeout=60)', 'self.gate.set()'),
            GATED.replace("'number',", "'numbers',"),
            GATED.replace('threading.Event()', 'threading.Lock()'),
        ],
        'right': [
            GATED.replace('wait(timeout=60)', 'wait(60)'),
            GATED.replace('self.number_callback,', 'lambda message: self.gate.wait(timeout=60),'),
            GATED.replace(
                'self.gate.wait(timeout=60)',
                'while not self.gate.is_set():\n            self.gate.wait(timeout=60)',
            ),
        ],
    },
    2: {
        'wrong': [
            law('in_flight + depth'),
            law('min(in_flight + depth, more)'),
            law('max(depth, more) + in_flight'),
            law('depth'),
            law('in_flight + min(10, more)'),
        ],
        'right': [
            law('min(in_flight + depth, in_flight + more)'),
            law('in_flight + (depth if more > depth else more)'),
            'def heard_after_burst(in_flight, depth, more):\n'
            '    lost = max(0, more - depth)\n'
            '    return in_flight + more - lost\n',
        ],
    },
    3: {
        'wrong': [
            depth('messages'),
            depth('messages - threads'),
            depth('messages - threads - 1'),
            depth('28'),
            depth('messages / threads'),
        ],
        'right': [
            depth('max(messages - threads, 1)'),
            depth('messages - threads if messages > threads else 1'),
            'def depth_for_burst(messages, threads):\n'
            '    depth = 1\n'
            '    while heard_after_burst(threads, depth, messages - threads) < messages:\n'
            '        depth += 1\n'
            '    return depth\n',
        ],
    },
    4: {
        'wrong': [
            PUBLISHER.replace('self.count = 0', 'self.count = 1'),
            PUBLISHER.replace('            self.timer.cancel()', '            pass'),
            PUBLISHER.replace('self.count == self.messages', 'self.count > self.messages'),
            PUBLISHER.replace('period_s, self', '0.025, self'),
            PUBLISHER.replace('Int32(data=self.count)', 'self.count'),
            PUBLISHER.replace("'number'", "'numbers'"),
            PUBLISHER.replace('        self.count += 1\n', ''),
        ],
        'right': [
            """
class NumberPublisher(Node):
    def __init__(self, messages, period_s):
        super().__init__('number_publisher')
        self.numbers = iter(range(messages))
        self.publisher = self.create_publisher(Int32, 'number', DEPTH)
        self.timer = self.create_timer(period_s, self.timer_callback)

    def timer_callback(self):
        number = next(self.numbers, None)
        if number is None:
            self.timer.cancel()
        else:
            self.publisher.publish(Int32(data=number))
""",
            PUBLISHER.replace('self.timer.cancel()', 'self.destroy_timer(self.timer)'),
            """
class NumberPublisher(Node):
    def __init__(self, messages, period_s):
        super().__init__('number_publisher')
        self.publisher = self.create_publisher(Int32, '/number', DEPTH)
        self.left = list(range(messages))
        self.create_timer(period_s, self.publish_next)

    def publish_next(self):
        if self.left:
            message = Int32()
            message.data = self.left.pop(0)
            self.publisher.publish(message)
""",
        ],
    },
    5: {
        'wrong': [
            WORKING.replace('ReentrantCallbackGroup', 'MutuallyExclusiveCallbackGroup'),
            WORKING.replace('            callback_group=ReentrantCallbackGroup(),\n', ''),
            WORKING.replace('            event_callbacks=QUIET,\n', ''),
            WORKING.replace('        self.work()', '        self.work'),
            WORKING.replace('            DEPTH,', '            1,'),
            WORKING.replace('self.subscription = ', ''),
        ],
        'right': [
            WORKING.replace('self.number_callback,', 'lambda _: work(),'),
            WORKING.replace('ReentrantCallbackGroup()', 'self.group').replace(
                '        self.work = work\n',
                '        self.work, self.group = work, ReentrantCallbackGroup()\n',
            ),
            WORKING.replace("'number'", "topic='/number'")
            .replace('self.number_callback,', 'callback=self.number_callback,')
            .replace('DEPTH,', 'qos_profile=DEPTH,'),
        ],
    },
    6: {
        'wrong': [
            rule('int(rate_hz * callback_s * (1 + reserve))'),
            rule('math.ceil(rate_hz * callback_s)'),
            rule('math.ceil(rate_hz * callback_s * (1 + reserve)) + 1'),
            rule('rate_hz * callback_s * (1 + reserve)'),
            rule('math.ceil(rate_hz / callback_s)'),
            rule('round(rate_hz * callback_s * (1 + reserve))'),
        ],
        'right': [
            rule('math.ceil(rate_hz * (callback_s + callback_s * reserve))'),
            rule('max(1, -int(-(rate_hz * callback_s * (1 + reserve)) // 1))'),
            'def threads_needed(rate_hz, callback_s, reserve=0.0):\n'
            '    threads = 1\n'
            '    while threads < rate_hz * callback_s * (1 + reserve):\n'
            '        threads += 1\n'
            '    return threads\n',
        ],
    },
    7: {
        'wrong': [
            """
def cpu_part(work):
    cpu_s, time_s = time.process_time(), time.monotonic()
    work()
    return (time.process_time() - cpu_s) / (time.monotonic() - time_s)
""",
            """
def cpu_part(work):
    cpu_s, time_s = time.thread_time(), time.monotonic()
    work()
    return (time.monotonic() - time_s) / (time.thread_time() - cpu_s)
""",
            """
def cpu_part(work):
    cpu_s = time.thread_time()
    work()
    return time.thread_time() - cpu_s > 0.01
""",
            """
def cpu_part(work):
    cpu_s, time_s = time.thread_time(), time.monotonic()
    return (time.thread_time() - cpu_s) / (time.monotonic() - time_s)
""",
            """
def cpu_part(work):
    work()
    return time.thread_time() / time.monotonic()
""",
            """
def cpu_part(work):
    cpu_s, time_s = time.thread_time(), time.monotonic()
    work()
    work()
    return (time.thread_time() - cpu_s) / (time.monotonic() - time_s)
""",
        ],
        'right': [
            """
def cpu_part(work):
    begin, begin_cpu = time.monotonic(), time.thread_time()
    work()
    end, end_cpu = time.monotonic(), time.thread_time()
    return (end_cpu - begin_cpu) / (end - begin)
""",
            """
def cpu_part(work):
    time_s = -time.monotonic()
    cpu_s = -time.thread_time()
    work()
    cpu_s += time.thread_time()
    time_s += time.monotonic()
    return min(1.0, cpu_s / time_s)
""",
            """
def clocks():
    return time.thread_time_ns(), time.monotonic_ns()


def cpu_part(work):
    before = clocks()
    work()
    cpu, wall = (b - a for a, b in zip(before, clocks()))
    return cpu / wall
""",
        ],
    },
    8: {
        'wrong': [
            """
def spin_until(executor, done):
    executor.spin_once(timeout_sec=0.1)
    done()
""",
            """
def spin_until(executor, done):
    while not done:
        executor.spin_once(timeout_sec=0.1)
""",
            """
def spin_until(executor, done):
    while done():
        executor.spin_once(timeout_sec=0.1)
""",
            """
def spin_until(executor, done):
    for _ in range(4):
        executor.spin_once(timeout_sec=0.1)
""",
            """
def spin_until(executor, done):
    if not done():
        executor.spin_once(timeout_sec=0.1)
""",
        ],
        'right': [
            """
def spin_until(executor, done):
    while True:
        if done():
            break
        executor.spin_once(timeout_sec=0.1)
""",
            """
def spin_until(executor, done):
    finished = done()
    while not finished:
        executor.spin_once(timeout_sec=0.1)
        finished = done()
""",
            """
def spin_until(executor, done):
    while done() is False:
        executor.spin_once(timeout_sec=0.05)
""",
        ],
    },
}
