"""What checks say of builds that failed, and what they ask setup.py."""

import pytest

from helpers.checks.builds import build
from helpers.checks.errors import Failed
from helpers.workspace import Workspace, compile_error, error_of_build
from helpers.workspace.build_output import lines_that_matter

COMPILER = """\
In file included from main.cpp:5:
../include/nearest.hpp: In function 'float nearest()':
../include/nearest.hpp:15:12: error: expected ';' before 'return'
   15 |   result = 1
      |            ^
../include/nearest.hpp:16:1: error: another one
"""
LINKER = """\
/usr/bin/ld: CMakeFiles/look.dir/look.cpp.o: in function `main':
look.cpp:(.text+0x25): undefined reference to `scan_tools::widest_gap(float const*, int, int)'
collect2: error: ld returned 1 exit status
"""
CMAKE = """\
CMake Error at CMakeLists.txt:6 (find_package):
  By not providing "Findmaps.cmake" in CMAKE_MODULE_PATH this project has
  asked CMake to find a package configuration file provided by "maps", but
  CMake did not find one.

  Could not find a package configuration file provided by "maps" with any of
  the following names:

    mapsConfig.cmake
    maps-config.cmake

  Add the installation prefix of "maps" to CMAKE_PREFIX_PATH or set "maps_DIR"
  to a directory containing one of the above files.
"""
DEEPER = """\
CMake Error at /opt/share/cmake/export.cmake:71 (install):
  install TARGETS given no EXPORT.
Call Stack (most recent call first):
  CMakeLists.txt:14 (ament_export_targets)
"""
ONE_LINE = """\
CMake Error: install(EXPORT "ours") given unknown export "ours"
"""
TRACEBACK = """\
Traceback (most recent call last):
  File "<string>", line 1, in <module>
  File "setup.py", line 3, in <module>
    setup(nam='robot')
TypeError: a name is missing
"""
COLCON_RUNS_SETUP = """\
Traceback (most recent call last):
  ...
  File "<string>", line 9, in <module>
NameError: name 'find_package' is not defined
"""

CMAKE_RUNS_PYTHON = """CMake Error at /opt/ros/rosidl_adapt_interfaces.cmake:57 (message):
  execute_process(/usr/bin/python -m rosidl_adapter)
  returned error code 1:

  Traceback (most recent call last):

    File "rosidl_adapter/parser.py", line 851, in parse_service_string
      raise InvalidServiceSpecification(

  rosidl_adapter.parser.InvalidServiceSpecification: Could not find separator
  '---' between request and response

Call Stack (most recent call first):
  CMakeLists.txt:8 (rosidl_generate_interfaces)


"""
GENERATOR = """Traceback (most recent call last):
  File "/opt/generate.py", line 3, in <module>
  File "rosidl_generator/__init__.py", line 160, in generate_type_hash
    pkg_dir = include_map[pkg]
KeyError: 'sensor_msgs'
gmake[2]: *** [build.make:76: rosidl_generator] Error 1
"""


@pytest.mark.parametrize(
    ('output', 'sentence'),
    [
        (COMPILER, "expected ';' before 'return'. Line 15 of nearest.hpp: result = 1"),
        (
            LINKER,
            "look.cpp:undefined reference to `scan_tools::widest_gap(float const*, int, int)'",
        ),
        (
            DEEPER,
            'install TARGETS given no EXPORT. Line 14 of CMakeLists.txt: ament_export_targets(...)',
        ),
        (ONE_LINE, 'install(EXPORT "ours") given unknown export "ours"'),
        (
            CMAKE_RUNS_PYTHON,
            'rosidl_adapter.parser.InvalidServiceSpecification: Could not find separator '
            "'---' between request and response. Line 8 of CMakeLists.txt: "
            'rosidl_generate_interfaces(...)',
        ),
        (
            GENERATOR,
            "KeyError: 'sensor_msgs'. Line 160 of __init__.py: pkg_dir = include_map[pkg]",
        ),
        ("error: can't copy 'x': no such file", "error: can't copy 'x': no such file"),
        (COLCON_RUNS_SETUP, "NameError: name 'find_package' is not defined. Line 9 of setup.py"),
        (TRACEBACK, "TypeError: a name is missing. Line 3 of setup.py: setup(nam='robot')"),
    ],
)  # fmt: skip
def test_the_first_error_is_said_with_its_line(output, sentence):
    assert compile_error(output) == sentence


def test_the_reason_of_cmake_is_kept_without_its_advice():
    error = error_of_build(lines_that_matter(CMAKE))
    assert 'Could not find a package configuration file provided by "maps"' in error
    assert error.endswith('maps-config.cmake. Line 6 of CMakeLists.txt: find_package(...)')


@pytest.fixture
def package():
    workspace = Workspace('packages')
    workspace.write(
        'src/robot/package.xml',
        '<package format="3"><name>robot</name><version>0.0.0</version><description>A</description>'
        '<maintainer email="you@example.com">you</maintainer><license>MIT</license>'
        '<export><build_type>ament_python</build_type></export></package>',
    )
    workspace.write('src/robot/robot/__init__.py', '')
    yield workspace
    workspace.close()


def setup(workspace, arguments):
    text = f"from setuptools import setup\n\nsetup(name='robot', {arguments})\n"
    workspace.write('src/robot/setup.py', text)


def test_a_build_raises_the_first_error_and_can_begin_anew(package):
    package.write('src/robot/old.txt', 'Of an earlier try')
    setup(package, "packages=['robot'], data_files=[('share/robot', ['old.txt'])]")
    build(package, 'robot')
    setup(package, "packages=['robot'], data_files=[('share/robot', ['missing.txt'])]")
    old = package.file('install/robot/share/robot/old.txt')
    for anew in (False, True):
        with pytest.raises(Failed, match=r'robot: .*missing\.txt'):
            build(package, 'robot', anew=anew)
        assert old.exists() != anew


@pytest.mark.parametrize('asked', [['camera'], ['robot', 'camera']])
def test_a_package_that_is_not_there_is_named(package, asked):
    setup(package, "packages=['robot']")
    with pytest.raises(Failed, match='there is no package camera in src'):
        build(package, *asked)
