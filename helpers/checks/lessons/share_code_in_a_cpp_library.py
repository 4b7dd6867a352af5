"""What the tasks of the lesson "Share code in a C++ library" are judged by."""

import math
import re
import shutil
import sys
import sysconfig
import threading

import numpy as np
from geometry_msgs.msg import Twist

from helpers.checks.bench import Bench, scan
from helpers.checks.builds import EMPTY_OPTIONAL
from helpers.checks.errors import Failed
from helpers.checks.points import all_of, cached, expect, needs, rows
from helpers.checks.programs import manifest
from helpers.checks.tasks import Tasks
from helpers.trials import build_anew
from helpers.workspace import compile_error, error_in, why_it_failed

tasks = Tasks()
check = tasks.check

BUILD_S = 90  # for a point that builds two or three packages
NOT_COMPILED = 'it does not compile'
NOT_BUILT = 'it does not build'

# --- A header and a source file, in a program of their own ----------------------------------------

# Prints what a call returns for the numbers in its arguments, in a line that begins with "= ": a
# student may print, too. What is beyond the end of the ranges is there, and is far away. The
# assertions end it where an empty optional is read.
PROGRAM = """#define _GLIBCXX_ASSERTIONS
#include <cstdlib>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <vector>
#include <scan_tools/HEADER>
template<class T> void show(const T & x) {std::cout << "\\n= " << x << std::endl;}
template<class T> void show(const std::optional<T> & x)
{
  if (x) {show(*x);} else {show("nothing");}
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
  show("refused");
}
"""


class Compiled:
    """A call of the student's function in a program of its own, which is compiled once.

    The call has the ranges `r.data()`, their number `n`, and two numbers `a` and `b`.
    """

    def __init__(self, workspace, header, call, source=''):
        self._workspace, self._call, self._source = workspace, call, source
        self._text = PROGRAM.replace('HEADER', header).replace('CALL', f'scan_tools::{call}')
        self.compiles = cached(self._compile)

    def _compile(self):
        """Return True, or the first error of the compiler."""
        self._workspace.write('try/main.cpp', self._text)
        output = self._workspace.terminal(
            'cd try && rm -f main\n'
            f'c++ -std=c++17 -I ../src/scan_tools/include main.cpp {self._source} -o main 2>&1'
        )
        return self._workspace.file('try/main').is_file() or compile_error(output)

    def gives(self, right, ranges, a, b=0):
        """Return True if the call returns what is right, or else what it returns."""
        needs(self.compiles, NOT_COMPILED)
        output = self._workspace.terminal(
            f'cd try && ulimit -t 1 && timeout 20 ./main {a} {b} {ranges} 2>&1'
        )
        lines = [line for line in output.splitlines() if line.startswith('= ')]
        numbers = ranges.split()
        values = {'r.data()': f'{{{", ".join(numbers)}}}', 'n': len(numbers), 'a': a, 'b': b}
        words = r'r\.data\(\)|\b[nab]\b'
        call = re.sub(words, lambda word: str(values[word[0]]), self._call)
        if not lines and EMPTY_OPTIONAL in output:
            raise Failed(f'{call} reads the value of a std::optional that is empty', hint='')
        found = lines[-1].removeprefix('= ') if lines else 'nothing: it crashed, or never ended'
        return found == right or f'{call} is {found}, not {right}'


@tasks.add
def the_nearest_range(workspace):
    program = Compiled(workspace, 'nearest.hpp', 'nearest(r.data(), a, b)')
    loop = 'A for loop from first, while less than last; an if.'
    nan = 'Skip it, with std::isnan.'
    negative = 'Skip NaN and 0.0, and nothing else.'
    half = 'Count the known ones. If 2 * known < last - first, return std::nullopt.'
    return [
        ('it compiles', program.compiles, 'Braces and semicolons?'),
        *rows(program.gives, loop, ('of 3, 1, 2 it is 1', '1', '3 1 2', 0, 3)),
        *rows(
            program.gives,
            'Beam `last` is not included.',
            ('from beam 1 up to 3', '4', '1 5 4 2', 1, 3),
        ),
        *rows(
            program.gives,
            nan,
            ('NaN does not count', '2', 'nan 3 nan 2', 0, 4),
            ('also after the nearest', '1', '1 nan 3 nan', 0, 4),
        ),
        *rows(
            program.gives,
            negative,
            ('-infinity is the nearest', '-inf', '1 -inf 2', 0, 3),
            ('0.0 does not count', '2', '0 3 2', 0, 3),
            ('infinity counts', 'inf', 'inf nan', 0, 2),
        ),
        *rows(
            program.gives,
            half,
            ('one known beam of three is not enough', 'nothing', 'nan 1 0', 0, 3),
            ('of no range it is nothing', 'nothing', '1 2', 1, 1),
        ),
    ]


@tasks.add
def the_gap(workspace):
    source = '../src/scan_tools/src/gap.cpp'
    program = Compiled(workspace, 'gap.hpp', 'widest_gap(r.data(), n, a)', source)
    call = 'nearest(ranges, first, ...)'
    every = 'for (int first = 0; first + width <= size; ++first)'
    known = 'A window whose nearest range is std::nullopt is no gap: if (here && ...).'
    ties = '1 inf inf inf 1 inf inf inf'
    return [
        ('it compiles', program.compiles, 'Braces and semicolons?'),
        *rows(program.gives, call, ('in the middle', '3', '1 1 5 6 7 1', 3)),
        *rows(
            program.gives,
            every,
            ('the last window counts', '4', '1 1 1 2 3', 2),
            ('no beam beyond the end', '1', '2 2 1', 2),
        ),
        *rows(program.gives, '>, not >=', ('the first of several', '2', ties, 3)),
        *rows(
            program.gives,
            known,
            ('what is not known is no gap', '6', 'nan nan 0 nan 1 2 3 1', 2),
            ('nothing, if nothing is known', 'nothing', 'nan nan 0', 2),
        ),
        *rows(
            program.gives,
            'Keep throw.',
            ('a width of 9 of 3 beams is refused', 'refused', '1 1 1', 9),
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


def prints(workspace, package, executable, right):
    """Return True if the last line that an executable prints is right, or else this line."""
    output = workspace.terminal(f'source install/setup.bash\nros2 run {package} {executable}')
    return expect((output.splitlines() or ['nothing'])[-1], right, 'it prints')


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
        needs(built, NOT_BUILT)
        return prints(workspace, 'try_library', 'user', '2')

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
        if not result.ok:
            return f'for {ranges} it does not build: {why_it_failed(result)}'
        right = prints(workspace, 'look', 'look', f'The gap is at beam {beam}')
        return right is True or f'for {ranges}, {right}'

    def prints_the_gap():
        needs(built, NOT_BUILT)
        right = prints(workspace, 'look', 'look', 'The gap is at beam 3')
        return prints_for('7, 8, 9, 1, 1, 1', 1) if right is True else right

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
        needs(built, NOT_BUILT)
        return prints(workspace, 'look', 'look', 'The gap is at beam 3')

    def is_found_at_the_start():
        """Source the package alone: for a library that is shared, colcon helps."""
        needs(built, NOT_BUILT)
        folders = workspace.terminal("""unset LD_LIBRARY_PATH DYLD_LIBRARY_PATH
            source install/scan_tools/share/scan_tools/local_setup.bash
            echo $LD_LIBRARY_PATH $DYLD_LIBRARY_PATH""")
        is_there = 'install/scan_tools/lib' in folders
        return is_there or 'after sourcing, programs do not look into install/scan_tools/lib'

    return [
        ('look builds with your library', built, 'Copy the three lines of the table.'),
        ('both headers are installed', headers_are_installed, 'install(DIRECTORY ...)'),
        ('look runs', look_runs, 'It runs if it builds.'),
        (
            'sourcing tells programs where the library is',
            is_found_at_the_start,
            'ament_export_targets(... HAS_LIBRARY_TARGET)',
        ),
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
        include = f"-I '{sysconfig.get_path('include')}' -I '{sys.prefix}/include'"
        output = workspace.terminal(f"""
            mkdir -p try_module && cd try_module && rm -f scan_tools_py.so
            c++ -std=c++17 -shared -fPIC {include} -I ../src/scan_tools/include \\
                ../src/scan_tools_py/src/bindings.cpp \\
                ../src/scan_tools/src/gap.cpp -o scan_tools_py.so 2>&1
        """)
        is_made = workspace.file('try_module/scan_tools_py.so').is_file()
        return is_made or compile_error(output)

    def prints(code, right):
        needs(compiled, NOT_COMPILED)
        workspace.write(
            'try_module/try.py',
            f'import numpy as np, threading, time\nimport scan_tools_py as m\n{code}\n',
        )
        lines = workspace.terminal('cd try_module && python try.py 2>&1').splitlines()
        return lines[-1:] == [right] or f'in Python: {error_in(lines)}'

    function = '[](const Ranges & ranges, int width) {return scan_tools::widest_gap(...);}'
    guard = 'm.def("search", &search, py::call_guard<...>());'
    return [
        ('it compiles', compiled, 'Compare with nearest: parentheses, commas, semicolons.'),
        *rows(
            prints,
            function,
            ('a gap', 'print(m.widest_gap([1, 5, 6, 5, 1], 3))', '2'),
            ('another gap', 'print(m.widest_gap(np.arange(9), 4))', '7'),
            ('no gap is None', 'print(m.widest_gap([0, 0], 1))', 'None'),
        ),
        ('search releases the GIL', lambda: prints(STOPPED, 'True'), guard),
    ]


@tasks.add
def name_what_it_needs(workspace):
    package = cached(lambda: manifest(workspace, 'src/scan_tools_py'))

    def names(kind, *right):
        found = sorted(depend.name for depend in getattr(package(), f'{kind}_depends'))
        return found == sorted(right) or f'named: {", ".join(found) or "none"}'

    tools = 'ament_cmake', 'ament_cmake_python'
    to_build = 'pybind11-dev', 'python3-dev', 'scan_tools'
    to_run = 'python3-numpy', 'scan_tools'
    both = '<build_depend>, and <depend>'
    return [
        ('the tools', lambda: names('buildtool', *tools), '<buildtool_depend>'),
        ('what it needs to build', lambda: names('build', *to_build), both),
        ('what it needs to run', lambda: names('exec', *to_run), '<exec_depend>'),
    ]


def module_points(workspace, built, hint):
    """Return the points of a task that makes the module: it builds, and Python imports it."""

    def is_imported():
        needs(built, NOT_BUILT)
        lines = workspace.terminal("""
            source install/setup.bash
            python -c 'import scan_tools_py as m; print(m.widest_gap([1, 5, 6, 5, 1], 3))' 2>&1
        """).splitlines()
        return lines[-1:] == ['2'] or error_in(lines)

    return [
        ('the module builds', built, hint),
        ('Python imports it', is_imported, 'It comes with the build.'),
    ]


@tasks.add(limit_s=BUILD_S)
def make_the_module(workspace, library):
    shared = re.sub('find_package', 'set(BUILD_SHARED_LIBS ON)\n\\g<0>', library, count=1)
    built = cached(
        lambda: result_of(workspace, 'scan_tools', 'scan_tools_py', library=shared + GIVEN)
    )
    module = 'pybind11_add_module(scan_tools_py NO_EXTRAS src/bindings.cpp)'
    return module_points(workspace, built, module)


@tasks.add(limit_s=BUILD_S)
def fix_it(workspace):
    built = cached(lambda: result_of(workspace, 'scan_tools', 'look', 'scan_tools_py'))
    return module_points(workspace, built, "'add_library(scan_tools SHARED'")


# --- The node -------------------------------------------------------------------------------------


@tasks.add
def through_the_slalom(GapDriver, WIDTH, scan_tools_py):
    def command_for(gap):
        """Return the command for a scan with a gap, and whether the node has asked C++ for it."""
        calls = []

        def note(frame, event, function):
            if event == 'c_call':
                calls.append(function)

        ranges = np.full(181, math.nan if gap is None else 1.0)
        if gap is not None:
            ranges[gap - WIDTH // 2 : gap + WIDTH // 2 + 1] = 3.0
        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist)
            threading.setprofile(note)  # for the thread that spins the node
            bench.spin(GapDriver())
            threading.setprofile(None)
            if not bench.tester.count_subscribers('scan'):
                raise Failed('nobody hears the topic scan')
            bench.say('scan', scan(ranges))
        if not commands:
            raise Failed('after a scan, it publishes nothing on cmd_vel')
        return commands[0], scan_tools_py.widest_gap in calls

    def drives(gap, w):
        command, _ = command_for(gap)
        of = f'with the gap at beam {gap},'
        return all_of(
            expect(command.linear.x, 0.4, f'{of} linear.x is', within=0.001),
            expect(command.angular.z, w, f'{of} angular.z is', within=0.001),
        )

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
