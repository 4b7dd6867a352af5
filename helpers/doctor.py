"""Is this machine ready for the notebooks, and if not, what to do.

`python -m helpers.doctor` prints a table of checks and exits with 1 where a required one fails.
It runs on any Python and with any installation of ROS 2, also with none.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import textwrap
import time
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from helpers.interrupts import uninterrupted

if TYPE_CHECKING:
    import pandas as pd

JAZZY = '7.1.'  # the versions of rclpy in ROS 2 Jazzy
SHARED_MEMORY = Path('/dev/shm')
ENOUGH_SHARED_MEMORY_BYTES = 32 * 2**20  # a notebook's nodes take about 1 MiB
MESSAGE_TIMEOUT_S = 10.0
COMMAND_TIMEOUT_S = 20.0
PREFIXES = (sys.prefix, '/usr/local', '/usr')
BROWSERS = (
    'firefox',
    'chromium',
    'chromium-browser',
    'google-chrome',
    'google-chrome-stable',
    'microsoft-edge',
    'brave-browser',
    'wslview',
)


@dataclass(frozen=True)
class Check:
    """One row of the table. `to_do` is empty where the check is ok."""

    name: str
    found: str
    to_do: str = ''
    required: bool = True

    @property
    def verdict(self) -> str:
        """Return 'ok', or what to do."""
        if not self.to_do:
            return 'ok'
        return self.to_do if self.required else f'optional: {self.to_do}'


def check_python() -> Check:
    """Check the version of this Python."""
    found = f'{platform.python_implementation()} {platform.python_version()}'
    fits = sys.implementation.name == 'cpython' and sys.version_info >= (3, 11)
    return Check('Python', found, '' if fits else 'use CPython 3.11 or newer')


def check_platform(has_rclpy: bool) -> Check:
    """Check the machine. Where rclpy is there, any machine will do."""
    fits = has_rclpy or (sys.platform, platform.machine()) == ('linux', 'x86_64')
    return Check(
        'platform',
        f'{platform.system()} {platform.machine()}',
        ''
        if fits
        else 'the ROS 2 wheels are for x86-64 Linux only: see "Other machines" in environment.md',
    )


def check_rclpy() -> Check:
    """Check that rclpy can be imported, and that it is the one of ROS 2 Jazzy."""
    if 'rclpy' not in sys.modules:
        # In a process of its own: rcl ends the whole process where RMW_IMPLEMENTATION is wrong.
        trial = _run([sys.executable, '-c', 'import rclpy, std_msgs.msg, rosgraph_msgs.msg'])
        if trial.returncode != 0:
            return Check('rclpy', *_why_import_failed(trial))
    version = _version('ros-rclpy', 'rclpy')
    to_do = f'use ROS 2 Jazzy (rclpy {JAZZY}x): see environment.md'
    return Check('rclpy', version, '' if version.startswith(JAZZY) else to_do)


def check_domain() -> Check:
    """Reserve this process's domain id and keep discovery on this machine."""
    from helpers.domain import configure_discovery, reserve_domain_id

    name = 'domain and discovery'
    configure_discovery()
    reach = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    try:
        domain_id = reserve_domain_id()
    except RuntimeError as error:
        return Check(name, f'no free domain id, discovery {reach}', str(error))
    return Check(name, f'domain id {domain_id}, discovery {reach}')


def check_message() -> Check:
    """Publish one message to a subscription in this process, through the RMW."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from rclpy.task import Future
    from std_msgs.msg import String

    from helpers.domain import one_process_at_a_time, reserve_domain_id
    from helpers.session import destroy_nodes

    name = 'one message to itself'
    try:
        rmw = rclpy.get_rmw_implementation_identifier()
        # A context of its own: the kernel's default one may be open and stays as it is.
        context = rclpy.Context()
        context.init(domain_id=reserve_domain_id(), initialize_logging=False)
        try:
            executor = SingleThreadedExecutor(context=context)
            with one_process_at_a_time():
                node = rclpy.create_node(
                    'doctor', context=context, enable_rosout=False, start_parameter_services=False
                )
            executor.add_node(node)
            # Transient local: the message arrives also where discovery ends after publish().
            qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            heard = Future(executor=executor)
            node.create_subscription(String, '_doctor', heard.set_result, qos)
            message = String(data=uuid.uuid4().hex)
            started = time.monotonic()
            node.create_publisher(String, '_doctor', qos).publish(message)
            executor.spin_until_future_complete(heard, timeout_sec=MESSAGE_TIMEOUT_S)
            took_ms = (time.monotonic() - started) * 1000
            executor.shutdown()
        finally:  # also when the cell is interrupted, here or before
            with uninterrupted():
                destroy_nodes(context)
                context.try_shutdown()
    except Exception as error:  # whatever the RMW raises is what was found
        return Check(name, _last_line(str(error)), 'see "Trouble" in environment.md')
    if not heard.done() or heard.result() != message:
        return Check(
            name,
            f'{rmw}: not heard within {MESSAGE_TIMEOUT_S:g} s',
            'allow UDP on the loopback interface, and see "Trouble" in environment.md',
        )
    return Check(name, f'{rmw}: heard after {took_ms:.1f} ms')


def check_shared_memory() -> Check:
    """Check the free space of the memory that Fast DDS shares between processes."""
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
    return (
        f'run `{_fastdds()} shm clean`, remove files from {SHARED_MEMORY}, or start the container '
        'with --shm-size=256m'
    )


def _fastdds() -> str:
    return '.venv/bin/fastdds' if _in_wheels('fastdds') else 'fastdds'


def stale_segments() -> list[Path]:
    """Return the Fast DDS files in shared memory that no living process uses.

    A process locks `NAME_el` (or `NAME_sl`) while it uses the segment or port `NAME`, and the
    kernel drops the lock when the process dies. `fastdds shm clean` decides in the same way.
    """
    import fcntl  # not on Windows, where ROS 2 keeps its segments elsewhere

    stale = []
    for lock_file in SHARED_MEMORY.glob('fastrtps_*_[es]l'):
        segment = lock_file.with_name(lock_file.name[:-3])
        try:
            # A process makes the file first and locks it a moment later.
            if time.time() - lock_file.stat().st_mtime < 2:
                continue
            with lock_file.open('rb') as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:  # in use, gone meanwhile, or another user's
            continue
        stale.append(segment if segment.exists() else lock_file)
    return sorted(stale)


def check_stale_segments() -> Check:
    """Look for what processes left in shared memory when they died hard."""
    stale = stale_segments() if SHARED_MEMORY.is_dir() else []
    size = 0
    for path in stale:
        try:
            size += path.stat().st_size
        except FileNotFoundError:  # somebody cleaned up meanwhile
            continue
    return Check(
        'left by dead processes',
        f'{len(stale)} Fast DDS files, {size / 2**20:.1f} MiB',
        f'run `{_fastdds()} shm clean`' if stale else '',
        required=False,
    )


def check_compiler() -> Check:
    """Check that a C++ compiler works with its standard library."""
    name = 'C++ compiler'
    to_do = 'for lessons 06 to 09 run `sudo apt install g++`'
    compiler = shutil.which(os.environ.get('CXX', 'c++'))
    if compiler is None:
        return Check(name, 'none', to_do, required=False)
    # It is there, but Debian's clang for example comes without the headers of the library.
    trial = _run([compiler, '-fsyntax-only', '-x', 'c++', '-'], '#include <string>\n')
    if trial.returncode != 0:
        return Check(name, 'cannot compile `#include <string>`', to_do, required=False)
    return Check(name, _first_line(_run([compiler, '--version']).stdout), required=False)


def check_cmake() -> Check:
    """Check that CMake runs, from this environment or from the system."""
    here = Path(sys.executable).parent
    cmake = shutil.which('cmake', path=f'{here}{os.pathsep}{os.environ.get("PATH", os.defpath)}')
    answer = _run([cmake, '--version']) if cmake else None
    if answer is None or answer.returncode != 0:
        to_do = 'for lessons 06 to 09 run `sudo apt install cmake`'
        return Check('CMake', 'none that runs', to_do, required=False)
    return Check('CMake', _first_line(answer.stdout).removeprefix('cmake version '), required=False)


def check_python_headers() -> Check:
    """Check that C++ code can be built for this Python."""
    version = f'{sys.version_info.major}.{sys.version_info.minor}'
    if any(
        (Path(sysconfig.get_path(kind)) / 'Python.h').is_file()
        for kind in ('include', 'platinclude')
    ):
        return Check('Python headers', f'for Python {version}', required=False)
    to_do = f'for lessons 06 to 09 run `sudo apt install python{version}-dev`'
    return Check('Python headers', f'none for Python {version}', to_do, required=False)


def check_colcon() -> Check:
    """Check that colcon is installed in this environment."""
    if importlib.util.find_spec('colcon_core'):
        return Check('colcon', _version('colcon-core'), required=False)
    to_do = 'for lessons 06 to 09 run `python -m pip install colcon-common-extensions`'
    return Check('colcon', 'none', to_do, required=False)


def check_pybind11() -> Check:
    """Check that pybind11 is where CMake looks for packages."""
    for prefix in PREFIXES:
        for file in Path(prefix).glob('*/cmake/pybind11/pybind11ConfigVersion.cmake'):
            version = re.search(r'set\(PACKAGE_VERSION "(.+?)"', file.read_text(encoding='utf-8'))
            return Check('pybind11', version[1] if version else str(file.parent), required=False)
    to_do = 'for lesson 08 run `sudo apt install pybind11-dev`'
    return Check('pybind11', 'none', to_do, required=False)


def check_browser() -> Check:
    """Look for a web browser on this machine."""
    for name in BROWSERS:
        if shutil.which(name):
            return Check('browser', name, required=False)
    to_do = 'open the address that `make lab` prints in a browser, also on another machine'
    return Check('browser', 'none known', to_do, required=False)


def checks() -> list[Check]:
    """Do all checks, the required ones first. It takes about a second."""
    rclpy_check = check_rclpy()
    if rclpy_check.to_do:
        skipped = 'not tried without rclpy'
        on_ros = [
            Check('domain and discovery', skipped, 'make rclpy work first'),
            Check('one message to itself', skipped, 'make rclpy work first'),
        ]
    else:
        on_ros = [check_domain(), check_message()]
    return [
        check_python(),
        check_platform(has_rclpy=not rclpy_check.to_do),
        rclpy_check,
        *on_ros,
        check_shared_memory(),
        check_stale_segments(),
        check_colcon(),
        check_compiler(),
        check_cmake(),
        check_python_headers(),
        check_pybind11(),
        check_browser(),
    ]


def report() -> pd.DataFrame:
    """Do all checks and return them as a table with the columns `check, found, verdict`."""
    import pandas as pd

    rows = [(row.name, row.found, row.verdict) for row in checks()]
    return pd.DataFrame(rows, columns=['check', 'found', 'verdict'])


def show() -> None:
    """Do all checks and print the table."""
    print(_table(checks()))


def ready() -> None:
    """Do all checks and print one sentence: is this machine ready, and if not, what to do."""
    print(_summary(checks()))


def _summary(rows: list[Check]) -> str:
    required = [row for row in rows if row.required]
    failed = [row for row in required if row.to_do]
    count = f'{len(required) - len(failed)} of {len(required)} required checks are ok.'
    if not failed:
        return f'This machine is ready: {count}'
    return '\n'.join(
        [f'This machine is not ready: {count}', *(f'- {row.name}: {row.to_do}' for row in failed)]
    )


def _table(rows: list[Check]) -> str:
    """Return the rows as text, with the last two columns wrapped."""
    lines = [('check', 'found', 'verdict')]
    for row in rows:
        found = textwrap.wrap(row.found, 42) or ['']
        verdict = textwrap.wrap(row.verdict, 50)
        for index in range(max(len(found), len(verdict))):
            lines.append(
                (
                    '' if index else row.name,
                    found[index] if index < len(found) else '',
                    verdict[index] if index < len(verdict) else '',
                )
            )
    widths = [max(len(line[column]) for line in lines) for column in range(3)]
    text = [
        '  '.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        for line in lines
    ]
    text.insert(1, '  '.join('-' * width for width in widths))
    return '\n'.join(line.rstrip() for line in text)


def _why_import_failed(trial: subprocess.CompletedProcess[str]) -> tuple[str, str]:
    """Return what a failed import of rclpy said, in short, and what to do."""
    if trial.returncode == -signal.SIGBUS:
        # LTTng, which rclpy is linked with, maps a page of shared memory when it is loaded.
        return 'ended with a bus error', f'{SHARED_MEMORY} is full: {_more_shared_memory()}'
    told = re.search(
        r"No module named '\S+'|\S+: cannot open shared object file|undefined symbol: \S+"
        r"|RMW implementation identifier of '\S+'",
        trial.stderr,
    )
    found = told[0] if told else _last_line(trial.stderr) or f'ended with {trial.returncode}'
    if 'RMW implementation' in found:
        return f'no {found}', 'run `unset RMW_IMPLEMENTATION`, and start again'
    if 'No module named' in found:
        return found, 'start JupyterLab with `make lab`, or source your ROS 2 installation'
    return found, (
        'start JupyterLab and its kernel from the same environment, with `make lab`, in a terminal '
        'where no other ROS 2 is sourced'
    )


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


def _version(*distributions: str) -> str:
    """Return the version of the first distribution that is installed."""
    for name in distributions:
        try:
            return importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return 'of unknown version'


def _in_wheels(command: str) -> bool:
    """Return whether a command of ROS 2 comes from the wheels in this environment."""
    return (Path(sys.prefix) / 'bin' / command).is_file()


def _first_line(text: str) -> str:
    return text.strip().partition('\n')[0]


def _last_line(text: str) -> str:
    return text.strip().rpartition('\n')[2]


def main() -> int:
    """Print the table and the summary. Return 1 where a required check fails, otherwise 0."""
    rows = checks()
    print(_table(rows))
    print()
    print(_summary(rows))
    return 1 if any(row.required and row.to_do for row in rows) else 0


if __name__ == '__main__':
    sys.exit(main())
