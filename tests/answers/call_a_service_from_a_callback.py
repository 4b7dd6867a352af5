"""Answers to the tasks of lesson 06, as students give them: the checks must judge all right."""

ASK = """
def ask(node):
    client = node.create_client(Trigger, 'look')
    client.wait_for_service(timeout_sec=2)
    LINES
"""
TERMINAL = """
with ros_session() as session:
    camera = Camera()
    spin(session, SingleThreadedExecutor(), camera)
    LINES
"""
BRAKE = """
LIMIT_M = 1.0


class Brake(Node):
    def __init__(self, scan_group=None, client_group=None):
        super().__init__('brake')
        self.publisher = self.create_publisher(Empty, 'stop', 1)
        self.client = self.create_client(Trigger, 'look', callback_group=client_group)
        self.subscription = self.create_subscription(
            LaserScan, 'scan', self.scan_callback, 1, callback_group=scan_group
        )

    def scan_callback(self, scan):
        LINES
"""
GROUPS = """
def make_brake():
    return Brake({})


def make_executor():
    return {}
"""
AWAIT = """
class AwaitBrake(Brake):
    def __init__(self):
        super().__init__(MutuallyExclusiveCallbackGroup(), MutuallyExclusiveCallbackGroup())

    async def scan_callback(self, scan):
        if scan.ranges[90] < LIMIT_M:
            LINES
"""
DONE = """
class DoneBrake(Brake):
    def scan_callback(self, scan):
        LINES

    def answered(self, future):
        if future.result().success:
            self.publisher.publish(Empty())
"""
RULE = """
def rule(threads, groups, style):
    return {}
"""
SAFE = """
class SafeBrake(Brake):
    def scan_callback(self, scan):
        if scan.ranges[90] < LIMIT_M:
            LINES
"""
EXPLORER = """
class Explorer(Node):
    def __init__(self):
        super().__init__('explorer')
        LINES
        self.create_subscription(Int32, 'scan', self.scan_callback, 10, callback_group=scans)
        self.timer = self.create_timer(0.05, self.motor_callback, callback_group=motors)
        self.create_service(Trigger, 'save', self.save_callback, callback_group=saves)

    def scan_callback(self, message): ...

    def motor_callback(self): ...

    def save_callback(self, request, response):
        return response
"""
EXCLUSIVE, REENTRANT = 'MutuallyExclusiveCallbackGroup()', 'ReentrantCallbackGroup()'
TWO = 'MultiThreadedExecutor(num_threads=2)'
CALL = 'response = self.client.call(Trigger.Request())\n'
IF_WALL = 'if response.success:\n    self.publisher.publish(Empty())'
NEAR = 'if scan.ranges[90] < LIMIT_M:\n'
AWAITS = 'response = await self.client.call_async(Trigger.Request())\n'
SENDS = 'future = self.client.call_async(Trigger.Request())\n'
LEAVES = 'future.add_done_callback(self.answered)'
WAITS = 'response = self.client.call(Trigger.Request(), timeout_sec=0.5)\n'


def fill(frame: str, lines: str) -> str:
    """Return the frame with the lines in the place of LINES, indented as it is."""
    [place] = [line for line in frame.splitlines() if 'LINES' in line]
    indent = place[: place.index('LINES')]
    return frame.replace(place, '\n'.join(indent + line for line in lines.splitlines()))


def inside(head: str, lines: str) -> str:
    """Return the lines, indented, below the head."""
    return head + ''.join(f'    {line}\n' for line in lines.splitlines())


ANSWERS = {
    1: {
        'wrong': [
            fill(ASK, 'return Trigger.Response()'),
            fill(ASK, 'client.call(Trigger.Request(), timeout_sec=2)'),
            fill(ASK, 'return client.call(Trigger, timeout_sec=2)'),
            fill(ASK, 'return client.call_async(Trigger.Request())'),
            fill(ASK, 'return client.call(Trigger.Request(), timeout_sec=2)').replace(
                "'look'", "'camera'"
            ),
            fill(ASK, "return Trigger.Response(success=True, message='a wall')"),
        ],
        'right': [
            fill(ASK, 'return client.call(Trigger.Request(), timeout_sec=2)'),
            fill(ASK, 'response = client.call(Trigger.Request())\nreturn response'),
            """
def ask(node):
    asker = node.create_client(srv_type=Trigger, srv_name='/look')
    while not asker.service_is_ready():
        time.sleep(0.01)
    future = asker.call_async(Trigger.Request())
    while not future.done():
        time.sleep(0.01)
    return future.result()
""",
        ],
    },
    2: {
        'wrong': [
            fill(TERMINAL, '!ros2 service list'),
            fill(TERMINAL, '!ros2 service type /look'),
            fill(TERMINAL, '!ros2 service call /camera std_srvs/srv/Trigger & sleep 2; kill $!'),
            fill(TERMINAL, '!ros2 service call /look'),
            fill(TERMINAL, '!ros2 topic pub --once /look std_msgs/msg/Empty & sleep 2; kill $!'),
        ],
        'right': [
            fill(TERMINAL, '!ros2 service call /look std_srvs/srv/Trigger'),
            fill(TERMINAL, "!ros2 service call /look std_srvs/srv/Trigger '{}'"),
            fill(
                TERMINAL,
                '!ros2 service type /look\n'
                'said = !ros2 service call /look $(ros2 service type /look)',
            ),
        ],
    },
    3: {
        'wrong': [
            fill(BRAKE, 'pass'),
            fill(BRAKE, inside(NEAR, 'self.publisher.publish(Empty())')),
            fill(BRAKE, CALL + IF_WALL),
            fill(BRAKE, inside(NEAR, CALL + 'self.publisher.publish(Empty())')),
            fill(BRAKE, inside(NEAR, CALL + 'if response.message:\n    ' + IF_WALL[-35:].strip())),
            fill(
                BRAKE,
                inside(
                    NEAR,
                    SENDS + 'future.add_done_callback(\n'
                    '    lambda f: self.publisher.publish(Empty()) if f.result().success else 0)',
                ),
            ),
            fill(BRAKE, inside(NEAR.replace('<', '>'), CALL + IF_WALL)),
        ],
        'right': [
            fill(BRAKE, inside(NEAR, CALL + IF_WALL)),
            fill(BRAKE, 'if scan.ranges[90] >= LIMIT_M:\n    return\n' + CALL + IF_WALL),
            fill(
                BRAKE,
                'near = scan.ranges[90] < 1.0\n'
                'if near and self.client.call(Trigger.Request()).success is True:\n'
                '    self.publisher.publish(Empty())',
            ),
        ],
    },
    4: {
        'wrong': [
            GROUPS.format('', 'SingleThreadedExecutor()'),
            GROUPS.format('', TWO),
            GROUPS.format(f'{EXCLUSIVE}, {EXCLUSIVE}', 'SingleThreadedExecutor()'),
            GROUPS.format(f'*[{EXCLUSIVE}] * 2', TWO),
            GROUPS.format(f'{EXCLUSIVE}, {EXCLUSIVE}', 'MultiThreadedExecutor(num_threads=1)'),
            GROUPS.format('', 'MultiThreadedExecutor(num_threads=8)'),
        ],
        'right': [
            GROUPS.format(f'{EXCLUSIVE}, {EXCLUSIVE}', TWO),
            GROUPS.format(f'client_group={EXCLUSIVE}', TWO),
            GROUPS.format(f'scan_group={EXCLUSIVE}', 'MultiThreadedExecutor(num_threads=4)'),
            GROUPS.format(f'*[{REENTRANT}] * 2', TWO),
        ],
    },
    5: {
        'wrong': [
            'class AwaitBrake(Brake):\n    pass\n',
            fill(AWAIT, AWAITS + 'self.publisher.publish(Empty())'),
            fill(AWAIT, AWAITS.replace('await ', '') + IF_WALL),
            fill(AWAIT, AWAITS.replace('call_async', 'call') + IF_WALL),
            fill(AWAIT, AWAITS + IF_WALL).replace(f'{EXCLUSIVE}, {EXCLUSIVE}', ''),
            fill(AWAIT, AWAITS + IF_WALL).replace('async def', 'def').replace('await ', ''),
            fill(AWAIT, AWAITS + IF_WALL).replace('scan.ranges[90] < LIMIT_M', 'True'),
        ],
        'right': [
            fill(AWAIT, AWAITS + IF_WALL),
            fill(
                AWAIT,
                'future = self.client.call_async(Trigger.Request())\nif (await future)'
                '.success:\n    self.publisher.publish(Empty())',
            ),
            fill(AWAIT, AWAITS + IF_WALL).replace(
                f'{EXCLUSIVE}, {EXCLUSIVE}', f'client_group={REENTRANT}'
            ),
        ],
    },
    6: {
        'wrong': [
            'class DoneBrake(Brake):\n    pass\n',
            fill(DONE, inside(NEAR, SENDS + 'future.add_done_callback(self.answered(future))')),
            fill(DONE, inside(NEAR, SENDS)),
            fill(DONE, SENDS + LEAVES),
            fill(DONE, inside(NEAR, SENDS + LEAVES)).replace('result().success', 'done()'),
            fill(DONE, inside(NEAR, SENDS + LEAVES)).replace('result().success', 'result.success'),
            fill(DONE, inside(NEAR, CALL + IF_WALL)),
        ],
        'right': [
            fill(DONE, inside(NEAR, SENDS + LEAVES)),
            fill(
                DONE,
                'if scan.ranges[90] > LIMIT_M:\n    return\n'
                'self.client.call_async(Trigger.Request()).add_done_callback(self.answered)',
            ),
            fill(
                DONE,
                inside(
                    NEAR,
                    SENDS + 'future.add_done_callback(\n'
                    '    lambda f: f.result().success and self.publisher.publish(Empty()))',
                ),
            ),
        ],
    },
    7: {
        'wrong': [
            RULE.format('True'),
            RULE.format('threads == 2'),
            RULE.format("threads == 2 and groups != 'one group'"),
            RULE.format("(threads == 2 or style != 'call') and groups != 'one group'"),
            RULE.format("threads == 2 or style != 'call' or groups != 'one group'"),
            RULE.format("style == 'done callback'"),
        ],
        'right': [
            RULE.format(
                "style == 'done callback' or groups != 'one group' "
                "and (threads == 2 or style == 'await')"
            ),
            RULE.format(
                'not (threads == 1 and style == "call" or '
                'groups == "one group" and style in ("call", "await"))'
            ),
            """
def rule(threads, groups, style):
    if style == 'done callback':
        return True
    if groups == 'one group':
        return False
    return threads > 1 or style == 'await'
""",
        ],
    },
    8: {
        'wrong': [
            'class SafeBrake(Brake):\n    pass\n',
            fill(SAFE, WAITS + IF_WALL),
            fill(
                SAFE,
                WAITS + 'if response and response.success:\n    self.publisher.publish(Empty())',
            ),
            fill(SAFE, WAITS + 'if not response:\n    self.publisher.publish(Empty())'),
            fill(SAFE, WAITS + 'self.publisher.publish(Empty())'),
            fill(SAFE, 'self.publisher.publish(Empty())'),
            fill(
                SAFE,
                'try:\n    response = self.client.call(Trigger.Request())\nexcept TimeoutError:\n'
                '    response = None\nif response is None or response.success:\n'
                '    self.publisher.publish(Empty())',
            ),
        ],
        'right': [
            fill(
                SAFE,
                WAITS + 'if response is None or response.success:\n'
                '    self.publisher.publish(Empty())',
            ),
            fill(
                SAFE,
                WAITS + 'if response and not response.success:\n    return\n'
                'self.publisher.publish(Empty())',
            ),
            fill(
                SAFE,
                WAITS + 'dust = response is not None and response.success is False\n'
                'if not dust:\n    self.publisher.publish(Empty())',
            ),
        ],
    },
    9: {
        'wrong': [
            fill(EXPLORER, 'scans = motors = saves = None'),
            fill(EXPLORER, f'scans = motors = saves = {EXCLUSIVE}'),
            fill(EXPLORER, f'scans = motors = saves = {REENTRANT}'),
            fill(EXPLORER, f'scans, motors, saves = {EXCLUSIVE}, {EXCLUSIVE}, {EXCLUSIVE}'),
            fill(EXPLORER, f'scans = motors = {EXCLUSIVE}\nsaves = {EXCLUSIVE}'),
            fill(EXPLORER, f'scans = saves = {REENTRANT}\nmotors = {EXCLUSIVE}'),
        ],
        'right': [
            fill(EXPLORER, f'scans = saves = {EXCLUSIVE}\nmotors = {EXCLUSIVE}'),
            fill(EXPLORER, f'scans = saves = None\nmotors = {EXCLUSIVE}'),
            fill(EXPLORER, f'scans = saves = {EXCLUSIVE}\nmotors = {REENTRANT}'),
        ],
    },
}
