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
from helpers.checks.errors import Failed
from helpers.checks.points import all_of, cached, expect, needs, rows
from helpers.checks.tasks import Tasks
from helpers.robot import EMPTY, Floor, Robot
from helpers.ros import ros_session
from helpers.trials import ways

tasks = Tasks()
check = tasks.check

KEEP_THE_BRAKE = (
    'CarefulDriver brakes in its scan_callback. Write speed(), and leave the rest to it.'
)
BLIND_ALLEY = Floor.from_text(
    '########\n#      #\n#>     #\n#      #\n########', name='blind alley'
)


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
            'speed() returns self.get_parameter(name).value.',
        ),
        (
            'it stops when max_speed is 0.0',
            lambda: drives_at(Driver, 0.5, 0.0),
            'When is the parameter read: once, or at each call of speed()?',
        ),
        ('it stops before a wall', lambda: brakes(Driver), KEEP_THE_BRAKE),
    ]


@tasks.add
def limit_the_parameter(LimitedDriver):
    def has_limits():
        with ros_session():
            ranges = list(LimitedDriver().describe_parameter('max_speed').floating_point_range)
        if not ranges:
            return 'max_speed has no range: `ros2 param describe` would show none'
        limits = ranges[0].from_value, ranges[0].to_value
        return all_of(
            expect(limits, (0.0, 1.0), 'the range of max_speed is'),
            default_of(LimitedDriver, 'max_speed', 0.5),
            accepts('max_speed', [0.0, 1.0, -0.1, 50.0], [True, True, False, False]),
        )

    def accepts(name, values, right):
        changes = [{name: value} for value in values]
        return expect(accepted(LimitedDriver, *changes), right, f'{name} = {values}: accepted')

    def has_description():
        with ros_session():
            description = LimitedDriver().describe_parameter('max_speed').description
        return expect(description, 'highest speed (m/s)', 'the description is')

    in_range = 'Where is the range? It must be a list, in floating_point_range=[...].'
    return [
        ('it drives', lambda: drives_at(LimitedDriver, 0.2, 0.4), 'speed() is as in Driver.'),
        ('it stops before a wall', lambda: brakes(LimitedDriver), KEEP_THE_BRAKE),
        ('max_speed: 0.0 and 1.0 are accepted, -0.1 and 50.0 refused', has_limits, in_range),
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


FAST, SLOW, LOAD = {'max_speed': 0.5}, {'max_speed': 0.3}, {'loaded': True}
REASON = 'too fast with a load'


@tasks.add
def slower_with_a_load(LoadedDriver):
    def takes(right, *changes):
        found = accepted(LoadedDriver, *changes)
        return expect(found, right, f'of the changes {named(changes)}, accepted are')

    def together(*changes):
        """Return the answer to the last one of changes, each of which sets several parameters."""
        with ros_session():
            driver = LoadedDriver()
            return [set_in(driver, change) for change in changes][-1]

    def is_taken(*changes):
        result = together(*changes)
        why = result.reason or 'without a reason'
        return result.successful or f'{named(changes[-1:])} was refused: {why}'

    def has_reason():
        return expect(together(LOAD | FAST).reason, REASON, 'the reason is')

    def begins(loaded, speed):
        """Start it with these values. Return the text of the ValueError that it raises, or None."""
        words = ['-p', f'loaded:={str(loaded).lower()}', '-p', f'max_speed:={speed}']
        with ros_session():
            try:
                LoadedDriver(cli_args=['--ros-args', *words])
            except ValueError as error:
                return str(error)
        return None

    def begins_only_if_allowed():
        for loaded, speed in ((True, 0.2), (True, 0.3), (False, 0.9)):
            if (error := begins(loaded, speed)) is not None:
                return f'with loaded {loaded}, max_speed {speed} it does not start: {error!r}'
        for speed in (0.9, 0.4):
            error = begins(True, speed)
            if error is None:
                return f'it starts with loaded True, max_speed {speed}'
            if error != REASON:
                return expect(error, REASON, 'the text of the ValueError is')
        return True

    at_start = 'At the end of __init__: self.refuse([]) looks at the values that are there.'
    no_load = {'loaded': False, 'max_speed': 0.5}
    slow_load = {'loaded': True, 'max_speed': 0.2}
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
        ('both at once: loaded, 0.2', lambda: is_taken(no_load, slow_load), 'Take the new ones.'),
        (
            'both at once: no load any more, 0.5',
            lambda: is_taken(slow_load, no_load),
            'The old load does not count if a new one is in parameters.',
        ),
        ('without a load, 1.0 m/s', lambda: takes([True], {'max_speed': 1.0}), 'Accept the rest.'),
        ('the reason is given', has_reason, 'SetParametersResult(successful=False, reason=...)'),
        ('it does not start loaded and too fast', begins_only_if_allowed, at_start),
    ]


@tasks.add
def say_what_has_changed(ReportingDriver):
    def logs(changes, *speeds):
        with Bench() as bench:
            driver = ReportingDriver()
            for change in changes:
                set_in(driver, change)
            log = bench.log('driver')
        right = [f'[INFO] [driver]: max_speed is now {speed}' for speed in speeds]
        return expect(log, right, f'after the changes {named(changes)} the log is')

    def logs_each_change():
        return all_of(
            logs([{'max_speed': 0.2}, {'max_speed': 0.7}], 0.2, 0.7),
            # Two at once, in either order:
            logs([{'loaded': False, 'max_speed': 0.2}], 0.2),
            logs([{'max_speed': 0.2, 'loaded': True}], 0.2),
        )

    return [
        (
            'two changes, two lines',
            logs_each_change,
            'for parameter in parameters: what is its .name?',
        ),
        (
            'a refused change is not logged',
            lambda: logs([{'max_speed': 5.0}, SLOW, LOAD, FAST], 0.3),
            'add_post_set_parameters_callback is called for accepted changes only.',
        ),
    ]


@tasks.add
def fix_a_node(Patrol):
    def starts(arguments, max_speed, rooms):
        with ros_session():
            node = Patrol(cli_args=['--ros-args', *arguments.split()])
            found = node.max_speed, [*node.rooms]
        return all_of(
            expect(type(found[0]).__name__, 'float', 'the type of max_speed is'),
            expect(found, (max_speed, rooms), 'max_speed and rooms are'),
        )

    hint = 'Which name, which type, and which value does each line give?'
    return rows(
        starts,
        hint,
        ('it starts without arguments', '', 1.0, ['A', 'B']),
        ('-p max_speed:=0.5', '-p max_speed:=0.5', 0.5, ['A', 'B']),
        ('-p rooms:=[C]', '-p rooms:=[C]', 1.0, ['C']),
    )


@tasks.add
def a_file_for_three_robots(workspace, file):
    def has_speed(name, right):
        must_be_yaml(workspace.path / file)
        *namespace, node_name = name.strip('/').split('/')
        words = ['-r', f'__node:={node_name}', '--params-file', str(workspace.path / file)]
        with ros_session():
            node = Node('driver', namespace='/'.join(namespace), cli_args=['--ros-args', *words])
            node.declare_parameter('max_speed', 0.5)
            speed = node.get_parameter('max_speed').value
        return expect(speed, right, 'its max_speed is')

    speeds = {
        '/driver': 0.2,
        '/one/pilot': 0.2,
        '/two/driver': 0.4,
        '/two/pilot': 0.2,
        '/three/driver': 1.0,
        '/three/pilot': 1.0,
    }
    hint = 'What holds for every node comes first, the exceptions after it.'
    return rows(
        has_speed, hint, *((f'{name} has {speed}', name, speed) for name, speed in speeds.items())
    )


def must_be_yaml(path):
    """Raise Failed, with the line, if a file cannot be read as YAML."""
    try:
        yaml.safe_load(path.read_text())
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        where = f'line {mark.line + 1} of ' if mark else ''
        problem = getattr(error, 'problem', None) or error
        raise Failed(f'{where}{path.name} is no YAML: {problem}') from None


@tasks.add(limit_s=60)
def keep_what_was_good(by_command, good, LimitedDriver):
    @cached
    def speeds_set():
        """Return the values that the commands set while a node spins."""
        speeds = []
        good.unlink(missing_ok=True)
        with Bench() as bench:
            driver = bench.spin(LimitedDriver())
            driver.add_post_set_parameters_callback(
                lambda changed: speeds.extend(p.value for p in changed if p.name == 'max_speed')
            )
            by_command()
        return speeds

    def is_obeyed():
        return expect(speeds_set(), [0.2, 0.4, 0.2], 'max_speed was set in turn to')

    def is_dumped():
        speeds_set()
        if not good.exists():
            return 'there is no such file'
        content = yaml.safe_load(good.read_text())
        if not content:
            return 'the file is empty'
        speed = content['/driver']['ros__parameters']['max_speed']
        return expect(speed, 0.2, 'the file has max_speed')

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
        what = 'after 3 s, the robots one, two, three have driven (m)'
        return expect(ways(*starts), right, what)

    def name_of_two():
        with ros_session():
            name = LimitedDriver(cli_args=TWO.split()).get_fully_qualified_name()
        return expect(name, '/two/pilot', 'it is')

    one, two, three = (LimitedDriver, ONE), (LimitedDriver, TWO), (ForeignDriver, THREE)
    drives_one = cached(lambda: drives([0.6, 0.0, 0.0], one))
    drives_two = cached(lambda: drives([0.0, 1.1, 0.0], two))
    drives_three = cached(lambda: drives([0.0, 0.0, 1.7], three))

    def drive_together():
        for alone in (drives_one, drives_two, drives_three):
            needs(alone, 'one of the three above does not drive its robot alone')
        return drives([0.6, 1.1, 1.7], one, two, three)

    return [
        ('ONE drives the robot one only', drives_one, 'A namespace: -r __ns:=/one'),
        ('TWO drives the robot two only', drives_two, 'A name and a namespace are two rules.'),
        (
            'THREE drives the robot three only',
            drives_three,
            'Two topics: -r /cmd_vel:=/three/cmd_vel',
        ),
        ('all three at once', drive_together, 'The three above must be right.'),
        ('the name of TWO is /two/pilot', name_of_two, '-r __node:=pilot'),
    ]


@tasks.add
def a_depth_by_parameter(NumberListener, SHALLOW):
    def hears_last(count, arguments):
        numbers = [Int32(data=number) for number in range(20)]
        with Bench() as bench:
            listener = NumberListener(cli_args=arguments.split())
            bench.say('number', *numbers, qos=100, at_once=True)
            bench.spin(listener)
            bench.quiet()
        right = [*range(20 - count, 20)]
        return expect(listener.heard, right, 'of the numbers 0 to 19 it received')

    deep = '--ros-args -p qos_overrides./number.subscription.depth:=15'
    return [
        ('without arguments, the last 10', lambda: hears_last(10, ''), 'Depth 10.'),
        (
            'with the depth 15, it receives the last 15',
            lambda: hears_last(15, deep),
            'qos_overriding_options=BY_PARAMETER',
        ),
        (
            'with SHALLOW, it receives the last 3',
            lambda: hears_last(3, SHALLOW),
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
        return all_of(
            expect(lines.count('[INFO] [driver]: I drive'), info, 'lines "I drive" at INFO:'),
            expect(
                lines.count('[DEBUG] [driver]: a scan has come'),
                debug,
                'lines "a scan has come" at DEBUG:',
            ),
        )

    return [
        ('it drives', lambda: drives_at(LoggingDriver, 0.2, 0.4), 'super().scan_callback(scan)'),
        ('it stops before a wall', lambda: brakes(LoggingDriver), KEEP_THE_BRAKE),
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


def drives_at(node_class, *speeds):
    """Tell whether a robot drives, 1.5 s (sim time) after each change, as fast as it may."""
    with ros_session():
        robot, executor = Robot(EMPTY, sim_time=True), SingleThreadedExecutor()
        driver, found = node_class(), []
        executor.add_node(driver)
        for speed in speeds:
            set_in(driver, {'max_speed': speed})
            robot.run(1.5, executor)
            found.append(round(robot.record.poses[-1].v, 2))
    return expect(found, [*speeds], f'with max_speed {[*speeds]} it drove (m/s) at')


def brakes(node_class):
    """Tell whether a robot stops before a wall, to which it drives at the default speed."""
    with ros_session():
        robot, executor = Robot(BLIND_ALLEY, sim_time=True), SingleThreadedExecutor()
        executor.add_node(node_class())
        robot.run(10, executor)
    way = robot.pose.x - robot.floor.start.x
    return all_of(
        robot.bumps == 0 or f'it hit the wall after {way:.1f} m',
        way > 0.1 or f'it drove {way:.1f} m only: the wall is farther away',
    )


def default_of(node_class, name, right):
    with ros_session():
        value = node_class().get_parameter(name).value
    is_right = type(value) is type(right) and value == right
    return is_right or f'the default of {name} is {value!r}, not {right!r}'


def accepted(node_class, *changes):
    """Change parameters, one change after the other. Return which ones were accepted."""
    with ros_session():
        driver = node_class()
        return [set_in(driver, change).successful for change in changes]


def set_in(node, change):
    """Set parameters of a node all at once: {'max_speed': 0.2}. Return its answer."""
    for name in change:
        if not node.has_parameter(name):  # rclpy's error would name none
            raise Failed(f'the parameter {name} is not declared')
    parameters = [Parameter(name, value=value) for name, value in change.items()]
    return node.set_parameters_atomically(parameters)


def named(changes):
    """Write changes in a sentence: 'max_speed 0.3, then loaded True and max_speed 0.5'."""
    return ', then '.join(
        ' and '.join(f'{name} {value}' for name, value in change.items()) for change in changes
    )


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
