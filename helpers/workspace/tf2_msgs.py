"""The package `tf2_msgs`, which the wheels lack: the message of /tf, built in a workspace."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from helpers.workspace.workspace import Build, Workspace

MESSAGE = 'geometry_msgs/TransformStamped[] transforms\n'
CMAKE_LISTS = """\
cmake_minimum_required(VERSION 3.8)
project(tf2_msgs)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(geometry_msgs REQUIRED)
rosidl_generate_interfaces(${PROJECT_NAME} "msg/TFMessage.msg" DEPENDENCIES geometry_msgs)
ament_package()
"""
PACKAGE_XML = """\
<?xml version="1.0"?>
<package format="3">
  <name>tf2_msgs</name>
  <version>0.0.0</version>
  <description>The message of the topic /tf</description>
  <maintainer email="you@example.com">You</maintainer>
  <license>BSD-3-Clause</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>geometry_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""


_begun: dict[Path, Build] = {}  # by the path of a workspace


def begin_tf2_msgs(workspace: Workspace) -> None:
    """Begin to build the package, which takes some seconds. If ROS has it, nothing is built."""
    if _is_there():
        return
    workspace.write('src/tf2_msgs/msg/TFMessage.msg', MESSAGE)
    workspace.write('src/tf2_msgs/CMakeLists.txt', CMAKE_LISTS)
    workspace.write('src/tf2_msgs/package.xml', PACKAGE_XML)
    _begun[workspace.path] = workspace.begin_build('tf2_msgs')


def provide_tf2_msgs(workspace: Workspace) -> None:
    """Make `from tf2_msgs.msg import TFMessage` possible. If ROS has it, nothing is built.

    Raises RuntimeError, with what colcon says, if the build fails.
    """
    if _is_there():
        return
    begun = _begun.get(workspace.path)
    if begun is None or begun.stopped:  # by an Interrupt of a cell that waited for it
        begin_tf2_msgs(workspace)
    result = _begun.pop(workspace.path).result()
    if not result.ok:
        raise RuntimeError(str(result))
    workspace.use()


def _is_there() -> bool:
    """Whether it can be imported: ROS has it, or a workspace that has not been emptied since."""
    spec = find_spec('tf2_msgs')
    return spec is not None and Path(spec.origin or '').is_file()
