"""The bench: it speaks to a student's nodes, listens, and says what is wrong with them."""

import threading
import time

import pytest
import rclpy
from builtin_interfaces.msg import Time
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Int32
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci

from helpers.checks.bench import Bench, must_be_called, must_define, must_have, override, scan
from helpers.checks.errors import Failed
from helpers.checks.tasks import Tasks


class Doubler(Node):
    """Publishes twice what it hears."""

    def __init__(self, depth=10, **options):
        super().__init__('doubler', **options)
        self.publisher = self.create_publisher(Int32, 'twice', 10)
        self.create_subscription(Int32, 'number', self.number_callback, depth)

    def number_callback(self, message):
        self.get_logger().info(f'I heard {message.data}')
        self.publisher.publish(Int32(data=2 * message.data))


def numbers(*values):
    return [Int32(data=value) for value in values]


@pytest.mark.parametrize('depth', [1, 10])
def test_what_is_said_one_by_one_is_heard_whatever_the_depth(depth):
    with Bench() as bench:
        twice = bench.hear('twice', Int32)
        bench.spin(Doubler(depth))
        bench.say('number', *numbers(1, 2, 3))
        log = bench.log('doubler')
    assert [message.data for message in twice] == [2, 4, 6]
    assert log == [f'[INFO] [doubler]: I heard {number}' for number in (1, 2, 3)]


def test_messages_at_once_fill_a_queue():
    with Bench() as bench:
        node = Doubler(2)
        twice = bench.hear('twice', Int32)
        bench.say('number', *numbers(*range(9)), at_once=True)
        bench.spin(node)
        assert bench.quiet()
    assert [message.data for message in twice] == [14, 16]


def test_a_service_answers_or_not():
    def answer(request, response):
        response.message = 'yes'
        return response

    with Bench() as bench:
        node = Node('server')
        node.create_service(Trigger, 'ask', answer)
        bench.spin(node)
        assert bench.call('ask', Trigger).message == 'yes'
        assert bench.call('nobody', Trigger, limit_s=0.2) is None


def test_goals_are_sent_and_cancelled():
    gate = threading.Event()

    def execute(goal):
        goal.publish_feedback(Fibonacci.Feedback(sequence=[1]))
        gate.wait(5)
        if goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.succeed()
        return Fibonacci.Result(sequence=[1, 2])

    with Bench() as bench:
        node = Node('server')
        options = {
            'callback_group': ReentrantCallbackGroup(),
            'cancel_callback': lambda goal: CancelResponse.ACCEPT,
        }
        ActionServer(node, Fibonacci, 'count', execute, **options)
        bench.spin(node, threads=3)
        goal = bench.send_goal('count', Fibonacci, Fibonacci.Goal(order=1))
        assert goal.accepted
        assert goal.ended(0.1) == ('RUNNING', None)
        assert goal.cancel()
        gate.set()
        status, result = goal.ended()
        assert (status, list(result.sequence)) == ('CANCELED', [1, 2])
        assert bench.wait(lambda: goal.feedback)
        with pytest.raises(Failed, match='nobody serves the action other'):
            bench.send_goal('other', Fibonacci, Fibonacci.Goal(), limit_s=0.2)


def test_a_gate_holds_callbacks_until_it_opens_or_the_bench_ends():
    with Bench() as bench:
        gate, node = bench.gate(), Node('gated')
        node.create_subscription(Int32, 'number', gate.hold, 10)
        bench.spin(node)
        assert not gate.wait_until_entered(limit_s=0.1)
        bench.say('number', *numbers(1, 2), at_once=True)
        assert gate.wait_until_entered()
        assert [message.data for message in gate.entered] == [1]
        gate.open()
        assert gate.wait_until_entered(2)
        held = threading.Thread(target=bench.gate().hold)
        held.start()
    held.join(1)
    assert not held.is_alive()


def test_a_scan_is_that_of_the_simulated_robot_unless_it_is_told():
    message = scan(0.5, age_s=3600)
    assert list(message.ranges) == [0.5] * 181
    assert (round(message.angle_min, 2), round(message.angle_max, 2)) == (-1.57, 1.57)
    assert 3590 < time.time() - message.header.stamp.sec < 3610
    other = scan([1.0, 2.0], first=0.0, step=0.1, limits=(0.2, 3.5), stamp=Time(sec=7))
    assert (list(other.ranges), round(other.angle_max, 3)) == ([1.0, 2.0], 0.1)
    assert (round(other.range_min, 3), other.range_max, other.header.stamp.sec) == (0.2, 3.5, 7)


def test_simulated_time_goes_on_only_when_it_is_told():
    ticks = []
    with Bench() as bench:
        node = Node('clock', parameter_overrides=[Parameter('use_sim_time', value=True)])
        node.create_timer(1.0, lambda: ticks.append(node.get_clock().now().nanoseconds / 1e9))
        bench.spin(node)
        bench.advance(3.5)
    assert [round(tick) for tick in ticks] in ([1, 2, 3], [0, 1, 2, 3])


def test_a_class_in_place_of_a_node_is_said():
    with (
        Bench() as bench,
        pytest.raises(Failed, match='^a node is wanted here.* the class Doubler'),
    ):
        bench.spin(Doubler)


def test_what_is_not_written_yet_is_named():
    with Bench(), pytest.raises(Failed, match=r'^there is no self\.timer yet$'):
        must_have(Doubler(), 'publisher', 'timer')
    must_define(Doubler, '__init__', 'number_callback')
    with pytest.raises(Failed, match='^the class has no timer_callback yet$'):
        must_define(Doubler, 'timer_callback')


def test_a_node_with_another_name_is_named():
    with Bench():
        must_be_called(Doubler(), 'doubler')
        with pytest.raises(Failed, match='^the name of the node is doubler, not halver$') as failed:
            must_be_called(Doubler(), 'halver')
    assert failed.value.hint == "super().__init__('halver') in its __init__."


PERIOD_S = 0.5


def period():
    return PERIOD_S


def test_a_constant_that_the_code_reads_gets_another_value(monkeypatch):
    monkeypatch.setitem(globals(), 'PERIOD_S', PERIOD_S)
    override(period, PERIOD_S=0.1)
    assert period() == 0.1


# --- What a verdict says of mistakes


def verdict_on(
    make_node, capsys, act=lambda bench: bench.say('number', *numbers(1)), points=('it works',)
):
    tasks = Tasks()

    @tasks.add
    def task(answer):
        def judged():
            with Bench() as bench:
                bench.spin(answer())
                act(bench)
            return True

        return [(point, judged, '') for point in points]

    tasks.check('task', make_node)
    return ' '.join(capsys.readouterr().out.split())


def node_with(callback):
    class Tried(Doubler):
        number_callback = callback

    return Tried


def raises(self, message):
    message.dat.append(1)


def loops(self, message):
    while True:
        try:  # noqa: SIM105
            time.sleep(0.001)
        except BaseException:
            pass


def computes(self, message):
    while True:
        pass


def shuts_down(self, message):
    rclpy.shutdown()


def spins(self, message):
    rclpy.spin_once(self)


def answers_itself(self, message):
    time.sleep(0.02)
    self.create_publisher(Int32, 'number', 10).publish(message)


@pytest.mark.parametrize(
    ('callback', 'found'),
    [
        (raises, "AttributeError: 'Int32' object has no attribute 'dat'. Line"),
        (loops, 'does not end. Line'),
        (computes, 'not end. '),  # by the CPU that it takes, or by the clock
        (shuts_down, 'rclpy was shut down: nothing can come any more. Line'),
        (spins, 'rclpy.spin_once inside a callback takes the node out of its executor'),
        (answers_itself, 'it is never quiet: callbacks come without end'),
    ],
    ids=lambda value: getattr(value, '__name__', ''),
)
def test_a_mistake_in_a_callback_is_named_with_its_line(callback, found, capsys):
    said = verdict_on(node_with(callback), capsys)
    assert found in said
    if 'Line' in found:
        assert 'of test_bench.py:' in said


def test_after_a_callback_that_never_ends_no_other_point_is_tried(capsys):
    said = verdict_on(node_with(loops), capsys, points=('it works', 'again'))
    assert 'not tried, because the one above did not end' in said


def holds_until_the_gate_opens(gate):
    def number_callback(self, message):
        gate.wait()

    return number_callback


def test_a_callback_that_waits_is_named_with_its_line():
    gate = threading.Event()
    with Bench() as bench:
        executor, free_one = SingleThreadedExecutor(), SingleThreadedExecutor()
        bench.spin(node_with(holds_until_the_gate_opens(gate))(), executor=executor)
        bench.spin(Node('idle'), executor=free_one)
        bench.publisher('number', Int32).publish(Int32(data=1))
        assert not bench.quiet()
        assert not bench.quiet(executor=executor)
        assert bench.quiet(executor=free_one)
        assert 'test_bench.py: gate.wait()' in bench.line_of_callback()
        gate.set()
        bench.quiet()
        assert bench.line_of_callback() == ''


def test_a_node_that_nobody_destroys_leaves_nothing(capsys):
    kept = []

    def make():
        kept.append(Doubler())
        return kept[-1]

    assert '[ok] it works' in verdict_on(make, capsys)
    assert kept == []


def test_a_service_without_a_response_is_said(capsys):
    class Forgets(Node):
        def __init__(self):
            super().__init__('forgets')
            self.create_service(Trigger, 'ask', lambda request, response: None)

    said = verdict_on(Forgets, capsys, lambda bench: bench.call('ask', Trigger))
    assert 'TypeError: the callback of a service has returned no response of its type' in said
