"""Answers to the tasks of the lesson "Share code in a C++ library": wrong ones, and right ones."""


def nearest(body: str, include: str = '') -> str:
    """Return the cell that writes `nearest` with this body."""
    return f"""%%write src/scan_tools/include/scan_tools/nearest.hpp
#pragma once

#include <cmath>
#include <limits>
{include}
namespace scan_tools
{{

inline float nearest(const float * ranges, int first, int last)
{{
  float result = std::numeric_limits<float>::infinity();
  {body}
  return result;
}}

}}  // namespace scan_tools
"""


def gap(body: str, throw: bool = True) -> str:
    """Return the cell that writes `widest_gap` with this body."""
    refusal = 'throw std::invalid_argument("width");' if throw else ''
    return f"""%%write src/scan_tools/src/gap.cpp
#include "scan_tools/gap.hpp"

#include <stdexcept>

#include "scan_tools/nearest.hpp"

namespace scan_tools
{{

int widest_gap(const float * ranges, int size, int width)
{{
  if (width < 1 || width > size) {{{refusal}}}
  int best = 0;
  {body}
  return best + width / 2;
}}

}}  // namespace scan_tools
"""


def export(lines: str) -> str:
    """Return the cell that writes the library's CMakeLists.txt."""
    return f"""EXPORT = '''
{lines}
'''
workspace.write('src/scan_tools/CMakeLists.txt', LIBRARY + EXPORT + 'ament_package()\\n')
"""


def look(depend: str, lines: str) -> str:
    """Return the cell that writes both files of `look`."""
    return f"""workspace.write('src/look/package.xml', '''<package format="3"><name>look</name>
<version>0.0.0</version><description>Look</description>
<maintainer email="you@example.com">you</maintainer><license>Apache-2.0</license>
<buildtool_depend>ament_cmake</buildtool_depend>{depend}
<export><build_type>ament_cmake</build_type></export></package>
''')
workspace.write('src/look/CMakeLists.txt', '''cmake_minimum_required(VERSION 3.8)
project(look)
find_package(ament_cmake REQUIRED)
add_executable(look src/look.cpp)
{lines}
install(TARGETS look DESTINATION lib/${{PROJECT_NAME}})
ament_package()
''')
"""


def bind(lines: str) -> str:
    """Return the cell that writes the module."""
    return f"""%%write src/scan_tools_py/src/bindings.cpp part 2
PYBIND11_MODULE(scan_tools_py, m)
{{
  m.def("nearest", [](const Ranges & ranges, int first, int last) {{
    return scan_tools::nearest(ranges.data(), first, last);
  }});
  m.def("search_holding_gil", &search);
  {lines}
}}
"""


def package_xml(lines: str) -> str:
    """Return the cell that writes `package.xml` of the module."""
    return f"""%%write src/scan_tools_py/package.xml
<?xml version="1.0"?>
<package format="3">
  <name>scan_tools_py</name>
  <version>0.0.0</version>
  <description>The functions of scan_tools for Python</description>
  <maintainer email="you@example.com">you</maintainer>
  <license>Apache-2.0</license>
  {lines}
  <export><build_type>ament_cmake</build_type></export>
</package>
"""


def mended(text: str) -> str:
    """Return the cell that writes the mended library."""
    return f"""MENDED = {text}
workspace.write('src/scan_tools/CMakeLists.txt', MENDED + EXPORT + 'ament_package()\\n')
"""


def driver(lines: str) -> str:
    """Return the class with these lines in its callback."""
    body = '\n        '.join(lines.splitlines())
    return f"""WIDTH = 51


class GapDriver(Node):
    def __init__(self):
        super().__init__('gap_driver')
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 10)
        self.subscription = self.create_subscription(LaserScan, 'scan', self.scan_callback, 1)

    def scan_callback(self, scan):
        message = Twist()
        {body}
        self.publisher.publish(message)
"""


def searcher(lines: str) -> str:
    """Return the class with these lines in its constructor."""
    body = '\n        '.join(lines.splitlines())
    return f"""class Searcher(Node):
    def __init__(self, search, limit_s):
        super().__init__('searcher')
        self.search, self.limit_s = search, limit_s
        self.stop = np.zeros(1, np.int32)
        self.begun, self.ended, self.stopped = threading.Event(), threading.Event(), None
        {body}

    def begin_callback(self, _):
        self.begun.set()
        self.stopped = self.search(self.stop, self.limit_s)
        self.ended.set()

    def stop_callback(self, _):
        self.stop[0] = 1
"""


LOOP = 'for (int i = first; i < last; ++i) '
KEEP = '{if (ranges[i] < result) result = ranges[i];}'
WINDOWS = 'for (int i = 0; i + width <= size; ++i) '
BETTER = 'nearest(ranges, i, i + width) > nearest(ranges, best, best + width)'
HEADERS = 'install(DIRECTORY include/ DESTINATION include/${PROJECT_NAME})\n'
TARGET = """install(TARGETS scan_tools EXPORT export_scan_tools
  ARCHIVE DESTINATION lib LIBRARY DESTINATION lib)
"""
EXPORTED = 'ament_export_targets(export_scan_tools HAS_LIBRARY_TARGET)\n'
DEPEND, FIND = '<depend>scan_tools</depend>', 'find_package(scan_tools REQUIRED)\n'
LINK = 'target_link_libraries(look PRIVATE scan_tools::scan_tools)\n'
GAP = """m.def("widest_gap", [](const Ranges & ranges, int width) {
    return scan_tools::widest_gap(ranges.data(), ranges.size(), width);
  });
"""
SEARCH = 'm.def("search", &search, py::call_guard<py::gil_scoped_release>());\n'
TOOLS = """<buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>ament_cmake_python</buildtool_depend>
"""
BUILDS = '<build_depend>python3-dev</build_depend><build_depend>pybind11-dev</build_depend>\n'
RUNS = '<exec_depend>python3-numpy</exec_depend>\n'
ASK = 'gap = scan_tools_py.widest_gap(scan.ranges, WIDTH)\n'
DRIVE = 'message.linear.x = 0.4\nmessage.angular.z = 2 * math.radians(gap - 90)'
ONE = "self.create_subscription(Empty, '{}', self.{}_callback, 10{})\n"
GROUP = ', callback_group=MutuallyExclusiveCallbackGroup()'
BOTH = ONE.format('begin', 'begin', GROUP) + ONE.format('stop', 'stop', GROUP)

ANSWERS = {
    1: {
        'wrong': [
            nearest(
                'for (int i = first; i <= last; ++i) {if (ranges[i] < result) result = ranges[i];}'
            ),
            nearest('for (int i = 0; i < last; ++i) ' + KEEP),
            nearest(
                'result = ranges[first]; ' + LOOP + '{if (ranges[i] < result) result = ranges[i];}'
            ),
            nearest(LOOP + '{if (ranges[i] > result) result = ranges[i];}'),
            nearest(LOOP + '{if (ranges[i] < result) return ranges[i];}'),
            nearest(LOOP + '{if (ranges[i] < result) result = ranges[i]}'),
            nearest('while (true) {}'),
        ],
        'right': [
            nearest(LOOP + '{if (!std::isnan(ranges[i])) result = std::fmin(result, ranges[i]);}'),
            nearest('while (first < last) {result = std::fmin(result, ranges[first++]);}'),
            nearest(
                'for (auto r = ranges + first; r != ranges + last; ++r)'
                ' {result = std::min(result, *r);}',
                '#include <algorithm>',
            ),
        ],
    },
    2: {
        'wrong': [
            gap(WINDOWS.replace('<=', '<') + f'{{if ({BETTER}) best = i;}}'),
            gap('for (int i = 0; i < size; ++i) ' + f'{{if ({BETTER}) best = i;}}'),
            gap(WINDOWS + f'{{if ({BETTER.replace(">", ">=")}) best = i;}}'),
            gap(WINDOWS + f'{{if ({BETTER.replace(">", "<")}) best = i;}}'),
            gap(WINDOWS + f'{{if ({BETTER}) best = i;}}', throw=False),
            gap('for (int i = 0; i < size; ++i) {if (ranges[i] > ranges[best]) best = i;}'),
        ],
        'right': [
            gap(f'int i = 0; while (i <= size - width) {{if ({BETTER}) {{best = i;}} i++;}}'),
            gap(
                'float most = -1; '
                + WINDOWS
                + '{const float here = nearest(ranges, i, i + width); '
                'if (here > most) {most = here; best = i;}}'
            ),
            gap(
                'for (int i = size - width; i >= 0; --i) {'
                f'if ({BETTER.replace(">", ">=")}) best = i;}}'
            ),
        ],
    },
    3: {
        'wrong': [
            export(HEADERS + TARGET),
            export(TARGET + EXPORTED),
            export(HEADERS + EXPORTED),
            export(HEADERS + TARGET.replace(' EXPORT export_scan_tools', '') + EXPORTED),
            export(HEADERS + TARGET + 'ament_export_targets(scan_tools)'),
            export(HEADERS.replace('include/${PROJECT_NAME}', 'include') + TARGET + EXPORTED),
        ],
        'right': [
            export(EXPORTED + HEADERS + TARGET),
            export((HEADERS + TARGET + EXPORTED).replace('export_scan_tools', 'scan_toolsTargets')),
            export(
                HEADERS.replace('${PROJECT_NAME}', 'scan_tools')
                + TARGET
                + 'ament_export_targets(export_scan_tools)'
            ),
        ],
    },
    4: {
        'wrong': [
            look('', FIND + LINK),
            look(DEPEND, LINK),
            look(DEPEND, FIND),
            look(DEPEND, FIND + LINK.replace('::scan_tools', '::look')),
            look('<exec_depend>scan_tool</exec_depend>', FIND + LINK),
        ],
        'right': [
            look('<build_depend>scan_tools</build_depend>', FIND + LINK),
            look(DEPEND, FIND + LINK.replace('PRIVATE ', '')),
            look(DEPEND, FIND + 'ament_target_dependencies(look scan_tools)'),
        ],
    },
    5: {
        'wrong': [
            bind(GAP),
            bind(GAP + 'm.def("search", &search);'),
            bind(SEARCH + GAP.replace('size(), width', 'size(), 3')),
            bind(SEARCH + GAP.replace('ranges.size(), width', 'width, ranges.size()')),
            bind(SEARCH + 'm.def("widest_gap", &scan_tools::widest_gap);'),
            bind(SEARCH + GAP.replace('});', '})')),
        ],
        'right': [
            bind(SEARCH + GAP),
            bind(
                GAP.replace('const Ranges & ranges', 'Ranges ranges')
                + 'm.def("search", &search, py::arg("stop"), py::arg("limit_s"), '
                'py::call_guard<py::gil_scoped_release>());'
            ),
            bind(
                GAP + 'm.def("search", [](py::array_t<int> & stop, double limit_s) {'
                'py::gil_scoped_release release; return search(stop, limit_s);});'
            ),
        ],
    },
    6: {
        'wrong': [
            package_xml(TOOLS + DEPEND + RUNS),
            package_xml(TOOLS + BUILDS.replace('python3-dev', 'python3') + DEPEND + RUNS),
            package_xml(TOOLS + BUILDS + RUNS),
            package_xml(BUILDS + DEPEND + RUNS),
            package_xml(TOOLS + BUILDS.replace('build_', '') + DEPEND + RUNS),
            package_xml(TOOLS + BUILDS + DEPEND),
        ],
        'right': [
            package_xml(RUNS + DEPEND + BUILDS + TOOLS),
            package_xml(
                TOOLS
                + BUILDS
                + RUNS
                + DEPEND.replace('depend', 'build_depend')
                + DEPEND.replace('depend', 'exec_depend')
            ),
            package_xml(
                TOOLS
                + BUILDS
                + RUNS
                + DEPEND.replace('depend', 'build_depend')
                + DEPEND.replace('depend', 'build_export_depend')
                + DEPEND.replace('depend', 'exec_depend')
            ),
        ],
    },
    7: {
        'wrong': [
            mended('LIBRARY'),
            mended("LIBRARY.replace('add_library(scan_tools', 'add_library(SHARED scan_tools')"),
            mended("LIBRARY.replace('add_library(scan_tools', 'add_library(scan_tools STATIC')"),
            mended("LIBRARY.replace('PUBLIC', 'SHARED')"),
            mended("LIBRARY.replace('Scan', 'SHARED')"),
        ],
        'right': [
            mended("LIBRARY.replace('src/gap.cpp', 'SHARED src/gap.cpp')"),
            mended(
                "LIBRARY + 'set_target_properties(scan_tools PROPERTIES "
                "POSITION_INDEPENDENT_CODE ON)\\n'"
            ),
            mended("LIBRARY.replace('add_library', 'set(BUILD_SHARED_LIBS ON)\\nadd_library')"),
        ],
    },
    8: {
        'wrong': [
            driver(ASK + DRIVE.replace('gap - 90', '90 - gap')),
            driver(ASK + DRIVE.replace('math.radians', '')),
            driver(ASK + DRIVE.replace('2 * ', '')),
            driver(ASK + DRIVE.replace('0.4', '4')),
            driver(ASK + DRIVE.replace('gap - 90', 'gap')),
            driver(DRIVE),
        ],
        'right': [
            driver(ASK + 'message.linear.x = 0.4\nmessage.angular.z = (gap - 90) * math.pi / 90'),
            driver(
                'message.linear.x = 0.4\nmessage.angular.z = 2.0 * np.radians('
                'scan_tools_py.widest_gap(np.array(scan.ranges), WIDTH) - 90.0)'
            ),
            driver(ASK + 'message.linear.x, message.angular.z = 0.4, math.radians(2 * gap - 180)'),
        ],
    },
    9: {
        'wrong': [
            searcher(BOTH.replace(GROUP, '')),
            searcher(
                'group = MutuallyExclusiveCallbackGroup()\n'
                + BOTH.replace('MutuallyExclusiveCallbackGroup()', 'group')
            ),
            searcher(ONE.format('begin', 'begin', GROUP)),
            searcher(BOTH.replace("'stop'", "'Stop'")),
            searcher(BOTH.replace('self.stop_callback', 'self.begin_callback')),
        ],
        'right': [
            searcher(ONE.format('begin', 'begin', '') + ONE.format('stop', 'stop', GROUP)),
            searcher(BOTH.replace('self.create', 'self.one = self.create', 1)),
            searcher(
                'one, two = MutuallyExclusiveCallbackGroup(), MutuallyExclusiveCallbackGroup()\n'
                + ONE.format('begin', 'begin', ', callback_group=one')
                + ONE.format('stop', 'stop', ', callback_group=two')
            ),
        ],
    },
}
