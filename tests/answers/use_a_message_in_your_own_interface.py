"""Answers to the tasks of lesson 11, as students give them. The checks judge all of them right."""

SRV = '%%write src/custom_interfaces/srv/TurnCamera.srv\n'

XML = """
%%write src/custom_interfaces/package.xml
<?xml version="1.0"?>
<package format="3">
  <name>custom_interfaces</name>
  <version>0.0.0</version>
  <description>A service that turns a camera</description>
  <maintainer email="you@example.com">you</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
{}
  <export><build_type>ament_cmake</build_type></export>
</package>
""".lstrip()
GENERATORS = '<buildtool_depend>rosidl_default_generators</buildtool_depend>\n'
RUNTIME = '<exec_depend>rosidl_default_runtime</exec_depend>\n'
GROUP = '<member_of_group>rosidl_interface_packages</member_of_group>\n'
SENSOR = '<depend>sensor_msgs</depend>\n'

CMAKE = """
%%write src/custom_interfaces/CMakeLists.txt
cmake_minimum_required(VERSION 3.8)
project(custom_interfaces)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(sensor_msgs REQUIRED)
rosidl_generate_interfaces(${PROJECT_NAME}
  "srv/TurnCamera.srv"
  DEPENDENCIES sensor_msgs
)
ament_package()
""".lstrip()
LOOP = """foreach(d rosidl_default_generators sensor_msgs)
  find_package(${d} REQUIRED)
endforeach()
"""

SERVER = """
class CameraServer(Node):
    def __init__(self, robot):
        super().__init__('camera')
        self.robot = robot
        self.service = self.create_service(TurnCamera, 'turn_camera', self.turn)

    def turn(self, request, response):
        response.camera_image = self.robot.turn_camera(request.deg_turn)
        return response
"""

CLIENT = """
def ask(session, node, degrees):
    client = node.create_client(TurnCamera, 'turn_camera')
    session.wait_until(client.service_is_ready)
    future = client.call_async(TurnCamera.Request(deg_turn=float(degrees)))
    session.wait_until(future.done)
    return future.result().camera_image


def pixels(image):
    return np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
"""

COMMAND = '''
COMMANDS = """
source install/setup.bash
ros2 service call /turn_camera custom_interfaces/srv/TurnCamera {}
"""
'''

SIGHTING = """
FILES = {
    'msg/Sighting.msg': '''nav_msgs/Path way
sensor_msgs/Image[] pictures
''',
    'CMakeLists.txt': '''cmake_minimum_required(VERSION 3.8)
project(sighting_interfaces)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(nav_msgs REQUIRED)
find_package(sensor_msgs REQUIRED)
rosidl_generate_interfaces(${PROJECT_NAME} "msg/Sighting.msg"
  DEPENDENCIES nav_msgs sensor_msgs)
ament_package()
''',
    'package.xml': '''<?xml version="1.0"?>
<package format="3">
  <name>sighting_interfaces</name>
  <version>0.0.0</version>
  <description>What the robot has seen</description>
  <maintainer email="you@example.com">you</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>nav_msgs</depend>
  <depend>sensor_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
''',
}
for name, text in FILES.items():
    workspace.write(f'src/sighting_interfaces/{name}', text)
"""
FIND = 'find_package(nav_msgs REQUIRED)\nfind_package(sensor_msgs REQUIRED)\n'
EACH = 'foreach(d nav_msgs sensor_msgs)\n  find_package(${d} REQUIRED)\nendforeach()\n'

ANSWERS = {
    1: {
        'wrong': [
            SRV + 'float32 deg_turn\n---\nImage camera_image\n',
            SRV + 'float32 deg_turn\n--\nsensor_msgs/Image camera_image\n',
            SRV + 'sensor_msgs/Image camera_image\n---\nfloat32 deg_turn\n',
            SRV + 'float deg_turn\n---\nsensor_msgs/Image camera_image\n',
            SRV + 'deg_turn float32\n---\ncamera_image sensor_msgs/Image\n',
            SRV + 'float32 deg_turn\n---\nsensor_msgs/Image[] camera_image\n',
            SRV + 'float64 deg_turn\n---\nsensor_msgs/msg/Image camera_image\n',
        ],
        'right': [
            SRV + 'float32 deg_turn\n---\nsensor_msgs/Image camera_image\n',
            SRV + '# degrees\nfloat32   deg_turn  # left\n---\nsensor_msgs/Image camera_image',
            SRV + '\nfloat32 deg_turn\n\n---\n# what it sees\nsensor_msgs/Image camera_image\n\n',
        ],
    },
    2: {
        'wrong': [
            XML.format(GENERATORS + RUNTIME + GROUP),
            XML.format(GENERATORS + RUNTIME + SENSOR),
            XML.format(GENERATORS + GROUP + SENSOR),
            XML.format(GENERATORS + RUNTIME + GROUP + SENSOR.replace('depend', 'build_depend')),
            XML.format(GENERATORS + RUNTIME + GROUP + SENSOR.replace('depend', 'exec_depend')),
            XML.format(RUNTIME + GROUP + SENSOR.replace('</', '<')),
            XML.format(GENERATORS + RUNTIME.replace('exec', 'execute') + GROUP + SENSOR),
        ],
        'right': [
            XML.format(SENSOR + GROUP + GENERATORS + RUNTIME),
            XML.format(
                GENERATORS
                + RUNTIME
                + GROUP
                + SENSOR.replace('depend', 'build_depend')
                + SENSOR.replace('depend', 'exec_depend')
            ),
            XML.format(GENERATORS.replace('buildtool', 'build') + RUNTIME + GROUP + SENSOR),
        ],
    },
    3: {
        'wrong': [
            CMAKE.replace('find_package(rosidl_default_generators REQUIRED)\n', ''),
            CMAKE.replace('  DEPENDENCIES sensor_msgs\n', ''),
            CMAKE.replace('find_package(sensor_msgs REQUIRED)\n', ''),
            CMAKE.replace('DEPENDENCIES sensor_msgs', 'DEPENDENCIES Image'),
            CMAKE.replace('DEPENDENCIES', 'DEPENDS'),
            CMAKE.replace('srv/TurnCamera.srv', 'TurnCamera.srv'),
        ],
        'right': [
            CMAKE,
            CMAKE.replace('find_package(sensor_msgs REQUIRED)\n', '').replace(
                'find_package(rosidl_default_generators REQUIRED)\n', LOOP
            ),
            CMAKE.replace('${PROJECT_NAME}', 'custom_interfaces').replace('"', ''),
        ],
    },
    4: {
        'wrong': [
            SERVER.replace('        return response\n', ''),
            SERVER.replace("'turn_camera'", "'camera'"),
            SERVER.replace('request.deg_turn', '30.0'),
            SERVER.replace('response.camera_image = ', ''),
            SERVER.replace('self.turn)', 'self.turn())'),
            SERVER.replace('(request.deg_turn)', '(-request.deg_turn)'),
            SERVER.replace('self, request, response', 'self, request'),
        ],
        'right': [
            SERVER,
            SERVER.replace(
                '        response.camera_image = self.robot.turn_camera(request.deg_turn)\n'
                '        return response\n',
                '        image = self.robot.turn_camera(request.deg_turn)\n'
                '        return TurnCamera.Response(camera_image=image)\n',
            ),
            SERVER.replace('self.service = ', '').replace("'turn_camera'", "'/turn_camera'"),
        ],
    },
    5: {
        'wrong': [
            CLIENT.replace('.result().camera_image', '.result()'),
            CLIENT.replace('(deg_turn=float(degrees))', '()'),
            CLIENT.replace("'turn_camera'", "'turn_kamera'").replace(
                'session.wait_until(client.service_is_ready)', 'client.wait_for_service(1)'
            ).replace('session.wait_until(future.done)', 'session.wait_until(future.done, 1)'),
            CLIENT.replace('    session.wait_until(future.done)\n', ''),
            CLIENT.replace('image.height, image.width', 'image.width, image.height'),
            CLIENT.replace('.reshape(image.height, image.width, 3)', ''),
            CLIENT.replace('image.height, image.width, 3', '48, 64, 3'),
        ],
        'right': [
            CLIENT,
            CLIENT.replace(
                'session.wait_until(client.service_is_ready)', 'client.wait_for_service()'
            ).replace('image.height, image.width, 3', 'image.height, -1, 3'),
            CLIENT.replace(
                'TurnCamera.Request(deg_turn=float(degrees))', 'request'
            ).replace(
                '    future =',
                '    request = TurnCamera.Request()\n'
                '    request.deg_turn = degrees * 1.0\n    future =',
            ),
        ],
    },
    6: {
        'wrong': [
            COMMAND.format('{deg_turn: 60.0}'),
            COMMAND.format('"{turn: 60.0}"'),
            COMMAND.format('"{deg_turn: sixty}"'),
            COMMAND.format('"{deg_turn: 1.05}"'),
            COMMAND.format('"{deg_turn: 60.0"'),
            COMMAND.format('"{deg_turn: 60.0}"').replace('source install/setup.bash', ''),
        ],
        'right': [
            COMMAND.format('"{deg_turn: 60.0}"'),
            COMMAND.format("'deg_turn: 60.0'"),
            COMMAND.format("'{\"deg_turn\": 60}'"),
        ],
    },
    7: {
        'wrong': [
            SIGHTING.replace('nav_msgs/Path', 'Path'),
            SIGHTING.replace('[] pictures', '[4] pictures'),
            SIGHTING.replace(FIND, ''),
            SIGHTING.replace('DEPENDENCIES nav_msgs sensor_msgs', 'DEPENDENCIES sensor_msgs'),
            SIGHTING.replace('<depend>nav_msgs</depend>', ''),
            SIGHTING.replace('<depend>', '<build_depend>').replace('</depend>', '</build_depend>'),
            SIGHTING.replace('"msg/Sighting.msg"', '"Sighting.msg"'),
        ],
        'right': [
            SIGHTING,
            SIGHTING.replace(FIND, EACH),
            SIGHTING.replace(
                'DEPENDENCIES nav_msgs sensor_msgs', 'DEPENDENCIES sensor_msgs nav_msgs'
            ),
        ],
    },
}  # fmt: skip
