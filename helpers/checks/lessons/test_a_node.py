"""What the tasks of the lesson "Test a node" are judged by: the student's tests test the tests.

The sources below are versions of what the student tests, right ones and wrong ones.
"""

import re

from helpers.checks.builds import build
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks
from helpers.trials import BRAKE, BUSY, Device, planted, run_busy, run_tests, state_after

tasks = Tasks()
check = tasks.check

PACKAGE = 'src/brake_pkg'


def is_caught(runs, name, right=()):
    """Return the test of a point: the student's tests must fail for this version.

    They must pass for the right versions: tests that fail for each version find no bug.
    """

    def test():
        if not all(runs()[version].passes for version in right):
            return 'not judged: your tests must first pass for the right ones'
        run = runs()[name]
        return run.fails or f'pytest: {run.says}'

    return test


def all_pass(runs, names):
    """Return the test of a point: the student's tests must pass for these versions."""

    def test():
        wrong = [name for name in names if not runs()[name].passes]
        return not wrong or f'with {names[wrong[0]]} pytest: {runs()[wrong[0]].says}'

    return test


def run_ours(workspace, name, source, module, versions):
    """Run tests of ours beside the student's, each with its version. Their file goes again."""
    file = workspace.file(f'{PACKAGE}/test/{name}')
    file.write_text(source)
    try:
        return run_tests(workspace, PACKAGE, f'test/{name}', module, versions, only=True)
    finally:
        file.unlink()


# --- Task 1: a function

SPEED = """import math
def safe_speed(distance_m, full_mps=0.25):
    if math.isnan(distance_m):
        return 0.0
    return full_mps * min(1.0, max(0.0, 2 * (distance_m - 0.5)))
"""
WRONG_SPEEDS = {
    'drives on near a wall': planted(
        SPEED, 'max(0.0, 2 * (distance_m - 0.5))', 'abs(2 * distance_m - 1)'
    ),
    'has no slow zone': planted(SPEED, '2 * (distance_m - 0.5)', 'distance_m > 0.5'),
    'treats nan as free': planted(SPEED, 'return 0.0', 'return full_mps'),
    'stops if nothing is in sight': planted(SPEED, 'isnan(distance_m)', 'isfinite(distance_m) - 1'),
    'still moves at 0.5 m': planted(SPEED, 'max(0.0', '(distance_m >= 0.5) * max(0.1'),
}
ROWS = {
    'drives on near a wall': 'A row with a distance below 0.5 m.',
    'has no slow zone': 'A row with a distance between 0.5 and 1.0 m.',
    'treats nan as free': 'A row with math.nan.',
    'stops if nothing is in sight': 'A row with math.inf.',
    'still moves at 0.5 m': 'A row with 0.5 m.',
}


@tasks.add(limit_s=60)
def test_the_function(workspace, tests):
    versions = {'our': '', 'another': SPEED, **WRONG_SPEEDS}
    runs = cached(lambda: run_tests(workspace, PACKAGE, tests, 'brake_pkg.speed', versions))
    right = {'our': 'our function', 'another': 'another function'}
    return [
        ('it passes for two right functions', all_pass(runs, right), 'Is each row what it says?'),
        *(
            (f'it fails for one that {name}', is_caught(runs, name, right), ROWS[name])
            for name in WRONG_SPEEDS
        ),
    ]


# --- Task 2: a fixture

ALONE = """import os, pytest, rclpy
from domain_coordinator import domain_id

before = []

def test_alone(bench):
    number = bench.node.context.get_domain_id()
    assert number != int(os.environ['ROS_DOMAIN_ID']), 'it is in the domain of this notebook'
    with pytest.raises(RuntimeError), domain_id(selector=lambda: number):
        assert not number, 'another test can take its domain'

@pytest.mark.parametrize('one', [1, 2])
def test_again(bench, one):
    before.append(bench)

def test_again_ends():
    assert not rclpy.ok(), 'rclpy is not shut down after a test'
    for node in before[0].brake, before[0].node:
        assert not list(node.publishers), f'the node {node.get_name()} is still there after a test'
"""


@tasks.add(limit_s=60)
def a_domain_of_its_own(workspace):
    @cached
    def runs():
        versions = {'alone': BRAKE, 'again': BRAKE}
        return run_ours(workspace, 'alone.py', ALONE, 'brake_pkg.brake', versions)

    def passes(name):
        return lambda: runs()[name].passes or f'with our test, {runs()[name].says}'

    inside = 'with domain_id() as number: all other lines are in it.'
    after = 'After yield: destroy_node(), twice, and shutdown().'
    return [
        ('its domain is its own', passes('alone'), inside),
        ('it clears up after each test', passes('again'), after),
    ]


# --- Tasks 3 and 5: a flaky test

LATE = (
    BRAKE
    + """
Quick = Brake

class Brake(Quick):
    def create_subscription(self, *arguments):
        def connect():
            late.cancel()
            Quick.create_subscription(self, *arguments)

        late = self.create_timer(0.4, connect)
"""
)


@tasks.add(limit_s=60)
def catch_it(workspace, tests):
    busy = cached(lambda: run_busy(workspace, tests))

    def runs_nine_times():
        run = busy()
        count = run.passed + len(run.failed)
        return count == 9 or f'number of runs: {count}; pytest: {run.says}'

    def is_flaky():
        run = busy()
        return (run.passed > 0 and run.fails) or f'all runs are alike: {run.says}'

    parametrize = "@pytest.mark.parametrize('again', range(9)), and (bench, again)"
    return [
        ('pytest runs it nine times', runs_nine_times, parametrize),
        ('some runs pass, and some fail', is_flaky, 'Leave the rest of the test as it is.'),
    ]


# --- Task 4: a wait

WAITS = """import pytest
from rclpy.executors import SingleThreadedExecutor
from waiting import wait_until
import rclpy

CASES = {'events_1': (9, 1, 5), 'events_7': (9, 7, 5), 'at_once': (9, 0, 5), 'in_vain': (3, 4, 1)}

@pytest.mark.parametrize('ticks, wanted, limit_s', CASES.values(), ids=CASES)
def test_waits(ticks, wanted, limit_s):
    seen, said = [], 'it returned'
    rclpy.init()
    node, executor = rclpy.create_node('ticking'), SingleThreadedExecutor()
    executor.add_node(node)
    node.create_timer(0.05, lambda: len(seen) < ticks and seen.append(1))
    try:
        wait_until(executor, lambda: len(seen) >= wanted, limit_s)
    except AssertionError:
        said = 'it raised AssertionError'
    node.destroy_node()
    rclpy.shutdown()
    right = 'it returned' if wanted <= ticks else 'it raised AssertionError'
    assert said == right and len(seen) == min(ticks, wanted), f'{said} after {len(seen)} events'
"""


@tasks.add(limit_s=60)
def wait_for_an_event(workspace):
    @cached
    def runs():
        versions = dict.fromkeys(('events', 'at_once', 'in_vain'), '')
        return run_ours(workspace, 'our_waits.py', WAITS, 'none', versions)

    def passes(name):
        return lambda: runs()[name].passes or f'with our test, {runs()[name].says}'

    at_once = 'Ask holds() before you spin.'
    end = 'time.monotonic() < end, and assert holds().'
    return [
        ('it waits for 1 and for 7 events', passes('events'), 'while'),
        ('it does not wait for what is true already', passes('at_once'), at_once),
        ('after 1 s without it, it raises AssertionError', passes('in_vain'), end),
    ]


@tasks.add(limit_s=60)
def fix_the_flaky_test(workspace, tests):
    @cached
    def runs():
        versions = {
            'busy': BUSY.replace('0.4', '2'),
            'late': LATE,
            'wrong': planted(BRAKE, 'distance(message)', '9.0'),
        }
        return run_tests(workspace, PACKAGE, tests, 'brake_pkg.brake', versions, most_failures=9)

    def passes_nine_times():
        run = runs()['busy']
        count = run.passed + len(run.failed)
        return (run.passed == 9 and run.passes) or f'of {count} runs: {without_run(run.says)}'

    def fails_for_wrong():
        if not (runs()['busy'].passes or runs()['late'].passes):
            return 'not judged: it passes for no right node'
        return is_caught(runs, 'wrong')()

    def passes_late():
        return runs()['late'].passes or without_run(runs()['late'].says)

    return [
        ('on the busy computer all nine runs pass', passes_nine_times, 'Wait for bench.speeds.'),
        ('it passes if the brake connects late', passes_late, 'Wait for a subscriber, then send.'),
        ('it fails for a node that drives on', fails_for_wrong, 'Keep the assert.'),
    ]


def without_run(text):
    """Leave out which of the nine runs it was: on a busy computer it is another one."""
    return re.sub(r'(test_\w+)\[.*?\]', r'\1', text)


# --- Task 6: colcon


@tasks.add(limit_s=90)
def run_them(workspace):
    def is_run():
        build(workspace, 'brake_pkg', anew=True)
        file = f'{PACKAGE}/test/test_planted.py'
        workspace.write(file, 'def test_planted():\n    assert 1 == 2\n')
        summary = workspace.terminal(
            'colcon test --packages-select brake_pkg --pytest-args -k "not flake8 and not pep257"'
            ' > test.txt 2>&1; colcon test-result | tail -1'
        )
        workspace.file(file).unlink()
        counts = {word: int(n) for n, word in re.findall(r'(\d+) (\w+?)s?\b', summary)}
        right = counts['test'] > 2 and counts['failure'] == 1 and not counts['error']
        return right or f'it ran {counts["test"]} tests, of which {counts["failure"]} failed'

    def has_executable():
        printed = workspace.terminal("""source install/setup.bash
            python -c 'from importlib.metadata import distribution
for entry in distribution("brake_pkg").entry_points: print(entry.name, entry.value)' 2>&1 | tail -1
        """)
        return printed == 'brake brake_pkg.brake:main' or f'it has {printed or "no executable"}'

    return [
        ('colcon runs pytest', is_run, "extras_require={'test': [...]}"),
        ('it has the executable brake', has_executable, "'brake = brake_pkg.brake:main'"),
    ]


# --- Task 7: a lifecycle

OURS = """import pytest
from rcl_interfaces.msg import Log
from rclpy.lifecycle import TransitionCallbackReturn as Return
from rclpy.parameter import Parameter
from waiting import wait_until

def say(bench, *distances):
    wait_until(bench.executor, bench.sensor.get_subscription_count)
    wait_until(bench.executor, lambda: bench.node.count_publishers('cmd_vel'))
    for distance in distances:
        bench.send(distance)

def up(bench):
    assert bench.brake.trigger_configure() == Return.SUCCESS
    assert bench.brake.trigger_activate() == Return.SUCCESS
    wait_until(bench.executor, bench.sensor.get_subscription_count)

def test_parameter(bench):
    errors = []
    bench.node.create_subscription(
        Log, '/rosout', lambda log: log.level >= 40 and errors.append(log.msg), 100
    )
    for wrong in (-1.0, 0.0):
        bench.brake.set_parameters([Parameter('full_mps', value=wrong)])
        assert bench.brake.trigger_configure() == Return.FAILURE, f'full_mps {wrong} is accepted'
    for _ in range(20):
        if not errors:
            bench.executor.spin_once(timeout_sec=0.1)
    assert errors, 'a wrong full_mps is refused, and no error is logged'
    bench.brake.set_parameters([Parameter('full_mps', value=1.0)])
    up(bench)
    say(bench, 9.0)
    wait_until(bench.executor, lambda: bench.speeds)
    assert bench.speeds == [1.0]

def test_active(bench):
    assert bench.brake.trigger_configure() == Return.SUCCESS
    say(bench, 9.0, 9.0)
    for _ in range(6):
        bench.executor.spin_once(timeout_sec=0.1)
    assert bench.speeds == [], 'it publishes while it is inactive'
    bench.brake.trigger_activate()
    for count, distance in enumerate((0.75, 0.25), 1):
        say(bench, distance)
        wait_until(bench.executor, lambda: len(bench.speeds) >= count)
    assert bench.speeds == [0.125, 0.0]

def test_unknown(bench):
    up(bench)
    for count, distance in enumerate((11.0, 0.01, float('inf')), 1):
        say(bench, distance)
        wait_until(bench.executor, lambda: len(bench.speeds) >= count)
    assert bench.speeds == [0.0, 0.0, 0.25], 'of 11 m, 0.01 m and inf it makes other speeds'

def test_stop(bench):
    up(bench)
    say(bench, 9.0)
    wait_until(bench.executor, lambda: bench.speeds)
    assert bench.brake.trigger_deactivate() == Return.SUCCESS
    wait_until(bench.executor, lambda: len(bench.speeds) == 2, 3)
    assert bench.speeds == [0.25, 0.0]

def test_again(bench):
    up(bench)
    assert bench.brake.trigger_deactivate() == Return.SUCCESS
    assert bench.brake.trigger_cleanup() == Return.SUCCESS
    assert not bench.brake.count_publishers('cmd_vel'), 'cleanup leaves the publisher'
    assert not bench.brake.count_subscribers('range'), 'cleanup leaves the subscription'
    up(bench)
"""
OUR_TESTS = {
    'a wrong full_mps is refused, a right one used': (
        'parameter',
        "full_mps = self.get_parameter('full_mps').value. If it is not above 0: log an error, "
        'and return FAILURE.',
    ),
    'it publishes in the state active only': (
        'active',
        'self.create_lifecycle_publisher(...), and publish safe_speed(...) in range_callback.',
    ),
    'it stops for what the sensor cannot measure': (
        'unknown',
        'safe_speed(distance(message), ...)',
    ),
    'deactivate stops the robot': ('stop', 'Publish Twist() before super().on_deactivate(state).'),
    'after cleanup it can begin again': ('again', 'Destroy both, and return SUCCESS.'),
}


@tasks.add(limit_s=60)
def a_brake_with_a_lifecycle(workspace):
    @cached
    def runs():
        versions = {name: '' for name, _ in OUR_TESTS.values()}
        return run_ours(workspace, 'ours.py', OURS, 'brake_pkg.brake', versions)

    def passes(name):
        def test():
            run = runs()[name]
            if "no attribute 'to_label'" in run.says:
                return 'a method on_... returned None. Is there a return?'
            return run.passes or f'with our test, {run.says}'

        return test

    return [(what, passes(name), hint) for what, (name, hint) in OUR_TESTS.items()]


# --- Task 8: a step that fails


@tasks.add
def a_camera_that_fails(Camera):
    def ends(broken, steps, wanted_state, *calls):
        device = Device(*broken)
        state, result, _ = state_after(Camera, device, *steps)
        if device.calls != list(calls):
            return f'it called {", ".join(device.calls) or "nothing"}'
        return state == wanted_state or f'it is {state}, and the step returned {result}'

    def is_failure():
        state, result, errors = state_after(Camera, Device('open'), 'configure')
        if result != 'FAILURE':
            return f'on_configure returned {result}'
        if not errors:
            return 'it logs no error'
        return ends(['open'], ['configure'], 'unconfigured', 'open')

    up = 'configure', 'activate'
    opens = ('open', 'start')
    return [
        (
            'it opens and starts the device',
            lambda: ends([], up, 'active', *opens),
            'self.device.start(), and return super().on_activate(state)',
        ),
        (
            'without a camera, configure is a FAILURE, with an error in the log',
            is_failure,
            'try, and except OSError as error: self.get_logger().error(str(error))',
        ),
        (
            'a start that fails closes it',
            lambda: ends(['start'], up, 'unconfigured', *opens, 'close'),
            'self.device.close() in on_error, and return SUCCESS',
        ),
    ]


# --- Task 9: the running node


@tasks.add
def make_it_active(workspace):
    def is_active():
        state = workspace.terminal('ros2 lifecycle get /brake')
        return state == 'active [3]' or f'its state is {state}'

    return [('the node is active', is_active, 'configure, then activate.')]


# --- Task 10: six bugs

RIGHT_NODE = """from geometry_msgs.msg import Twist
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from sensor_msgs.msg import Range

from brake_pkg.distance import distance
from brake_pkg.speed import safe_speed


class Brake(LifecycleNode):
    def __init__(self):
        super().__init__('brake')
        self.declare_parameter('full_mps', 0.25)

    def on_configure(self, state):
        self.full_mps = self.get_parameter('full_mps').value
        if self.full_mps <= 0:
            self.get_logger().error('full_mps must be above 0')
            return TransitionCallbackReturn.FAILURE
        self.publisher = self.create_lifecycle_publisher(Twist, 'cmd_vel', 1)
        self.subscription = self.create_subscription(Range, 'range', self.range_callback, 1)
        return TransitionCallbackReturn.SUCCESS

    def range_callback(self, message):
        twist = Twist()
        twist.linear.x = safe_speed(distance(message), self.full_mps)
        self.publisher.publish(twist)

    def on_deactivate(self, state):
        self.publisher.publish(Twist())
        return super().on_deactivate(state)

    def on_cleanup(self, state):
        self.destroy_lifecycle_publisher(self.publisher)
        self.destroy_subscription(self.subscription)
        return TransitionCallbackReturn.SUCCESS
"""
OTHER_NODE = """from geometry_msgs.msg import Twist, Vector3
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn as Return
from sensor_msgs.msg import Range
from brake_pkg import distance, speed


class Brake(LifecycleNode):
    def __init__(self):
        super().__init__('brake')
        self.full = self.declare_parameter('full_mps', 0.25)
        self.active, self.parts = False, []

    def on_configure(self, state):
        self.full = self.get_parameter('full_mps').value
        if not self.full > 0:
            return Return.FAILURE
        out = self.create_publisher(Twist, 'cmd_vel', 1)
        self.say = lambda x: out.publish(Twist(linear=Vector3(x=x)))
        self.parts = [out, self.create_subscription(Range, 'range', self.hear, 1)]
        return Return.SUCCESS

    def hear(self, message):
        if self.active:
            self.say(float(speed.safe_speed(distance.distance(message), self.full)))

    def on_activate(self, state):
        self.active = True
        return Return.SUCCESS

    def on_deactivate(self, state):
        self.active = False
        self.say(0.0)
        return Return.SUCCESS

    def on_cleanup(self, state):
        self.destroy_publisher(self.parts[0])
        self.destroy_subscription(self.parts[1])
        return Return.SUCCESS
"""
BUGS = {
    'drives on before a wall': ('safe_speed(distance(message), self.full_mps)', 'self.full_mps'),
    'ignores full_mps': ('distance(message), self.full_mps', 'distance(message)'),
    'publishes while it is inactive': ('create_lifecycle_publisher', 'create_publisher'),
    'does not stop at deactivate': ('        self.publisher.publish(Twist())\n', ''),
    'takes a negative full_mps': ('self.full_mps <= 0', 'self.full_mps == 0'),
    'answers twice after cleanup': ('        self.destroy_subscription(self.subscription)\n', ''),
}
HINTS = {
    'drives on before a wall': 'Send a distance below 0.5 m: the speed must be 0.0.',
    'ignores full_mps': 'start(bench, full_mps=0.5): then 9.0 m is answered by 0.5.',
    'publishes while it is inactive': 'Configure it, send 9.0, spin; activate it, send 0.75: the '
    'first command must be 0.125.',
    'does not stop at deactivate': 'After trigger_deactivate(), wait for one more speed: 0.0.',
    'takes a negative full_mps': 'Set full_mps to -1.0: trigger_configure() must return FAILURE.',
    'answers twice after cleanup': 'Start it, clean it up, start it again, and send two '
    'distances: two answers, in their order.',
}


@tasks.add(limit_s=90)
def find_six_bugs(workspace, tests):
    @cached
    def runs():
        versions = {'right': RIGHT_NODE, 'other': OTHER_NODE}
        versions |= {bug: planted(RIGHT_NODE, old, new) for bug, (old, new) in BUGS.items()}
        return run_tests(workspace, PACKAGE, tests, 'brake_pkg.brake', versions)

    right = {'right': 'the right node', 'other': 'another right node'}

    own = 'Use no name of your own node. Hear the 0.0 of deactivate first.'
    return [
        ('they pass for two right nodes', all_pass(runs, right), own),
        *(
            (f'they fail for one that {bug}', is_caught(runs, bug, right), HINTS[bug])
            for bug in BUGS
        ),
    ]
