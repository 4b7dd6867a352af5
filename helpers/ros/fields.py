"""Messages check the types of their fields: `twist.linear.x = 1` is an error.

Since rosidl_generator_py 0.18.0 they do so only on demand
(https://github.com/ros2/rosidl_python/pull/194). Without it, an int in a float field is sent as
5e-324, and in an interface that was built here it ends the kernel: its C code has an assert, which
the wheels were built without.
"""

import os
import sys


def check_fields() -> None:
    """Let all messages check their fields, also those of processes that this one starts."""
    os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'
    for module in list(sys.modules.values()):  # those that were imported before read it then
        if hasattr(module, 'ros_python_check_fields'):
            module.ros_python_check_fields = '1'
