"""Answers to the tasks of lesson 14, as students give them."""

FOLDER = 'src/fleet_pkg/launch/'
ROBOT = '<node pkg="fleet_pkg" exec="robot" args="--floor corridor" output="screen"/>'
DRIVER = '<node pkg="fleet_pkg" exec="driver">{}</node>'
SPEED = '<param name="speed" value="0.4"/>'


def xml(name: str, *lines: str) -> str:
    """Return the cell that writes a launch file."""
    return '\n'.join([f'%%write {FOLDER}{name}.launch.xml', '<launch>', *lines, '</launch>', ''])


def robot(*lines: str) -> str:
    return xml('robot', ROBOT, *lines)


def yaml(text: str) -> str:
    head = '- node: {pkg: fleet_pkg, exec: robot, args: --floor corridor, output: screen}'
    return f'%%write {FOLDER}robot.launch.yaml\nlaunch:\n{head}\n{text}\n'


ARGUMENTS = [
    '<arg name="floor" default="corridor"/>',
    '<arg name="speed" default="0.4"/>',
    '<arg name="driver" default="true"/>',
]
ANY_FLOOR = ROBOT.replace('corridor', '$(var floor)')
ANY_SPEED = SPEED.replace('0.4', '$(var speed)')
IF_DRIVER = DRIVER.replace('exec=', 'if="$(var driver)" exec=').format(ANY_SPEED)

NAME, PUSH = '<arg name="name"/>', '<push_ros_namespace namespace="$(var name)"/>'
FILE = '<param from="$(dirname)/../config/driver.yaml"/>'


def one(*lines: str) -> str:
    return xml('one_robot', *lines)


def include(name: str, file: str = 'one_robot.launch.xml') -> str:
    return f'<include file="$(dirname)/{file}"><arg name="name" value="{name}"/></include>'


def two(*lines: str) -> str:
    return xml('two_robots', *lines)


def speeds(text: str) -> str:
    return f'%%write src/fleet_pkg/config/driver.yaml\n{text}\n'


def guarded(attributes: str) -> str:
    node = DRIVER.replace('exec=', f'{attributes} exec=').format(ANY_SPEED)
    return xml('guarded', ARGUMENTS[1], node)


CAMERA = """%%write src/fleet_pkg/fleet_pkg/camera.py part 2
class Camera(Node):
    def __init__(self):
        super().__init__('camera')
        self.client = self.create_client(Trigger, 'camera/turn_left')

    def turn(self):
"""
WAIT = """        while not self.client.wait_for_service(timeout_sec=1.0):
            self.get_logger().info('I wait for the robot')
"""
CALL = """        future = self.client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(self, future)
"""
LOG = """        self.get_logger().info(f'Turned: {future.result().success}')
"""


def setup(*lines: str) -> str:
    return '\n'.join(
        [
            '%%write src/fleet_pkg/setup.py part 1',
            'from glob import glob',
            "package_name = 'fleet_pkg'",
            'data_files = [',
            "    ('share/ament_index/resource_index/packages', ['resource/' + package_name]),",
            "    ('share/' + package_name, ['package.xml']),",
            *lines,
            ']',
            '',
        ]
    )


LAUNCH = "    ('share/' + package_name + '/launch', glob('launch/*')),"
CONFIG = "    ('share/' + package_name + '/config', glob('config/*')),"

ANSWERS = {
    1: {
        'wrong': [
            robot(DRIVER.format('')),
            robot('<node pkg="fleet_pkg" exec="driver"/>', SPEED),
            robot(DRIVER.format('<param name="speed" value="0.5"/>')),
            robot('<node pkg="fleet_pkg" exec="drive">', SPEED, '</node>'),
            robot('<node pkg="fleet_pkg" exec="driver" args="speed:=0.4"/>'),
            robot(*[DRIVER.format(SPEED)] * 2),
        ],
        'right': [
            xml('robot', DRIVER.format(SPEED), ROBOT),
            robot('<node pkg="fleet_pkg" exec="driver" ros_args="-p speed:=0.4"/>'),
            robot(DRIVER.replace('exec=', 'output="screen" exec=').format(SPEED)),
        ],
    },
    2: {
        'wrong': [
            yaml('- node:\n    pkg: fleet_pkg\n    exec: driver'),
            yaml('- node:\n    pkg: fleet_pkg\n    exec: driver\n    param: {speed: 0.4}'),
            yaml('- node:\n    pkg: fleet_pkg\n    exec: driver\n    param:\n    - speed: 0.4'),
            yaml('  node:\n    pkg: fleet_pkg\n    exec: driver'),
            yaml('- node:\n\tpkg: fleet_pkg\n\texec: driver'),
        ],
        'right': [
            yaml(
                '- node:\n    pkg: fleet_pkg\n    exec: driver\n    param:\n'
                '    - name: speed\n      value: 0.4'
            ),
            yaml('- node: {pkg: fleet_pkg, exec: driver, param: [{name: speed, value: 0.4}]}'),
            yaml('- node:\n    pkg: fleet_pkg\n    exec: driver\n    ros_args: -p speed:=0.4'),
        ],
    },
    3: {
        'wrong': [
            xml('robot', *ARGUMENTS, ROBOT, DRIVER.format(SPEED)),
            xml('robot', *ARGUMENTS[:2], ANY_FLOOR, DRIVER.format(ANY_SPEED)),
            xml('robot', *ARGUMENTS, ANY_FLOOR, IF_DRIVER.replace('if=', 'unless=')),
            xml('robot', ANY_FLOOR, IF_DRIVER, *ARGUMENTS),
            xml('robot', *ARGUMENTS, ANY_FLOOR, IF_DRIVER.replace('$(var speed)', '$(speed)')),
        ],
        'right': [
            xml('robot', *ARGUMENTS[::-1], IF_DRIVER, ANY_FLOOR),
            xml(
                'robot',
                *ARGUMENTS,
                ANY_FLOOR,
                '<group if="$(var driver)">',
                DRIVER.format(ANY_SPEED),
                '</group>',
            ),
            xml(
                'robot',
                *ARGUMENTS,
                ANY_FLOOR,
                IF_DRIVER.replace('if="$(var driver)"', 'unless="$(not $(var driver))"'),
            ),
        ],
    },
    4: {
        'wrong': [
            one(NAME, '<group>', PUSH, '</group>', ROBOT, DRIVER.format(FILE)),
            one(NAME, PUSH, ROBOT, DRIVER.format(FILE)),
            one(NAME, '<group>', PUSH, ROBOT, DRIVER.format(''), '</group>'),
            one(NAME, '<group>', ROBOT, DRIVER.format(FILE), PUSH, '</group>'),
            one(
                NAME,
                '<group>',
                PUSH.replace('$(var name)', 'name'),
                ROBOT,
                DRIVER.format(FILE),
                '</group>',
            ),
            one(
                NAME,
                '<group>',
                PUSH,
                ROBOT,
                DRIVER.format(FILE.replace('../config', 'config')),
                '</group>',
            ),
        ],
        'right': [
            one(NAME, '<group>', PUSH, DRIVER.format(FILE), ROBOT, '</group>'),
            one(
                NAME,
                *(
                    node.replace('exec=', 'namespace="$(var name)" exec=')
                    for node in (ROBOT, DRIVER.format(FILE))
                ),
            ),
            one(NAME, *(f'<group>{PUSH}{node}</group>' for node in (ROBOT, DRIVER.format(FILE)))),
        ],
    },
    5: {
        'wrong': [
            two(include('one')),
            two(include('one'), include('one')),
            two(include('one'), include('two').replace('name="name" value', 'name="names" value')),
            two(include('one', 'robot.launch.xml'), include('two', 'robot.launch.xml')),
            two(include('one'), include('two'), '<include file="$(dirname)/robot.launch.xml"/>'),
        ],
        'right': [
            two(include('two'), include('one')),
            two(*(f'<group>{include(name)}</group>' for name in ('one', 'two'))),
            two(
                '<let name="name" value="one"/>',
                '<include file="$(dirname)/one_robot.launch.xml"/>',
                include('two'),
            ),
        ],
    },
    6: {
        'wrong': [
            speeds('/**:\n  ros__parameters:\n    speed: 0.3'),
            speeds('one/driver:\n  ros__parameters:\n    speed: 0.3'),
            speeds('/one/driver:\n  speed: 0.3\n/two/driver:\n  speed: 0.6'),
            speeds(
                '/one:\n  ros__parameters:\n    speed: 0.3\n/two:\n  ros__parameters:\n'
                '    speed: 0.6'
            ),
            speeds(
                '/one/driver:\n  ros__parameters:\n    speed: 0.6\n/two/driver:\n'
                '  ros__parameters:\n    speed: 0.3'
            ),
        ],
        'right': [
            speeds(
                'one:\n  driver:\n    ros__parameters:\n      speed: 0.3\n'
                'two:\n  driver:\n    ros__parameters:\n      speed: 0.6'
            ),
            speeds(
                '/two/driver: {ros__parameters: {speed: 0.6}}\n'
                '/one/driver: {ros__parameters: {speed: 0.3}}'
            ),
            speeds(
                '/one/*: {ros__parameters: {speed: 0.3}}\n/two/*: {ros__parameters: {speed: 0.6}}'
            ),
        ],
    },
    7: {
        'wrong': [
            guarded('respawn="true"'),
            guarded('respawn="true" respawn_delay="0.5"'),
            guarded('respawn="true" respawn_max_retries="2"'),
            guarded('respawn="true" respawn_delay="0.5" respawn_max_retries="3"'),
            guarded('respawn="true" respawn_delay="0.5" respawn_max_retries="1"'),
            guarded('respawn_delay="0.5" respawn_max_retries="2"'),
            guarded('on_exit="shutdown"'),
        ],
        'right': [
            guarded('respawn_max_retries="2" respawn_delay="0.5" respawn="true"'),
            guarded('respawn="1" respawn_delay="0.5" respawn_max_retries="2" output="screen"'),
            guarded('respawn="True" respawn_delay="0.5" respawn_max_retries="2"'),
        ],
    },
    8: {
        'wrong': [
            CAMERA + CALL + LOG,
            CAMERA + '        import time\n        time.sleep(5)\n' + CALL + LOG,
            CAMERA + '        self.client.wait_for_service()\n' + CALL + LOG,
            CAMERA + WAIT + '        self.client.call_async(Trigger.Request())\n'
            "        self.get_logger().info('Turned: True')\n        rclpy.spin(self)\n",
            CAMERA + WAIT.replace('while', 'if') + CALL + LOG,
            CAMERA.replace("'camera/", "'/camera/") + WAIT + CALL + LOG,
        ],
        'right': [
            CAMERA + WAIT.replace('1.0', '0.5') + CALL + LOG,
            CAMERA
            + """        while True:
            if self.client.wait_for_service(timeout_sec=1.0):
                break
            self.get_logger().warning('I wait for the robot')
"""
            + CALL
            + """        answer = future.result()
        self.get_logger().info('Turned: ' + str(answer.success))
""",
            CAMERA
            + """        import time
        while not self.client.service_is_ready():
            self.get_logger().info('I wait for the robot')
            time.sleep(1)
        future = self.client.call_async(Trigger.Request())
        while not future.done():
            rclpy.spin_once(self)
"""
            + LOG,
        ],
    },
    9: {
        'wrong': [
            setup(LAUNCH),
            setup(CONFIG),
            setup(LAUNCH.replace("'/launch'", "'/'"), CONFIG.replace("'/config'", "'/'")),
            setup(LAUNCH.replace('glob(', '(').replace("'))", "')),"), CONFIG),
            setup(LAUNCH.replace('launch/*', 'launch/*.xml'), CONFIG),
            setup(LAUNCH.replace("'share/' + package_name + ", ''), CONFIG),
        ],
        'right': [
            setup(CONFIG, LAUNCH),
            setup(
                LAUNCH.replace('launch/*', 'launch/*.launch.*'),
                CONFIG.replace("glob('config/*')", "['config/driver.yaml']"),
            ),
            setup(
                "    *[('share/' + package_name + '/' + folder, glob(folder + '/*'))",
                "      for folder in ('launch', 'config')],",
            ),
        ],
    },
}
