"""Every private name of another package that the rooms touch, and the version in which it was read.

A new version may take one away. tests/test_private.py says which one is gone, and which one is not
listed here. The `ros2` command and the tools for a class are packages of their own.
"""

from typing import NamedTuple


class PrivateName(NamedTuple):
    """A private name: what has it, in which version, and which file of helpers uses it for what."""

    name: str
    owner: str
    version: str
    file: str
    reason: str


RCLPY, PYTHON = 'rclpy 7.1.6', 'Python 3.11.7'
SESSION = 'ros/private.py'

PRIVATE_NAMES = (
    PrivateName('_is_shutdown', 'an executor', RCLPY, SESSION, 'its spin ends, and it lives on'),
    PrivateName('_tasks', 'an executor', RCLPY, SESSION, 'what never started is cancelled'),
    PrivateName('_wait_for_ready_callbacks', 'an executor', RCLPY, SESSION, 'a thread is free'),
    PrivateName('_executor', 'a MultiThreadedExecutor', RCLPY, SESSION, 'its pool ends'),
    PrivateName('_futures', 'a MultiThreadedExecutor', RCLPY, SESSION, 'what callbacks raised'),
    PrivateName('_pending_requests', 'a client', RCLPY, SESSION, 'calls that wait end'),
    PrivateName('_action_name', 'an action client', RCLPY, SESSION, 'a sentence names it'),
    PrivateName('_state_machine', 'a lifecycle node', RCLPY, SESSION, 'it keeps the node'),
    PrivateName('_threads', 'a ThreadPoolExecutor', PYTHON, SESSION, 'they are joined'),
    PrivateName('_max_workers', 'a ThreadPoolExecutor', PYTHON, SESSION, 'a thread is free'),
    PrivateName(
        '_current_frames', 'sys', PYTHON, 'notebook/threads.py', 'where threads wait (documented)'
    ),
    PrivateName(
        '_base_executable', 'sys', PYTHON, 'machine/build_tools.py', 'a Python without spaces'
    ),
    PrivateName(
        '_allow_stdin', 'a kernel', 'ipykernel 7.4.0', 'notebook/kernel.py', 'does anybody watch?'
    ),
    PrivateName(
        '_reply_subshell_id',
        'a comm',
        'ipykernel 7.4.0',
        'notebook/kernel.py',
        'widgets are heard while a cell runs',
    ),
    PrivateName(
        '_spawnpty',
        'a process of pexpect',
        'pexpect 4.9.0',
        'notebook/interrupts.py',
        'an Interrupt waits for the start of a process',
    ),
    PrivateName(
        '_quickjs',
        'quickjs-ng',
        'quickjs-ng 0.17.0',
        'replay/script.py',
        'an import of quickjs starts a thread',
    ),
)
