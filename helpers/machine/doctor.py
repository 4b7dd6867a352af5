"""Is this machine ready for the notebooks, and if not, what to do.

`python -m helpers.machine.doctor` prints a table of checks, and exits with 1 if a required one
fails. It runs on Python 3.10 and newer, and with any installation of ROS 2, also with none.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from helpers.machine.build_tools import from_wheels, tools_of_a_build
from helpers.notebook import table, uninterrupted

JAZZY = '7.1.'  # the versions of rclpy in ROS 2 Jazzy
SHARED_MEMORY = Path('/dev/shm')
ENOUGH_SHARED_MEMORY_BYTES = 32 * 2**20  # a notebook's nodes take about 1 MiB
MESSAGE_TIMEOUT_S = 10.0
COMMAND_TIMEOUT_S = 20.0
ANOTHER_ENVIRONMENT = (
    'start JupyterLab and its kernel from the same environment, with `make lab`, in a terminal '
    'where no other ROS 2 is sourced'
)
# What a failed import of rclpy says, and what to do.
FAILED_IMPORTS = {
    r"No module named '\S+'": 'start JupyterLab with `make lab`, or source your ROS 2 installation',
    r"RMW implementation identifier of '\S+'": ('run `unset RMW_IMPLEMENTATION`, and start again'),
    r'\S+: cannot open shared object file|undefined symbol: \S+': ANOTHER_ENVIRONMENT,
}


@dataclass(frozen=True)
class Check:
    """One row of the table. `to_do` is empty if the check is ok."""

    name: str
    found: str
    to_do: str = ''
    required: bool = True


def checks() -> list[Check]:
    """Do all checks, the required ones first. It takes about a second."""
    rclpy_check = check_rclpy()
    if rclpy_check.to_do:
        names = ('domain and discovery', 'one message to itself')
        on_ros = [Check(name, 'not tried', 'make rclpy work first') for name in names]
    else:
        on_ros = [check_domain(), check_message()]
    return [
        check_python(),
        check_platform(has_rclpy=not rclpy_check.to_do),
        rclpy_check,
        *on_ros,
        check_shared_memory(),
        *check_build_tools(),
    ]


def check_python() -> Check:
    python = f'{platform.python_implementation()} {platform.python_version()}'
    fits = sys.implementation.name == 'cpython' and sys.version_info >= (3, 11)
    return Check('Python', python, '' if fits else 'use CPython 3.11 or newer')


def check_platform(has_rclpy: bool) -> Check:
    """Check the machine. If rclpy is there, any machine will do."""
    fits = has_rclpy or (sys.platform, platform.machine()) == ('linux', 'x86_64')
    to_do = 'ROS 2 wheels are for x86-64 Linux: see "A door for every machine" in environment.md'
    return Check('platform', f'{platform.system()} {platform.machine()}', '' if fits else to_do)


def check_rclpy() -> Check:
    """Check that rclpy can be imported, and that it is the one of ROS 2 Jazzy."""
    if 'rclpy' not in sys.modules:
        # In a process of its own: rcl ends the whole process if RMW_IMPLEMENTATION is wrong.
        trial = _run([sys.executable, '-c', 'import rclpy, std_msgs.msg, rosgraph_msgs.msg'])
        if trial.returncode != 0:
            return Check('rclpy', *_why_import_failed(trial))
    # The wheel's name differs from that of the other installations.
    version = importlib.metadata.version('ros-rclpy' if from_wheels() else 'rclpy')
    to_do = f'use ROS 2 Jazzy (rclpy {JAZZY}x): see environment.md'
    return Check('rclpy', version, '' if version.startswith(JAZZY) else to_do)


def _why_import_failed(trial: subprocess.CompletedProcess[str]) -> tuple[str, str]:
    """Return what a failed import of rclpy said, in short, and what to do."""
    if trial.returncode == -signal.SIGBUS:
        # LTTng, which rclpy is linked with, maps a page of shared memory when it is loaded.
        return 'ended with a bus error', f'{SHARED_MEMORY} is full: {_more_shared_memory()}'
    for pattern, to_do in FAILED_IMPORTS.items():
        if said := re.search(pattern, trial.stderr):
            return said[0], to_do
    return _last_line(trial.stderr) or f'ended with {trial.returncode}', ANOTHER_ENVIRONMENT


def check_domain() -> Check:
    """Reserve this process's domain id."""
    from helpers.ros import graph_environment

    name = 'domain and discovery'
    try:
        domain_id, discovery, *_ = graph_environment().values()
    except RuntimeError as error:
        return Check(name, 'no free domain id', str(error))
    return Check(name, f'domain id {domain_id}, discovery {discovery}')


def check_message() -> Check:
    """Publish one message to a subscription in this process, through the RMW."""
    import rclpy

    name = 'one message to itself'
    try:
        rmw = rclpy.get_rmw_implementation_identifier()
        took_s = _seconds_to_hear()
    except TimeoutError as error:
        to_do = 'allow UDP on the loopback interface, and see "It does not work" in environment.md'
        return Check(name, f'{rmw}: {str(error).splitlines()[0]}', to_do)
    except Exception as error:  # whatever the RMW raises is what was found
        return Check(name, _last_line(str(error)), 'see "It does not work" in environment.md')
    return Check(name, f'{rmw}: received after {took_s * 1000:.1f} ms')


def _seconds_to_hear() -> float:
    """Publish one message in a session of its own, and return when it was received, in seconds."""
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from std_msgs.msg import String

    from helpers.ros import ros_session

    # Transient local: the message arrives also if discovery ends after publish().
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    heard_s = []
    with ros_session() as session:
        node, executor = Node('doctor'), SingleThreadedExecutor()
        node.create_subscription(String, 'doctor', lambda _: heard_s.append(time.monotonic()), qos)
        executor.add_node(node)
        session.spin(executor)
        started_s = time.monotonic()
        node.create_publisher(String, 'doctor', qos).publish(String())
        session.wait_until(lambda: heard_s, MESSAGE_TIMEOUT_S)
    return heard_s[0] - started_s


def check_shared_memory() -> Check:
    name = 'shared memory'
    if not SHARED_MEMORY.is_dir():
        return Check(name, f'no {SHARED_MEMORY} on this system', required=False)
    free = shutil.disk_usage(SHARED_MEMORY).free
    found, to_do = f'{free / 2**20:,.0f} MiB free', ''
    if not os.access(SHARED_MEMORY, os.W_OK):
        found = f'{SHARED_MEMORY} cannot be written'
        to_do = f'let {SHARED_MEMORY} be written; until then Fast DDS uses UDP'
    elif free < ENOUGH_SHARED_MEMORY_BYTES:
        to_do = _more_shared_memory()
    return Check(name, found, to_do, required=False)


def _more_shared_memory() -> str:
    fastdds = '.venv/bin/fastdds' if from_wheels() else 'fastdds'
    return (
        f'run `{fastdds} shm clean`, remove files from {SHARED_MEMORY}, or start the container '
        'with --shm-size=256m'
    )


def check_build_tools() -> list[Check]:
    rows = []
    for tool in tools_of_a_build():
        found, to_do = tool.found, f'to build packages in the lessons, run `{tool.install}`'
        if os.path.isabs(found):  # a command
            found = _run([found, '--version']).stdout.partition('\n')[0]
        if tool.name == 'C++ compiler' and found:
            # Debian's clang, for example, comes without the headers of the standard library.
            trial = _run([tool.found, '-fsyntax-only', '-x', 'c++', '-'], '#include <string>\n')
            found = found if trial.returncode == 0 else ''
        rows.append(
            Check(tool.name, found or 'none that works', '' if found else to_do, required=False)
        )
    return rows


def _run(command: list[str], stdin: str = '') -> subprocess.CompletedProcess[str]:
    """Run a command. One that hangs or cannot start has a return code other than 0."""
    try:
        with uninterrupted():
            return subprocess.run(
                command,
                input=stdin,
                capture_output=True,
                text=True,
                errors='replace',
                timeout=COMMAND_TIMEOUT_S,
            )
    except (OSError, subprocess.TimeoutExpired) as error:
        return subprocess.CompletedProcess(command, returncode=-1, stdout='', stderr=str(error))


def _last_line(text: str) -> str:
    return text.strip().rpartition('\n')[2]


# --- What is printed -----------------------------------------------------------------------------


def show() -> None:
    """Do all checks and print the table."""
    print(_table(checks()))


def ready() -> None:
    """Do all checks and print one sentence: is this machine ready, and if not, what to do."""
    print(_summary(checks()))


def _table(rows: list[Check]) -> str:
    verdicts = {True: 'NOT OK', False: 'optional'}
    return table(
        [
            ('check', 'verdict', 'found'),
            *(
                (row.name, verdicts[row.required], f'{row.found}: {row.to_do}')
                if row.to_do
                else (row.name, 'ok', row.found)
                for row in rows
            ),
        ]
    )


def _summary(rows: list[Check]) -> str:
    required = [row for row in rows if row.required]
    failed = [row for row in required if row.to_do]
    count = f'{len(required) - len(failed)} of {len(required)} required checks are ok.'
    if not failed:
        return f'This machine is ready: {count}'
    return '\n'.join(
        [f'This machine is not ready: {count}', *(f'- {row.name}: {row.to_do}' for row in failed)]
    )


def main() -> int:
    """Print the table and the summary. Return 1 if a required check fails, otherwise 0."""
    rows = checks()
    print(_table(rows))
    print()
    print(_summary(rows))
    return 1 if any(row.required and row.to_do for row in rows) else 0


if __name__ == '__main__':
    sys.exit(main())
