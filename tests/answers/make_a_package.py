"""Answers to the tasks of lesson 09, as students give them. The checks judge all of them right."""

CREATE = '%%terminal\ncd src\nrm -rf hello_pkg\n'
OPTIONS = 'ros2 pkg create hello_pkg --build-type ament_python --license Apache-2.0'

LISTENER = """
%%write src/hello_pkg/hello_pkg/listener.py
import time

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String


class Listener(Node):
    def __init__(self):
        super().__init__('listener')
        self.subscription = self.create_subscription(String, 'topic', self.callback, 10)

    def callback(self, message):
        self.get_logger().info(f'I heard: "{message.data}" at {time.monotonic():.4f}')
        time.sleep(0.2)


def main():
    rclpy.init()
    try:
        rclpy.spin(Listener())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
""".lstrip()

XML = """
%%write src/hello_pkg/package.xml
<?xml version="1.0"?>
<package format="3">
  <name>hello_pkg</name>
  <version>0.0.0</version>
  <description>A talker and a slow listener</description>
  <maintainer email="you@example.com">you</maintainer>
  <license>Apache-2.0</license>
{}
</package>
""".lstrip()
DEPENDS = '  <depend>rclpy</depend>\n  <depend>std_msgs</depend>\n'
EXPORT = '  <export>\n    <build_type>ament_python</build_type>\n  </export>\n'

SETUP = """
%%write src/hello_pkg/setup.py
from setuptools import find_packages, setup

package_name = 'hello_pkg'

setup(
    name=package_name,
    version='0.0.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', ['config/slow.yaml']),
    ],
    entry_points={
        'console_scripts': [
            'talker = hello_pkg.talker:main',
            'listener = hello_pkg.listener:main',
        ],
    },
)
""".lstrip()

TALK = '%%terminal talker\n'
SOURCE = 'source install/setup.bash\n'
RUN = 'ros2 run hello_pkg talker'

PARALLEL = """
%%write src/hello_pkg/hello_pkg/listener.py
import time

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String


class Listener(Node):
    def __init__(self):
        super().__init__('listener')
        group = ReentrantCallbackGroup()
        self.subscription = self.create_subscription(
            String, 'topic', self.callback, 10, callback_group=group
        )

    def callback(self, message):
        self.get_logger().info(f'I heard: "{message.data}" at {time.monotonic():.4f}')
        time.sleep(0.2)


def main():
    rclpy.init()
    executor = MultiThreadedExecutor(num_threads=8)
    executor.add_node(Listener())
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
""".lstrip()

NEW = '%%terminal new_listener\n'
LISTEN = 'ros2 run hello_pkg listener'

OTHER = '%%terminal other_talker\n' + SOURCE
YAML = 'install/hello_pkg/share/hello_pkg/config/slow.yaml'

MEND = SETUP.replace('hello_pkg', 'forgetful_pkg').replace(
    "        ('share/' + package_name + '/config', ['config/slow.yaml']),\n", ''
)
MEND = MEND.replace("            'talker = forgetful_pkg.talker:main',\n", '').replace(
    'listener = forgetful_pkg.listener:main', 'counter = forgetful_pkg.counter:main'
)

ANSWERS = {
    1: {
        'wrong': [
            CREATE + 'ros2 pkg create hello_pkg --license Apache-2.0',
            CREATE + 'ros2 pkg create hello_pkg --build-type ament_python',
            CREATE + OPTIONS.replace('hello_pkg', 'hello_pgk'),
            CREATE + OPTIONS.replace('ament_python', 'python'),
            CREATE + 'cd ..\n' + OPTIONS,
        ],
        'right': [
            CREATE + OPTIONS,
            CREATE + 'ros2 pkg create --license Apache-2.0 --build-type=ament_python hello_pkg',
            CREATE + f'cd ..\n{OPTIONS} --destination-directory src --node-name talker',
        ],
    },
    2: {
        'wrong': [
            LISTENER.replace('I heard: "{message.data}"', 'I heard: {message.data}'),
            LISTENER.replace('        time.sleep(0.2)\n', ''),
            LISTENER.replace('time.sleep(0.2)', 'time.sleep(2)'),
            LISTENER.replace("'topic'", "'topik'"),
            LISTENER.replace('.create_subscription(String', '.create_publisher(String'),
            LISTENER.replace('except (KeyboardInterrupt,', 'except (ValueError,'),
            LISTENER.replace('{message.data}', '{message}'),
        ],
        'right': [
            LISTENER.replace('import rclpy\n', 'import rclpy\nimport rclpy.executors\n'),
            LISTENER.replace(
                """f'I heard: "{message.data}" at {time.monotonic():.4f}'""",
                """'I heard: "%s" at %.4f' % (message.data, time.monotonic())""",
            ),
            LISTENER.replace('def main():\n', 'def main(args=None):\n').replace(
                'rclpy.spin(Listener())', 'node = Listener()\n        rclpy.spin(node)'
            ),
        ],
    },
    3: {
        'wrong': [
            XML.format(DEPENDS),
            XML.format('  <depend>rclpy</depend>\n' + EXPORT),
            XML.format('  <depend>rclpy, std_msgs</depend>\n' + EXPORT),
            XML.format(DEPENDS.replace('depend', 'depends') + EXPORT),
            XML.format(DEPENDS.replace('depend', 'build_depend') + EXPORT),
            XML.format(DEPENDS + EXPORT.replace('</export>', '')),
            XML.format(DEPENDS.replace('std_msgs', 'std_msgs.msg') + EXPORT),
        ],
        'right': [
            XML.format(EXPORT + DEPENDS),
            XML.format(
                DEPENDS.replace('depend', 'build_depend')
                + DEPENDS.replace('depend', 'exec_depend')
                + EXPORT
            ),
            XML.format(DEPENDS.replace('\n', '') + EXPORT.replace('\n', '')),
        ],
    },
    4: {
        'wrong': [
            SETUP.replace("            'listener = hello_pkg.listener:main',\n", ''),
            SETUP.replace('hello_pkg.talker:main', 'hello_pkg.talker.main'),
            SETUP.replace('hello_pkg.talker:main', 'talker:main'),
            SETUP.replace("    packages=find_packages(exclude=['test']),\n", ''),
            SETUP.replace(" + '/config'", ''),
            SETUP.replace("['config/slow.yaml']", "['slow.yaml']"),
            SETUP.replace(":main',\n            'l", ":main'\n            'l"),
        ],
        'right': [
            SETUP.replace("find_packages(exclude=['test'])", '[package_name]'),
            SETUP.replace(
                "('share/' + package_name + '/config', ['config/slow.yaml'])",
                "(f'share/{package_name}/config/', ['config/slow.yaml'])",
            ),
            SETUP.replace("'talker = hello_pkg.talker:main'", "'talker=hello_pkg.talker:main'"),
        ],
    },
    5: {
        'wrong': [
            TALK + RUN,
            TALK + SOURCE + RUN.replace('talker', 'tallker'),
            TALK + SOURCE + RUN.replace('hello_pkg ', ''),
            TALK + SOURCE + 'ros2 run hello_pkg.talker',
            TALK + SOURCE + 'python src/hello_pkg/hello_pkg/talker.py',
            TALK + 'source setup.bash\n' + RUN,
        ],
        'right': [
            TALK + SOURCE + RUN,
            TALK + '. install/setup.bash && ' + RUN,
            TALK + SOURCE + './install/hello_pkg/lib/hello_pkg/talker',
        ],
    },
    6: {
        'wrong': [
            LISTENER,
            PARALLEL.replace(', callback_group=group', ''),
            PARALLEL.replace('ReentrantCallbackGroup', 'MutuallyExclusiveCallbackGroup'),
            PARALLEL.replace('num_threads=8', 'num_threads=4'),
            PARALLEL.replace('MultiThreadedExecutor(num_threads=8)', 'SingleThreadedExecutor()'),
            PARALLEL.replace('    executor.add_node(Listener())\n', ''),
        ],
        'right': [
            PARALLEL,
            PARALLEL.replace('num_threads=8', '8'),
            PARALLEL.replace(
                '    executor.add_node(Listener())\n', ''
            ).replace('executor.spin()', 'rclpy.spin(Listener(), executor)'),
        ],
    },
    7: {
        'wrong': [
            NEW + SOURCE + LISTEN,
            NEW + 'cd src\ncolcon build\ncd ..\n' + SOURCE + LISTEN,
            NEW + 'colcon build --packages-select hello_pgk\n' + SOURCE + LISTEN,
            NEW + SOURCE + LISTEN + '\ncolcon build',
            NEW + 'colcon test\n' + SOURCE + LISTEN,
        ],
        'right': [
            NEW + 'colcon build\n' + SOURCE + LISTEN,
            NEW + 'colcon build --packages-select hello_pkg && ' + SOURCE + LISTEN,
            NEW + SOURCE + 'colcon build --packages-up-to hello_pkg\n' + LISTEN,
        ],
    },
    8: {
        'wrong': [
            OTHER + RUN + f' -r topic:=other --params-file {YAML}',
            OTHER + RUN + f' -r topic:=other --ros-args --params-file {YAML}',
            OTHER + RUN + f' "--ros-args -r topic:=other --params-file {YAML}"',
            OTHER + RUN + ' --ros-args -r topic:=other',
            OTHER + RUN + f' --ros-args -r topic:=othr --params-file {YAML}',
            OTHER + RUN + f' --ros-args -r other:=topic --params-file {YAML}',
            OTHER + RUN + ' --ros-args -r topic:=other --params-file slow.yaml',
        ],
        'right': [
            OTHER + RUN + f' --ros-args -r topic:=other --params-file {YAML}',
            OTHER + RUN + f' --ros-args --params-file {YAML} --remap /topic:=/other',
            OTHER + RUN + ' --ros-args -r topic:=other --params-file '
            '$(ros2 pkg prefix hello_pkg)/share/hello_pkg/config/slow.yaml',
        ],
    },
    9: {
        'wrong': [
            MEND.replace("'resource/'", "'resources/'"),
            MEND.replace("exclude=['test']", "exclude=['test', package_name]"),
            MEND.replace('.counter:main', '.count:main'),
            MEND.replace('.counter:main', '.counter:callback'),
            MEND.replace('counter = ', 'count = '),
        ],
        'right': [
            MEND,
            MEND.replace("find_packages(exclude=['test'])", "['forgetful_pkg']"),
            MEND.replace("['resource/' + package_name]", "['resource/forgetful_pkg']"),
        ],
    },
}  # fmt: skip
