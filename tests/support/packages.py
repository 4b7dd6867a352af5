"""Packages that tests build, and what a student's terminal may have set beside them."""

import re
from pathlib import Path

import psutil

from helpers.workspace import Workspace

PACKAGE_XML = """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.0.0</version>
  <description>For a test</description>
  <maintainer email="user@example.com">user</maintainer>
  <license>Apache-2.0</license>
  {depends}
  <export>
    <build_type>{build_type}</build_type>
  </export>
</package>
"""
# Two libraries, of which the first by name needs the other. The extension, as of an interface
# package, is for Python alone to load.
CMAKE_LISTS = """\
cmake_minimum_required(VERSION 3.8)
project(number_pkg CXX)
find_package(ament_cmake REQUIRED)
file(WRITE ${CMAKE_BINARY_DIR}/number.cpp "extern \\"C\\" int number() {return 21;}")
file(WRITE ${CMAKE_BINARY_DIR}/double.cpp
  "extern \\"C\\" int number(); extern \\"C\\" int doubled() {return 2 * number();}")
add_library(number SHARED ${CMAKE_BINARY_DIR}/number.cpp)
add_library(double SHARED ${CMAKE_BINARY_DIR}/double.cpp)
target_link_libraries(double number)
install(TARGETS number double DESTINATION lib)
install(FILES package.xml DESTINATION lib/python3/site-packages/number_pkg RENAME extension.so)
ament_package()
"""
SETUP_PY = """\
from setuptools import find_packages, setup

package_name = 'talker_pkg'

setup(
    name=package_name,
    version='0.0.0',
    packages=find_packages(),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    entry_points={'console_scripts': ['talker = talker_pkg.talker:main']},
)
"""
SETUP_CFG = """\
[develop]
script_dir=$base/lib/talker_pkg
[install]
install_scripts=$base/lib/talker_pkg
"""
TALKER = """\
import rclpy
from rclpy.node import Node
from std_msgs.msg import String

GREETING = 'Hello World'


class Talker(Node):
    def __init__(self):
        super().__init__('talker')
        self.publisher = self.create_publisher(String, 'topic', 10)
        self.count = 0
        self.timer = self.create_timer(0.05, self.tick)

    def tick(self):
        self.publisher.publish(String(data=f'{GREETING}: {self.count}'))
        self.get_logger().info(f'Publishing: {self.count}')
        self.count += 1


def main():
    rclpy.init()
    node = Talker()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        print('The talker ends.')
"""

# Settings of another ROS 2, of builds, and of the terminal. They must not reach a build or a node.
HOSTILE = {
    'AMENT_PREFIX_PATH': '/opt/ros/humble',
    'CCACHE_DISABLE': '1',
    'CLICOLOR_FORCE': '1',
    'CMAKE_GENERATOR': 'No Such Generator',
    'CMAKE_PREFIX_PATH': '/opt/ros/humble',
    'COLCON_DEFAULTS_FILE': '/nowhere/defaults.yaml',
    'CPATH': '/opt/ros/humble/include',
    'CPLUS_INCLUDE_PATH': '/opt/ros/humble/include',
    'CXXFLAGS': '--no-such-option',
    'DESTDIR': '/nowhere',
    'FASTDDS_BUILTIN_TRANSPORTS': 'NONE',
    'FASTRTPS_DEFAULT_PROFILES_FILE': '/nowhere/profiles.xml',
    'FORCE_COLOR': '1',
    'LANGUAGE': 'de',
    'LC_MESSAGES': 'de_DE.UTF-8',
    'LIBRARY_PATH': '/opt/ros/humble/lib',
    'MAKELEVEL': '3',
    'NINJA_STATUS': '[wrong]',
    'PKG_CONFIG_PATH': '/opt/ros/humble/lib/pkgconfig',
    'PYTEST_ADDOPTS': '--no-such-option',
    'PYTHONPATH': '/opt/ros/humble/lib/python3.10/site-packages',
    'RCUTILS_LOGGING_BUFFERED_STREAM': '9',
    'RMW_IMPLEMENTATION': 'rmw_no_such',
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF',
    'ROS_DOMAIN_ID': '77',
    'ROS_LOCALHOST_ONLY': '1',
    'ROS_STATIC_PEERS': '192.0.2.1',
    'VERBOSE': '1',
}


def package_xml(name: str, build_type: str, depends: str = '') -> str:
    return PACKAGE_XML.format(name=name, build_type=build_type, depends=depends)


def write_library(workspace: Workspace) -> None:
    depends = '<buildtool_depend>ament_cmake</buildtool_depend>'
    xml = package_xml('number_pkg', 'ament_cmake', depends)
    workspace.write('src/number_pkg/package.xml', xml)
    workspace.write('src/number_pkg/CMakeLists.txt', CMAKE_LISTS)


def write_talker(workspace: Workspace, setup: str = SETUP_PY, talker: str = TALKER) -> None:
    top = 'src/talker_pkg'
    xml = package_xml('talker_pkg', 'ament_python', '<depend>rclpy</depend>')
    workspace.write(f'{top}/package.xml', xml)
    workspace.write(f'{top}/setup.py', setup)
    workspace.write(f'{top}/setup.cfg', SETUP_CFG)
    workspace.write(f'{top}/resource/talker_pkg', '')
    workspace.write(f'{top}/talker_pkg/__init__.py', '')
    workspace.write(f'{top}/talker_pkg/talker.py', talker)


def processes_of(workspace: Path) -> list[psutil.Process]:
    """Return the processes that name a file of the workspace in their command, or work in it."""
    found = []
    for process in psutil.process_iter(['cmdline', 'cwd', 'status']):
        words = [*(process.info['cmdline'] or []), process.info['cwd'] or '']
        of_workspace = any(re.search(rf'{workspace}(/|$)', word) for word in words)
        if of_workspace and process.info['status'] != psutil.STATUS_ZOMBIE:
            found.append(process)
    return found
