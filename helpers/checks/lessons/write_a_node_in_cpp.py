"""What the tasks of the lesson "Write a node in C++" are judged by."""

import math
import re
import shutil
import signal
import time
from contextlib import suppress

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
SCAN_S = 0.1  # between two scans of a laser
TRY_S = 20  # for a program of ours to end
START_S = 8  # for a program to start and be known to the others
CALLS_MY_SPIN = 'brake.cpp calls spin, not my_spin: run the cell above this task again'
NOT_ANSWERED = 'not judged: each scan must first be answered'
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
    ours = {f'src/{name}/{file}': text.replace('@PACKAGE@', name) for file, text in files.items()}
    with workspace.replaced(ours):
        install_anew(workspace, name)
        with workspace.run(name, name) as process:
            process.wait(TRY_S)
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


def hear(workspace, distances):
    """Run the watcher, show it a wall at each of these distances, and return what it says (m).

    Raises Failed if it does not say one number for each scan.
    """
    with Bench() as bench, Program(workspace.run('watcher', 'watcher')) as running:
        answers = bench.hear('nearest', Float32, RELIABLE)
        start(bench, running, 'nearest', answers)
        for sent, distance in enumerate(distances, 1):
            running.wait(lambda: True)  # it has not ended
            bench.publisher('scan', LaserScan).publish(scan([3.5, distance], limits=(0.1, 3.5)))
            running.wait(lambda sent=sent: len(answers) >= sent, STOP_S)
            bench.quiet()
            if len(answers) != sent:
                raise Failed(f'scans: {sent}, messages on nearest: {len(answers)}')
        return [round(message.data, 3) for message in answers]


def meet(bench, running, topic):
    """Wait until a program hears scans and says something. Raises Failed if it does not."""
    scans, tester = bench.publisher('scan', LaserScan), bench.tester
    running.wait(lambda: scans.get_subscription_count() and tester.count_publishers(topic), START_S)
    if not scans.get_subscription_count():
        raise Failed('nobody subscribes to scan: a member of the node must keep the subscription')
    if not tester.count_publishers(topic):
        raise Failed(f'nobody publishes on {topic}')


def start(bench, running, topic, answers):
    """Wait until a program answers a scan, and forget this answer. Raises Failed if none comes.

    A program that starts may not know yet who listens to it: then its first answers are lost.
    """
    meet(bench, running, topic)
    sent = 0
    while sent < FIRST_SCANS and not answers:
        bench.publisher('scan', LaserScan).publish(scan([3.5], limits=(0.1, 3.5)))
        running.wait(lambda: answers, ANSWER_S)
        sent += 1
    if not answers:
        raise Failed(f'scans: {sent}, messages on {topic}: 0')
    while sent > 1 and bench.wait(lambda: len(answers) > 1, LATE_S):
        answers.pop()  # to one of the other first scans
    answers.clear()


def show(bench, running, wall, until):
    """Show a program a wall (m) until a condition holds, or for STOP_S.

    As a laser does, we say the same again and again: on a busy machine a scan may be too old when
    its turn comes.
    """
    limit = time.monotonic() + STOP_S
    while not until() and time.monotonic() < limit:
        bench.publisher('scan', LaserScan).publish(scan([3.5, wall], limits=(0.1, 3.5)))
        running.wait(until, SCAN_S)


def last(commands):
    """Return the speed (m/s) of the last command, or None."""
    return round(commands[-1].linear.x, 3) if commands else None


def drives(workspace, *pairs):
    """Run the brake, and show it walls (m), each until it commands its speed (m/s).

    Return the names of its nodes. Raises Failed if it commands another speed, or nothing.
    """
    with Bench() as bench, Program(workspace.run('brake', 'brake')) as running:
        commands = bench.hear('cmd_vel', Twist, RELIABLE)
        try:
            meet(bench, running, 'cmd_vel')
            for wall, speed in pairs:
                commands.clear()
                show(bench, running, wall, lambda speed=speed: last(commands) == speed)
                if not commands:
                    raise Failed('scans come, and on cmd_vel comes nothing')
                if last(commands) != speed:
                    raise Failed(
                        f'a wall at {wall} m: its speed (m/s) is {last(commands)}, not {speed}'
                    )
            bench.wait(lambda: names_of_others(bench.tester), START_S)
            return names_of_others(bench.tester)
        finally:
            running.end(signal.SIGKILL)  # a callback without an end would hear no Ctrl+C


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
        return expect(hear(workspace, distances), [*distances], f'walls at {distances} m; it says')

    hint = (
        'Four commands: find_package, add_executable, target_link_libraries, install(TARGETS ...).'
    )
    finds = 'find_package(NAME REQUIRED), and what it brings in target_link_libraries.'
    return [
        ('it builds', built, hint),
        ('it finds and links each package that it uses', names_what_it_uses, finds),
        ('it runs and says the nearest range', lambda: watches(2.5, 0.75), hint),
    ]


# What the student's brake commands, scan by scan: it runs in our program, so only we let it go on.
# What it commands while it handles a scan is the answer, all else is its timer's. A line that
# begins with @ says: after how many ms, what has come, the speeds. On a busy machine, a new scan
# may be old before its turn comes: then it is `late`, is not judged, and another one is shown.
TRY_BRAKE = """#define _GLIBCXX_ASSERTIONS
#define main main_of_the_student
#include "brake.cpp"
#undef main
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

using Steady = std::chrono::steady_clock;
using Ready = std::vector<small_rclcpp::SubscriptionBase::SharedPtr>;

int handle(const Ready & ready)
{
  int handled = 0;
  for (const auto & subscription : ready) {
    auto message = subscription->create_message();
    if (subscription->take_type_erased(message.get())) {
      subscription->handle_message(message);
      ++handled;
    }
  }
  return handled;
}

int main(int argc, char ** argv)
{
  small_rclcpp::init(argc, argv);
  const auto brake = std::make_shared<Brake>();
  const auto tester = std::make_shared<small_rclcpp::Node>("tester");
  const auto scans = tester->create_publisher<sensor_msgs::msg::LaserScan>("scan", 10);
  std::vector<double> speeds;
  const auto listener = tester->create_subscription<geometry_msgs::msg::Twist>("cmd_vel", 100,
      [&](const geometry_msgs::msg::Twist & twist) {speeds.push_back(twist.linear.x);});
  // So its wait() takes no longer.
  const auto tick = tester->create_wall_timer(std::chrono::milliseconds(20), [] {});
  auto last_scan = Steady::now();
  const auto say = [&](const std::string & what, bool is_answer = false) {
      for (int i = 0; i < 100 && is_answer && speeds.empty(); ++i) {handle(tester->wait());}
      while (handle(tester->wait()) > 0) {}
      const std::chrono::duration<double, std::milli> since = Steady::now() - last_scan;
      std::cout << "\\n@" << since.count() << " " << what;
      for (const double speed : speeds) {std::cout << " " << speed;}
      std::cout << std::endl;
      speeds.clear();
    };
  const auto show = [&](double wall, double age_s, int times) {
      sensor_msgs::msg::LaserScan scan;
      scan.range_min = 0.1;
      scan.range_max = 3.5;
      scan.ranges = {NAN, NAN, NAN};
      if (!std::isnan(wall)) {scan.ranges = {3.5, static_cast<float>(wall)};}
      for (int left = 9; ; --left) {
        const auto stamp_ns = brake->now().nanoseconds() - static_cast<std::int64_t>(1e9 * age_s);
        scan.header.stamp.sec = stamp_ns / 1'000'000'000;
        scan.header.stamp.nanosec = stamp_ns % 1'000'000'000;
        for (int i = 0; i < times; ++i) {scans->publish(scan);}
        scans->wait_for_all_acked(std::chrono::seconds(2));
        Ready ready;
        for (int i = 0; i < 10 && ready.empty(); ++i) {ready = brake->wait();}
        say("timer");
        last_scan = Steady::now();
        int handled = handle(ready);
        const bool has_aged = brake->now().nanoseconds() - stamp_ns > 400'000'000;
        const bool is_late = left > 0 && age_s < 0.4 && has_aged;
        say(is_late ? "late" : std::to_string(wall), true);
        while ((ready = brake->wait()).size() > 0) {
          handled += handle(ready);
          last_scan = Steady::now();
        }
        if (!is_late) {return handled;}
      }
    };
  for (int i = 0; i < 50 && show(3.0, 0.0, 1) == 0; ++i) {}
  say("begin");
  for (const double wall : {3.0, 0.65, 0.45, 0.35, 0.75, double{NAN}, 3.0}) {show(wall, 0.0, 1);}
  say("ages");
  for (const double age_s : {0.1, 0.8, 0.1}) {show(2.0, age_s, 1);}
  say("silence");
  for (int i = 0; i < 20 && speeds.empty(); ++i) {
    brake->wait();
    handle(tester->wait());
  }
  say("timer");
  show(2.5, 0.0, 1);
  say("queue");
  const int handled = show(NAN, 0.0, 3);
  std::cout << "\\n@0 handled " << handled << std::endl;
}
"""


class Tried:
    """What our program prints that has the student's brake in it."""

    def __init__(self, lines):
        self.reads_empty = any(EMPTY_OPTIONAL in line for line in lines)
        self.parts = {'': []}  # of (ms since the last scan, what has come, speeds)
        for line in lines:
            if not line.startswith('@'):
                continue
            since_ms, what, *speeds = line[1:].split()
            if what in ('begin', 'ages', 'silence', 'queue'):
                part = self.parts[what] = []
                continue
            part = self.parts[[*self.parts][-1]]
            part.append((float(since_ms), what, [round(float(speed), 3) for speed in speeds]))

    def answers(self, part):
        """Return what it commanded for each scan of a part. Raises Failed if it ended before."""
        if part not in self.parts:
            raise Failed(f'of no known beam {READS_EMPTY}' if self.reads_empty else 'it ended')
        return [speeds for _, what, speeds in self.parts[part] if what not in ('timer', 'late')]

    def of_timer(self, part):
        """Return pairs of the ms since the last scan and what it commanded beside its answers."""
        return [(ms, speeds) for ms, what, speeds in self.parts.get(part, []) if what == 'timer']


@tasks.add(limit_s=BUILD_S)
def a_node_of_your_own(workspace):
    built = cached(lambda: install_anew(workspace, 'scan_tools', 'small_rclcpp', 'brake'))

    @cached
    def runs():
        needs(built)
        return drives(workspace, (3, 0.5))

    @cached
    def tried():
        runs()  # a callback without an end would hold our program, too
        return Tried(run_ours(workspace, 'try_brake', TRY_BRAKE))

    def brakes(walls, speeds, after=0):
        answers = tried().answers('begin')[after:][: len(walls)]
        if any(len(one) != 1 for one in answers):
            counts = [len(one) for one in answers]
            return f'one command for each scan is right; of {len(answers)} scans its are {counts}'
        found = [speed for [speed] in answers]
        return expect(found, [*speeds], f'walls at {walls} m: its speeds (m/s) are')

    def stops_without_a_distance():
        tried().answers('queue')  # the last scans are without a distance, too
        return brakes((0.75, math.nan, 3), (0.5, 0.0, 0.5), after=4)

    def stops_for_old_scans():
        answers = tried().answers('ages')
        said = 'scans are 0.1, 0.8 and 0.1 s old, the wall is at 2 m: its speeds (m/s) are'
        return expect([one[-1] if one else None for one in answers], [0.5, 0.0, 0.5], said)

    def watches():
        before = [*tried().of_timer('begin'), *tried().of_timer('ages')]
        early = [(ms, speeds) for ms, speeds in before if speeds and ms < 400]
        if early:
            return f'{early[0][0]:.0f} ms after a scan a timer commands {early[0][1][0]}'
        silent = next((speeds for _, speeds in tried().of_timer('silence') if speeds), [])
        if not silent:
            return 'no scan comes, and it commands nothing'
        if set(silent) != {0.0}:
            return f'no scan comes, and it commands {max(silent)}'
        again = [speed for speeds in tried().answers('silence') for speed in speeds]
        return expect(again, [0.5], 'scans come again: its speed (m/s) is')

    def send_ctrl_c():
        """Return whether the program ends at Ctrl+C, and the last speed that we have heard."""
        with Bench() as bench, Program(workspace.run('brake', 'brake')) as brake:
            commands = bench.hear('cmd_vel', Twist, RELIABLE)
            meet(bench, brake, 'cmd_vel')
            show(bench, brake, 3, lambda: last(commands) == 0.5)
            has_ended = brake.end(limit_s=STOP_S)
            bench.wait(lambda: last(commands) == 0.0, STOP_S if has_ended else 0)
            return has_ended, last(commands)

    def stops_at_ctrl_c():
        runs()
        has_ended, speed = send_ctrl_c()
        if not has_ended:  # a right program may hang, too, but seldom: tools/UPGRADING.md, Fast DDS
            has_ended, speed = send_ctrl_c()
        if not has_ended:
            return 'Ctrl+C does not end it'
        if 'shutdown' not in code_of(workspace, 'src/brake/src/brake.cpp'):
            return 'main ends without shutdown()'
        return expect(speed, 0.0, 'the last speed (m/s) that the robot hears is')

    def is_called_brake():
        names = runs()
        return 'brake' in names or f'its name is {" ".join(names) or "not to be seen"}'

    def has_depth_1():
        tried().answers('queue')
        [handled] = [speeds for _, what, speeds in tried().parts['queue'] if what == 'handled']
        return expect(handled, [1], 'three scans came while it was busy: it handles')

    nearer = 'Is the nearer limit tested first?'
    unknown = 'if (distance && ...): without a distance the Twist stays as it was made, 0.'
    ctrl_c = 'main: spin(brake), then brake->stop(), then shutdown().'
    age = '(now() - scan.header.stamp).seconds() is its age.'
    timer = 'The lambda of timer_ compares Clock::now() - came_ with 500ms.'
    return [
        (
            'it drives, slows down, stops',
            lambda: brakes((3, 0.65, 0.45, 0.35), (0.5, 0.2, 0.2, 0.0)),
            nearer,
        ),
        (
            'it drives on when the way is free',
            lambda: brakes((0.35, 0.75), (0.0, 0.5), after=3),
            nearer,
        ),
        ('it stops if no beam is known', stops_without_a_distance, unknown),
        ('it stops if a scan is old', stops_for_old_scans, age),
        ('it stops if no scan comes', watches, timer),
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
# one of the two has none left when its turn comes. Then three messages come, with pauses.
TRY_SPIN = """#include <atomic>
#include <chrono>
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

void pause_ms(int time) {std::this_thread::sleep_for(std::chrono::milliseconds(time));}

int main(int argc, char ** argv)
{
  small_rclcpp::init(argc, argv);
  const auto node = std::make_shared<small_rclcpp::Node>("try_spin");
  Subscription left, right, single;
  std::atomic<int> calls{0}, answers{0};
  left = node->create_subscription<Float32>("left", 1, [&](const Float32 &) {
      ++calls;
      take_from(right);
    });
  right = node->create_subscription<Float32>("right", 1, [&](const Float32 &) {
      ++calls;
      take_from(left);
    });
  single = node->create_subscription<Float32>("single", 10, [&](const Float32 &) {++answers;});
  const auto to_left = node->create_publisher<Float32>("left", 1);
  const auto to_right = node->create_publisher<Float32>("right", 1);
  const auto to_single = node->create_publisher<Float32>("single", 1);
  while (node->wait().size() < 2) {
    to_left->publish(Float32());
    to_right->publish(Float32());
  }
  pause_ms(300);
  std::thread([&] {
      pause_ms(1000);
      for (int sent = 1; sent <= 3; ++sent) {
        to_single->publish(Float32());
        for (int i = 0; i < 100 && answers < sent; ++i) {pause_ms(10);}
        pause_ms(300);
      }
      std::cout << "\\n" << calls << " " << answers << std::endl;
      std::_Exit(0);
    }).detach();
  my_spin(node);
  pause_ms(9000);
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
    def counts():
        """Return the calls for two messages of which one is taken away, and the calls for three."""
        lines = run_ours(workspace, 'try_spin', TRY_SPIN)
        if not lines:
            raise Failed('it ended')
        return [int(count) for count in lines[-1].split()]

    @cached
    def answers():
        needs(built)
        return bool(drives(workspace, (3, 0.5), (0.55, 0.2), (0.25, 0.0)))

    def answers_after_a_pause():
        needs(answers, NOT_ANSWERED)
        _, called = counts()
        return expect(called, 3, 'three messages come, 0.3 s apart; calls of the callback')

    def handles_what_it_took():
        needs(answers, NOT_ANSWERED)
        calls, _ = counts()
        if calls == 2:
            return 'a callback was called though take_type_erased returned false'
        return calls == 1 or f'calls of a callback for one message: {calls}'

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
        ('scans are answered', answers, hint),
        (
            'one call each, also after a pause in which wait() returns none',
            answers_after_a_pause,
            taken,
        ),
        ('nothing is handled that was not taken', handles_what_it_took, taken),
        ('Ctrl+C ends it', ends_with_ctrl_c, 'Loop while (small_rclcpp::ok()).'),
    ]
