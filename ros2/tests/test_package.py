"""The package stands alone: it needs what its pyproject.toml and its README name."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from waits import LIMIT_S

import ros2_command
from ros2_command.commands import ROS

FOLDER = Path(ros2_command.__file__).parent
# Of pyproject.toml, under the names that are imported; rosbags brings numpy.
DEPENDENCIES = {'argcomplete', 'mcap', 'numpy', 'rosbags', 'yaml'}
# The command in a Python that does not have the packages that the first argument names.
WITHOUT = """
import sys
from importlib.machinery import PathFinder

missing, *words = sys.argv[1:]


class WithoutThem(PathFinder):
    @classmethod
    def find_spec(cls, name, *where):
        return None if name.split('.')[0] in missing.split() else super().find_spec(name, *where)


sys.meta_path[sys.meta_path.index(PathFinder)] = WithoutThem
from ros2_command.main import main

sys.exit(main(words))
"""
# A command that imports it before it needs anything else that may be missing.
FIRST_TO_NEED = {
    'lifecycle_msgs': 'lifecycle nodes',
    'rcl_interfaces': 'param list',
    'rclpy': 'topic list',
    'rosgraph_msgs': 'bag info nowhere',
    'rosidl_adapter': 'interface show std_msgs/msg/String',
}


def imported(file):
    """Yield the packages that a module imports, anywhere in it."""
    for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, file
            yield node.module.split('.')[0]


def test_imports_only_what_it_says_that_it_needs():
    files = list(FOLDER.rglob('*.py'))
    packages = {name for file in files for name in imported(file)} - sys.stdlib_module_names
    assert packages == {'ros2_command'} | DEPENDENCIES | ROS


def without(missing, command):
    """Run a command in a Python that does not have some packages."""
    words = [sys.executable, '-c', WITHOUT, missing, *command.split()]
    return subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S)


def sentence(missing):
    return (
        f'ros2 needs {missing}, which the Python in {sys.prefix} does not have: install the wheels '
        "of ROS 2 with `pip install 'ros2-command[ros]'`, or source a ROS 2 in this terminal.\n"
    )


@pytest.mark.parametrize(
    'command',
    [
        *('action list', 'bag info nowhere', 'lifecycle nodes', 'node list', 'param list'),
        *('service list', 'topic list', 'topic pub /chatter std_msgs/msg/String'),
    ],
)
def test_says_in_one_sentence_that_rclpy_is_missing(domain, command):
    run = without(' '.join(ROS), command)
    assert (run.returncode, run.stdout, run.stderr) == (1, '', sentence('rclpy'))


@pytest.mark.parametrize('missing', sorted(ROS))
def test_names_what_is_missing_beside_rclpy(domain, missing):
    run = without(missing, FIRST_TO_NEED[missing])
    assert (run.returncode, run.stdout, run.stderr) == (1, '', sentence(missing))


def test_a_missing_module_that_is_not_of_ros_is_shown_as_an_error(domain):
    run = without('yaml', 'topic list')
    assert run.returncode == 1
    assert run.stderr.startswith('Traceback')
    assert "No module named 'yaml'" in run.stderr


def test_doctor_says_what_is_missing_and_goes_on(domain):
    run = without('rclpy', 'doctor')
    assert (run.returncode, run.stderr) == (0, '')
    assert f'Missing      {sentence("rclpy")}' in run.stdout
    assert 'Packages' in run.stdout


@pytest.mark.parametrize('command', ['--help', 'interface list', 'pkg list', 'run --help'])
def test_what_needs_no_rclpy_works_without(domain, command):
    run = without('rclpy', command)
    assert (run.returncode, run.stderr) == (0, '')


def test_the_files_that_pkg_create_writes_are_in_the_package(run, tmp_path):
    words = '--build-type {} --license Apache-2.0 --node-name talk --destination-directory {}'
    for kind in ('ament_python', 'ament_cmake'):
        status, _, err = run(f'pkg create {kind}_pkg {words.format(kind, tmp_path)}')
        assert (status, err) == (0, '')
        text = (tmp_path / f'{kind}_pkg' / 'LICENSE').read_text()
        assert text.split()[:4] == ['Apache', 'License', 'Version', '2.0,']
    assert (
        'talk = ament_python_pkg.talk:main' in (tmp_path / 'ament_python_pkg/setup.py').read_text()
    )
    assert 'add_executable(talk src/talk.cpp)' in (
        (tmp_path / 'ament_cmake_pkg/CMakeLists.txt').read_text()
    )
