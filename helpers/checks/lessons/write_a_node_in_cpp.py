"""What the tasks of the lesson "Write a node in C++" are judged by."""

import math
import re
import shutil
import time
from contextlib import suppress

from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32

from helpers.checks.bench import RELIABLE, Bench
from helpers.checks.builds import build
from helpers.checks.errors import Failed
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks

tasks = Tasks()
check = tasks.check

BUILD_S = 90  # for a point that builds
FIRST_SCANS = 10  # at most, until a program is known to answer
ANSWER_S = 0.5  # after each of these
LATE_S = 1.0  # for an answer to another of these
STOP_S = 5  # until the last command of a program is here
START_S = 8  # for a program to start and be known to the others
CALLS_MY_SPIN = 'brake.cpp calls spin, not my_spin: run the cell above this task again'


def install_anew(workspace, *packages):
    """Build packages, and return True. Raises Failed with the first error.

    A build takes nothing away: what an earlier try of the last package has installed would stay.
    It is removed before. The other packages stay, and need not be compiled again.
    """
    shutil.rmtree(workspace.file(f'install/{packages[-1]}'), ignore_errors=True)
    build(workspace, *packages)
    return True


@tasks.add(limit_s=BUILD_S)
def the_nearest_range(workspace):
    built = cached(lambda: install_anew(workspace, 'scan_tools'))

    def nearest_is(right, range_min, range_max, *ranges):
        built()
        numbers = map(str, (range_min, range_max, *ranges))
        with workspace.run('scan_tools', 'try_nearest', *numbers) as program:
            program.wait()
        found = program.lines[0] if program.lines else 'no line'
        with suppress(ValueError):
            found = f'{float(found):g}'
        of = ', '.join(map(str, ranges))
        return found == right or (
            f'of {of}, valid from {range_min} to {range_max}: {found}, not {right}'
        )

    def limits_are_valid():
        results = nearest_is('0.5', 0.5, 2.5, 2.5, 0.5), nearest_is('2.5', 0.5, 2.5, 2.5)
        return next((result for result in results if result is not True), True)

    known = 'Is it in the range? Two comparisons with && in between; both are false for NaN.'
    half = 'Count the known ones. If 2 * known < scan.ranges.size(), return std::nullopt.'
    return [
        (
            'the smallest one, wherever it is',
            lambda: nearest_is('0.5', 0.1, 3.5, 2, 0.5, 1),
            'A loop over scan.ranges; *found is the smallest one so far, if there is one.',
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
        (
            'the limits themselves are valid',
            limits_are_valid,
            'A range is valid if range_min <= range and range <= range_max.',
        ),
        (
            'one known beam of three is not enough',
            lambda: nearest_is('nothing', 0.1, 3.5, 'nan', 0, 2),
            half,
        ),
    ]


def wake(bench, process, scans, answers):
    """Publish scans until the program answers one. Return how many.

    A program that starts may not know yet who listens to it: then its first answers are lost.
    """
    scan = LaserScan(range_min=0.1, range_max=3.5, ranges=[3.5])
    for sent in range(FIRST_SCANS):
        if answers or not process.running:
            return sent
        scans.publish(scan)
        bench.wait(lambda: answers, ANSWER_S)
    return FIRST_SCANS


def answers_to(workspace, program, kind, topic, *distances, pause_s=0.0):
    """Publish a scan for each distance. Return the node's name, and what it says to each scan."""
    with Bench() as bench, workspace.run(program, program) as process:
        answers = bench.hear(topic, kind, RELIABLE)
        scans, tester = bench.publisher('scan', LaserScan), bench.tester

        def is_known():
            return scans.get_subscription_count() and tester.count_publishers(topic)

        bench.wait(lambda: not process.running or is_known(), START_S)
        sent = wake(bench, process, scans, answers)
        while sent > 1 and bench.wait(lambda: len(answers) > 1, LATE_S):
            answers.pop()  # to one of the other first scans
        answers.clear()
        for number, distance in enumerate(distances):
            if not process.running:
                last = ' / '.join(process.lines[-2:]) or 'it printed nothing'
                raise Failed(f'the program has ended: {last}')
            ranges = [math.nan] * 3 if math.isnan(distance) else [3.5, distance]
            scans.publish(LaserScan(range_min=0.1, range_max=3.5, ranges=ranges))
            bench.wait(lambda sent=number + 1: len(answers) >= sent)
            bench.quiet()
            if len(answers) != number + 1:
                raise Failed(f'scans: {number + 1}, messages on {topic}: {len(answers)}')
            time.sleep(pause_s)

        def names():
            return [name for name in tester.get_node_names() if name != 'tester' and name[0] != '_']

        # A program says how its nodes are called after the topics that they use.
        bench.wait(lambda: names() or not process.running, START_S)
        seen = names()
    return seen, answers[: len(distances)]  # when it ends, it stops the robot


def code_of(workspace, file):
    """Return a file of CMake or C++ without its comments."""
    comment = r'#.*' if file.endswith('CMakeLists.txt') else r'//.*|/\*.*?\*/'
    return re.sub(comment, '', workspace.file(file).read_text())


@tasks.add(limit_s=BUILD_S)
def its_cmakelists(workspace):
    packages = 'scan_tools', 'small_rclcpp', 'std_msgs'
    built = cached(lambda: install_anew(workspace, 'scan_tools', 'small_rclcpp', 'watcher'))

    def finds_the_packages():
        """Test the text: a package that another one has found is there, too."""
        code = code_of(workspace, 'src/watcher/CMakeLists.txt')
        missing = [
            package
            for package in packages
            if not re.search(rf'find_package\s*\(\s*"?{package}\b', code)
        ]
        if not missing or 'foreach' in code.lower():
            return True
        return f'no find_package for {", ".join(missing)}'

    def watches(*distances):
        built()
        _, answers = answers_to(workspace, 'watcher', Float32, 'nearest', *distances)
        found = [round(message.data, 3) for message in answers]
        return found == [*distances] or f'walls at {distances} m; it says {found}'

    hint = (
        'Four commands: find_package, add_executable, target_link_libraries, install(TARGETS ...).'
    )
    return [
        ('it builds', built, hint),
        ('it finds each package that it uses', finds_the_packages, 'find_package(NAME REQUIRED)'),
        ('it runs and says the nearest range', lambda: watches(2.5, 0.75), hint),
    ]


def brakes(workspace, *pairs, pause_s=0.0):
    """Put walls before the brake, and compare the speeds that it gives. Return True, or these."""
    distances, speeds = zip(*pairs, strict=True)
    _, answers = answers_to(workspace, 'brake', Twist, 'cmd_vel', *distances, pause_s=pause_s)
    found = [round(message.linear.x, 3) for message in answers]
    right = found == list(speeds)
    return right or f'walls at {distances} m: {found} m/s, not {list(speeds)}'


@tasks.add(limit_s=BUILD_S)
def a_node_of_your_own(workspace):
    built = cached(lambda: install_anew(workspace, 'scan_tools', 'small_rclcpp', 'brake'))

    def drives(*pairs):
        return built() and brakes(workspace, *pairs)

    def stops_at_ctrl_c():
        built()
        with Bench() as bench, workspace.run('brake', 'brake') as process:
            commands = bench.hear('cmd_vel', Twist, RELIABLE)
            scans = bench.publisher('scan', LaserScan)
            bench.wait(lambda: not process.running or scans.get_subscription_count(), START_S)
            wake(bench, process, scans, commands)
            process.stop()
            bench.wait(lambda: commands and commands[-1].linear.x == 0.0, STOP_S)
        last = commands[-1].linear.x if commands else 'nothing'
        return last == 0.0 or f'the last that the robot hears: {last}'

    def is_called_brake():
        built()
        names, _ = answers_to(workspace, 'brake', Twist, 'cmd_vel', 3.0)
        return 'brake' in names or f'its name is {" ".join(names) or "not to be seen"}'

    def has_depth_1():
        """Test the text: other processes do not see the depth of a subscription."""
        code = code_of(workspace, 'src/brake/src/brake.cpp')
        depth = re.search(r'create_subscription\s*<.*?>\s*\(\s*"/?scan"\s*,\s*(\d+)', code)
        if depth is None:
            return 'create_subscription' in code or 'it has no subscription'
        return depth[1] == '1' or f'the depth of its subscription is {depth[1]}'

    hint = (
        'Is the nearer limit tested first? main keeps the node: '
        'const auto brake = std::make_shared<Brake>();'
    )
    return [
        (
            'it drives, slows down, stops',
            lambda: drives((3, 0.5), (0.55, 0.2), (0.25, 0.0)),
            hint,
        ),
        ('it drives on when the way is free', lambda: drives((0.25, 0.0), (2, 0.5)), hint),
        (
            'it stops if no beam is known',
            lambda: drives((3, 0.5), (math.nan, 0.0), (3, 0.5)),
            'if (distance && ...): without a distance the Twist stays as it was made, 0.',
        ),
        (
            'Ctrl+C stops the robot',
            stops_at_ctrl_c,
            'main: spin(brake), then brake->stop(), then shutdown().',
        ),
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
            raise Failed('ARGUMENTS is one text: write several, in ( )')
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
TRY_SPIN_CMAKE = """cmake_minimum_required(VERSION 3.8)
project(try_spin)
find_package(ament_cmake REQUIRED)
find_package(small_rclcpp REQUIRED)
find_package(std_msgs REQUIRED)
find_package(Threads REQUIRED)
add_executable(try_spin try_spin.cpp)
target_include_directories(try_spin PRIVATE ../brake/src)
target_link_libraries(try_spin PRIVATE
  small_rclcpp::small_rclcpp ${std_msgs_TARGETS} Threads::Threads)
install(TARGETS try_spin DESTINATION lib/${PROJECT_NAME})
ament_package()
"""
TRY_SPIN_XML = """<package format="3"><name>try_spin</name><version>0.0.0</version>
<description>Spins</description><maintainer email="you@example.com">you</maintainer>
<license>Apache-2.0</license><buildtool_depend>ament_cmake</buildtool_depend>
<depend>small_rclcpp</depend><depend>std_msgs</depend>
<export><build_type>ament_cmake</build_type></export></package>
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
        return built() and brakes(workspace, (3, 0.5), (0.55, 0.2), (0.25, 0.0))

    def answers_after_a_pause():
        if answers_each() is not True:
            return 'not judged: each scan must first be answered'
        return brakes(workspace, (0.25, 0.0), (2, 0.5), (0.25, 0.0), pause_s=0.3)

    def handles_what_it_took():
        built()
        workspace.write('src/try_spin/try_spin.cpp', TRY_SPIN)
        workspace.write('src/try_spin/CMakeLists.txt', TRY_SPIN_CMAKE)
        workspace.write('src/try_spin/package.xml', TRY_SPIN_XML)
        try:
            install_anew(workspace, 'try_spin')
            with workspace.run('try_spin', 'try_spin') as process:
                process.wait()
        finally:
            shutil.rmtree(workspace.file('src/try_spin'))
        calls = process.lines[-1] if process.lines else 'none: it ended'
        if calls == '2':
            return 'a callback was called though take_type_erased returned false'
        return calls == '1' or f'calls of a callback for one message: {calls}'

    def ends_with_ctrl_c():
        built()
        with Bench() as bench, workspace.run('brake', 'brake') as process:
            tester = bench.tester
            bench.wait(lambda: not process.running or tester.count_publishers('cmd_vel'), START_S)
            process.stop()
            code = process.wait()
        return code == 0 or f'it had to be killed, or it failed: {code}'

    hint = 'In the while: for (const auto & subscription : node->wait()) {...}'
    taken = 'Only what take_type_erased has taken is handled.'
    return [
        ('each scan is answered once', answers_each, hint),
        ('also after a pause, in which wait() returns none', answers_after_a_pause, taken),
        ('nothing is handled that was not taken', handles_what_it_took, taken),
        ('Ctrl+C ends it', ends_with_ctrl_c, 'Loop while (small_rclcpp::ok()).'),
    ]
