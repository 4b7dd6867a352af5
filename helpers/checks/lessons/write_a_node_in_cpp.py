"""What the tasks of the lesson "Write a node in C++" are judged by."""

import math
import re
import shutil
import signal
import time
from contextlib import suppress
from dataclasses import dataclass, field

from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32

from helpers.checks.bench import RELIABLE, Bench, scan
from helpers.checks.builds import EMPTY_OPTIONAL, build
from helpers.checks.errors import Failed
from helpers.checks.points import all_of, cached, expect, needs
from helpers.checks.programs import Program
from helpers.checks.tasks import Tasks

tasks = Tasks()
check = tasks.check

BUILD_S = 90  # for a point that builds
FIRST_SCANS = 10  # at most, until a program is known to answer
ANSWER_S = 0.5  # after each of these
LATE_S = 1.0  # for an answer to another of these
STOP_S = 5  # until the last command of a program is here
TRY_S = 10  # for a program of ours to end
START_S = 8  # for a program to start and be known to the others
CALLS_MY_SPIN = 'brake.cpp calls spin, not my_spin: run the cell above this task again'
READS_EMPTY = 'it reads the value of a std::optional that is empty'


def install_anew(workspace, *packages):
    """Build packages, and return True. Raises Failed with the first error.

    A build takes nothing away: what an earlier try of the last package has installed would stay.
    It is removed before. The other packages stay, and need not be compiled again.
    """
    shutil.rmtree(workspace.file(f'install/{packages[-1]}'), ignore_errors=True)
    build(workspace, *packages)
    return True


# A package of ours, in which the code of the student is tried.
OUR_CMAKE = """cmake_minimum_required(VERSION 3.8)
project(@PACKAGE@)
find_package(ament_cmake REQUIRED)
find_package(geometry_msgs REQUIRED)
find_package(scan_tools REQUIRED)
find_package(small_rclcpp REQUIRED)
find_package(std_msgs REQUIRED)
find_package(Threads REQUIRED)
add_executable(@PACKAGE@ @PACKAGE@.cpp)
target_include_directories(@PACKAGE@ PRIVATE ../brake/src)
target_link_libraries(@PACKAGE@ PRIVATE
  scan_tools::scan_tools small_rclcpp::small_rclcpp
  ${geometry_msgs_TARGETS} ${std_msgs_TARGETS} Threads::Threads)
install(TARGETS @PACKAGE@ DESTINATION lib/${PROJECT_NAME})
ament_package()
"""
OUR_XML = """<package format="3"><name>@PACKAGE@</name><version>0.0.0</version>
<description>Ours</description><maintainer email="you@example.com">you</maintainer>
<license>Apache-2.0</license><buildtool_depend>ament_cmake</buildtool_depend>
<depend>geometry_msgs</depend><depend>scan_tools</depend>
<depend>small_rclcpp</depend><depend>std_msgs</depend>
<export><build_type>ament_cmake</build_type></export></package>
"""


def run_ours(workspace, name, code):
    """Build a program of ours that includes what the student wrote, and return what it prints."""
    files = {f'{name}.cpp': code, 'CMakeLists.txt': OUR_CMAKE, 'package.xml': OUR_XML}
    for file, text in files.items():
        workspace.write(f'src/{name}/{file}', text.replace('@PACKAGE@', name))
    try:
        install_anew(workspace, name)
        with workspace.run(name, name) as process:
            process.wait(TRY_S)
    finally:
        shutil.rmtree(workspace.file(f'src/{name}'))
    return process.lines


@tasks.add(limit_s=BUILD_S)
def the_nearest_range(workspace):
    built = cached(lambda: install_anew(workspace, 'scan_tools'))

    def nearest_is(right, range_min, range_max, *ranges):
        needs(built)
        numbers = map(str, (range_min, range_max, *ranges))
        with workspace.run('scan_tools', 'try_nearest', *numbers) as program:
            program.wait()
        of = f'of {", ".join(map(str, ranges)) or "no beam"}'
        if any(EMPTY_OPTIONAL in line for line in program.lines):
            raise Failed(f'{of}: {READS_EMPTY}', hint='')
        found = program.lines[-2] if len(program.lines) > 1 else 'no line'
        with suppress(ValueError):
            found = f'{float(found):g}'
        valid = f'valid from {range_min} to {range_max}'
        return found == right or f'{of}, {valid}: {found}, not {right}'

    def limits_are_valid():
        return all_of(
            nearest_is('0.5', 0.5, 2.5, 2.5, 0.5),
            nearest_is('2.5', 0.5, 2.5, 2.5),
        )

    smallest = 'A loop over scan.ranges; *found is the smallest one so far, if there is one.'
    known = 'Is it in the range? Two comparisons with && in between; both are false for NaN.'
    limits = 'A range is valid if range_min <= range and range <= range_max.'
    half = 'Count the known ones. If 2 * known < scan.ranges.size(), return std::nullopt.'
    return [
        (
            'the smallest one, wherever it is',
            lambda: nearest_is('0.5', 0.1, 3.5, 2, 0.5, 1),
            smallest,
        ),
        (
            'NaN and ranges below range_min are not known',
            lambda: nearest_is('0.4', 0.2, 3.5, 'nan', 0.1, 3, 0.4),
            known,
        ),
        (
            'ranges above range_max are not known, and inf is range_max',
            lambda: nearest_is('3.5', 0.1, 3.5, 'inf', 99, 'inf'),
            'range == INFINITY counts as scan.range_max.',
        ),
        (
            '-inf is 0.0',
            lambda: nearest_is('0', 0.1, 3.5, 2, '-inf'),
            'range == -INFINITY counts as 0.0.',
        ),
        (
            '0.0 is not known, also if range_min is 0',
            lambda: nearest_is('2', 0, 3.5, 0, 2),
            '... && range > 0',
        ),
        ('the limits themselves are valid', limits_are_valid, limits),
        (
            'one known beam of three is not enough',
            lambda: nearest_is('nothing', 0.1, 3.5, 'nan', 0, 2),
            half,
        ),
        (
            'a scan without beams says nothing',
            lambda: nearest_is('nothing', 0.1, 3.5),
            'Return found as it was made: std::nullopt.',
        ),
    ]


# --- A program that answers scans -----------------------------------------------------------------


@dataclass
class Heard:
    """What a program said to each scan, the names of its nodes, and why it said no more."""

    answers: list = field(default_factory=list)
    names: list = field(default_factory=list)
    problem: str = ''

    def first(self, count):
        """Return the first answers. Raises Failed if there are fewer."""
        if len(self.answers) < count:
            raise Failed(self.problem, hint='')
        return self.answers[:count]


def hear(workspace, program, kind, topic, *distances, pause_s=0.0):
    """Run a program, show it a wall at each of these distances, and return what is `Heard`."""
    heard = Heard()
    with Bench() as bench, Program(workspace.run(program, program)) as running:
        answers = bench.hear(topic, kind, RELIABLE)
        try:
            start(bench, running, topic, answers)
            for distance in distances:
                running.wait(lambda: True)  # it has not ended
                ranges = [math.nan] * 3 if math.isnan(distance) else [3.5, distance]
                bench.publisher('scan', LaserScan).publish(scan(ranges, limits=(0.1, 3.5)))
                running.wait(lambda: len(answers) > len(heard.answers), STOP_S)
                bench.quiet()
                if len(answers) != len(heard.answers) + 1:
                    count = f'scans: {len(heard.answers) + 1}, messages on {topic}: {len(answers)}'
                    raise Failed(count)
                heard.answers = [*answers]
                time.sleep(pause_s)
            # A program says how its nodes are called after the topics that they use.
            bench.wait(lambda: names_of_others(bench.tester), START_S)
            heard.names = names_of_others(bench.tester)
        except Failed as failed:
            heard.problem = READS_EMPTY if running.says(EMPTY_OPTIONAL) else str(failed)
            running.end(signal.SIGKILL)  # a callback without an end would hear no Ctrl+C
    return heard


def start(bench, running, topic, answers):
    """Wait until a program answers a scan, and forget this answer. Raises Failed if none comes.

    A program that starts may not know yet who listens to it: then its first answers are lost.
    """
    scans, tester = bench.publisher('scan', LaserScan), bench.tester
    running.wait(lambda: scans.get_subscription_count() and tester.count_publishers(topic), START_S)
    if not scans.get_subscription_count():
        raise Failed('nobody subscribes to scan: a member of the node must keep the subscription')
    if not tester.count_publishers(topic):
        raise Failed(f'nobody publishes on {topic}')
    sent = 0
    while sent < FIRST_SCANS and not answers:
        scans.publish(scan([3.5], limits=(0.1, 3.5)))
        running.wait(lambda: answers, ANSWER_S)
        sent += 1
    if not answers:
        raise Failed(f'scans: {sent}, messages on {topic}: 0')
    while sent > 1 and bench.wait(lambda: len(answers) > 1, LATE_S):
        answers.pop()  # to one of the other first scans
    answers.clear()


def names_of_others(node):
    """Return the names of the nodes that are not the tester's."""
    return [name for name in node.get_node_names() if name != 'tester' and name[0] != '_']


def code_of(workspace, file):
    """Return a file of CMake or C++ without its comments."""
    comment = r'#.*' if file.endswith('CMakeLists.txt') else r'//.*|/\*.*?\*/'
    return re.sub(comment, '', workspace.file(file).read_text())


@tasks.add(limit_s=BUILD_S)
def its_cmakelists(workspace):
    packages = 'scan_tools', 'small_rclcpp', 'std_msgs'
    built = cached(lambda: install_anew(workspace, 'scan_tools', 'small_rclcpp', 'watcher'))

    def names_what_it_uses():
        """Test the text: what another package has found or links is there, too."""
        code = code_of(workspace, 'src/watcher/CMakeLists.txt')
        if 'foreach' in code.lower():
            return True
        not_found = [
            one for one in packages if not re.search(rf'find_package\s*\(\s*"?{one}\b', code)
        ]
        if not_found:
            return f'no find_package for {", ".join(not_found)}'
        links = r'(?:target_link_libraries|ament_target_dependencies)\s*\(([^)]*)\)'
        linked = ' '.join(re.findall(links, code))
        if re.search(r'\$\{(?!\w+_TARGETS\})', linked):  # a variable of the student's own
            return True
        not_linked = [one for one in packages if one not in linked]
        return not not_linked or f'watcher is not linked to {", ".join(not_linked)}'

    def watches(*distances):
        needs(built)
        heard = hear(workspace, 'watcher', Float32, 'nearest', *distances)
        if heard.problem:
            return heard.problem
        found = [round(message.data, 3) for message in heard.answers]
        return expect(found, [*distances], f'walls at {distances} m; it says')

    hint = (
        'Four commands: find_package, add_executable, target_link_libraries, install(TARGETS ...).'
    )
    finds = 'find_package(NAME REQUIRED), and what it brings in target_link_libraries.'
    return [
        ('it builds', built, hint),
        ('it finds and links each package that it uses', names_what_it_uses, finds),
        ('it runs and says the nearest range', lambda: watches(2.5, 0.75), hint),
    ]


def brakes(heard, *pairs, after=0):
    """Compare the speeds that the brake gave, after so many, with pairs of a wall and its speed."""
    distances, speeds = zip(*pairs, strict=True)
    answers = heard.first(after + len(pairs))[after:]
    found = [round(message.linear.x, 3) for message in answers]
    return expect(found, [*speeds], f'walls at {distances} m: its speeds (m/s) are')


# Three scans come while the brake is busy: how many does it handle? Nothing is known of them: if
# the brake reads the empty optional, the assertions end the program.
TRY_BRAKE = """#define _GLIBCXX_ASSERTIONS
#define main main_of_the_student
#include "brake.cpp"
#undef main
#include <cmath>
#include <iostream>
#include <memory>

int main(int argc, char ** argv)
{
  small_rclcpp::init(argc, argv);
  const auto brake = std::make_shared<Brake>();
  const auto tester = std::make_shared<small_rclcpp::Node>("tester");
  const auto scans = tester->create_publisher<sensor_msgs::msg::LaserScan>("scan", 10);
  const auto handle_all = [&] {
      int handled = 0;
      for (auto ready = brake->wait(); !ready.empty(); ready = brake->wait()) {
        for (const auto & subscription : ready) {
          auto message = subscription->create_message();
          if (subscription->take_type_erased(message.get())) {
            subscription->handle_message(message);
            ++handled;
          }
        }
      }
      return handled;
    };
  const auto show = [&](int times) {
      sensor_msgs::msg::LaserScan scan;
      scan.range_min = 0.1;
      scan.range_max = 3.5;
      scan.ranges = {NAN, NAN, NAN};
      for (int i = 0; i < times; ++i) {scans->publish(scan);}
      scans->wait_for_all_acked(std::chrono::seconds(2));
      return handle_all();
    };
  for (int i = 0; i < 50 && show(1) == 0; ++i) {}
  std::cout << "\\n" << show(3) << std::endl;
}
"""


@tasks.add(limit_s=BUILD_S)
def a_node_of_your_own(workspace):
    built = cached(lambda: install_anew(workspace, 'scan_tools', 'small_rclcpp', 'brake'))
    walls = 3, 0.65, 0.45, 0.35, 0.75, math.nan, 3

    @cached
    def heard():
        needs(built)
        return hear(workspace, 'brake', Twist, 'cmd_vel', *walls)

    @cached
    def tried():
        """Return what our program prints that has the student's brake in it."""
        if heard().problem:  # a callback without an end would hold ours, too
            raise Failed(heard().problem, hint='')
        return run_ours(workspace, 'try_brake', TRY_BRAKE)

    def stops_without_a_distance():
        return all_of(
            brakes(heard(), (0.75, 0.5), (math.nan, 0.0), (3, 0.5), after=4),
            not any(EMPTY_OPTIONAL in line for line in tried())
            or f'of no known beam {READS_EMPTY}',
        )

    def stops_at_ctrl_c():
        heard().first(1)
        with Bench() as bench, Program(workspace.run('brake', 'brake')) as brake:
            commands = bench.hear('cmd_vel', Twist, RELIABLE)
            start(bench, brake, 'cmd_vel', commands)
            bench.say('scan', scan([3.5], limits=(0.1, 3.5)))
            bench.wait(lambda: commands)
            if not brake.end(limit_s=STOP_S):
                return 'Ctrl+C does not end it'
            bench.wait(lambda: commands and commands[-1].linear.x == 0.0, STOP_S)
        last = commands[-1].linear.x if commands else 'nothing'
        if 'shutdown' not in code_of(workspace, 'src/brake/src/brake.cpp'):
            return 'main ends without shutdown()'
        return expect(last, 0.0, 'the last speed (m/s) that the robot hears is')

    def is_called_brake():
        names = heard().names
        if heard().problem and not names:
            raise Failed(heard().problem, hint='')
        return 'brake' in names or f'its name is {" ".join(names) or "not to be seen"}'

    def has_depth_1():
        handled = (tried() or ['nothing'])[-1]
        if EMPTY_OPTIONAL in ' '.join(tried()):
            raise Failed(f'of no known beam {READS_EMPTY}', hint='')
        return handled == '1' or f'three scans came while it was busy: it handles {handled}, not 1'

    nearer = 'Is the nearer limit tested first?'
    unknown = 'if (distance && ...): without a distance the Twist stays as it was made, 0.'
    ctrl_c = 'main: spin(brake), then brake->stop(), then shutdown().'
    return [
        (
            'it drives, slows down, stops',
            lambda: brakes(heard(), (3, 0.5), (0.65, 0.2), (0.45, 0.2), (0.35, 0.0)),
            nearer,
        ),
        (
            'it drives on when the way is free',
            lambda: brakes(heard(), (0.35, 0.0), (0.75, 0.5), after=3),
            nearer,
        ),
        ('it stops if no beam is known', stops_without_a_distance, unknown),
        ('Ctrl+C stops the robot', stops_at_ctrl_c, ctrl_c),
        ('the node is called brake', is_called_brake, 'Node("brake"), after the colon'),
        (
            'its subscription has depth 1',
            has_depth_1,
            'create_subscription<LaserScan>("scan", 1, ...)',
        ),
    ]


@tasks.add(limit_s=BUILD_S)
def another_robot(workspace, ARGUMENTS):
    @cached
    def started():
        """Start the brake. Return the topics that it uses, and what it prints."""
        if isinstance(ARGUMENTS, str):
            raise Failed('ARGUMENTS is one text: write several, in ( )', hint='')
        if not workspace.file('install/brake/lib/brake/brake').exists():
            install_anew(workspace, 'scan_tools', 'small_rclcpp', 'brake')
        topics = set()
        with Bench() as bench, workspace.run('brake', 'brake', *ARGUMENTS) as process:

            def both_are_there():
                topics.clear()
                topics.update(topics_of_others(bench.tester))
                return len(topics) == 2 or not process.running

            bench.wait(both_are_there, START_S)
        return sorted(topics), ' '.join(process.lines)

    def uses_the_topics_of_blue():
        topics, printed = started()
        right = topics == ['/blue/cmd_vel', '/blue/scan']
        return right or f'it uses {", ".join(topics) or "nothing: " + printed[:300]}'

    def nothing_is_deprecated():
        _, printed = started()
        if 'deprecated' in printed:
            return 'rcl says that a rule without --ros-args is deprecated'
        return '[ERROR]' not in printed or f'rcl refuses a rule: {printed[:300]}'

    rule = '-r __ns:=/blue sets the namespace; or two rules for topics, each with its own -r.'
    return [
        ('it hears and drives the robot in /blue', uses_the_topics_of_blue, rule),
        ('rcl prints no warning', nothing_is_deprecated, 'All rules follow one --ros-args.'),
    ]


def topics_of_others(node):
    """Return the first topic that each other node hears, and those on which it says a Twist."""
    topics = set()
    for name, namespace in node.get_node_names_and_namespaces():
        if name in ('tester', '_session_log'):
            continue
        try:
            heard = node.get_subscriber_names_and_types_by_node(name, namespace)
            said = node.get_publisher_names_and_types_by_node(name, namespace)
        except Exception:  # noqa: BLE001, S112 - the node may be half known
            continue
        topics.update(topic for topic, _ in heard[:1])
        topics.update(topic for topic, kinds in said if 'geometry_msgs/msg/Twist' in kinds)
    return topics


# Two subscriptions have a message each, and the callback of each takes away that of the other: so
# one of the two has none left when its turn comes.
TRY_SPIN = """#include <chrono>
#include <cstdlib>
#include <iostream>
#include <thread>

#include <my_spin.hpp>
#include <std_msgs/msg/float32.hpp>

using std_msgs::msg::Float32;
using Subscription = small_rclcpp::Subscription<Float32>::SharedPtr;

void take_from(const Subscription & subscription)
{
  auto message = subscription->create_message();
  subscription->take_type_erased(message.get());
}

int main(int argc, char ** argv)
{
  small_rclcpp::init(argc, argv);
  const auto node = std::make_shared<small_rclcpp::Node>("try_spin");
  Subscription left, right;
  int calls = 0;
  left = node->create_subscription<Float32>("left", 1, [&](const Float32 &) {
      ++calls;
      take_from(right);
    });
  right = node->create_subscription<Float32>("right", 1, [&](const Float32 &) {
      ++calls;
      take_from(left);
    });
  const auto to_left = node->create_publisher<Float32>("left", 1);
  const auto to_right = node->create_publisher<Float32>("right", 1);
  while (node->wait().size() < 2) {
    to_left->publish(Float32());
    to_right->publish(Float32());
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  std::thread([&calls] {
      std::this_thread::sleep_for(std::chrono::seconds(1));
      std::cout << calls << std::endl;
      std::_Exit(0);
    }).detach();
  my_spin(node);
  std::this_thread::sleep_for(std::chrono::seconds(5));
}
"""


@tasks.add(limit_s=BUILD_S)
def your_executor(workspace):
    @cached
    def built():
        code = code_of(workspace, 'src/brake/src/brake.cpp')
        if not re.search(r'\bmy_spin\s*\(', code):
            raise Failed(CALLS_MY_SPIN)
        return install_anew(workspace, 'scan_tools', 'small_rclcpp', 'brake')

    @cached
    def answers_each():
        needs(built)
        heard = hear(workspace, 'brake', Twist, 'cmd_vel', 3, 0.55, 0.25)
        if heard.problem:
            return heard.problem
        return brakes(heard, (3, 0.5), (0.55, 0.2), (0.25, 0.0))

    def answers_after_a_pause():
        needs(answers_each, 'not judged: each scan must first be answered')
        heard = hear(workspace, 'brake', Twist, 'cmd_vel', 0.25, 2, 0.25, pause_s=0.3)
        if heard.problem:
            return heard.problem
        return brakes(heard, (0.25, 0.0), (2, 0.5), (0.25, 0.0))

    def handles_what_it_took():
        needs(built)
        calls = (run_ours(workspace, 'try_spin', TRY_SPIN) or ['none: it ended'])[-1]
        if calls == '2':
            return 'a callback was called though take_type_erased returned false'
        return calls == '1' or f'calls of a callback for one message: {calls}'

    def ends_with_ctrl_c():
        needs(built)
        with Bench() as bench, Program(workspace.run('brake', 'brake')) as brake:
            brake.wait(lambda: bench.tester.count_publishers('cmd_vel'), START_S)
            if not brake.end(limit_s=STOP_S):
                return 'Ctrl+C does not end it'
            return expect(brake.exit_code(), 0, 'it failed: its exit code is')

    hint = 'In the while: for (const auto & subscription : node->wait()) {...}'
    taken = 'Only what take_type_erased has taken is handled.'
    return [
        ('each scan is answered once', answers_each, hint),
        ('also after a pause, in which wait() returns none', answers_after_a_pause, taken),
        ('nothing is handled that was not taken', handles_what_it_took, taken),
        ('Ctrl+C ends it', ends_with_ctrl_c, 'Loop while (small_rclcpp::ok()).'),
    ]
