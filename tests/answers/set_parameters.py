"""Answers to the tasks of lesson 08, as students give them: the checks judge all of them right."""

DRIVER = """
class Driver(Node):
    def __init__(self, **options):
        super().__init__('driver', **options)
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 10)
        self.create_subscription(LaserScan, 'scan', self.scan_callback, 10)
"""
CALLBACK = """
    def scan_callback(self, scan):
        command = Twist()
        command.linear.x = self.get_parameter('max_speed').value
        self.publisher.publish(command)
"""
LIMITED = DRIVER.replace('Driver', 'LimitedDriver')
LOADED = """
class LoadedDriver(LimitedDriver):
    def __init__(self, **options):
        super().__init__(**options)
        self.declare_parameter('loaded', False)
        self.add_on_set_parameters_callback(self.refuse)

    def refuse(self, parameters):
"""
YES = '        return SetParametersResult(successful=True)\n'
NO = "            return SetParametersResult(successful=False, reason='too fast with a load')\n"
REPORTING = """
class ReportingDriver(LoadedDriver):
    def __init__(self, **options):
        super().__init__(**options)
        self.add_post_set_parameters_callback(self.report)

    def report(self, parameters):
"""
PATROL = """
class Patrol(Node):
    def __init__(self, **options):
        super().__init__('patrol', **options)
"""
READ = """
        self.max_speed = self.get_parameter('max_speed').value
        self.rooms = self.get_parameter('rooms').value
"""


def yaml(*parts: tuple[str, str]) -> str:
    """Return a cell that writes speeds.yaml: names of nodes, each with its max_speed."""
    return '%%write speeds.yaml\n' + ''.join(
        f'{name}:\n  ros__parameters:\n    max_speed: {value}\n' for name, value in parts
    )


def commands(*lines: str) -> str:
    """Return the function of task 7 with these commands of ros2 param."""
    body = ''.join(f'    !ros2 param {line}\n' for line in lines)
    return f"GOOD = workspace.path / 'good.yaml'\n\n\ndef by_command():\n{body}"


def starts(one: str, two: str, three: str) -> str:
    """Return the arguments of task 8."""
    names = zip(('ONE', 'TWO', 'THREE'), (one, two, three), strict=True)
    return ''.join(f'{name} = {words!r}\n' for name, words in names)


ONE = '--ros-args -r __ns:=/one -p max_speed:=0.2'
TWO = '--ros-args -r __ns:=/two -r __node:=pilot -p max_speed:=0.4'
THREE = '--ros-args -r /cmd_vel:=/three/cmd_vel -r /scan:=/three/scan -p max_speed:=0.6'
LISTENER = """
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_msgs.msg import Int32

BY_PARAMETER = QoSOverridingOptions.with_default_policies()


class NumberListener(Node):
    def __init__(self, **options):
        super().__init__('number_listener', **options)
        self.heard = []
        self.create_subscription(
            Int32, 'number', self.number_callback, 10, qos_overriding_options=BY_PARAMETER
        )

    def number_callback(self, message):
        self.heard.append(message.data)


"""
SHALLOW = "SHALLOW = '--ros-args -p qos_overrides./number.subscription.depth:=3'\n"
LOGGING = """
class LoggingDriver(LimitedDriver):
    def scan_callback(self, scan):
        super().scan_callback(scan)
"""
DEBUG = "        self.get_logger().debug('a scan has come')\n"
INFO = """        self.get_logger().info(
            'I drive', throttle_duration_sec=1.0, throttle_time_source_type=self.get_clock()
        )
"""
LIMITS = """        limits = ParameterDescriptor(
            description='highest speed (m/s)',
            floating_point_range=[FloatingPointRange(from_value=0.0, to_value=1.0)],
        )
        self.declare_parameter('max_speed', 0.5, limits)
"""
NAME = (
    "        self.declare_parameter('robot_name', 'robot', ParameterDescriptor(read_only=True))\n"
)
SPEED = "        self.declare_parameter('max_speed', 0.5)\n"

ANSWERS = {
    1: {
        'wrong': [
            # read once
            DRIVER
            + SPEED
            + "        self.max_speed = self.get_parameter('max_speed').value\n"
            + CALLBACK.replace("self.get_parameter('max_speed').value", 'self.max_speed'),
            # without .value
            DRIVER + SPEED + CALLBACK.replace('.value', ''),
            # another name
            DRIVER + SPEED.replace('max_speed', 'speed') + CALLBACK.replace('max_speed', 'speed'),
            # an integer
            DRIVER + SPEED.replace('0.5', '1') + CALLBACK,
            # declared at each scan
            DRIVER
            + CALLBACK.replace(
                '        command = Twist()\n', SPEED + '        command = Twist()\n'
            ),
            # nothing is published
            DRIVER + SPEED + CALLBACK.replace('self.publisher.publish(command)', 'pass'),
        ],
        'right': [
            DRIVER
            + "        self.declare_parameter(name='max_speed', value=0.5)\n"
            + CALLBACK.replace('.value', '.get_parameter_value().double_value'),
            DRIVER
            + SPEED
            + """        self.max_speed = 0.5
        self.add_post_set_parameters_callback(self.keep)

    def keep(self, parameters):
        for parameter in parameters:
            if parameter.name == 'max_speed':
                self.max_speed = parameter.value
"""
            + CALLBACK.replace("self.get_parameter('max_speed').value", 'self.max_speed'),
            DRIVER
            + "        self.declare_parameters('', [('max_speed', 0.5)])\n"
            + CALLBACK.replace(
                "self.get_parameter('max_speed').value",
                "self.get_parameters(['max_speed'])[0].value",
            ),
        ],
    },
    2: {
        'wrong': [
            # no range
            LIMITED
            + "        limits = ParameterDescriptor(description='highest speed (m/s)')\n"
            + "        self.declare_parameter('max_speed', 0.5, limits)\n"
            + NAME
            + CALLBACK,
            # a range without a list
            LIMITED
            + LIMITS.replace(
                '[FloatingPointRange(from_value=0.0, to_value=1.0)]',
                'FloatingPointRange(from_value=0.0, to_value=1.0)',
            )
            + NAME
            + CALLBACK,
            # another range
            LIMITED + LIMITS.replace('to_value=1.0', 'to_value=100.0') + NAME + CALLBACK,
            # the descriptor is not given
            LIMITED + LIMITS.replace(', limits)', ')') + NAME + CALLBACK,
            # not read-only
            LIMITED + LIMITS + NAME.replace(', ParameterDescriptor(read_only=True)', '') + CALLBACK,
            # max_speed is read-only, too
            LIMITED
            + LIMITS.replace('description=', 'read_only=True, description=')
            + NAME
            + CALLBACK,
            # no commands
            LIMITED + LIMITS + NAME + '\n    def scan_callback(self, scan):\n        pass\n',
        ],
        'right': [
            LIMITED
            + """        limits = ParameterDescriptor()
        limits.description = 'highest speed (m/s)'
        limits.floating_point_range.append(FloatingPointRange(from_value=0.0, to_value=1.0))
        self.declare_parameter('max_speed', 0.5, descriptor=limits)
"""
            + NAME
            + CALLBACK,
            'class LimitedDriver(Node):\n    def __init__(self, **options):\n'
            + "        super().__init__('driver', **options)\n"
            + NAME
            + LIMITS
            + "        self.publisher = self.create_publisher(Twist, 'cmd_vel', 1)\n"
            + "        self.create_subscription(LaserScan, 'scan', self.drive, 1)\n"
            + CALLBACK.replace('scan_callback', 'drive'),
            LIMITED
            + """        speeds = FloatingPointRange()
        speeds.from_value, speeds.to_value = 0.0, 1.0
        self.declare_parameters(
            '',
            [
                (
                    'max_speed',
                    0.5,
                    ParameterDescriptor(
                        description='highest speed (m/s)', floating_point_range=[speeds]
                    ),
                ),
                ('robot_name', 'robot', ParameterDescriptor(read_only=True)),
            ],
        )
"""
            + CALLBACK,
        ],
    },
    3: {
        'wrong': [
            # the old values only
            LOADED
            + "        old = self.get_parameter('loaded').value\n"
            + "        if old and self.get_parameter('max_speed').value > 0.3:\n"
            + NO
            + YES,
            # the speed only, with the old load
            LOADED
            + """        for parameter in parameters:
            fast = parameter.name == 'max_speed' and parameter.value > 0.3
            if fast and self.get_parameter('loaded').value:
                return SetParametersResult(successful=False, reason='too fast with a load')
"""
            + YES,
            # all that is fast
            LOADED
            + """        for parameter in parameters:
            if parameter.name == 'max_speed' and parameter.value > 0.3:
                return SetParametersResult(successful=False, reason='too fast with a load')
"""
            + YES,
            # it returns nothing
            LOADED + '        pass\n',
            # it returns a bool
            LOADED + '        return True\n',
            # no reason
            LOADED
            + """        new = {n: self.get_parameter(n).value for n in ('loaded', 'max_speed')}
        new |= {p.name: p.value for p in parameters}
        return SetParametersResult(successful=not (new['loaded'] and new['max_speed'] > 0.3))
""",
            # never asked
            LOADED.replace('        self.add_on_set_parameters_callback(self.refuse)\n', '')
            + """        new = {n: self.get_parameter(n).value for n in ('loaded', 'max_speed')}
        new |= {p.name: p.value for p in parameters}
        if new['loaded'] and new['max_speed'] > 0.3:
"""
            + NO
            + YES,
            # 0.3 itself is refused
            LOADED
            + """        new = {n: self.get_parameter(n).value for n in ('loaded', 'max_speed')}
        new |= {p.name: p.value for p in parameters}
        if new['loaded'] and new['max_speed'] >= 0.3:
"""
            + NO
            + YES,
        ],
        'right': [
            LOADED
            + """        loaded = self.get_parameter('loaded').value
        speed = self.get_parameter('max_speed').value
        for parameter in parameters:
            if parameter.name == 'loaded':
                loaded = parameter.value
            elif parameter.name == 'max_speed':
                speed = parameter.value
        if loaded and speed > 0.3:
"""
            + NO
            + YES,
            LOADED
            + """        new = {p.name: p.value for p in parameters}
        loaded = new.get('loaded', self.get_parameter('loaded').value)
        speed = new.get('max_speed', self.get_parameter('max_speed').value)
        fast = loaded and speed > 0.3
        reason = 'too fast with a load' if fast else ''
        return SetParametersResult(successful=not fast, reason=reason)
""",
            LOADED.replace(
                '        self.declare_parameter',
                '        self.load = False\n        self.declare_parameter',
            )
            + """        result = SetParametersResult(successful=True)
        names = [parameter.name for parameter in parameters]
        old = [self.get_parameter(n) for n in ('loaded', 'max_speed') if n not in names]
        now = {p.name: p.value for p in [*old, *parameters]}
        if now['loaded'] is True and not now['max_speed'] <= 0.3:
            result.successful = False
            result.reason = 'too fast with a load'
        return result
""",
        ],
    },
    4: {
        'wrong': [
            # before the change: what is refused is said, too
            REPORTING.replace('add_post_set', 'add_on_set')
            + """        for parameter in parameters:
            if parameter.name == 'max_speed':
                self.get_logger().info(f'max_speed is now {parameter.value}')
"""
            + YES,
            # every parameter
            REPORTING
            + """        for parameter in parameters:
            self.get_logger().info(f'{parameter.name} is now {parameter.value}')
""",
            # the whole Parameter
            REPORTING
            + """        for parameter in parameters:
            if parameter.name == 'max_speed':
                self.get_logger().info(f'max_speed is now {parameter}')
""",
            # called, not named
            REPORTING.replace('self.report)', 'self.report([]))') + '        pass\n',
            # print in place of the log
            REPORTING
            + """        for parameter in parameters:
            if parameter.name == 'max_speed':
                print(f'max_speed is now {parameter.value}')
""",
            # another level
            REPORTING
            + """        for parameter in parameters:
            if parameter.name == 'max_speed':
                self.get_logger().warning(f'max_speed is now {parameter.value}')
""",
            # after any change
            REPORTING
            + """        value = self.get_parameter('max_speed').value
        self.get_logger().info(f'max_speed is now {value}')
""",
        ],
        'right': [
            REPORTING
            + """        if 'max_speed' in [parameter.name for parameter in parameters]:
            value = self.get_parameter('max_speed').value
            self.get_logger().info(f'max_speed is now {value}')
""",
            """
class ReportingDriver(LoadedDriver):
    def __init__(self, **options):
        super().__init__(**options)

        def report(parameters):
            for parameter in parameters:
                if parameter.name == 'max_speed':
                    self.get_logger().info('max_speed is now ' + str(parameter.value))

        self.add_post_set_parameters_callback(report)
""",
            REPORTING
            + """        new = {parameter.name: parameter.value for parameter in parameters}
        if 'max_speed' in new:
            self.get_logger().info('max_speed is now %s' % new['max_speed'])
""",
        ],
    },
    5: {
        'wrong': [
            # one error mended
            PATROL
            + """        self.declare_parameter('max_speed', 1)
        self.declare_parameter('rooms', ['A', 'B'])
"""
            + READ,
            # no value of the rooms
            PATROL
            + """        self.declare_parameter('max_speed', 1.0)
        self.declare_parameter('rooms', Parameter.Type.STRING_ARRAY)
"""
            + READ,
            # the values are constants
            PATROL
            + """        self.declare_parameter('max_speed', 1.0)
        self.declare_parameter('rooms', ['A', 'B'])
        self.max_speed = 1.0
        self.rooms = ['A', 'B']
""",
            # a text
            PATROL
            + """        self.declare_parameter('max_speed', 1.0)
        self.declare_parameter('rooms', 'A, B')
"""
            + READ,
            # the other name is declared
            PATROL
            + """        self.declare_parameter('max_sped', 1.0)
        self.declare_parameter('rooms', ['A', 'B'])
        self.max_speed = self.get_parameter('max_sped').value
        self.rooms = self.get_parameter('rooms').value
""",
        ],
        'right': [
            PATROL
            + """        self.max_speed = self.declare_parameter('max_speed', 1.0).value
        self.rooms = self.declare_parameter('rooms', ['A', 'B']).value
""",
            PATROL
            + """        self.declare_parameters('', [('max_speed', 1.0), ('rooms', ['A', 'B'])])
"""
            + READ,
            PATROL
            + """        self.declare_parameter('max_speed', 1.0)
        self.declare_parameter('rooms', Parameter.Type.STRING_ARRAY)
        self.max_speed = self.get_parameter('max_speed').value
        unset = Parameter('rooms', value=['A', 'B'])
        self.rooms = self.get_parameter_or('rooms', unset).value
""",
        ],
    },
    6: {
        'wrong': [
            # every node last
            yaml(('/two/driver', '0.4'), ('/three/*', '1.0'), ('/**', '0.2')),
            # an integer
            yaml(('/**', '0.2'), ('/two/driver', '0.4'), ('/three/*', '1')),
            # one node of /three
            yaml(('/**', '0.2'), ('/two/driver', '0.4'), ('/three/driver', '1.0')),
            # a namespace is no node
            yaml(('/**', '0.2'), ('/two/driver', '0.4'), ('/three', '1.0')),
            # a tab
            yaml(('/**', '0.2'), ('/two/driver', '0.4'), ('/three/*', '1.0')).replace('    ', '\t'),
            # one underscore
            yaml(('/**', '0.2'), ('/two/driver', '0.4'), ('/three/*', '1.0')).replace('s__', 's_'),
            # `*` is one word
            yaml(('/*', '0.2'), ('/two/driver', '0.4'), ('/three/*', '1.0')),
        ],
        'right': [
            yaml(('/**', '0.2'), ('/three/**', '1.0'), ('/two/driver', '0.4')),
            yaml(
                ('/**', '0.2'),
                ('/two/driver', '0.4'),
                ('/three/driver', '1.0'),
                ('/three/pilot', '1.0'),
            ),
            """%%write speeds.yaml
/**: {ros__parameters: {max_speed: 0.2}}
two:
  driver:
    ros__parameters: {max_speed: 0.4}
/three/*: {ros__parameters: {max_speed: 1.0}}
""",
        ],
    },
    7: {
        'wrong': [
            # dumped too late
            commands(
                'set /driver max_speed 0.2',
                'set /driver max_speed 0.4',
                'dump /driver > {GOOD}',
                'load /driver {GOOD}',
            ),
            # not loaded
            commands(
                'set /driver max_speed 0.2', 'dump /driver > {GOOD}', 'set /driver max_speed 0.4'
            ),
            # set again in place of load
            commands(
                'set /driver max_speed 0.2',
                'set /driver max_speed 0.4',
                'set /driver max_speed 0.2',
            ),
            # printed, not written
            commands(
                'set /driver max_speed 0.2',
                'dump /driver',
                'set /driver max_speed 0.4',
                'load /driver {GOOD}',
            ),
            # another node
            commands(
                'set /drive max_speed 0.2',
                'dump /drive > {GOOD}',
                'set /drive max_speed 0.4',
                'load /drive {GOOD}',
            ),
        ],
        'right': [
            commands(
                'set driver max_speed 0.2',
                'dump driver > {GOOD}',
                'set driver max_speed 0.4',
                'load driver {GOOD}',
            ),
            commands(
                'set /driver max_speed 0.2',
                'dump /driver > "{GOOD}"',
                'set /driver max_speed 0.4',
                'get /driver max_speed',
                'load /driver "{GOOD}"',
            ),
            commands(
                'set /driver max_speed 0.20',
                'dump /driver | cat > {GOOD}',
                'set /driver max_speed 0.40',
                'load /driver {GOOD} --no-use-wildcard',
            ),
        ],
    },
    8: {
        'wrong': [
            # no namespace
            starts('--ros-args -p max_speed:=0.2', TWO, THREE),
            # one -r for two rules
            starts(ONE, '--ros-args -r __ns:=/two __node:=pilot -p max_speed:=0.4', THREE),
            # a namespace for absolute names
            starts(ONE, TWO, '--ros-args -r __ns:=/three -p max_speed:=0.6'),
            # one topic only
            starts(ONE, TWO, THREE.replace(' -r /scan:=/three/scan', '')),
            # = in place of :=
            starts(ONE.replace('__ns:=', '__ns='), TWO, THREE),
            # the name has a namespace in it
            starts(ONE, '--ros-args -r __node:=/two/pilot -p max_speed:=0.4', THREE),
            # without --ros-args
            starts(ONE.replace('--ros-args ', ''), TWO, THREE),
            # the wrong way round
            starts(ONE, TWO, THREE.replace('/cmd_vel:=/three/cmd_vel', '/three/cmd_vel:=/cmd_vel')),
            # a name of its own only
            starts(ONE, TWO.replace(' -r __node:=pilot', ''), THREE),
        ],
        'right': [
            starts(
                '--ros-args -p max_speed:=0.2 -r __ns:=/one',
                '--ros-args --remap __node:=pilot --remap __ns:=/two --param max_speed:=0.4',
                THREE + ' -r __ns:=/three',
            ),
            starts(
                '--ros-args -r cmd_vel:=/one/cmd_vel -r scan:=/one/scan -p max_speed:=0.2',
                TWO,
                THREE,
            ),
            starts(
                ONE,
                '--ros-args -r __ns:=/two --ros-args -r driver:__node:=pilot -p max_speed:=0.4',
                '--ros-args -r cmd_vel:=three/cmd_vel -r scan:=three/scan -p max_speed:=0.6',
            ),
        ],
    },
    9: {
        'wrong': [
            # no argument
            LISTENER.replace(', qos_overriding_options=BY_PARAMETER', '') + SHALLOW,
            # a constant depth
            LISTENER.replace('10, qos', '3, qos') + SHALLOW,
            # no slash
            LISTENER + SHALLOW.replace('./number', '.number'),
            # of a publisher
            LISTENER + SHALLOW.replace('subscription', 'publisher'),
            # no -p
            LISTENER + SHALLOW.replace(' -p', ''),
            # another depth
            LISTENER + SHALLOW.replace(':=3', ':=30'),
        ],
        'right': [
            LISTENER.replace(
                'qos_overriding_options=BY_PARAMETER',
                'qos_overriding_options=QoSOverridingOptions.with_default_policies()',
            )
            + SHALLOW,
            LISTENER.replace(
                'QoSOverridingOptions.with_default_policies()',
                'QoSOverridingOptions([QoSPolicyKind.DEPTH])',
            ).replace('import Int32', 'import Int32\nfrom rclpy.qos import QoSPolicyKind')
            + SHALLOW,
            LISTENER + SHALLOW.replace('-p', '--param').replace("3'", "3 -r __node:=listener'"),
        ],
    },
    10: {
        'wrong': [
            # no throttle
            LOGGING + DEBUG + "        self.get_logger().info('I drive')\n",
            # the clock of the computer
            LOGGING
            + DEBUG
            + "        self.get_logger().info('I drive', throttle_duration_sec=1.0)\n",
            # once
            LOGGING + DEBUG + "        self.get_logger().info('I drive', once=True)\n",
            # the debug line is throttled, too
            LOGGING + INFO.replace('info', 'debug').replace('I drive', 'a scan has come') + INFO,
            # it does not drive
            LOGGING.replace('super().scan_callback(scan)', 'pass') + DEBUG + INFO,
            # INFO in place of DEBUG
            LOGGING + DEBUG.replace('debug', 'info') + INFO,
            # every two seconds
            LOGGING + DEBUG + INFO.replace('1.0', '2.0'),
        ],
        'right': [
            LOGGING + INFO + DEBUG,
            """
class LoggingDriver(LimitedDriver):
    def __init__(self, **options):
        super().__init__(**options)
        self.create_subscription(LaserScan, 'scan', self.log, 10)

    def log(self, scan):
"""
            + DEBUG
            + INFO.replace('1.0', '1'),
            LOGGING.replace('(self, scan):', '(self, scan):\n        logger = self.get_logger()')
            + """        logger.debug('a scan has come')
        how = {'throttle_duration_sec': 1, 'throttle_time_source_type': self._clock}
        logger.info('I drive', **how)
""",
        ],
    },
}
