"""Answers to the tasks of lesson 18, as students give them: the checks must judge all right."""

READ = """
def read(path, topic, kind):
    found = []
    LINES
    return found
"""
AGE = """
def age_s(recorded_ns, header):
    LINES
"""
BUMP = """
def at_bump(path):
    LINES
"""
SALVAGE = """
def salvage(file):
    topics, found = {}, []
    LINES
    return found
"""
FRESH = """
class FreshBrake(Brake):
    def __init__(self, **options):
        super().__init__(depth=1, **options)

    def scan_callback(self, scan):
        LINES
"""
JUDGE = """
class Judge(Node):
    def __init__(self):
        super().__init__('judge')
        self.commands, self.distance = [], None
        self.create_subscription(LaserScan, 'scan', self.on_scan, 10)
        self.create_subscription(Twist, 'cmd_vel', self.on_command, 10)

    def on_scan(self, scan):
        SCAN

    def on_command(self, twist):
        COMMAND
"""
TEST = """
def check_commands(commands):
    known = [(distance, speed) for distance, speed in commands if distance is not None]
    LINES
"""
SYNC = """
class Synchroniser:
    def __init__(self, size, slop_s):
        self.size, self.slop_s = size, slop_s
        self.queues = {'scan': [], 'wall': []}
        self.pairs = []

    def add(self, name, message):
        own, other = self.queues[name], self.queues['wall' if name == 'scan' else 'scan']
        own.append(message)
        LINES
"""
LOOP = """
with file.open('rb') as stream:
    for record in StreamReader(stream).records:
        if isinstance(record, records.Channel):
            topics[record.id] = record.topic
        if isinstance(record, records.Message):
            found.append((topics[record.channel_id], record.log_time, record.data))
"""
NEAREST = """
del own[: -self.size]
if other:
    near = min(other, key=lambda one: abs(stamp_s(one) - stamp_s(message)))
    if abs(stamp_s(near) - stamp_s(message)) <= self.slop_s:
        own.remove(message)
        other.remove(near)
        self.pairs.append((message, near) if name == 'scan' else (near, message))
"""


def fill(frame: str, **parts: str) -> str:
    """Put lines into a frame, with its indentation."""
    for name, lines in parts.items():
        row = next(row for row in frame.splitlines() if row.strip() == name)
        indent = row[: len(row) - len(row.lstrip())]
        body = '\n'.join(indent + line for line in lines.strip('\n').splitlines())
        frame = frame.replace(row, body)
    return frame


def salvages(lines: str) -> str:
    return fill(SALVAGE, LINES=lines)


def inside_try(loop: str, ending: str) -> str:
    return 'try:\n' + '\n'.join('    ' + line for line in loop.strip().splitlines()) + ending


def reads(lines: str) -> str:
    return fill(READ, LINES=lines)


def judges(scan: str, command: str) -> str:
    return fill(JUDGE, SCAN=scan, COMMAND=command)


def syncs(old: str = '', new: str = '') -> str:
    return fill(SYNC, LINES=NEAREST.replace(old, new) if old else NEAREST)


AGE_NS = '(self.get_clock().now() - Time.from_msg(scan.header.stamp)).nanoseconds'
UNTIL = """
when = next(ns for ns, bump in read(path, '/bumper', Bool) if bump.data)
walls = [wall for ns, wall in read(path, '/wall', Range) if ns <= when]
scans = [scan for ns, scan in read(path, '/scan', LaserScan) if ns <= when]
return walls[-1].range, scans[-1].ranges[90]
"""
FOR = 'with AnyReader([path]) as bag:\n    for connection, ns, data in bag.messages():\n'

ANSWERS = {
    1: {
        'wrong': [
            "RECORD = 'ros2 bag record -o crash scan wall cmd_vel'",
            "RECORD = 'ros2 bag record -a -o crash'",
            "RECORD = 'ros2 bag record -o crashes scan wall cmd_vel bumper'",
            "RECORD = 'ros2 bag record crash scan wall cmd_vel bumper'",
            "RECORD = 'ros2 bag record -o crash scan,wall,cmd_vel,bumper'",
            "RECORD = 'ros2 bag play -o crash scan wall cmd_vel bumper'",
        ],
        'right': [
            "RECORD = 'ros2 bag record -o crash /scan /wall /cmd_vel /bumper'",
            "RECORD = 'ros2 bag record --topics bumper scan wall cmd_vel --output crash'",
            "RECORD = 'ros2 bag record scan wall cmd_vel bumper -s mcap -o crash'",
        ],
    },
    2: {
        'wrong': [
            reads(FOR + '        found.append((ns, deserialize_message(data, kind)))'),
            reads(
                FOR + '        if connection.topic == topic:\n            found.append((ns, data))'
            ),
            reads(
                FOR + '        if connection.topic == topic:\n'
                '            found.append(deserialize_message(data, kind))'
            ),
            reads(
                FOR + '        if connection.topic == topic:\n'
                '            return [(ns, deserialize_message(data, kind))]'
            ),
            reads(
                FOR + "        if connection.topic == '/a':\n"
                '            found.append((ns, deserialize_message(data, kind)))'
            ),
        ],
        'right': [
            reads(
                FOR + '        if connection.topic == topic:\n'
                '            found.append((ns, deserialize_message(data, kind)))'
            ),
            reads(
                FOR + '        if connection.topic != topic:\n            continue\n'
                '        found += [(ns, deserialize_message(bytes(data), kind))]'
            ),
            reads(
                'with AnyReader([path]) as bag:\n'
                '    rows = list(bag.messages())\n'
                'found = [(n, deserialize_message(d, kind)) for c, n, d in rows '
                'if c.topic == topic]'
            ),
        ],
    },
    3: {
        'wrong': [
            fill(AGE, LINES='return recorded_ns - Time.from_msg(header.stamp).nanoseconds'),
            fill(AGE, LINES='return (Time.from_msg(header.stamp).nanoseconds - recorded_ns) / 1e9'),
            fill(AGE, LINES='return recorded_ns / 1e9 - header.stamp.sec'),
            fill(AGE, LINES='return (recorded_ns - header.stamp.nanosec) / 1e9'),
            fill(AGE, LINES='return (time.time_ns() - recorded_ns) / 1e9'),
        ],
        'right': [
            fill(AGE, LINES='return (recorded_ns - Time.from_msg(header.stamp).nanoseconds) / 1e9'),
            fill(
                AGE,
                LINES='return recorded_ns / 1e9 - header.stamp.sec - header.stamp.nanosec / 1e9',
            ),
            fill(
                AGE,
                LINES='came = Time(nanoseconds=recorded_ns)\n'
                'return (came - Time.from_msg(header.stamp, came.clock_type)).nanoseconds / 1e9',
            ),
        ],
    },
    4: {
        'wrong': [
            fill(BUMP, LINES=UNTIL.replace(' if bump.data', '')),
            fill(BUMP, LINES=UNTIL.replace('<=', '>')),
            fill(BUMP, LINES=UNTIL.replace('[-1]', '[0]')),
            fill(
                BUMP,
                LINES=UNTIL.replace(
                    "next(ns for ns, bump in read(path, '/bumper', Bool) if bump.data)",
                    "read(path, '/bumper', Bool)[-1][0]",
                ),
            ),
            fill(BUMP, LINES=UNTIL + 'return scans[-1].ranges[90], walls[-1].range').replace(
                'return walls[-1].range, scans[-1].ranges[90]\n', ''
            ),
        ],
        'right': [
            fill(BUMP, LINES=UNTIL),
            fill(BUMP, LINES=UNTIL.replace('<=', '<')),
            fill(
                BUMP,
                LINES="""
when = min(ns for ns, bump in read(path, '/bumper', Bool) if bump.data)
for ns, wall in read(path, '/wall', Range):
    if ns <= when:
        believed = wall.range
for ns, scan in read(path, '/scan', LaserScan):
    if ns <= when:
        true = scan.ranges[90]
return [believed, true]
""",
            ),
        ],
    },
    5: {
        'wrong': [
            salvages(LOOP),
            salvages(inside_try(LOOP, '\nexcept Exception:\n    found = []')),
            salvages(
                inside_try(
                    LOOP.replace('topics[record.channel_id]', 'record.channel_id'),
                    '\nexcept Exception:\n    pass',
                )
            ),
            salvages(
                inside_try(LOOP.replace('record.log_time, ', ''), '\nexcept Exception:\n    pass')
            ),
            salvages("""
try:
    with file.open('rb') as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            found.append((channel.topic, message.log_time, message.data))
except Exception:
    pass
"""),
        ],
        'right': [
            salvages(inside_try(LOOP, '\nexcept Exception:\n    pass')),
            salvages(
                'from contextlib import suppress\nwith suppress(Exception):\n'
                + '\n'.join('    ' + line for line in LOOP.strip().splitlines())
            ),
            salvages(
                inside_try(LOOP, '\nexcept Exception as error:\n    reason = error').replace(
                    '        if isinstance(record, records.Message)',
                    '        elif isinstance(record, records.Message)',
                )
            ),
        ],
    },
    6: {
        'wrong': [
            fill(FRESH, LINES='super().scan_callback(scan)'),
            fill(FRESH, LINES=f'if {AGE_NS} <= 5e8:\n    super().scan_callback(scan)'),
            fill(
                FRESH,
                LINES=f'if {AGE_NS} < 5e8:\n    self.command(0.0)\n'
                'else:\n    super().scan_callback(scan)',
            ),
            fill(
                FRESH,
                LINES='if time.time() - scan.header.stamp.sec > 0.5:\n'
                '    self.command(0.0)\nelse:\n    super().scan_callback(scan)',
            ),
            fill(
                FRESH,
                LINES=f'if {AGE_NS} > 5e8:\n    self.command(0.0)\n'
                'else:\n    super().scan_callback(scan)',
            ).replace('depth=1', 'depth=10'),
            fill(
                FRESH,
                LINES=f'if {AGE_NS} > 0.5:\n    self.command(0.0)\n'
                'else:\n    super().scan_callback(scan)',
            ),
        ],
        'right': [
            fill(
                FRESH,
                LINES=f'if {AGE_NS} > 5e8:\n    self.command(0.0)\n'
                'else:\n    super().scan_callback(scan)',
            ),
            fill(
                FRESH,
                LINES=f'if {AGE_NS} / 1e9 > 0.5:\n    self.command(0.0)\n    return\n'
                'Brake.scan_callback(self, scan)',
            ),
            fill(
                FRESH,
                LINES='age = self.get_clock().now() - Time.from_msg(scan.header.stamp)\n'
                'if age <= Duration(seconds=0.5):\n    super().scan_callback(scan)\n'
                'else:\n    self.command(0.0)',
            ),
        ],
    },
    7: {
        'wrong': [
            "PLAY = 'ros2 bag play crash --clock'",
            "PLAY = 'ros2 bag play crash --topics /scan'",
            "PLAY = 'ros2 bag play crash --clock --topics /scan /cmd_vel'",
            "PLAY = 'ros2 bag play --clock --topics /scan'",
            "PLAY = 'ros2 bag play crash --clock --topics /laser'",
        ],
        'right': [
            "PLAY = 'ros2 bag play crash --topics /scan --clock'",
            "PLAY = 'ros2 bag play --clock 100 crash --topics scan'",
            "PLAY = 'ros2 bag play crash/crash.mcap --clock --topics /scan'",
        ],
    },
    8: {
        'wrong': [
            judges('pass', 'self.commands.append((self.distance, twist.linear.x))'),
            judges('self.distance = scan.ranges[90]', 'self.commands.append(twist.linear.x)'),
            judges(
                'self.distance = scan.ranges[0]',
                'self.commands.append((self.distance, twist.linear.x))',
            ),
            judges(
                'self.distance = scan.ranges[90]',
                'self.commands.append((twist.linear.x, self.distance))',
            ),
            judges(
                'self.distance = self.distance or scan.ranges[90]',
                'self.commands.append((self.distance, twist.linear.x))',
            ),
        ],
        'right': [
            judges(
                'self.distance = scan.ranges[90]',
                'self.commands.append((self.distance, twist.linear.x))',
            ),
            judges(
                'self.scan = scan',
                "distance = self.scan.ranges[90] if hasattr(self, 'scan') else None\n"
                'self.commands.append((distance, twist.linear.x))',
            ),
            judges(
                '(self.distance,) = scan.ranges[90:91]',
                'self.commands += [(self.distance, twist.linear.x)]',
            ),
        ],
    },
    9: {
        'wrong': [
            fill(TEST, LINES='assert all(s == 0 for d, s in known if d < 0.25)'),
            fill(TEST, LINES='assert known\nassert all(s == 0 for d, s in known if d < 0.25)'),
            fill(
                TEST,
                LINES='assert any(s > 0 for d, s in known if d > 1)\n'
                'assert any(s == 0 for d, s in known if d < 0.25)',
            ),
            fill(
                TEST,
                LINES='assert any(s > 0 for d, s in known if d > 1)\n'
                'assert all(s == 0 for d, s in known if d < 0.25)',
            ),
            fill(
                TEST,
                LINES='assert any(s > 0 for d, s in known if d > 1)\n'
                'near = [s for d, s in known if d < 0.25]\nassert near\n'
                'assert all(s <= 0 for s in near)',
            ),
        ],
        'right': [
            fill(
                TEST,
                LINES='assert any(s > 0 for d, s in known if d > 1)\n'
                'near = [s for d, s in known if d < 0.25]\nassert near\n'
                'assert all(s == 0 for s in near)',
            ),
            fill(
                TEST,
                LINES='near = {s for d, s in known if d < 0.25}\n'
                'assert near == {0.0}\nassert max(s for d, s in known if d > 1) > 0',
            ).replace(
                'assert max(s for d, s in known if d > 1)',
                'assert max([s for d, s in known if d > 1], default=0)',
            ),
            fill(
                TEST,
                LINES='assert [s for d, s in known if d > 1 and s > 0]\n'
                'assert [d for d, s in known if d < 0.25]\n'
                'for d, s in known:\n    assert d >= 0.25 or s == 0',
            ),
        ],
    },
    10: {
        'wrong': [
            syncs('del own[: -self.size]\n'),
            syncs('del own[: -self.size]', 'del own[self.size :]'),
            syncs('        other.remove(near)\n'),
            syncs("(message, near) if name == 'scan' else (near, message)", 'message, near'),
            syncs('<= self.slop_s', '<= 1000'),
            syncs('min(other, key=lambda one: abs(stamp_s(one) - stamp_s(message)))', 'other[-1]'),
        ],
        'right': [
            syncs(),
            syncs('del own[: -self.size]', 'while len(own) > self.size:\n    own.pop(0)'),
            syncs(
                'min(other, key=lambda one: abs(stamp_s(one) - stamp_s(message)))',
                'sorted(other, key=lambda one: abs(stamp_s(one) - stamp_s(message)))[0]',
            ),
        ],
    },
    11: {
        'wrong': [
            'LASER_QOS = QoSProfile(depth=10)',
            'LASER_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)',
            'LASER_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)',
            'LASER_QOS = 100',
            "LASER_QOS = QoSProfile(depth=100, reliability='BEST_EFFORT')",
        ],
        'right': [
            'LASER_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)',
            'import rclpy.qos\n'
            'LASER_QOS = QoSProfile(history=rclpy.qos.HistoryPolicy.KEEP_LAST, depth=100,\n'
            '                       reliability=rclpy.qos.ReliabilityPolicy.BEST_EFFORT)',
            'LASER_QOS = QoSProfile(depth=100)\n'
            'LASER_QOS.reliability = ReliabilityPolicy.BEST_EFFORT',
        ],
    },
}
