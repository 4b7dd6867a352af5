"""Answers to the tasks of lesson 05, as students give them: the checks must judge all right."""

BRAKE = """
class Brake(Node):
    def __init__(self, depth, speed=0.5, look=look_ahead):
        super().__init__('brake')
        self.speed, self.look = speed, look
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        self.subscription = self.create_subscription(LaserScan, 'scan', self.scan_callback, depth)

    def command(self, speed):
        twist = Twist()
        twist.linear.x = speed
        self.publisher.publish(twist)

    def scan_callback(self, scan):
        LINES
"""
SPIN = """
def spin(session, node):
    LINES
"""
AGE_BRAKE = """
class AgeBrake(Brake):
    def __init__(self, depth, **options):
        super().__init__(depth, **options)
        self.ages_s = []

    def scan_callback(self, scan):
        LINES
"""
ALLOWED = """
RADIUS_M, BRAKING = 0.11, 2.5


def allowed_s(speed, limit=LIMIT_M):
    LINES
"""
CAREFUL = """
class CarefulBrake(Brake):
    def __init__(self, depth, most_s, **options):
        super().__init__(depth, **options)
        self.most_s = most_s

    def scan_callback(self, scan):
        LINES
"""
STOP = """
class StopBrake(Brake):
    def __init__(self, depth, **options):
        super().__init__(depth, **options)
        self.stopped, self.lock = threading.Event(), threading.Lock()
        LINES

    def command(self, speed):
        with self.lock:
            super().command(0.0 if self.stopped.is_set() else speed)
"""
NEWEST = """
class Newest:
    def __init__(self):
        self.condition = threading.Condition()
        self.waiting = []

    def put(self, scan):
        LINES

    def take(self):
        with self.condition:
            self.condition.wait_for(lambda: self.waiting)
            return self.waiting.pop(0)
"""
WORKER = """
class NewestBrake(StopBrake):
    def __init__(self, depth, **options):
        super().__init__(depth, **options)
        self.newest = Newest()
        self.worker = threading.Thread(target=self.work, daemon=True)
        self.worker.start()

    def scan_callback(self, scan):
        PUT

    def work(self):
        LINES

    def destroy_node(self):
        self.newest.put(None)
        self.worker.join()
        super().destroy_node()
"""
LISTEN = """
def listen(node, qos, missed, counts):
    LINES
"""
WATCHDOG = """
class LaserWatchdog(Node):
    def __init__(self, most_s):
        super().__init__('laser_watchdog')
        self.most_s = most_s
        self.last_s = START
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        self.create_subscription(LaserScan, 'scan', self.scan_callback, 1)
        self.create_timer(0.1, self.timer_callback)

    def scan_callback(self, scan):
        self.last_s = time.monotonic()

    def timer_callback(self):
        LINES
"""
LASER_QOS = 'QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, deadline=Duration({}))'
MAP_QOS = 'QoSProfile(depth={}, durability=DurabilityPolicy.TRANSIENT_LOCAL)'


def fill(frame: str, lines: str, **more: str) -> str:
    """Return the frame with the lines in the place of LINES, indented as it is."""
    for word, text in {'LINES': lines, **more}.items():
        [place] = [line for line in frame.splitlines() if word in line]
        if place.strip() != word:
            frame = frame.replace(word, text)
            continue
        indent = place[: place.index(word)]
        frame = frame.replace(place, '\n'.join(indent + line for line in text.splitlines()))
    return frame


def profiles(laser: str, of_map: str) -> str:
    """Return a cell with both profiles."""
    return f'laser_qos = {laser}\nmap_qos = {of_map}\n'


OLD = 'age = self.get_clock().now() - Time.from_msg(scan.header.stamp)\n'
SECONDS = 'age_s = (self.get_clock().now() - Time.from_msg(scan.header.stamp)).nanoseconds / 1e9\n'
LISTENS = (
    "node.create_subscription(LaserScan, 'scan', lambda scan: None, qos, event_callbacks=events)"
)
LATE = 'time.monotonic() - self.last_s > self.most_s'
RIGHT_LASER = LASER_QOS.format('seconds=0.5')

ANSWERS = {
    1: {
        'wrong': [
            fill(BRAKE, 'self.command(self.speed)'),
            fill(BRAKE, 'self.command(0.0 if self.look(scan) > LIMIT_M else self.speed)'),
            fill(BRAKE, 'if self.look(scan) < LIMIT_M:\n    self.command(0.0)'),
            fill(BRAKE, 'self.command(0.0 if self.look(scan) < LIMIT_M else 0.5)'),
            fill(BRAKE, 'self.command(0.0 if min(scan.ranges) < LIMIT_M else self.speed)'),
            fill(BRAKE, 'self.command(0 if self.look(scan) < LIMIT_M else self.speed)').replace(
                'twist.linear.x = speed', 'twist.linear = speed'
            ),
            fill(BRAKE, 'self.command(0.0 if self.look(scan) < LIMIT_M else self.speed)').replace(
                'twist.linear.x = speed', 'twist.angular.z = speed'
            ),
        ],
        'right': [
            fill(BRAKE, 'self.command(0.0 if self.look(scan) < LIMIT_M else self.speed)'),
            fill(
                BRAKE,
                'speed = self.speed\nif self.look(scan) < LIMIT_M:\n    speed = 0.0\n'
                'self.command(speed)',
            ),
            fill(
                BRAKE,
                'distance = self.look(scan)\n'
                'if distance >= LIMIT_M:\n    self.command(self.speed)\n'
                'else:\n    self.command(0.0)',
            ),
            fill(BRAKE, 'self.command(self.speed * (self.look(scan) >= LIMIT_M))').replace(
                'twist.linear.x = speed', 'twist.linear.x = float(speed)'
            ),
        ],
    },
    2: {
        'wrong': [
            fill(SPIN, 'return SingleThreadedExecutor()'),
            fill(
                SPIN,
                'executor = SingleThreadedExecutor()\nexecutor.add_node(node)\nreturn executor',
            ),
            fill(
                SPIN,
                'executor = SingleThreadedExecutor()\nexecutor.add_node(node)\n'
                'session.spin(executor)',
            ),
            fill(
                SPIN,
                'executor = SingleThreadedExecutor()\nsession.spin(executor)\nreturn executor',
            ),
            fill(SPIN, 'session.spin(node)\nreturn node'),
            fill(SPIN, 'executor = SingleThreadedExecutor(node)\nsession.spin(executor)'),
        ],
        'right': [
            fill(
                SPIN,
                'executor = SingleThreadedExecutor()\nexecutor.add_node(node)\n'
                'session.spin(executor)\nreturn executor',
            ),
            fill(
                SPIN,
                'one = SingleThreadedExecutor()\nsession.spin(one)\none.add_node(node)\nreturn one',
            ),
            fill(
                SPIN,
                'import rclpy\nexecutor = rclpy.executors.SingleThreadedExecutor()\n'
                'assert executor.add_node(node)\nsession.spin(executor=executor)\nreturn executor',
            ),
        ],
    },
    3: {
        'wrong': [
            fill(AGE_BRAKE, 'super().scan_callback(scan)'),
            fill(
                AGE_BRAKE, f'{OLD}self.ages_s.append(age.nanoseconds)\nsuper().scan_callback(scan)'
            ),
            fill(AGE_BRAKE, f'{SECONDS}super().scan_callback(scan)\nself.ages_s.append(age_s)'),
            fill(AGE_BRAKE, f'{SECONDS}self.ages_s.append(age_s)'),
            fill(
                AGE_BRAKE,
                'self.ages_s.append(Time.from_msg(scan.header.stamp).nanoseconds / 1e9)\n'
                'super().scan_callback(scan)',
            ),
            fill(
                AGE_BRAKE,
                'self.ages_s.append(self.get_clock().now() - scan.header.stamp)\n'
                'super().scan_callback(scan)',
            ),
            fill(AGE_BRAKE, f'{SECONDS}self.ages_s = [age_s]\nsuper().scan_callback(scan)'),
        ],
        'right': [
            fill(AGE_BRAKE, f'{SECONDS}self.ages_s.append(age_s)\nsuper().scan_callback(scan)'),
            fill(
                AGE_BRAKE,
                'stamp = scan.header.stamp\nnow = self.get_clock().now().nanoseconds\n'
                'self.ages_s.append(now / 1e9 - stamp.sec - stamp.nanosec / 1e9)\n'
                'super().scan_callback(scan)',
            ),
            fill(
                AGE_BRAKE,
                'now, stamp = self.get_clock().now().to_msg(), scan.header.stamp\n'
                'self.ages_s += [now.sec - stamp.sec + (now.nanosec - stamp.nanosec) * 1e-9]\n'
                'Brake.scan_callback(self, scan)',
            ),
        ],
    },
    4: {
        'wrong': [
            fill(ALLOWED, 'return limit / speed'),
            fill(ALLOWED, 'return (limit - RADIUS_M) / speed'),
            fill(ALLOWED, 'return (limit - RADIUS_M - speed / BRAKING) / speed'),
            fill(ALLOWED, 'return limit - RADIUS_M - speed**2 / (2 * BRAKING)'),
            fill(ALLOWED, 'return (LIMIT_M - RADIUS_M - speed**2 / (2 * BRAKING)) / speed'),
            fill(ALLOWED, 'return (limit - RADIUS_M - speed**2 / 2 * BRAKING) / speed'),
            fill(ALLOWED, 'print((limit - RADIUS_M - speed**2 / (2 * BRAKING)) / speed)'),
        ],
        'right': [
            fill(ALLOWED, 'return (limit - RADIUS_M) / speed - speed / (2 * BRAKING)'),
            fill(
                ALLOWED,
                'left = limit - RADIUS_M\nleft -= speed * speed / BRAKING / 2\nreturn left / speed',
            ),
            fill(ALLOWED, 'return (limit - 0.11 - speed**2 / 5) / speed'),
        ],
    },
    5: {
        'wrong': [
            fill(CAREFUL, 'super().scan_callback(scan)'),
            fill(CAREFUL, f'{SECONDS}if age_s <= self.most_s:\n    super().scan_callback(scan)'),
            fill(CAREFUL, f'{SECONDS}if age_s > self.most_s:\n    self.command(0.0)'),
            fill(
                CAREFUL,
                f'{SECONDS}super().scan_callback(scan)\n'
                'if age_s > self.most_s:\n    self.command(0.0)',
            ),
            fill(
                CAREFUL,
                f'{SECONDS}if age_s > 10:\n    self.command(0.0)\n'
                'else:\n    super().scan_callback(scan)',
            ),
            fill(
                CAREFUL,
                f'{OLD}if age.nanoseconds > self.most_s:\n    self.command(0.0)\n'
                'else:\n    super().scan_callback(scan)',
            ),
            fill(
                CAREFUL,
                f'{SECONDS}if age_s < self.most_s:\n    self.command(0.0)\n'
                'else:\n    super().scan_callback(scan)',
            ),
        ],
        'right': [
            fill(
                CAREFUL,
                f'{SECONDS}if age_s > self.most_s:\n    self.command(0.0)\n'
                'else:\n    super().scan_callback(scan)',
            ),
            fill(
                CAREFUL,
                f'{OLD}if age > Duration(seconds=self.most_s):\n    self.command(0.0)\n    return\n'
                'super().scan_callback(scan)',
            ),
            """
class CarefulBrake(Brake):
    def __init__(self, depth, most_s, speed=0.5, look=look_ahead):
        super().__init__(depth, speed, look)
        self.most = Duration(seconds=most_s)

    def scan_callback(self, scan):
        fresh = Time.from_msg(scan.header.stamp) + self.most >= self.get_clock().now()
        self.command(self.speed if fresh and self.look(scan) >= LIMIT_M else 0.0)
""",
        ],
    },
    6: {
        'wrong': [
            fill(STOP, 'pass'),
            *(
                fill(STOP, f'self.create_subscription(Empty, {topic}, self.stop, 10)').replace(
                    '    def command',
                    f'    def stop(self, message):\n        {body}\n\n    def command',
                )
                for topic, body in (
                    ("'stop'", 'self.stopped.set()'),
                    ("'cmd_stop'", 'self.stopped.set()\n        self.command(0.0)'),
                    ("'stop'", 'self.stopped = True\n        self.command(0.0)'),
                    ("'stop'", 'self.speed = 0.0'),
                    ("'stop'", 'self.command(0.0)'),
                )
            ),
        ],
        'right': [
            fill(STOP, "self.create_subscription(Empty, 'stop', self.stop, 10)").replace(
                '    def command',
                f'    def stop(self, message):\n        {body}\n\n    def command',
            )
            for body in (
                'self.stopped.set()\n        self.command(0.0)',
                'self.stopped.set()\n        self.command(self.speed)',
                'self.speed = 0.0\n        self.stopped.set()\n        self.command(self.speed)',
            )
        ],
    },
    7: {
        'wrong': [
            fill(
                NEWEST,
                'with self.condition:\n    self.waiting.append(scan)\n    self.condition.notify()',
            ),
            fill(
                NEWEST,
                'with self.condition:\n    self.waiting.insert(0, scan)\n'
                '    self.condition.notify()',
            ),
            fill(NEWEST, 'with self.condition:\n    self.waiting = [scan]'),
            fill(
                NEWEST, 'with self.condition:\n    self.waiting = scan\n    self.condition.notify()'
            ),
            fill(NEWEST, 'self.waiting = [scan]\nself.condition.notify()'),
            fill(
                NEWEST,
                'with self.condition:\n    if not self.waiting:\n        self.waiting = [scan]\n'
                '    self.condition.notify()',
            ),
        ],
        'right': [
            fill(
                NEWEST,
                'with self.condition:\n    self.waiting = [scan]\n    self.condition.notify()',
            ),
            fill(
                NEWEST,
                'with self.condition:\n    self.waiting.clear()\n    self.waiting.append(scan)\n'
                '    self.condition.notify_all()',
            ),
            fill(
                NEWEST,
                'self.condition.acquire()\nself.waiting[:] = [scan]\nself.condition.notify()\n'
                'self.condition.release()',
            ),
        ],
    },
    8: {
        'wrong': [
            fill(WORKER, 'pass', PUT='super().scan_callback(scan)'),
            fill(WORKER, 'pass', PUT='self.newest.put(scan)'),
            fill(
                WORKER,
                'scan = self.newest.take()\nif scan is not None:\n    super().scan_callback(scan)',
                PUT='self.newest.put(scan)',
            ),
            fill(
                WORKER,
                'while (scan := self.newest.take()) is not None:\n    self.look(scan)',
                PUT='self.newest.put(scan)',
            ),
            fill(
                WORKER,
                'while (scan := self.newest.take()) is not None:\n    super().scan_callback(scan)',
                PUT='self.newest.put(scan)\nsuper().scan_callback(scan)',
            ),
            fill(
                WORKER,
                'while (scan := self.newest.take()) is not None:\n    self.command(self.speed)',
                PUT='self.newest.put(scan)',
            ),
            fill(
                WORKER,
                'while (scan := self.newest.take()) is not None:\n    super().scan_callback(scan)',
                PUT='self.newest.put(self.look(scan))',
            ),
        ],
        'right': [
            fill(
                WORKER,
                'while (scan := self.newest.take()) is not None:\n    super().scan_callback(scan)',
                PUT='self.newest.put(scan)',
            ),
            fill(
                WORKER,
                'while True:\n    scan = self.newest.take()\n    if scan is None:\n        return\n'
                '    near = self.look(scan) < LIMIT_M\n'
                '    self.command(0.0 if near else self.speed)',
                PUT='self.newest.put(scan)',
            ),
            fill(
                WORKER,
                'for scan in iter(self.newest.take, None):\n'
                '    StopBrake.scan_callback(self, scan)',
                PUT='self.newest.put(scan)',
            ),
        ],
    },
    9: {
        'wrong': [
            fill(LISTEN, "node.create_subscription(LaserScan, 'scan', lambda scan: None, qos)"),
            fill(
                LISTEN,
                f'events = SubscriptionEventCallbacks(deadline=missed.append)\n{LISTENS}',
            ),
            fill(
                LISTEN,
                'events = SubscriptionEventCallbacks(\n'
                '    deadline=missed.append, matched=counts.append)\n'
                f'{LISTENS}',
            ),
            fill(
                LISTEN,
                'events = SubscriptionEventCallbacks(\n    deadline=missed.append,\n'
                '    matched=lambda event: counts.append(event.total_count),\n)\n'
                f'{LISTENS}',
            ),
            fill(
                LISTEN,
                'events = SubscriptionEventCallbacks(\n    liveliness=missed.append,\n'
                '    matched=lambda event: counts.append(event.current_count),\n)\n'
                f'{LISTENS}',
            ),
            fill(
                LISTEN,
                'events = PublisherEventCallbacks(\n    deadline=missed.append,\n'
                '    matched=lambda event: counts.append(event.current_count),\n)\n'
                "node.create_subscription(LaserScan, 'scan', lambda scan: None, qos)",
            ),
        ],
        'right': [
            fill(
                LISTEN,
                'events = SubscriptionEventCallbacks(\n    deadline=missed.append,\n'
                '    matched=lambda event: counts.append(event.current_count),\n)\n'
                f'{LISTENS}',
            ),
            fill(
                LISTEN,
                'def late(event):\n    missed.append(event)\n\n'
                'def changed(event):\n    counts.append(event.current_count)\n\n'
                'events = SubscriptionEventCallbacks(deadline=late, matched=changed)\n'
                f'{LISTENS}',
            ),
            fill(
                LISTEN,
                "node.create_subscription(\n    LaserScan, '/scan', print, qos,\n"
                '    event_callbacks=SubscriptionEventCallbacks(\n'
                '        matched=lambda one: counts.append(one.current_count),\n'
                '        deadline=lambda one: missed.append(one.total_count)))',
            ),
        ],
    },
    10: {
        'wrong': [
            fill(WATCHDOG, 'pass', START='None'),
            fill(WATCHDOG, f'if {LATE}:\n    self.publisher.publish(Twist())', START='None'),
            fill(
                WATCHDOG,
                f'if self.last_s and {LATE}:\n    self.publisher.publish(Twist())',
                START='None',
            ),
            fill(WATCHDOG, 'self.publisher.publish(Twist())', START='0.0'),
            fill(
                WATCHDOG,
                f'if not {LATE}:\n    self.publisher.publish(Twist())',
                START='time.monotonic()',
            ),
            fill(
                WATCHDOG,
                'if self.last_s is None:\n    self.publisher.publish(Twist())',
                START='None',
            ),
            fill(
                WATCHDOG, f'if {LATE}:\n    self.publisher.publish(Twist)', START='time.monotonic()'
            ),
        ],
        'right': [
            fill(
                WATCHDOG,
                f'if {LATE}:\n    self.publisher.publish(Twist())',
                START='time.monotonic()',
            ),
            """
class LaserWatchdog(Node):
    def __init__(self, most_s):
        super().__init__('laser_watchdog')
        self.most = Duration(seconds=most_s)
        self.last = self.get_clock().now()
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 10)
        self.subscription = self.create_subscription(LaserScan, '/scan', self.on_scan, 1)
        self.timer = self.create_timer(0.1, self.on_timer)

    def on_scan(self, scan):
        self.last = self.get_clock().now()

    def on_timer(self):
        if self.get_clock().now() - self.last >= self.most:
            twist = Twist()
            twist.linear.x = 0.0
            self.publisher.publish(twist)
""",
            """
class LaserWatchdog(Node):
    def __init__(self, most_s):
        super().__init__('dog')
        self.silent, self.most = 0, most_s * 10
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        self.create_subscription(LaserScan, 'scan', self.hear, 1)
        self.create_timer(0.1, self.tick)

    def hear(self, scan):
        self.silent = 0

    def tick(self):
        self.silent += 1
        if self.silent > self.most:
            self.publisher.publish(Twist())
""",
        ],
    },
    11: {
        'wrong': [
            profiles('QoSProfile(depth=10)', 'QoSProfile(depth=10)'),
            profiles(RIGHT_LASER.replace('depth=1', 'depth=10'), MAP_QOS.format(1)),
            profiles(LASER_QOS.format('seconds=0.1'), MAP_QOS.format(1)),
            profiles(LASER_QOS.format('seconds=10'), MAP_QOS.format(1)),
            profiles(RIGHT_LASER, 'QoSProfile(depth=1)'),
            profiles(
                'QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)', MAP_QOS.format(1)
            ),
            profiles(
                RIGHT_LASER,
                MAP_QOS.format('1, reliability=ReliabilityPolicy.BEST_EFFORT'),
            ),
        ],
        'right': [
            profiles(RIGHT_LASER, MAP_QOS.format(1)),
            profiles(LASER_QOS.format('seconds=0.2'), MAP_QOS.format(10)),
            profiles(
                LASER_QOS.format('seconds=2'),
                MAP_QOS.format('5, reliability=ReliabilityPolicy.RELIABLE'),
            ),
        ],
    },
}
