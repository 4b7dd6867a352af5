"""Answers to the tasks of lesson 01, as students give them: the checks must judge all right."""

SUBSCRIBER = """
class MinimalSubscriber(Node):
    def __init__(self, qos=10):
        super().__init__('minimal_subscriber')
        self.heard = []
        self.subscription = self.create_subscription(String, 'topic', self.listener_callback, qos)

    def listener_callback(self, message):
"""
SPIN = """
def spin_together(session, *nodes):
"""
DRIVER = """
class Driver(Node):
    def __init__(self, speed, turn):
        super().__init__('driver')
        self.speed, self.turn = speed, turn  # m/s, rad/s
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        self.timer = self.create_timer(0.1, self.timer_callback)

    def timer_callback(self):
"""
ODOMETER = """
class Odometer(Node):
    def __init__(self):
        super().__init__('odometer')
        self.distance = 0.0
        self.place = None
        self.subscription = self.create_subscription(Odometry, 'odom', self.odom_callback, 10)

    def odom_callback(self, message):
        position = message.pose.pose.position
"""
SQUARE = """
class Square(Node):
    def __init__(self, side):
        super().__init__('square')
        self.side_ticks = round(side / 0.5 * 10)  # 0.5 m/s, ten ticks a second
        self.ticks = 0
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        self.timer = self.create_timer(0.1, self.timer_callback)

    def timer_callback(self):
"""
MIRROR = """
class Mirror(Node):
    def __init__(self):
        super().__init__('mirror')
        self.publisher = self.create_publisher(Twist, 'two/cmd_vel', 1)
        self.subscription = self.create_subscription(Odometry, 'odom', self.odom_callback, 10)

    def odom_callback(self, message):
"""
TALKER = """
%%write talker.py part 2
class Talker(Node):
    def __init__(self):
        super().__init__('talker')
        self.publisher = self.create_publisher(String, 'topic', 10)
        self.timer = self.create_timer(0.1, self.timer_callback)

    def timer_callback(self):
        self.publisher.publish(String(data=sys.argv[1]))
        self.get_logger().info(f'{sys.argv[1]} talks')


""".lstrip()
END = """
rclpy.init()
try:
    rclpy.spin(Talker())
except (KeyboardInterrupt, ExternalShutdownException):
    pass
"""


def body(head: str, lines: str, indent: int = 8) -> str:
    """Return the head, and below it the lines, indented."""
    return head + ''.join(f'{" " * indent}{line}\n' for line in lines.strip('\n').splitlines())


ANSWERS = {
    1: {
        'wrong': [
            body(SUBSCRIBER, 'self.heard.append(message.data)'),
            body(SUBSCRIBER, """self.get_logger().info(f'I heard: "{message.data}"')"""),
            body(
                SUBSCRIBER,
                """
self.heard.append(message)
self.get_logger().info(f'I heard: "{message}"')
""",
            ),
            body(
                SUBSCRIBER,
                """
self.heard.append(message.data)
print(f'I heard: "{message.data}"')
""",
            ),
            body(
                SUBSCRIBER,
                """
self.heard = [message.data]
self.get_logger().info(f'I heard: "{message.data}"')
""",
            ),
            body(
                SUBSCRIBER,
                """
self.heard.append(message.data)
self.get_logger().info('I heard: "{message.data}"')
""",
            ),
            body(
                SUBSCRIBER,
                """
self.heard.append(message.data)
self.get_logger().info('I heard: "Hello World: 7"')
""",
            ),
            body(
                SUBSCRIBER,
                """
heard.append(message.data)
get_logger().info(f'I heard: "{message.data}"')
""",
            ),
        ],
        'right': [
            body(
                SUBSCRIBER,
                """
text = message.data
self.get_logger().info('I heard: "%s"' % text)
self.heard.append(text)
""",
            ),
            body(
                SUBSCRIBER,
                """
self.heard += [message.data]
self.get_logger().info('I heard: "' + message.data + '"')
""",
            ),
            body(
                SUBSCRIBER,
                """
self.heard = [*self.heard, message.data]
self.get_logger().info('I heard: "{}"'.format(self.heard[-1]))
""",
            ),
        ],
    },
    2: {
        'wrong': [
            body(
                SPIN,
                """
executor = SingleThreadedExecutor()
executor.add_node(nodes[0])
session.spin(executor)
""",
                4,
            ),
            body(
                SPIN,
                """
for node in nodes:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    session.spin(executor)
""",
                4,
            ),
            body(
                SPIN,
                """
executor = SingleThreadedExecutor()
for node in nodes:
    executor.add_node(node)
""",
                4,
            ),
            body(
                SPIN,
                """
executor = SingleThreadedExecutor()
for node in nodes:
    executor.add_node(node)
    session.spin(executor)
""",
                4,
            ),
            body(
                SPIN,
                """
executor = SingleThreadedExecutor()
executor.add_node(nodes)
session.spin(executor)
""",
                4,
            ),
            body(
                SPIN,
                """
executor = SingleThreadedExecutor()
executor.add_node(nodes[0])
executor.add_node(nodes[1])
session.spin(executor)
""",
                4,
            ),
        ],
        'right': [
            body(
                SPIN,
                """
executor = SingleThreadedExecutor()
session.spin(executor)
for node in nodes:
    executor.add_node(node)
""",
                4,
            ),
            body(
                SPIN,
                """
e = SingleThreadedExecutor()
for i in range(len(nodes)):
    e.add_node(nodes[i])
session.spin(e)
""",
                4,
            ),
            body(
                SPIN,
                """
executor = SingleThreadedExecutor()
[executor.add_node(node) for node in nodes]
session.spin(executor=executor)
""",
                4,
            ),
        ],
    },
    3: {
        'wrong': [
            body(
                DRIVER,
                """
message = Twist()
message.linear.x = self.speed
message.angular.z = self.turn
""",
            ),
            body(
                DRIVER,
                """
message = Twist()
message.linear.x = self.speed
self.publisher.publish(message)
""",
            ),
            body(
                DRIVER,
                """
message = Twist()
message.linear.x = self.turn
message.angular.z = self.speed
self.publisher.publish(message)
""",
            ),
            body(
                DRIVER,
                """
message = Twist()
message.linear.x = 0.5
message.angular.z = 1.0
self.publisher.publish(message)
""",
            ),
            body(
                DRIVER,
                """
message = Twist()
message.linear = self.speed
message.angular = self.turn
self.publisher.publish(message)
""",
            ),
            body(
                DRIVER,
                """
message = Twist()
message.linear.x = self.speed
message.angular.z = self.turn
self.publisher.publish(message)
self.timer.cancel()
""",
            ),
            body(
                DRIVER,
                """
message = Twist()
message.linear.x = self.speed
message.angular.x = self.turn
self.publisher.publish(message)
""",
            ),
        ],
        'right': [
            body(
                DRIVER,
                """
twist = Twist()
twist.angular.z, twist.linear.x = self.turn, self.speed
self.publisher.publish(twist)
""",
            ),
            body(
                DRIVER,
                """
from geometry_msgs.msg import Vector3
self.publisher.publish(Twist(linear=Vector3(x=self.speed), angular=Vector3(z=self.turn)))
""",
            ),
            body(
                DRIVER,
                """
message = Twist()
message.linear.x = float(self.speed)
message.linear.y = 0.0
message.angular.z = float(self.turn)
self.publisher.publish(message)
""",
            ),
        ],
    },
    4: {
        'wrong': [
            body(
                ODOMETER.replace('= None', '= (0.0, 0.0)'),
                """
place = position.x, position.y
self.distance += math.dist(self.place, place)
self.place = place
""",
            ),
            body(
                ODOMETER,
                """
place = position.x, position.y
if self.place is not None:
    self.distance += math.dist(self.place, place)
else:
    self.place = place
""",
            ),
            body(
                ODOMETER,
                """
place = position.x, position.y
if self.place is not None:
    self.distance = math.dist(self.place, place)
self.place = place
""",
            ),
            body(
                ODOMETER,
                """
place = position.x, position.y
self.distance += math.dist(self.place, place)
self.place = place
""",
            ),
            body(
                ODOMETER,
                """
if self.place is not None:
    self.distance += abs(position.x - self.place[0]) + abs(position.y - self.place[1])
self.place = position.x, position.y
""",
            ),
            body(
                ODOMETER.replace("'odom'", "'odometry'"),
                """
place = position.x, position.y
if self.place is not None:
    self.distance += math.dist(self.place, place)
self.place = place
""",
            ),
            body(
                ODOMETER,
                """
place = position.x, position.y
if self.place is not None:
    self.distance += math.dist(self.place, place)
    self.place = place
""",
            ),
        ],
        'right': [
            body(
                ODOMETER,
                """
if self.place:
    self.distance += math.hypot(position.x - self.place.x, position.y - self.place.y)
self.place = position
""",
            ),
            body(
                ODOMETER,
                """
place = [position.x, position.y]
if self.place is None:
    self.place = place
    return
self.distance = self.distance + math.dist(place, self.place)
self.place = place
""",
            ),
            """
class Odometer(Node):
    def __init__(self):
        super().__init__('odometer')
        self.places = []
        self.create_subscription(Odometry, 'odom', self.odom_callback, 10)

    @property
    def distance(self):
        return sum(math.dist(a, b) for a, b in zip(self.places, self.places[1:]))

    def odom_callback(self, message):
        p = message.pose.pose.position
        self.places.append((p.x, p.y))
""",
        ],
    },
    5: {
        'wrong': [
            body(
                SQUARE,
                """
message = Twist()
if self.ticks % (self.side_ticks + 10) < self.side_ticks:
    message.linear.x = 0.5
else:
    message.angular.z = math.pi / 2
self.publisher.publish(message)
self.ticks += 1
""",
            ),
            body(
                SQUARE,
                """
message = Twist()
if self.ticks == 4 * (self.side_ticks + 10):
    self.timer.cancel()
elif self.ticks % (self.side_ticks + 10) < self.side_ticks:
    message.linear.x = 0.5
else:
    message.angular.z = -math.pi / 2
self.publisher.publish(message)
self.ticks += 1
""",
            ),
            body(
                SQUARE,
                """
message = Twist()
if self.ticks == 4 * 30:
    self.timer.cancel()
elif self.ticks % 30 < 20:
    message.linear.x = 0.5
else:
    message.angular.z = math.pi / 2
self.publisher.publish(message)
self.ticks += 1
""",
            ),
            body(
                SQUARE,
                """
message = Twist()
if self.ticks == 4 * (self.side_ticks + 10):
    self.timer.cancel()
elif self.ticks % (self.side_ticks + 10) < self.side_ticks:
    message.linear.x = 0.5
else:
    message.angular.z = 90.0
self.publisher.publish(message)
self.ticks += 1
""",
            ),
            body(
                SQUARE,
                """
message = Twist()
if self.ticks == 4 * (self.side_ticks + 10):
    self.timer.cancel()
elif self.ticks % (self.side_ticks + 10) < self.side_ticks:
    message.linear.x = 0.5
else:
    message.angular.z = math.pi / 2
self.publisher.publish(message)
""",
            ),
            body(
                SQUARE,
                """
message = Twist()
if self.ticks == 4 * (self.side_ticks + 10):
    self.timer.cancel()
elif self.ticks % (self.side_ticks + 10) < self.side_ticks:
    message.linear.x = 0.5
else:
    message.linear.x = 0.5
    message.angular.z = math.pi / 2
self.publisher.publish(message)
self.ticks += 1
""",
            ),
            body(
                SQUARE.replace('0.1, self', '1.0, self'),
                """
message = Twist()
if self.ticks == 4 * (self.side_ticks + 10):
    self.timer.cancel()
elif self.ticks % (self.side_ticks + 10) < self.side_ticks:
    message.linear.x = 0.5
else:
    message.angular.z = math.pi / 2
self.publisher.publish(message)
self.ticks += 1
""",
            ),
            body(
                SQUARE,
                """
message = Twist()
if self.ticks == self.side_ticks + 10:
    self.timer.cancel()
elif self.ticks < self.side_ticks:
    message.linear.x = 0.5
else:
    message.angular.z = math.pi / 2
self.publisher.publish(message)
self.ticks += 1
""",
            ),
        ],
        'right': [
            body(
                SQUARE,
                """
message = Twist()
part = self.ticks % (self.side_ticks + 10)
if part < self.side_ticks:
    message.linear.x = 0.5
if part >= self.side_ticks:
    message.angular.z = math.pi / 2
if self.ticks >= 4 * (self.side_ticks + 10):
    message = Twist()
    self.timer.cancel()
self.publisher.publish(message)
self.ticks += 1
""",
            ),
            """
class Square(Node):
    def __init__(self, side):
        super().__init__('square')
        side_ticks = round(side / 0.5 * 10)
        self.plan = 4 * [*side_ticks * [(0.5, 0.0)], *10 * [(0.0, math.pi / 2)]] + [(0.0, 0.0)]
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)
        self.timer = self.create_timer(0.1, self.timer_callback)

    def timer_callback(self):
        message = Twist()
        message.linear.x, message.angular.z = self.plan.pop(0)
        self.publisher.publish(message)
        if not self.plan:
            self.timer.cancel()
""",
            """
class Square(Node):
    def __init__(self, side):
        super().__init__('square')
        self.side_ticks = round(side / 0.5 * 10)
        self.left, self.sides, self.turning = self.side_ticks, 0, False
        self.pub = self.create_publisher(Twist, '/cmd_vel', 10)
        self.timer = self.create_timer(0.1, self.tick)

    def tick(self):
        message = Twist()
        if self.left == 0:
            self.sides += self.turning
            self.turning = not self.turning
            self.left = 10 if self.turning else self.side_ticks
        if self.sides == 4:
            self.pub.publish(message)
            self.destroy_timer(self.timer)
            return
        if self.turning:
            message.angular.z = 3.14159 / 2
        else:
            message.linear.x = 0.5
        self.pub.publish(message)
        self.left -= 1
""",
        ],
    },
    6: {
        'wrong': [
            body(
                MIRROR,
                """
command = Twist()
command.linear.x = message.twist.twist.linear.x
command.angular.z = message.twist.twist.angular.z
self.publisher.publish(command)
""",
            ),
            body(
                MIRROR,
                """
command = Twist()
command.linear.x = -message.twist.twist.linear.x
command.angular.z = -message.twist.twist.angular.z
self.publisher.publish(command)
""",
            ),
            body(
                MIRROR,
                """
command = Twist()
command.linear.x = message.twist.twist.linear.x
command.angular.z = -message.twist.twist.angular.z
return command
""",
            ),
            body(
                MIRROR.replace("'two/cmd_vel'", "'cmd_vel'"),
                """
command = Twist()
command.linear.x = message.twist.twist.linear.x
command.angular.z = -message.twist.twist.angular.z
self.publisher.publish(command)
""",
            ),
            body(
                MIRROR,
                """
command = Twist()
command.linear.x = message.twist.linear.x
command.angular.z = -message.twist.angular.z
self.publisher.publish(command)
""",
            ),
            body(
                MIRROR,
                """
command = Twist()
command.linear.x = 0.5
command.angular.z = -1.0
self.publisher.publish(command)
""",
            ),
            body(
                MIRROR,
                """
command = message.twist.twist
command.linear.x *= 1.0
self.publisher.publish(command)
""",
            ),
        ],
        'right': [
            body(
                MIRROR,
                """
command = message.twist.twist
command.angular.z = -command.angular.z
self.publisher.publish(command)
""",
            ),
            """
class Mirror(Node):
    def __init__(self):
        super().__init__('mirror')
        publisher = self.create_publisher(Twist, '/two/cmd_vel', 10)

        def turn_around(message):
            command = Twist()
            command.linear.x = message.twist.twist.linear.x
            command.angular.z = 0.0 - message.twist.twist.angular.z
            publisher.publish(command)

        self.create_subscription(Odometry, '/odom', turn_around, 10)
""",
            body(
                MIRROR,
                """
twist = message.twist.twist
self.command = Twist(linear=twist.linear)
self.command.angular.z = -1 * twist.angular.z
self.publisher.publish(self.command)
""",
            ),
        ],
    },
    7: {
        'wrong': [
            'asked = 10\n',
            'asked = reliable\n',
            'asked = QoSProfile(depth=10)\n',
            'asked = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)\n',
            'asked = ReliabilityPolicy.BEST_EFFORT\n',
            "asked = 'best effort'\n",
            'from rclpy.qos import qos_profile_sensor_data\n\nasked = qos_profile_sensor_data\n',
        ],
        'right': [
            'asked = best_effort\n',
            'asked = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, depth=10)\n',
            """
asked = QoSProfile(depth=10)
asked.reliability = ReliabilityPolicy.BEST_EFFORT
""",
        ],
    },
    8: {
        'wrong': [
            TALKER + 'rclpy.init()\nTalker()\n',
            TALKER + 'rclpy.spin(Talker())\n',
            TALKER + 'rclpy.init()\nrclpy.spin(Talker())\n',
            TALKER + 'rclpy.init()\nrclpy.spin(Talker)\n',
            TALKER.replace('sys.argv[1]', "'red'") + END,
            TALKER.replace("'topic'", "'talker'") + END,
            TALKER.replace('self.get_logger().info', 'print') + END,
            TALKER + 'rclpy.init()\nrclpy.spin_once(Talker())\n',
        ],
        'right': [
            TALKER
            + """
def main():
    rclpy.init()
    node = Talker()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    except ExternalShutdownException:
        pass


main()
""",
            """
%%write talker.py part 2
rclpy.init()
team = sys.argv[1]
node = Node('talker')
publisher = node.create_publisher(String, 'topic', 10)


def talk():
    publisher.publish(String(data=team))
    node.get_logger().info(team + ' talks')


timer = node.create_timer(0.1, talk)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException):
    node.destroy_node()
""".lstrip(),
            TALKER.replace('self):\n        super', "self, team='nobody'):\n        super")
            + """
from contextlib import suppress

rclpy.init(args=sys.argv)
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(Talker(sys.argv[1]))
""",
        ],
    },
}
