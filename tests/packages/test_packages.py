"""The packages that a learner ends with, on a computer that has only what they name.

A package is built, started and tested in an environment without this project: `package.xml` says
what is there. So a dependency that it does not name fails here, as it would for the first person
who takes the package to a robot. `make test-packages LESSON="09 12"` tries those of some lessons.
"""

import ctypes
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

import pytest
import rclpy
from catkin_pkg.package import Package, parse_package
from domain_coordinator import domain_id
from geometry_msgs.msg import Twist, TwistStamped
from packages.declared import undeclared
from rclpy.executors import SingleThreadedExecutor
from support.environments import OUTSIDE, SHARE, Environment, MissingError, needed_to_use
from support.judged import stand_in
from support.kernel import NOTEBOOKS, Kernel

from helpers.lesson import code_of_solution, path_of, read
from helpers.workspace import fix_wheels, lines_that_matter, without_folders

LESSONS = [
    'make_a_package',
    'bring_in_a_package',
    'use_a_message_in_your_own_interface',
    'launch_a_system',
    'test_a_node',
    'share_code_in_a_cpp_library',
    'write_a_node_in_cpp',
    'put_the_sensors_on_the_robot',
    'build_a_robot_program',
    'put_a_program_on_a_robot',
]
# What is in a workspace and is no package of the learner: why it is not tried.
LEFT_OUT = {
    'brake_gazebo': 'it is for a simulator that is not installed, and lesson 10 leaves it out',
    'letter_pkg': 'a game of lesson 09 writes it, without a manifest that anybody fills in',
}
# What `ros2 pkg create` names, and no wheel is: what such a test reads is taken out here.
WITHOUT_WHEEL = {'ament_copyright', 'ament_lint_auto', 'ament_lint_common'}
ITS_TEST = 'test/test_copyright.py'
# In these lessons a check runs the learner's commands, or builds what the next cells use.
WITH_CHECKS = {'bring_in_a_package', 'use_a_message_in_your_own_interface'}
BUILD_LIMIT_S, START_LIMIT_S, DRIVER_LIMIT_S, END_LIMIT_S = 200, 40, 6, 15
CODE = {'.py', '.cpp', '.hpp'}
EVENTS = ['--event-handlers', 'console_direct+', 'desktop_notification-', 'status-']


@pytest.fixture(scope='session', autouse=True)
def wheels_fit():
    fix_wheels()


@pytest.mark.parametrize('lesson', LESSONS)
def test_packages_need_what_they_name(lesson, tmp_path):
    computer = Computer(tmp_path, sources(lesson))
    problems = [problem for name in computer.order for problem in computer.problems(name)]
    if problems:
        pytest.fail('\n'.join(problems), pytrace=False)


# --- What the learner ends with


def sources(lesson: str) -> dict[str, Path]:
    """Run the cells of a lesson with its solutions. Return the folder of each package it made."""
    path = path_of(lesson, NOTEBOOKS)
    cells = read(path.read_text(encoding='utf-8'), path.name)
    ends = {task.solutions[-1].id: task for task in cells.tasks if task.solutions}
    checks = {check.id for task in cells.tasks for check in task.checks}
    with Kernel() as kernel:
        for cell in cells.code_cells():
            if cell.id in checks:  # it would judge the starter
                continue
            # Without its first line a solution is what a learner wrote.
            run(kernel, code_of_solution(cell.source))
            if cell.id in ends:
                for check in ends[cell.id].checks if lesson in WITH_CHECKS else []:
                    run(kernel, check.source)
                stand_in(kernel, ends[cell.id].name)
        folder = Path(run(kernel, 'print(workspace.path)').split()[-1])
    found = {}
    for top in (folder / 'src', folder / 'overlay' / 'src'):  # an overlay's package hides the other
        found |= {parse_package(path).name: path for path in packages_below(top)}
    return {name: path for name, path in found.items() if name not in LEFT_OUT}


def run(kernel: Kernel, source: str) -> str:
    said = kernel.run(source)
    outputs = kernel.nb.cells[-1].outputs
    if any(output.output_type == 'error' for output in outputs):
        pytest.fail(f'A cell of the lesson failed:\n{source}\n\n{said}', pytrace=False)
    return said


def packages_below(top: Path) -> Iterator[Path]:
    for folder, folders, files in os.walk(top):
        if 'COLCON_IGNORE' in files or 'package.xml' in files:
            folders.clear()
        if 'package.xml' in files and 'COLCON_IGNORE' not in files:
            yield Path(folder)


# --- A computer that has what they name


class Computer:
    """Builds, starts and tests packages, each with an environment of what it names.

    Each has a workspace of its own, and sees those of the packages that it names.
    """

    def __init__(self, top: Path, sources: dict[str, Path]) -> None:
        self.top = top
        self.environment = Environment(top / 'environment')
        self.packages: dict[str, Package] = {}
        self._failed: set[str] = set()
        for name, source in sources.items():
            target = top / name / 'src' / name
            ignored = shutil.ignore_patterns('__pycache__', '.git', '*.egg-info')
            shutil.copytree(source, target, ignore=ignored)
            self.packages[name] = parse_package(target)

    @property
    def order(self) -> list[str]:
        """The names of the packages, each after those that it needs."""
        ordered: list[str] = []

        def add(name: str) -> None:
            if name not in ordered:
                for other in self._ours(self._names(name, 'build', 'buildtool', 'exec', 'test')):
                    if other != name:
                        add(other)
                ordered.append(name)

        for name in sorted(self.packages):
            add(name)
        return ordered

    def problems(self, name: str) -> list[str]:
        """Return a sentence for each thing that is wrong with a package."""
        package, folder = self.packages[name], self.top / name / 'src' / name
        known = {*self.packages}
        try:
            return [
                *undeclared(package, folder, known),
                *self._build(name),
                *self._start(name),
                *self._test(name),
            ]
        except MissingError as error:
            return [
                f'{name} names {error} in its package.xml, and no wheel of this environment is it: '
                'is the name right? Then tests/support/environments.py must know it.'
            ]

    def _names(self, name: str, *moments: str) -> list[str]:
        package = self.packages[name]
        depends = [d.name for moment in moments for d in getattr(package, f'{moment}_depends')]
        return [each for each in depends if each not in WITHOUT_WHEEL]

    def _ours(self, names: Iterable[str]) -> list[str]:
        """Return those of the packages that are among these names, with all that these use."""
        found: list[str] = []
        waiting = [*names]
        while waiting:
            name = waiting.pop()
            if name in self.packages and name not in found:
                found.append(name)
                waiting += needed_to_use(self.packages[name])
            elif name in OUTSIDE:
                waiting += needed_to_use(parse_package(SHARE / name / 'package.xml'))
        return found

    def _terminal(self, name: str, *moments: str, tools: bool = False) -> dict[str, str]:
        """Make a terminal in which what the package names is sourced. Return its variables."""
        names = self._names(name, *moments)
        ours = self._ours(names)
        used = {n for other in ours for n in needed_to_use(self.packages[other])}
        self.environment.hold({*names, *used} - {*self.packages}, tools=tools)
        variables = self.environment.variables(self.top)
        overlays = [self.top / other for other in reversed(ours)]
        overlays += [self.top / name] if 'exec' in moments else []
        scripts = [str(path / 'install/local_setup.bash') for path in overlays]
        script = 'for file; do source "$file"; done; env -0'
        answer = subprocess.run(
            ['bash', '--norc', '-c', script, 'bash', *scripts],
            env=variables,
            cwd=self.top / name,
            capture_output=True,
            check=True,
        )
        pairs = os.fsdecode(answer.stdout).split('\0')
        return dict(pair.split('=', 1) for pair in pairs if '=' in pair)

    def _colcon(self, name: str, variables: dict[str, str], *words: str) -> tuple[bool, str]:
        main = 'import sys; from colcon_core.command import main; sys.exit(main())'
        answer = subprocess.run(
            [self.environment.python, '-c', main, '--log-base', 'log', *words],
            env=variables,
            cwd=self.top / name,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=BUILD_LIMIT_S,
            check=False,
        )
        return answer.returncode == 0, without_folders(answer.stdout, self.top / name)

    def _build(self, name: str) -> Iterator[str]:
        variables = self._terminal(name, 'build', 'buildtool', 'test', tools=True)
        python = ['--cmake-args', f'-DPython3_EXECUTABLE={self.environment.python}']
        built, said = self._colcon(
            name, variables, 'build', '--base-paths', 'src', *EVENTS, *python
        )
        if not built:
            self._failed.add(name)
            reason = '\n  '.join(lines_that_matter(said)[:6])
            yield f'{name} does not build with what its package.xml names:\n  {reason}'

    def _start(self, name: str) -> Iterator[str]:
        """Start each executable and each launch file, and end it with Ctrl+C."""
        if name in self._failed:
            return
        install = self.top / name / 'install' / name
        programs = sorted(
            path for path in install.glob(f'lib/{name}/*') if os.access(path, os.X_OK)
        )
        launches = sorted(install.glob(f'share/{name}/launch/*launch.[xy]*ml'))
        if not programs and not launches:
            return
        variables = self._terminal(name, 'exec')
        code = [path for path in (self.top / name / 'src').rglob('*') if path.suffix in CODE]
        may_drive = any('cmd_vel' in path.read_text() for path in code)
        for program in programs:
            for sent in (signal.SIGINT, signal.SIGTERM):
                problem = start([str(program)], variables, self.top / name, sent, may_drive)
                if problem:
                    yield f'{name}: {program.name} {problem}'
                    break
        for file in launches:
            if not shutil.which('ros2', path=variables['PATH']):
                yield f'{name} installs {file.name}, and does not name ros2launch.'
                return
            words = ['ros2', 'launch', name, file.name, *arguments_of(file)]
            problem = start(words, variables, self.top / name, signal.SIGINT, False)
            if problem:
                yield f'{name}: {file.name} {problem}'

    def _test(self, name: str) -> Iterator[str]:
        folder = self.top / name / 'src' / name
        (folder / ITS_TEST).unlink(missing_ok=True)
        in_cmake = folder / 'CMakeLists.txt'
        adds = in_cmake.is_file() and re.search(r'ament_add_\w*test', in_cmake.read_text())
        if name in self._failed or not (adds or [*folder.glob('test/test_*.py')]):
            return
        moments = ('build', 'buildtool', 'exec', 'test')
        variables = self._terminal(name, *moments, tools=True)
        setup = folder / 'setup.py'
        if setup.is_file() and 'tests_require' in setup.read_text():
            yield from self._pytest(name, variables)
            return
        _, said = self._colcon(name, variables, 'test', '--base-paths', 'src', *EVENTS)
        _, result = self._colcon(name, variables, 'test-result')
        counts = {word: int(n) for n, word in re.findall(r'(\d+) (test|error|failure)s?\b', result)}
        if not counts.get('test'):
            reason = '\n  '.join(said.splitlines()[-12:])
            yield f'{name} has tests, and colcon test runs none:\n  {reason}'
        elif counts['error'] or counts['failure']:
            failed = re.findall(r'^(?:E  .*|FAILED.*|.*Failure$|.*\(Failed\))$', said, re.MULTILINE)
            yield f'{name}: {result.splitlines()[-1]}\n  ' + '\n  '.join(failed[:12])

    def _pytest(self, name: str, variables: dict[str, str]) -> Iterator[str]:
        """Run the tests as colcon does on Ubuntu 24.04: newer setuptools ignore `tests_require`."""
        answer = subprocess.run(
            [
                self.environment.python,
                '-m',
                'pytest',
                '-q',
                '-c',
                os.devnull,
                '--rootdir=.',
                'test',
            ],
            env=variables,
            cwd=self.top / name / 'src' / name,
            capture_output=True,
            text=True,
            check=False,
        )
        if answer.returncode:
            yield f'{name}: its tests fail:\n  ' + '\n  '.join(answer.stdout.splitlines()[-12:])


# --- A program that starts, stops and ends


# A signal came while a message was converted: pybind11 makes this of the KeyboardInterrupt. It is
# an accident of the moment, so the program is started once more.
CONVERTED = "Unable to convert call argument '0' to Python object"


def start(
    command: list[str],
    variables: dict[str, str],
    folder: Path,
    sent: signal.Signals,
    may_drive: bool,
    again: bool = True,
) -> str:
    """Start a program, wait for its node, and end it. Return what is wrong, or nothing.

    A program without a node must end by itself, without an error. One that drives must send the
    speed 0 as its last command: the base of many robots keeps the last one.
    """
    with domain_id() as number, Ear(number) as ear:
        output = folder / 'said.txt'
        with output.open('w') as file:
            process = subprocess.Popen(
                command,
                env=variables | {'ROS_DOMAIN_ID': str(number)},
                cwd=folder,
                stdout=file,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                preexec_fn=end_with_this_process,
            )

        def are_there() -> bool:
            """Return whether the nodes of all programs are there; a launch has several."""
            programs = output.read_text(errors='replace').count('process started with pid')
            return len(ear.nodes()) >= max(1, programs)

        try:
            ear.wait(lambda: process.poll() is not None or are_there(), START_LIMIT_S)
            if process.poll() is None:
                drives = may_drive and ear.wait(ear.hears_driver, DRIVER_LIMIT_S)
                ear.wait(lambda: process.poll() is not None, 1)
                process.send_signal(sent)
                ended = ear.wait(lambda: process.poll() is not None, END_LIMIT_S)
                if not ended:
                    return f'goes on {END_LIMIT_S} s after {sent.name}.'
                ear.wait(lambda: ear.speeds and ear.speeds[-1] == 0.0, 1 if drives else 0)
                if drives and ear.speeds[-1:] != [0.0]:
                    last = f'{ear.speeds[-1]} m/s' if ear.speeds else 'nothing'
                    return f'does not stop the robot when {sent.name} ends it: it says {last}.'
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        said = output.read_text(errors='replace')
    if CONVERTED in said and again:
        return start(command, variables, folder, sent, may_drive, again=False)
    errors = re.findall(r'^(?:\[\S+\] )?(\w[\w.]*(?:Error|Exception)\b.*)', said, re.MULTILINE)
    if errors or 'Traceback' in said or 'process has died' in said:
        return f'fails: {errors[-1] if errors else said[-300:]}'
    allowed = {0} if len(command) == 1 else {0, 1, -signal.SIGINT}  # ros2 launch has its own codes
    if process.returncode not in allowed and not said.startswith('usage:'):
        return f'ends with code {process.returncode}: {said[-300:].strip() or "it says nothing"}'
    return ''


def end_with_this_process() -> None:
    """Let Linux end a program when the process that tests it is killed: 1 is PR_SET_PDEATHSIG."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)


class Ear:
    """Sees which nodes are in a domain, and hears how fast they drive."""

    def __init__(self, number: int) -> None:
        self.context = rclpy.Context()
        self.context.init(domain_id=number)
        self.node = rclpy.create_node('ear', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.speeds: list[float] = []
        self.subscription = None

    def _hear(self, message: Twist | TwistStamped) -> None:
        twist = getattr(message, 'twist', message)
        self.speeds.append(twist.linear.x or twist.angular.z)

    def nodes(self) -> list[str]:
        names = {f'{space}/{name}' for name, space in self.node.get_node_names_and_namespaces()}
        return [name for name in names if not re.search(r'/(ear|launch_ros_\d+)$', name)]

    def hears_driver(self) -> bool:
        """Return whether a program says how fast to drive, and this one hears it."""
        if self.subscription is None:
            for info in self.node.get_publishers_info_by_topic('cmd_vel'):
                kind = TwistStamped if 'Stamped' in info.topic_type else Twist
                self.subscription = self.node.create_subscription(kind, 'cmd_vel', self._hear, 100)
                break
        return bool(self.subscription and self.subscription.get_publisher_count())

    def wait(self, condition, limit_s: float) -> bool:
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end:
                return False
            self.executor.spin_once(timeout_sec=0.05)
        return True

    def __enter__(self) -> 'Ear':
        return self

    def __exit__(self, *exception) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.shutdown()


def arguments_of(file: Path) -> list[str]:
    """Return a value for each argument of a launch file that has no default."""
    names = re.findall(r'<arg name="(\w+)"\s*(?:description="[^"]*"\s*)?/>', file.read_text())
    return [f'{name}:=one' for name in names]


# --- What the test itself finds


PUBLISHES = """import signal
import rclpy
from rclpy.signals import SignalHandlerOptions
from {package}.msg import {names}

def end(*_):
    raise KeyboardInterrupt

def main():
    signal.signal(signal.SIGTERM, end)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('small')
    message = {message}
    publisher = node.create_publisher(type(message), '{topic}', 1)
    node.create_timer(0.1, lambda: publisher.publish(message))  # it wakes spin
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        rclpy.try_shutdown()
"""
PACKAGE = {
    'package.xml': """<?xml version="1.0"?>
<package format="3">
  <name>small_pkg</name><version>0.0.0</version><description>Says its name</description>
  <maintainer email="you@example.com">you</maintainer><license>Apache-2.0</license>
  <exec_depend>rclpy</exec_depend>
  <exec_depend>std_msgs</exec_depend>
  <test_depend>python3-pytest</test_depend>
  <export><build_type>ament_python</build_type></export>
</package>
""",
    'setup.py': """from setuptools import setup
setup(
    name='small_pkg', version='0.0.0', packages=['small_pkg'],
    data_files=[('share/ament_index/resource_index/packages', ['resource/small_pkg']),
                ('share/small_pkg', ['package.xml'])],
    extras_require={'test': ['pytest']},
    entry_points={'console_scripts': ['small = small_pkg.small:main']},
)
""",
    'setup.cfg': """[develop]
script_dir=$base/lib/small_pkg
[install]
install_scripts=$base/lib/small_pkg
""",
    'resource/small_pkg': '',
    'small_pkg/__init__.py': '',
    'small_pkg/small.py': PUBLISHES.format(
        package='std_msgs', names='String', topic='name', message="String(data='small')"
    ),
    'test/test_small.py': """from small_pkg import small
def test_it():
    assert small.main
""",
}
DRIVES = PUBLISHES.format(
    package='geometry_msgs',
    names='Twist, Vector3',
    topic='cmd_vel',
    message='Twist(linear=Vector3(x=0.5))',
)


def edit(file: str, old: str, new: str) -> dict[str, str]:
    assert old in PACKAGE[file]
    return {file: PACKAGE[file].replace(old, new)}


without = partial(edit, 'package.xml', new='')
PLANTED = {
    'nothing': ({}, ''),
    'a package of ROS': (
        without('<exec_depend>std_msgs</exec_depend>'),
        "No module named 'std_msgs'",
    ),
    'the client library': (without('<exec_depend>rclpy</exec_depend>'), "No module named 'rclpy'"),
    'what another one brings': (
        edit('small_pkg/small.py', 'import rclpy', 'import rclpy\nimport yaml')
        | without('<exec_depend>std_msgs</exec_depend>'),
        'imports yaml, and its package.xml does not name python3-yaml',
    ),
    'this project': (
        edit('small_pkg/small.py', 'import rclpy', 'import rclpy\nfrom helpers.robot import Robot'),
        "No module named 'helpers'",
    ),
    'pytest': (
        without('<test_depend>python3-pytest</test_depend>'),
        'does not name python3-pytest',
    ),
    'a word that is no package': (
        edit('package.xml', 'std_msgs', 'standard_msgs'),
        'names standard_msgs in its package.xml, and no wheel',
    ),
    'a stop': (
        {'small_pkg/small.py': DRIVES} | edit('package.xml', 'std_msgs', 'geometry_msgs'),
        'does not stop the robot when SIGINT ends it: it says 0.5 m/s',
    ),
}


@pytest.mark.parametrize('lack', PLANTED)
def test_what_a_package_lacks_is_found(lack, tmp_path):
    files, found = PLANTED[lack]
    for file, text in (PACKAGE | files).items():
        path = tmp_path / 'small_pkg' / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    computer = Computer(tmp_path / 'computer', {'small_pkg': tmp_path / 'small_pkg'})
    problems = '\n'.join(computer.problems('small_pkg'))
    assert (found in problems) if found else not problems, problems
