"""The transforms of a URDF's fixed joints, on /tf_static: `robot_state_publisher` for lessons.

A package in `prefix` starts it as a program. The one of ROS 2 publishes joints that move, too.
"""

from __future__ import annotations

import contextlib
import io
import sys

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from urdf_parser_py.urdf import URDF

from helpers.ros import quaternion, run_program


class StatePublisher(Node):
    """Publishes the fixed joints of its parameter `robot_description` once, for late ones as well.

    Raises ValueError if the parameter is no URDF.
    """

    def __init__(self) -> None:
        from tf2_msgs.msg import TFMessage  # there only after provide_tf2_msgs

        super().__init__('robot_state_publisher')
        description = self.declare_parameter('robot_description', '').value
        said = io.StringIO()
        try:
            with contextlib.redirect_stderr(said):
                robot = URDF.from_xml_string(description.encode())
        except (SyntaxError, AssertionError) as error:
            raise ValueError(f'robot_description is no URDF: {error}') from None
        joints = [_transform(joint) for joint in robot.joints if joint.type == 'fixed']
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._publisher = self.create_publisher(TFMessage, '/tf_static', latched)
        self._publisher.publish(TFMessage(transforms=joints))


def _transform(joint) -> TransformStamped:
    message = TransformStamped(child_frame_id=joint.child)
    message.header.frame_id = joint.parent
    shift, turn = message.transform.translation, joint.origin.rpy if joint.origin else (0, 0, 0)
    shift.x, shift.y, shift.z = map(float, joint.origin.xyz if joint.origin else (0, 0, 0))
    message.transform.rotation = quaternion(*map(float, turn))
    return message


def main() -> None:
    """Run until Ctrl+C."""
    try:
        run_program(StatePublisher)
    except ValueError as error:
        sys.exit(f'robot_state_publisher: {error}')


if __name__ == '__main__':
    main()
