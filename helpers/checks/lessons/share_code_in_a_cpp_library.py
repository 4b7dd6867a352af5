"""What the tasks of the lesson "Share code in a C++ library" are judged by."""

import math
import re
import shutil
import sys
import sysconfig
import threading

import numpy as np
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan

from helpers.checks.bench import Bench
from helpers.checks.errors import Failed
from helpers.checks.points import cached
from helpers.checks.programs import manifest
from helpers.checks.tasks import Tasks
from helpers.trials import build_anew
from helpers.workspace import compile_error, why_it_failed

tasks = Tasks()
check = tasks.check

BUILD_S = 90  # for a point that builds two or three packages
NOT_COMPILED = 'it does not compile'
NOT_BUILT = 'it does not build'

# --- A header and a source file, in a program of their own ----------------------------------------

# Prints what a call returns for the numbers in its arguments. What is beyond the end of the ranges
# is there, and is far away.
PROGRAM = """#include <cstdlib>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <vector>
#include <scan_tools/HEADER>
template<class T> void show(const T & x) {std::cout << x << std::endl;}
template<class T> void show(const std::optional<T> & x)
{
  if (x) {show(*x);} else {std::cout << "nothing" << std::endl;}
}
int main(int count, char ** word) try {
  const int a = std::atoi(word[1]), b = std::atoi(word[2]);
  std::vector<float> r;
  for (int i = 3; i < count; ++i) {r.push_back(std::strtof(word[i], nullptr));}
  const int n = r.size();
  r.resize(n + 200, 1000);
  (void)b;
  (void)n;
  show(CALL);
} catch (const std::invalid_argument &) {
  std::cout << "refused" << std::endl;
}
"""


class Program:
    """A program that is compiled for a check, once."""

    def __init__(self, workspace, header, call, source=''):
        self._workspace = workspace
        program = PROGRAM.replace('HEADER', header).replace('CALL', call)
        self._text, self._source = program, source
        self.error = cached(self._compile)

    def _compile(self):
        """Return the first error of the compiler, or ''."""
        self._workspace.write('try/main.cpp', self._text)
        output = self._workspace.terminal(
            'cd try && rm -f main\n'
            f'c++ -std=c++17 -I ../src/scan_tools/include main.cpp {self._source} -o main 2>&1'
        )
        return compile_error(output) if output else ''

    def compiles(self):
        """Return True, or the first error of the compiler."""
        return self.error() or True

    def gives(self, right, a, b, ranges):
        """Run the program. Return True if it prints what is right, or what it prints."""
        if self.error():
            return NOT_COMPILED
        output = self._workspace.terminal(
            f'cd try && ulimit -t 1 && timeout 20 ./main {a} {b} {ranges} 2>&1'
        )
        found = output or 'nothing: it crashed, or never ended'
        return found == right or f'for {ranges} and {a}, {b} it is {found}, not {right}'


FEW = 'nothing', 0, 3, 'nan 1 0'


@tasks.add
def the_nearest_range(workspace):
    program = Program(workspace, 'nearest.hpp', 'scan_tools::nearest(r.data(), a, b)')
    loop = 'A for loop from first, while less than last; an if.'
    nan = 'Skip it, with std::isnan.'
    negative = 'Skip NaN and 0.0, and nothing else.'
    half = 'Count the known ones. If 2 * known < last - first, return std::nullopt.'
    return [
        ('it compiles', program.compiles, 'Braces and semicolons?'),
        ('of 3, 1, 2 it is 1', lambda: program.gives('1', 0, 3, '3 1 2'), loop),
        (
            'from beam 1 up to 3',
            lambda: program.gives('4', 1, 3, '1 5 4 2'),
            'Beam `last` is not included.',
        ),
        ('NaN does not count', lambda: program.gives('2', 0, 4, 'nan 3 nan 2'), nan),
        ('also after the nearest', lambda: program.gives('1', 0, 4, '1 nan 3 nan'), nan),
        (
            '-infinity is the nearest',
            lambda: program.gives('-inf', 0, 3, '1 -inf 2'),
            negative,
        ),
        ('0.0 does not count', lambda: program.gives('2', 0, 3, '0 3 2'), negative),
        ('infinity counts', lambda: program.gives('inf', 0, 2, 'inf nan'), negative),
        ('one known beam of three is not enough', lambda: program.gives(*FEW), half),
        ('of no range it is nothing', lambda: program.gives('nothing', 1, 1, '1 2'), half),
    ]


@tasks.add
def the_gap(workspace):
    call = 'scan_tools::widest_gap(r.data(), n, a)'
    program = Program(workspace, 'gap.hpp', call, '../src/scan_tools/src/gap.cpp')
    every = 'for (int first = 0; first + width <= size; ++first)'
    known = 'A window whose nearest range is std::nullopt is no gap: if (here && ...).'
    ties = '1 inf inf inf 1 inf inf inf'
    return [
        ('it compiles', program.compiles, 'Braces and semicolons?'),
        (
            'in the middle',
            lambda: program.gives('3', 3, 0, '1 1 5 6 7 1'),
            'nearest(ranges, first, ...)',
        ),
        ('the last window counts', lambda: program.gives('4', 2, 0, '1 1 1 2 3'), every),
        ('no beam beyond the end', lambda: program.gives('1', 2, 0, '2 2 1'), every),
        ('the first of several', lambda: program.gives('2', 3, 0, ties), '>, not >='),
        (
            'what is not known is no gap',
            lambda: program.gives('6', 2, 0, 'nan nan 0 nan 1 2 3 1'),
            known,
        ),
        (
            'nothing, if nothing is known',
            lambda: program.gives('nothing', 2, 0, 'nan nan 0'),
            known,
        ),
        (
            'a width of 9 of 3 beams is refused',
            lambda: program.gives('refused', 9, 0, '1 1 1'),
            'Keep throw.',
        ),
    ]


# --- Packages -------------------------------------------------------------------------------------

# A package that uses the library, and the lines that give the library to others.
USER = {
    'package.xml': """<package format="3"><name>try_library</name><version>0.0.0</version>
<description>A user</description><maintainer email="you@example.com">you</maintainer>
<license>Apache-2.0</license><buildtool_depend>ament_cmake</buildtool_depend>
<depend>scan_tools</depend><export><build_type>ament_cmake</build_type></export></package>
""",
    'CMakeLists.txt': """cmake_minimum_required(VERSION 3.8)
project(try_library CXX)
find_package(ament_cmake REQUIRED)
find_package(scan_tools REQUIRED)
add_executable(user main.cpp)
target_link_libraries(user PRIVATE scan_tools::scan_tools)
install(TARGETS user DESTINATION lib/${PROJECT_NAME})
ament_package()
""",
    'main.cpp': """#include <iostream>
#include <scan_tools/gap.hpp>
int main() {const float r[] = {1, 5, 6, 5}; std::cout << *scan_tools::widest_gap(r, 4, 3);}
""",
}
GIVEN = """
install(DIRECTORY include/ DESTINATION include/${PROJECT_NAME})
install(TARGETS scan_tools EXPORT ours ARCHIVE DESTINATION lib LIBRARY DESTINATION lib)
ament_export_targets(ours HAS_LIBRARY_TARGET)
ament_package()
"""


def result_of(workspace, *packages, library=None):
    """Build anew. Return True, or the first error."""
    result = build_anew(workspace, *packages, library=library)
    return result.ok or why_it_failed(result)


def printed_by(workspace, package, executable):
    """Return the last line that an executable prints."""
    run = f'source install/setup.bash\nros2 run {package} {executable}'
    output = workspace.terminal(run)
    return output.splitlines()[-1] if output else 'nothing'


@tasks.add(limit_s=BUILD_S)
def make_the_library(workspace, library):
    @cached
    def built():
        for file, text in USER.items():
            workspace.write(f'src/try_library/{file}', text)
        try:
            return result_of(workspace, 'scan_tools', 'try_library', library=library + GIVEN)
        finally:
            shutil.rmtree(workspace.file('src/try_library'))

    def is_a_library():
        folder = workspace.file('install/scan_tools/lib')
        names = [f'libscan_tools.{end}' for end in ('a', 'so', 'dylib')]
        if any((folder / name).is_file() for name in names):
            return True
        others = sorted(path.name for path in folder.glob('lib*'))
        return f'in install/scan_tools/lib: {", ".join(others) or "no library"}'

    def finds_the_gap():
        if built() is not True:
            return NOT_BUILT
        output = printed_by(workspace, 'try_library', 'user')
        return output == '2' or f'it prints: {output}'

    return [
        ('another package builds with it', built, 'target_include_directories(... PUBLIC ...)'),
        ('it is called scan_tools', is_a_library, 'add_library(scan_tools src/gap.cpp)'),
        ('its program finds the gap', finds_the_gap, 'It runs if it builds.'),
    ]


@tasks.add(limit_s=BUILD_S)
def link_the_library(workspace, library):
    built = cached(lambda: result_of(workspace, 'scan_tools', 'look', library=library + GIVEN))

    def library_is_first():
        order = workspace.terminal('colcon list -t --names-only').split()
        if 'look' not in order:
            return f'colcon does not find look: {" ".join(order)}'
        return order.index('scan_tools') < order.index('look') or 'colcon builds look first'

    def prints_for(ranges, beam):
        """Build look again with other ranges. Return whether it prints the right beam."""
        file = workspace.file('src/look/src/look.cpp')
        yours = file.read_text()
        try:
            file.write_text(re.sub(r'(ranges\[\] = )\{.*?\}', rf'\1{{{ranges}}}', yours))
            # CMake installs no program that was linked in the same second as the one there.
            workspace.file('install/look/lib/look/look').unlink(missing_ok=True)
            result = workspace.build('look')
        finally:
            file.write_text(yours)
        output = printed_by(workspace, 'look', 'look') if result.ok else why_it_failed(result)
        right = f'The gap is at beam {beam}'
        return output == right or f'for {ranges} it prints: {output}'

    def prints_the_gap():
        if built() is not True:
            return NOT_BUILT
        output = printed_by(workspace, 'look', 'look')
        if output != 'The gap is at beam 3':
            return f'it prints: {output}'
        return prints_for('7, 8, 9, 1, 1, 1', 1)

    steps = 'As in step 1, with find_package and target_link_libraries.'
    call = 'scan_tools::widest_gap(ranges, 6, 3).value(), and install(...)'
    return [
        ('colcon builds the library first', library_is_first, '<depend>NAME</depend>'),
        ('look builds', built, steps),
        ('look prints the gap', prints_the_gap, call),
    ]


@tasks.add(limit_s=BUILD_S)
def give_it_to_others(workspace):
    built = cached(lambda: result_of(workspace, 'scan_tools', 'look'))

    def headers_are_installed():
        include = workspace.path / 'install/scan_tools/include'
        headers = sorted(str(file.relative_to(include)) for file in include.glob('**/*.hpp'))
        right = [f'scan_tools/scan_tools/{name}.hpp' for name in ('gap', 'nearest')]
        return headers == right or f'in install/scan_tools/include: {", ".join(headers) or "none"}'

    def look_runs():
        if built() is not True:
            return NOT_BUILT
        output = printed_by(workspace, 'look', 'look')
        return output == 'The gap is at beam 3' or f'it prints: {output}'

    return [
        ('look builds with your library', built, 'Copy the three lines of the table.'),
        ('both headers are installed', headers_are_installed, 'install(DIRECTORY ...)'),
        ('look runs', look_runs, 'It runs if it builds.'),
    ]


# --- A module of Python ---------------------------------------------------------------------------

STOPPED = """def stop_it():
    while True: time.sleep(0.05); m.stop()
threading.Thread(target=stop_it, daemon=True).start()
print(m.search(4.0))"""


@tasks.add(limit_s=BUILD_S)
def bind(workspace):
    @cached
    def compiled():
        include = f'-I {sysconfig.get_path("include")} -I {sys.prefix}/include'
        output = workspace.terminal(f"""
            mkdir -p try_module && cd try_module && rm -f scan_tools_py.so
            c++ -std=c++17 -shared -fPIC {include} -I ../src/scan_tools/include \\
                ../src/scan_tools_py/src/bindings.cpp \\
                ../src/scan_tools/src/gap.cpp -o scan_tools_py.so 2>&1
        """)
        is_made = workspace.file('try_module/scan_tools_py.so').is_file()
        return is_made or compile_error(output)

    def prints(code, right):
        if compiled() is not True:
            return NOT_COMPILED
        workspace.write(
            'try_module/try.py',
            f'import numpy as np, threading, time\nimport scan_tools_py as m\n{code}\n',
        )
        output = workspace.terminal('cd try_module && python try.py 2>&1')
        lines = output.splitlines() or ['nothing']
        if lines[-1] == right:
            return True
        errors = [number for number, line in enumerate(lines) if re.match(r'\w*Error', line)]
        first = errors[0] if errors else len(lines) - 1
        return 'in Python: ' + ' '.join(map(str.strip, lines[first : first + 4]))

    guard = 'm.def("search", &search, py::call_guard<...>());'
    function = '[](const Ranges & ranges, int width) {return scan_tools::widest_gap(...);}'
    return [
        ('it compiles', compiled, 'Compare with nearest: parentheses, commas, semicolons.'),
        ('a gap', lambda: prints('print(m.widest_gap([1, 5, 6, 5, 1], 3))', '2'), function),
        ('another gap', lambda: prints('print(m.widest_gap(np.arange(9), 4))', '7'), function),
        ('no gap is None', lambda: prints('print(m.widest_gap([0, 0], 1))', 'None'), function),
        ('search releases the GIL', lambda: prints(STOPPED, 'True'), guard),
    ]


@tasks.add
def name_what_it_needs(workspace):
    package = cached(lambda: manifest(workspace, 'src/scan_tools_py'))

    def needs(kind, *right):
        found = sorted(depend.name for depend in getattr(package(), f'{kind}_depends'))
        return found == sorted(right) or f'named: {", ".join(found) or "none"}'

    tools = 'ament_cmake', 'ament_cmake_python'
    to_build = 'pybind11-dev', 'python3-dev', 'scan_tools'
    to_run = 'python3-numpy', 'scan_tools'
    return [
        ('the tools', lambda: needs('buildtool', *tools), '<buildtool_depend>'),
        (
            'what it needs to build',
            lambda: needs('build', *to_build),
            '<build_depend>, and <depend>',
        ),
        ('what it needs to run', lambda: needs('exec', *to_run), '<exec_depend>'),
    ]


def imports_the_module(workspace):
    output = workspace.terminal("""
        source install/setup.bash
        python -c 'import scan_tools_py as m; print(m.widest_gap([1, 5, 6, 5, 1], 3))' 2>&1
    """)
    return output == '2' or (output.splitlines() or ['it printed nothing'])[-1]


@tasks.add(limit_s=BUILD_S)
def make_the_module(workspace, library):
    shared = re.sub('find_package', 'set(BUILD_SHARED_LIBS ON)\n\\g<0>', library, count=1)
    built = cached(
        lambda: result_of(workspace, 'scan_tools', 'scan_tools_py', library=shared + GIVEN)
    )

    def is_imported():
        return imports_the_module(workspace) if built() is True else NOT_BUILT

    module = 'pybind11_add_module(scan_tools_py NO_EXTRAS src/bindings.cpp)'
    return [
        ('the module builds', built, module),
        ('Python imports it', is_imported, 'It comes with the build.'),
    ]


@tasks.add(limit_s=BUILD_S)
def fix_it(workspace):
    built = cached(lambda: result_of(workspace, 'scan_tools', 'look', 'scan_tools_py'))

    def is_imported():
        return imports_the_module(workspace) if built() is True else NOT_BUILT

    return [
        ('the module builds', built, "'add_library(scan_tools SHARED'"),
        ('Python imports it', is_imported, 'It comes with the build.'),
    ]


# --- The node -------------------------------------------------------------------------------------


@tasks.add
def through_the_slalom(GapDriver, WIDTH, scan_tools_py):
    def command_for(gap):
        """Return the command for a scan with a gap, and whether the node has asked C++ for it."""
        calls = []

        def note(frame, event, function):
            if event == 'c_call':
                calls.append(function)

        ranges = np.full(181, math.nan if gap is None else 1.0, np.float32)
        if gap is not None:
            ranges[gap - WIDTH // 2 : gap + WIDTH // 2 + 1] = 3.0
        step = math.pi / 180
        scan = LaserScan(angle_min=-math.pi / 2, angle_increment=step, ranges=ranges.tolist())
        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist)
            threading.setprofile(note)  # for the thread that spins the node
            bench.spin(GapDriver())
            threading.setprofile(None)
            if not bench.tester.count_subscribers('scan'):
                raise Failed('nobody hears the topic scan')
            bench.say('scan', scan)
        if not commands:
            raise Failed('after a scan, it publishes nothing on cmd_vel')
        return commands[0], scan_tools_py.widest_gap in calls

    def drives(gap, right):
        command, _ = command_for(gap)
        v, w = command.linear.x, command.angular.z
        if abs(v - 0.4) > 0.001:
            return f'linear.x is {v:.2f}'
        return abs(w - right) < 0.001 or f'with the gap at beam {gap}, angular.z is {w:.2f}'

    def stops():
        command, _ = command_for(None)
        v, w = command.linear.x, command.angular.z
        return v == w == 0.0 or f'of beams that are all NaN it makes {v:.2f} m/s, {w:.2f} rad/s'

    def asks_cpp():
        _, asked = command_for(90)
        return asked or 'for a scan it does not call scan_tools_py.widest_gap'

    angle = '2 * math.radians(gap - 90)'
    call = 'scan_tools_py.widest_gap(scan.ranges, WIDTH)'
    return [
        ('straight ahead', lambda: drives(90, 0.0), call),
        ('to the left', lambda: drives(120, math.radians(60)), angle),
        ('to the right', lambda: drives(45, -math.radians(90)), angle),
        ('it stops if there is no gap', stops, 'widest_gap returns None: then publish Twist().'),
        ('it asks C++', asks_cpp, call),
    ]
