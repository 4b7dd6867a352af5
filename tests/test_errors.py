"""The first error in what was printed: its text, and the line of the student, never another one."""

import pytest

from helpers.workspace import (
    compile_error,
    error_in,
    error_of_build,
    error_of_launch,
    error_of_pytest,
    first_error,
)

# --- Builds

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
IN_A_LIBRARY = """\
/usr/include/c++/bits/vector.tcc:71:9: error: no matching function
   71 |   construct(first)
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
        (GENERATOR, "KeyError: 'sensor_msgs'"),  # the line is one of a library
        (IN_A_LIBRARY, 'no matching function (in vector.tcc, a file of a library)'),
        ("error: can't copy 'x': no such file", "error: can't copy 'x': no such file"),
        (COLCON_RUNS_SETUP, "NameError: name 'find_package' is not defined. Line 9 of setup.py"),
        (TRACEBACK, "TypeError: a name is missing. Line 3 of setup.py: setup(nam='robot')"),
    ],
)  # fmt: skip
def test_the_first_error_is_said_with_its_line(output, sentence):
    assert compile_error(output) == sentence


def test_the_reason_of_cmake_is_kept_without_its_advice():
    error = compile_error(CMAKE)
    assert 'Could not find a package configuration file provided by "maps"' in error
    assert error.endswith('maps-config.cmake. Line 6 of CMakeLists.txt: find_package(...)')


def test_a_build_that_says_nothing_is_said():
    assert error_of_build([]) == 'it failed, and printed no reason'


# --- Programs and launches

OF_A_PROGRAM = """[INFO] [listener]: I begin
Traceback (most recent call last):
  File "/home/you/ws/.start.py", line 3, in <module>
    runpy.run_path('src/hello_pkg/hello_pkg/listener.py')["main"]()
  File "/home/you/ws/src/hello_pkg/hello_pkg/listener.py", line 12, in main
    self.create_subscriber(String, 'topic', self.heard, 10)
    ^^^^^^^^^^^^^^^^^^^^^^
AttributeError: 'Listener' object has no attribute 'create_subscriber'
"""


def test_the_error_of_a_program_has_text_and_line():
    said = "AttributeError: 'Listener' object has no attribute 'create_subscriber'. "
    said += "Line 12 of listener.py: self.create_subscriber(String, 'topic', self.heard, 10)"
    assert error_in(OF_A_PROGRAM.splitlines()) == said
    # In what a terminal of the workspace prints, its folder is left out.
    assert error_in(OF_A_PROGRAM.replace('/home/you/ws/src', 'src').splitlines()) == said
    launched = [f'[listener-2] {line}' for line in OF_A_PROGRAM.splitlines()]
    mixed = [
        line for pair in zip(launched, ['[robot-1] I drive'] * 9, strict=False) for line in pair
    ]
    assert error_in(mixed) == said


def test_of_several_errors_the_first_one_counts_and_of_a_chain_the_last():
    second = 'Traceback (most recent call last):\nValueError: another one\n'
    assert error_in((OF_A_PROGRAM + second).splitlines()).startswith('AttributeError')
    chain = (
        f'{OF_A_PROGRAM}\nDuring handling of the above exception, another exception occurred:\n\n'
    )
    assert error_in((chain + second).splitlines()) == 'ValueError: another one'


def test_a_program_without_a_traceback_has_said_its_last_line():
    assert error_in(["Package 'x' not found", '']) == "Package 'x' not found"
    assert error_in([]) == 'it printed nothing'


def test_a_launch_names_its_own_error_or_that_of_the_first_program_that_died():
    assert error_of_launch("a.xml:3: '2' is neither true nor false") == (
        "a.xml:3: '2' is neither true nor false"
    )
    starts = '[INFO] [robot-1]: process started with pid [1]\n'
    assert error_of_launch(starts) == ''
    said = '[robot-1] error: no floor x\n'
    died = '[ERROR] [robot-1]: process has died [pid 1, exit code 2]\n'
    assert error_of_launch(starts + said + died) == 'robot-1 has died. [robot-1] error: no floor x'


IN_RCLPY = """Traceback (most recent call last):
  File "/home/you/ws/src/hello_pkg/hello_pkg/talker.py", line 7, in main
    rclpy.spin(Talker)
  File "/usr/lib/python3/dist-packages/rclpy/__init__.py", line 9, in spin
    executor.add_node(node)
AttributeError: type object 'Talker' has no attribute 'handle'
"""


def test_the_line_of_a_library_is_never_the_students():
    said = "AttributeError: type object 'Talker' has no attribute 'handle'"
    own = IN_RCLPY.replace('/home/you/ws/', '')
    library = own.replace('/usr/lib/python3/dist-packages/', '')  # as a workspace prints it
    assert first_error(library) == f'{said}. Line 7 of talker.py: rclpy.spin(Talker)'
    assert first_error(library.replace('src/hello_pkg', 'other')) == said


@pytest.mark.parametrize(
    'printed', ['', 'I drive\n[INFO] [robot-1]: process started', '[robot-1] I']
)
def test_without_an_error_there_is_none(printed):
    assert first_error(printed) == error_of_launch(f'{printed}: process started') == ''


@pytest.mark.parametrize(
    ('build', 'said'),
    [
        (
            f'Starting >>> robot\n--- stderr: robot\n{TRACEBACK}---\nFailed <<< robot',
            'TypeError: a',
        ),
        ("--- stderr: robot\nerror: can't copy 'x'\n---", "error: can't copy 'x'"),
        (CMAKE, 'By not providing "Findmaps.cmake"'),
    ],
)
def test_what_colcon_prints_has_the_error_of_its_package(build, said):
    assert first_error(build).startswith(said)


# --- pytest

OF_PYTEST = """src/brake_pkg/test/test_speed.py:4: in <module>
    from brake_pkg.speed import sped
E   ImportError: cannot import name 'sped' from 'brake_pkg.speed'
"""


def test_why_pytest_cannot_read_a_file():
    said = "ImportError: cannot import name 'sped' from 'brake_pkg.speed'"
    assert error_of_pytest(OF_PYTEST) == f'{said} (line 4 of test_speed.py)'
    library = OF_PYTEST.replace('src/brake_pkg/test', '/usr/lib/python3/dist-packages')
    assert error_of_pytest(library) == said
