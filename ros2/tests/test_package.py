"""The package stands alone: it needs what its pyproject.toml and its README name."""

import ast
import sys
from pathlib import Path

import ros2_command

FOLDER = Path(ros2_command.__file__).parent
# Of pyproject.toml, under the names that are imported.
DEPENDENCIES = {'argcomplete', 'mcap', 'rosbags', 'yaml'}
# rclpy, with what it needs itself; `ros2 interface show` reads a file with ROS's own parser.
ROS = {'lifecycle_msgs', 'numpy', 'rcl_interfaces', 'rclpy', 'rosgraph_msgs', 'rosidl_adapter'}


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
