"""What the tasks of the lesson "Set parameters" are judged by."""

import yaml
from geometry_msgs.msg import Twist
from rclpy.executors import SingleThreadedExecutor
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Int32

from helpers.checks.bench import Bench
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks
from helpers.robot import EMPTY, Robot
from helpers.ros import ros_session
from helpers.trials import ways

tasks = Tasks()
check = tasks.check


@tasks.add
def obey_at_once(Driver):
    return [
        (
            'max_speed is 0.5 at first',
            lambda: default_of(Driver, 'max_speed', 0.5),
            'self.declare_parameter(name, value)',
        ),
        (
            'it drives at 0.2, then at 0.4 m/s',
            lambda: drives_at(Driver, 0.2, 0.4),
            'self.get_parameter(name).value, in the callback.',
        ),
        (
            'it stops when max_speed is 0.0',
            lambda: drives_at(Driver, 0.5, 0.0),
            'When is the parameter read: once, or at each scan?',
        ),
    ]


@tasks.add
def limit_the_parameter(LimitedDriver):
    def has_limits():
        with ros_session():
            ranges = list(LimitedDriver().describe_parameter('max_speed').floating_point_range)
        found = [(limits.from_value, limits.to_value) for limits in ranges]
        if not found:
            return 'max_speed has no range: `ros2 param describe` would show none'
        if found != [(0.0, 1.0)]:
            return f'the range of max_speed is from {found[0][0]:g} to {found[0][1]:g}'
        values = [0.0, 1.0, -0.1, 50.0]
        return accepts('max_speed', values, [True, True, False, False])

    def accepts(name, values, right):
        found = accepted(LimitedDriver, *((name, value) for value in values))
        return found == right or f'{name} = {values}: accepted {found}'

    def has_description():
        with ros_session():
            found = LimitedDriver().describe_parameter('max_speed').description
        return found == 'highest speed (m/s)' or f'the description is {found!r}'

    return [
        (
            'it drives',
            lambda: drives_at(LimitedDriver, 0.2, 0.4),
            'Step 1 has a node that drives.',
        ),
        (
            'max_speed: 0.0 and 1.0 are accepted, -0.1 and 50.0 refused',
            has_limits,
            'Where is the range? It must be a list, in floating_point_range=[...].',
        ),
        ('max_speed has its description', has_description, 'ParameterDescriptor(description=...)'),
        (
            'robot_name is robot',
            lambda: default_of(LimitedDriver, 'robot_name', 'robot'),
            'A text.',
        ),
        (
            'robot_name is read-only',
            lambda: accepts('robot_name', ['rover'], [False]),
            'ParameterDescriptor(read_only=True)',
        ),
    ]


FAST, SLOW, LOAD = ('max_speed', 0.5), ('max_speed', 0.3), ('loaded', True)


@tasks.add
def slower_with_a_load(LoadedDriver):
    def takes(right, *changes):
        found = accepted(LoadedDriver, *changes)
        return found == right or f'of the changes {changes} it accepted {found}'

    def together(loaded, speed, first=(False, 0.5)):
        """Set both at once, twice, and return the answer to the second change."""
        with ros_session():
            driver = LoadedDriver()
            for values in (first, (loaded, speed)):
                parameters = [Parameter('loaded', value=values[0])]
                parameters.append(Parameter('max_speed', value=values[1]))
                result = driver.set_parameters_atomically(parameters)
        return result

    def is_taken(loaded, speed, first=(False, 0.5)):
        result = together(loaded, speed, first)
        return result.successful or f'it was refused: {result.reason or "without a reason"}'

    def has_reason():
        reason = together(True, 0.5).reason
        return reason == 'too fast with a load' or f'the reason is {reason!r}'

    def begins(loaded, speed):
        """Start it with these values. Return the ValueError that it raises, or None."""
        words = ['-p', f'loaded:={str(loaded).lower()}', '-p', f'max_speed:={speed}']
        with ros_session():
            try:
                LoadedDriver(cli_args=['--ros-args', *words])
            except ValueError as error:
                return error
        return None

    def begins_only_if_allowed():
        for loaded, speed in ((True, 0.2), (True, 0.3), (False, 0.9)):
            if error := begins(loaded, speed):
                return f'started with loaded {loaded}, max_speed {speed} it raises {error!r}'
        for speed in (0.9, 0.4):
            error = begins(True, speed)
            if error is None:
                return f'it starts with loaded True, max_speed {speed}'
            if str(error) != 'too fast with a load':
                return f'the text of the ValueError is {str(error)!r}'
        return True

    at_start = 'At the end of __init__: self.refuse([]) looks at the values that are there.'
    return [
        (
            'a load at 0.5 m/s is refused',
            lambda: takes([False], LOAD),
            'One of the two values is not in parameters.',
        ),
        (
            'at 0.3 m/s it is accepted, and 0.5 m/s is then refused',
            lambda: takes([True, True, False], SLOW, LOAD, FAST),
            'Begin with self.get_parameter(...).value, then put in what is in parameters.',
        ),
        ('both at once: loaded, 0.2', lambda: is_taken(True, 0.2), 'Take the new ones.'),
        (
            'both at once: no load any more, 0.5',
            lambda: is_taken(False, 0.5, (True, 0.2)),
            'The old load does not count if a new one is in parameters.',
        ),
        ('without a load, 1.0 m/s', lambda: takes([True], ('max_speed', 1.0)), 'Accept the rest.'),
        ('the reason is given', has_reason, 'SetParametersResult(successful=False, reason=...)'),
        ('it does not start loaded and too fast', begins_only_if_allowed, at_start),
    ]


@tasks.add
def say_what_has_changed(ReportingDriver):
    def logs(changes, lines):
        with Bench() as bench:
            driver = ReportingDriver()
            for name, value in changes:
                driver.set_parameters([Parameter(name, value=value)])
            found = bench.log('driver')
        right = [f'[INFO] [driver]: {line}' for line in lines]
        return found == right or f'after the changes {changes} the log is {found}'

    return [
        (
            'two changes, two lines',
            lambda: logs(
                [('max_speed', 0.2), ('max_speed', 0.7)],
                ['max_speed is now 0.2', 'max_speed is now 0.7'],
            ),
            'for parameter in parameters: what is its .name?',
        ),
        (
            'a refused change is not logged',
            lambda: logs([('max_speed', 5.0), SLOW, LOAD, FAST], ['max_speed is now 0.3']),
            'add_post_set_parameters_callback is called for accepted changes only.',
        ),
    ]


@tasks.add
def fix_a_node(Patrol):
    def starts(arguments, max_speed, rooms):
        with ros_session():
            node = Patrol(cli_args=['--ros-args', *arguments.split()])
            found = node.max_speed, list(node.rooms)
        right = found == (max_speed, rooms) and isinstance(found[0], float)
        return right or f'max_speed is {found[0]!r}, rooms is {found[1]}'

    hint = 'Which name, which type, and which value does each line give?'
    return [
        ('it starts without arguments', lambda: starts('', 1.0, ['A', 'B']), hint),
        ('-p max_speed:=0.5', lambda: starts('-p max_speed:=0.5', 0.5, ['A', 'B']), hint),
        ('-p rooms:=[C]', lambda: starts('-p rooms:=[C]', 1.0, ['C']), hint),
    ]


@tasks.add
def a_file_for_three_robots(workspace, file):
    def has_speed(name, right):
        *namespace, node_name = name.strip('/').split('/')
        words = ['-r', f'__node:={node_name}', '--params-file', str(workspace.path / file)]
        with ros_session():
            node = Node('driver', namespace='/'.join(namespace), cli_args=['--ros-args', *words])
            node.declare_parameter('max_speed', 0.5)
            found = node.get_parameter('max_speed').value
        return found == right or f'its max_speed is {found}'

    speeds = {
        '/driver': 0.2,
        '/one/pilot': 0.2,
        '/two/driver': 0.4,
        '/two/pilot': 0.2,
        '/three/driver': 1.0,
        '/three/pilot': 1.0,
    }
    hint = 'What holds for every node comes first, the exceptions after it.'
    return [
        (f'{name} has {speed}', lambda name=name, speed=speed: has_speed(name, speed), hint)
        for name, speed in speeds.items()
    ]


@tasks.add(limit_s=60)
def keep_what_was_good(by_command, good, LimitedDriver):
    @cached
    def set_values():
        """Return the values that the commands set while a node spins."""
        values = []
        good.unlink(missing_ok=True)
        with Bench() as bench:
            driver = bench.spin(LimitedDriver())
            driver.add_post_set_parameters_callback(
                lambda parameters: values.extend(
                    parameter.value for parameter in parameters if parameter.name == 'max_speed'
                )
            )
            by_command()
        return values

    def is_obeyed():
        values = set_values()
        return values == [0.2, 0.4, 0.2] or f'max_speed was set to {values or "nothing"}'

    def is_dumped():
        set_values()
        if not good.exists():
            return 'there is no such file'
        content = yaml.safe_load(good.read_text())
        if not content:
            return 'the file is empty'
        found = content['/driver']['ros__parameters']['max_speed']
        return found == 0.2 or f'the file has max_speed {found}'

    return [
        ('it is set to 0.2, to 0.4, and back', is_obeyed, 'ros2 param load /driver {GOOD}'),
        (
            'the file has 0.2',
            is_dumped,
            'Dump before you set 0.4: !ros2 param dump /driver > {GOOD}',
        ),
    ]


@tasks.add
def start_three_drivers(LimitedDriver, ONE, TWO, THREE):
    def drives(right, *starts):
        found = ways(*starts)
        return found == right or f'after 3 s, the robots one, two, three have driven {found} m'

    def name_of_two():
        with ros_session():
            found = LimitedDriver(cli_args=TWO.split()).get_fully_qualified_name()
        return found == '/two/pilot' or f'it is {found}'

    one, two, three = (LimitedDriver, ONE), (LimitedDriver, TWO), (ForeignDriver, THREE)
    return [
        (
            'ONE drives the robot one only',
            lambda: drives([0.6, 0.0, 0.0], one),
            'A namespace: -r __ns:=/one',
        ),
        (
            'TWO drives the robot two only',
            lambda: drives([0.0, 1.1, 0.0], two),
            'A name and a namespace are two rules.',
        ),
        (
            'THREE drives the robot three only',
            lambda: drives([0.0, 0.0, 1.7], three),
            'Two topics: -r /cmd_vel:=/three/cmd_vel',
        ),
        (
            'all three at once',
            lambda: drives([0.6, 1.1, 1.7], one, two, three),
            'The three above must be right.',
        ),
        ('the name of TWO is /two/pilot', name_of_two, '-r __node:=pilot'),
    ]


@tasks.add
def a_depth_by_parameter(NumberListener, SHALLOW):
    def hears(arguments, right):
        numbers = [Int32(data=number) for number in range(20)]
        with Bench() as bench:
            listener = NumberListener(cli_args=arguments.split())
            bench.say('number', *numbers, qos=100, at_once=True)
            bench.spin(listener)
            bench.quiet()
        found = listener.heard
        return found == right or f'of the numbers 0 to 19 it received {found}'

    deep = '--ros-args -p qos_overrides./number.subscription.depth:=15'
    return [
        ('without arguments, the last 10', lambda: hears('', list(range(10, 20))), 'Depth 10.'),
        (
            'with the depth 15, it receives the last 15',
            lambda: hears(deep, list(range(5, 20))),
            'qos_overriding_options=BY_PARAMETER',
        ),
        (
            'with SHALLOW, it receives the last 3',
            lambda: hears(SHALLOW, [17, 18, 19]),
            'qos_overrides./number.subscription. and then the policy.',
        ),
    ]


@tasks.add
def once_a_second(LoggingDriver):
    def counts(level, seconds, debug, info):
        """Count what is logged while a robot drives, at a level of the logger."""
        with Bench() as bench:
            robot, executor = Robot(EMPTY, sim_time=True), SingleThreadedExecutor()
            driver = LoggingDriver(parameter_overrides=[Parameter('use_sim_time', value=True)])
            executor.add_node(driver)
            driver.get_logger().set_level(level)
            robot.run(seconds, executor)
            lines = bench.log('driver')
        found = (
            lines.count('[DEBUG] [driver]: a scan has come'),
            lines.count('[INFO] [driver]: I drive'),
        )
        return found == (debug, info) or f'{found[0]} times "a scan has come", {found[1]} "I drive"'

    return [
        ('it drives', lambda: drives_at(LoggingDriver, 0.2, 0.4), 'super().scan_callback(scan)'),
        (
            'in 3 s at the level INFO: 3 lines of INFO, none of DEBUG',
            lambda: counts(LoggingSeverity.INFO, 3.0, 0, 3),
            'throttle_duration_sec=1.0, and the node has its own clock: self.get_clock().',
        ),
        (
            'in 5 s at the level DEBUG: 50 lines of DEBUG, 5 of INFO',
            lambda: counts(LoggingSeverity.DEBUG, 5.0, 50, 5),
            'self.get_logger().debug(...) has no throttle here.',
        ),
    ]


# --- What the tasks share -------------------------------------------------------------------------


def drives_at(node_class, *values):
    """Tell whether a robot drives, 1.5 s (sim time) after each change, as fast as it may."""
    with ros_session():
        robot, executor = Robot(EMPTY, sim_time=True), SingleThreadedExecutor()
        driver, found = node_class(), []
        executor.add_node(driver)
        for value in values:
            driver.set_parameters([Parameter('max_speed', value=value)])
            robot.run(1.5, executor)
            found.append(round(robot.record.poses[-1].v, 2))
    return found == list(values) or f'with max_speed {list(values)} it drove at {found} m/s'


def default_of(node_class, name, value):
    with ros_session():
        found = node_class().get_parameter(name).value
    right = found == value and type(found) is type(value)
    return right or f'the default of {name} is {found!r}'


def accepted(node_class, *changes):
    """Set parameters, one after the other. Return which changes were accepted."""
    with ros_session():
        driver = node_class()
        results = [driver.set_parameters([Parameter(n, value=v)])[0] for n, v in changes]
    return [result.successful for result in results]


class ForeignDriver(Node):
    """The driver of somebody else, whose topics have absolute names."""

    def __init__(self, **options):
        super().__init__('driver', **options)
        self.publisher = self.create_publisher(Twist, '/cmd_vel', 1)
        self.create_subscription(LaserScan, '/scan', self.scan_callback, 1)
        self.declare_parameter('max_speed', 0.5)

    def scan_callback(self, scan):
        command = Twist()
        command.linear.x = self.get_parameter('max_speed').value
        self.publisher.publish(command)
