"""A brake and a camera with a lifecycle, and the tests that find six bugs."""

from std_msgs.msg import Empty

from helpers.checks.lessons.test_a_node.shared import (
    PACKAGE,
    all_pass,
    is_caught,
    ours_pass,
    run_ours,
    tasks,
)
from helpers.checks.points import all_of, cached, expect
from helpers.ros import ros_session
from helpers.trials import Device, planted, run_tests, state_after

# --- Task 6: a lifecycle

# rclpy tells nobody what a step raises: `step` does.
OURS = """import time

from brake_pkg.brake import Brake
from rcl_interfaces.msg import Log
from rclpy.lifecycle import TransitionCallbackReturn as Return
from rclpy.parameter import Parameter

raised = []

def watched(name):
    method = getattr(Brake, name)

    def on_step(self, state):
        try:
            result = method(self, state)
            assert isinstance(result, Return), f'{name} returned {result}. Is there a return?'
        except Exception as error:
            raised.append(error)
            raise
        return result

    return on_step

for name in 'configure', 'activate', 'deactivate', 'cleanup':
    setattr(Brake, f'on_{name}', watched(f'on_{name}'))

def step(bench, name, right=Return.SUCCESS, case=''):
    raised.clear()
    result = getattr(bench.brake, f'trigger_{name}')()
    if raised:
        raise raised[0]
    assert result == right, f'{case}on_{name} returns {result.name}, not {right.name}'

def soon(bench, holds, otherwise):
    end = time.monotonic() + 4
    while not holds():
        assert time.monotonic() < end, otherwise
        bench.executor.spin_once(timeout_sec=0.1)

def connect(bench):
    soon(bench, bench.sensor.get_subscription_count, 'nobody subscribes to range')
    soon(bench, lambda: bench.node.count_publishers('cmd_vel'), 'nobody publishes on cmd_vel')

def up(bench):
    step(bench, 'configure')
    step(bench, 'activate')
    connect(bench)

def answers(bench, *distances):
    bench.speeds.clear()
    for count, distance in enumerate(distances, 1):
        bench.send(distance)
        soon(bench, lambda: len(bench.speeds) >= count, f'of {distance} m it makes no speed')
    return bench.speeds

def must_answer(bench, distances, right):
    found = answers(bench, *distances)
    assert found == right, f'of {distances} m it makes the speeds {found}, not {right}'

def is_silent(bench, state):
    bench.speeds.clear()
    bench.send(9.0)
    for _ in range(8):
        bench.executor.spin_once(timeout_sec=0.1)
    moves = [speed for speed in bench.speeds if speed]
    assert not moves, f'it publishes {moves} while it is {state}'

def test_parameter(bench):
    errors = []
    bench.node.create_subscription(
        Log, '/rosout', lambda log: log.level >= 40 and errors.append(log.msg), 100
    )
    for wrong in (-1.0, 0.0):
        errors.clear()
        bench.brake.set_parameters([Parameter('full_mps', value=wrong)])
        step(bench, 'configure', Return.FAILURE, f'with full_mps {wrong}, ')
        soon(bench, lambda: errors, f'full_mps {wrong} is refused, and no error is logged')
        left = bench.brake.count_publishers('cmd_vel') + bench.brake.count_subscribers('range')
        assert not left, 'a configure that fails leaves a publisher or a subscription'
    errors.clear()
    bench.brake.set_parameters([Parameter('full_mps', value=1.0)])
    up(bench)
    publisher = getattr(bench.brake, 'publisher', None)
    assert hasattr(publisher, 'publish'), 'it has no publisher with the name self.publisher'
    found = answers(bench, 9.0)
    assert found == [1.0], f'with full_mps 1.0, of 9.0 m it makes {found}, not [1.0]'
    assert not errors, f'with full_mps 1.0, it logs an error: {errors[0]}'

def test_active(bench):
    step(bench, 'configure')
    assert not list(bench.brake.timers), 'it has a timer: take each distance when it comes'
    connect(bench)
    is_silent(bench, 'inactive')
    step(bench, 'activate')
    must_answer(bench, [0.75, 0.25], [0.125, 0.0])
    step(bench, 'deactivate')
    is_silent(bench, 'inactive again')

def test_unknown(bench):
    up(bench)
    must_answer(bench, [11.0, 0.01, float('inf')], [0.0, 0.0, 0.25])

def test_stop(bench):
    up(bench)
    answers(bench, 9.0)
    step(bench, 'deactivate')
    soon(bench, lambda: len(bench.speeds) == 2, 'at deactivate it publishes no speed')
    assert bench.speeds == [0.25, 0.0], f'at deactivate it publishes {bench.speeds[1]}, not 0.0'

def test_again(bench):
    up(bench)
    step(bench, 'deactivate')
    step(bench, 'cleanup')
    assert not bench.brake.count_publishers('cmd_vel'), 'cleanup leaves the publisher'
    assert not bench.brake.count_subscribers('range'), 'cleanup leaves the subscription'
    up(bench)
"""


@tasks.add(limit_s=60)
def a_brake_with_a_lifecycle(workspace):
    @cached
    def runs():
        versions = dict.fromkeys(('parameter', 'active', 'unknown', 'stop', 'again'), '')
        return run_ours(workspace, 'ours.py', OURS, 'brake_pkg.brake', versions)

    refused = (
        "full_mps = self.get_parameter('full_mps').value. If it is not above 0: log an error, "
        'and return FAILURE.'
    )
    active = (
        'self.create_lifecycle_publisher(...); on_deactivate ends with '
        'return super().on_deactivate(state), which makes it silent again.'
    )
    unknown = 'safe_speed(distance(message), ...)'
    stop = 'Publish Twist() before super().on_deactivate(state).'
    again = 'Destroy both, and return SUCCESS.'
    return [
        ('a wrong full_mps is refused, a right one used', ours_pass(runs, 'parameter'), refused),
        ('it publishes in the state active only', ours_pass(runs, 'active'), active),
        ('it stops for what the sensor cannot measure', ours_pass(runs, 'unknown'), unknown),
        ('deactivate stops the robot', ours_pass(runs, 'stop'), stop),
        ('after cleanup it can begin again', ours_pass(runs, 'again'), again),
    ]


# --- Task 7: a step that fails


class OddDevice(Device):
    """A camera that fails in a way of which nobody has thought."""

    def open(self):
        """Raise what on_configure should not catch."""
        raise ValueError('there is no lens')


@tasks.add
def a_camera_that_fails(Camera):
    def ends(broken, steps, wanted_state, *calls):
        device, publishers = Device(*broken), []

        class WithPublisher(Camera):
            def __init__(self, device):
                super().__init__(device)
                publishers.append(self.create_lifecycle_publisher(Empty, 'image', 1))

        state, result, _ = state_after(WithPublisher, device, *steps)
        is_on = publishers[0].is_activated or state != 'active'
        return all_of(
            expect(device.calls, [*calls], 'it called'),
            expect(state, wanted_state, f'the last step returned {result}, and the camera is'),
            is_on or 'on_activate leaves out what super().on_activate(state) does: publishers wait',
        )

    def tries_again(device):
        """Return the results of two configures, and how many errors it has logged."""
        with ros_session() as session:
            camera = Camera(device)
            results = [camera.trigger_configure().name for _ in range(2)]
            logged = [(record.node, record.level) for record in session.records()]
        return results, logged.count(('camera', 'ERROR'))

    def is_failure():
        results, errors = tries_again(Device('open'))
        return all_of(
            expect(results[0], 'FAILURE', 'on_configure returned'),
            errors > 0 or 'it logs no error',
            errors > 1 or 'it logs an error the first time only',
            ends(['open'], ['configure'], 'unconfigured', 'open'),
            expect(
                tries_again(OddDevice())[0][0],
                'ERROR',
                'open raised a ValueError, which is no OSError, and on_configure returned',
            ),
        )

    up, opens = ('configure', 'activate'), ('open', 'start')
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


# --- Task 8: the running node


@tasks.add
def make_it_active(workspace):
    def is_active():
        state = workspace.terminal('ros2 lifecycle get /brake')
        return state == 'active [3]' or f'its state is {state}, not active [3]'

    return [('the node is active', is_active, 'configure, then activate.')]


# --- Task 9: six bugs

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
    'takes a negative full_mps': ('self.full_mps <= 0', 'self.full_mps is None'),  # and 0.0
    'answers twice after cleanup': ('        self.destroy_subscription(self.subscription)\n', ''),
}
HINT_AGAINST = {
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

    right = all_pass(runs, {'right': 'the right node', 'other': 'another right node'})
    own = 'Use no name of your own node. Hear the 0.0 of deactivate first.'
    return [
        ('they pass for two right nodes', right, own),
        *(
            (f'they fail for one that {bug}', is_caught(runs, bug, right), HINT_AGAINST[bug])
            for bug in BUGS
        ),
    ]
