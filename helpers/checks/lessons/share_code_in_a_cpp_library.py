"""What the tasks of the lesson "Share code in a C++ library" are judged by."""

import math
import re
import sys
import sysconfig
import threading

import numpy as np
from geometry_msgs.msg import Twist

from helpers.checks.bench import Bench, scan
from helpers.checks.builds import EMPTY_OPTIONAL
from helpers.checks.errors import Failed
from helpers.checks.points import all_of, cached, expect, needs, rows
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
            ('also after the nearest', '1', '9 1 nan 3 nan', 1, 5),
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

# The lines that give the library to others.
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


@tasks.add(limit_s=BUILD_S)
def link_the_library(workspace, library):
    built = cached(lambda: result_of(workspace, 'scan_tools', 'look', library=library + GIVEN))

    def prints_the_gap():
        needs(built, NOT_BUILT)
        printed = workspace.terminal('source install/setup.bash\nros2 run look look')
        return expect(
            (printed.splitlines() or ['nothing'])[-1], 'The gap is at beam 3', 'it prints'
        )

    steps = 'As in step 1, with find_package and target_link_libraries.'
    return [
        ('look builds', built, steps),
        (
            'look prints the gap',
            prints_the_gap,
            'install(TARGETS look DESTINATION ...), as in step 1',
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

    def said(code):
        """Return the last line that a program of Python prints. Raises Failed with its error."""
        needs(compiled, NOT_COMPILED)
        workspace.write(
            'try_module/try.py',
            f'import numpy as np, threading, time\nimport scan_tools_py as m\n{code}\n',
        )
        printed = workspace.terminal('cd try_module && timeout 20 python try.py 2>&1')
        if 'Error' in printed or not printed:
            raise Failed(f'in Python: {error_in(printed)}')
        return printed.splitlines()[-1]

    def returns(call, right):
        return expect(said(f'print({call})'), right, f'{call} is')

    def releases_the_gil():
        return said(STOPPED) == 'True' or 'm.stop() in another thread did not end m.search(4.0)'

    function = '[](const Ranges & ranges, int width) {return scan_tools::widest_gap(...);}'
    guard = 'm.def("search", &search, py::call_guard<...>());'
    return [
        ('it compiles', compiled, 'Compare with nearest: parentheses, commas, semicolons.'),
        *rows(
            returns,
            function,
            ('a gap', 'm.widest_gap([1, 5, 6, 5, 1], 3)', '2'),
            ('another gap', 'm.widest_gap(np.arange(9), 4)', '7'),
            ('no gap is None', 'm.widest_gap([0, 0], 1)', 'None'),
        ),
        ('search releases the GIL', releases_the_gil, guard),
    ]


@tasks.add(limit_s=BUILD_S)
def fix_it(workspace):
    built = cached(lambda: result_of(workspace, 'scan_tools', 'scan_tools_py'))

    def is_imported():
        needs(built, NOT_BUILT)
        lines = workspace.terminal("""
            source install/setup.bash
            python -c 'import scan_tools_py as m; print(m.nearest([3, 1, 2], 0, 3))' 2>&1
        """).splitlines()
        return lines[-1:] == ['1.0'] or error_in(lines)

    return [
        ('the module builds', built, "'add_library(scan_tools SHARED'"),
        ('Python imports it', is_imported, 'It comes with the build.'),
    ]


# --- The node -------------------------------------------------------------------------------------


@tasks.add
def through_the_slalom(GapDriver, WIDTH, scan_tools_py):
    asked = []

    def command_for(ranges):
        """Return the command that the node makes of a scan, and note whether it asks C++."""

        def note(frame, event, function):
            if event == 'c_call':
                asked.append(function)

        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist)
            threading.setprofile(note)  # for the thread that spins the node
            bench.spin(GapDriver())
            threading.setprofile(None)
            if not bench.tester.count_subscribers('scan'):
                raise Failed('nobody hears the topic scan')
            bench.say('scan', scan(ranges))
            bench.quiet()
        if not commands:
            raise Failed('after a scan, it publishes nothing on cmd_vel')
        if len(commands) > 1:
            raise Failed(f'after one scan, it publishes {len(commands)} messages on cmd_vel')
        return commands[0]

    def with_gap(gap, *, near=(), near_m=0.3):
        """Return a scan of 1 m with a gap, and something near where the beams of `near` look."""
        ranges = np.full(181, 1.0)
        ranges[gap - WIDTH // 2 : gap + WIDTH // 2 + 1] = 3.0
        ranges[[*near]] = near_m
        return ranges

    def drives(gap, w, **near):
        command = command_for(with_gap(gap, **near))
        of = f'with the gap at beam {gap},'
        return all_of(
            expect(command.linear.x, 0.4, f'{of} linear.x is', within=0.001),
            expect(command.angular.z, w, f'{of} angular.z is', within=0.001),
        )

    def stops(of, ranges):
        command = command_for(ranges)
        v, w = command.linear.x, command.angular.z
        return v == w == 0.0 or f'{of} it makes {v:.2f} m/s, {w:.2f} rad/s'

    def stops_where_all_is_near():
        return all_of(
            stops('of beams that are all 0.12 m', np.full(181, 0.12)),
            stops('of beams that are all -inf', np.full(181, -math.inf)),
        )

    def stops_before_something():
        of = 'with a gap on the left, and something at 0.3 m ahead,'
        return all_of(*(stops(of, with_gap(150, near=[beam])) for beam in (60, 120)))

    def drives_past_something():
        return all_of(
            drives(90, 0.0, near=(20, 59, 121, 160)),
            drives(90, 0.0, near=[62], near_m=0.5),  # far enough
        )

    def stops_if_ahead_is_unknown():
        ranges = with_gap(150, near=range(60, 121), near_m=math.nan)
        ranges[90] = 5.0
        return stops('with a gap on the left, and one known beam ahead,', ranges)

    def stops_without_a_gap():
        ranges = np.full(181, math.nan)
        ranges[60:76] = ranges[105:121] = 3.0  # half of those ahead, and too few for a gap
        return all_of(
            stops('of beams that are all NaN', np.full(181, math.nan)),
            stops('of beams of which too few are known for a gap', ranges),
        )

    def asks_cpp():
        command_for(with_gap(90))
        return (
            scan_tools_py.widest_gap in asked
            or 'for a scan it does not call scan_tools_py.widest_gap'
        )

    angle = '2 * math.radians(gap - 90)'
    call = 'scan_tools_py.widest_gap(scan.ranges, WIDTH)'
    ahead = 'scan_tools_py.nearest(scan.ranges, 60, 121)'
    near = f'If {ahead} is less than STOP_M, publish Twist().'
    return [
        ('straight ahead', lambda: drives(90, 0.0), call),
        ('to the left', lambda: drives(120, math.radians(60)), angle),
        ('to the right', lambda: drives(45, -math.radians(90)), angle),
        ('it stops where all is near', stops_where_all_is_near, near),
        ('it stops before something ahead', stops_before_something, near),
        ('it drives past what is far enough, or at its side', drives_past_something, ahead),
        (
            'it stops if there is no gap',
            stops_without_a_gap,
            'widest_gap returns None: then publish Twist().',
        ),
        (
            'it stops if it does not know what is ahead',
            stops_if_ahead_is_unknown,
            'nearest returns None: then publish Twist().',
        ),
        ('it asks C++', asks_cpp, call),
    ]
