"""Of "Keep what is fresh": what notices that no scan comes."""

import time
from contextlib import contextmanager

from geometry_msgs.msg import Twist
from rclpy.clock import ClockType
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_policy_name_from_kind
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Int32

from helpers.checks.bench import Bench, periods_of, scan
from helpers.checks.errors import Failed
from helpers.checks.lessons.keep_what_is_fresh.brakes import number_of, speeds_after
from helpers.checks.lessons.keep_what_is_fresh.shared import tasks
from helpers.checks.points import cached, expect, needs

LATE_S = 1.0  # that a stop may come late
BETWEEN_S = 0.4  # two scans: the later one counts


@tasks.add(own_domain=True)
def a_watchdog(WatchfulBrake):
    long_s, middle_s, short_s = 1.3, 0.9, 0.3

    def make(most_s):
        return WatchfulBrake(1, most_s, look=lambda scan: 9.0)

    @cached
    def trial():
        """Let it hear nothing, then two scans, then nothing."""
        with Bench() as bench:
            stops, begun_s = hear_stops(bench), time.monotonic()
            brake = bench.spin(make(long_s))
            periods_s = periods_of(brake)
            bench.wait(lambda: stops, long_s + LATE_S)
            without = [at_s - begun_s for at_s in stops]
            again = bench.wait(lambda: len(stops) >= 3, LATE_S) if stops else False
            bench.say('scan', scan(0))
            bench.wait(lambda: False, BETWEEN_S)
            scan_s = time.monotonic()
            bench.say('scan', scan(0))
            stops.clear()  # those that came before the scan was handled
            bench.wait(lambda: stops, long_s + LATE_S)
            after = [at_s - scan_s for at_s in stops]
        return without, again, after, periods_s

    @cached
    def stops_at_all():
        without, _, after, _ = trial()
        return bool(without or after) or 'it never stops at all'

    def stops_without_a_scan():
        without, again, _, periods_s = trial()
        if not without:
            waited_s = long_s + LATE_S
            return f'with most_s={long_s}, no scan ever came, and in {waited_s} s no stop came'
        if without[0] < long_s:
            return f'with most_s={long_s} it stopped {without[0]:.1f} s after it was made'
        if not again:
            return 'one stop came, and then no more'
        return expect(periods_s or [0.1], [0.1], 'the periods of its timers are', unit='s')

    def stops_after_a_scan():
        _, _, after, _ = trial()
        return bool(after) or 'one scan came, and then no stop'

    def is_quiet_after_a_scan():
        needs(stops_at_all)
        _, _, after, _ = trial()
        too_soon = after and after[0] < long_s
        return not too_soon or f'with most_s={long_s} it stopped {after[0]:.1f} s after a scan'

    def silence_until_a_stop(most_s, age_s=0, set_s=0, **parameters):
        """Return how long after one scan it stops (s, or None), and the clocks of its timers."""
        with Bench() as bench:
            stops = hear_stops(bench)
            brake = bench.spin(make(most_s))
            brake.set_parameters([Parameter(name, value=on) for name, on in parameters.items()])
            begun_s = time.monotonic()
            bench.say('scan', scan(0, age_s=age_s))
            stops.clear()  # the answer to a scan whose stamp is wrong
            with clock_set_by(set_s):
                bench.wait(lambda: stops, most_s + LATE_S)
            clocks = {timer.clock.clock_type for timer in brake.timers}
        return (stops[0] - begun_s if stops else None), clocks

    def waits_for_most_s():
        needs(stops_at_all)
        silence_s, _ = silence_until_a_stop(short_s)
        late_s = short_s + LATE_S
        came = silence_s is not None
        return came or f'with most_s={short_s}, {late_s} s after a scan no stop came'

    def counts_when_a_scan_came():
        """Let a scan come with another stamp, and set the clock of the computer."""
        needs(stops_at_all)
        for what, age_s, set_s in (
            ('a scan came that was stamped an hour ago', 3600, 0),
            ('a scan came that was stamped an hour ahead', -3600, 0),
            ('a scan came, then somebody set the clock of the computer', 0, 3600),
        ):
            silence_s, _ = silence_until_a_stop(middle_s, age_s, set_s)
            if silence_s is None:
                return f'{what}, and in {middle_s + LATE_S} s no stop came'
            if silence_s < middle_s:
                return f'{what}, and with most_s={middle_s} it stopped after {silence_s:.1f} s'
        return True

    def needs_no_clock():
        silence_s, clocks = silence_until_a_stop(short_s, use_sim_time=True)
        if ClockType.SYSTEM_TIME in clocks:
            return 'its timer is on the system clock, which jumps when somebody sets it'
        if silence_s is None and clocks == {ClockType.STEADY_TIME}:
            return 'its timer is steady, but the times that it compares stand still without /clock'
        if silence_s is None:
            return f'with use_sim_time and no /clock, no stop came in {short_s + LATE_S} s'
        other = clocks - {ClockType.STEADY_TIME}
        return not other or f'its timer is on a clock of the type {other.pop().name}'

    def brakes_as_before():
        scans = [(2.0, 0), (0.3, 0), (2.0, 90), (2.0, 0)]
        speeds, _ = speeds_after(WatchfulBrake, scans, depth=9, most_s=60)
        return expect(speeds, [0.5, 0.0, 0.0, 0.5], 'free, near, old, free: it commands')

    def is_one_voice():
        with Bench() as bench:
            bench.spin(make(60))
            publishers = bench.tester.count_publishers('cmd_vel')
        return expect(publishers, 1, 'on cmd_vel it has', unit='publishers')

    since = 'Note time.monotonic() at the start and in each callback of a scan. How long ago is it?'
    steady = (
        'The timer: clock=Clock(clock_type=ClockType.STEADY_TIME). The times: time.monotonic().'
    )
    return [
        ('a laser that never sends: it stops, again and again', stops_without_a_scan, since),
        ('one scan, then silence: it stops', stops_after_a_scan, since),
        ('it does not stop while a scan is fresh', is_quiet_after_a_scan, since),
        ('it waits for most_s seconds, however long', waits_for_most_s, 'Compare with most_s.'),
        (
            'it counts when a scan came, not its stamp or the time of day',
            counts_when_a_scan_came,
            since,
        ),
        ('it stops without /clock, too', needs_no_clock, steady),
        ('it brakes as before', brakes_as_before, 'super().scan_callback(scan)'),
        ('one publisher on cmd_vel', is_one_voice, 'Brake has a method for it: self.command(0.0).'),
    ]


@contextmanager
def clock_set_by(seconds):
    """Let time.time() jump, as if somebody had set the clock of the computer."""
    real = time.time
    time.time = lambda: real() + seconds
    try:
        yield
    finally:
        time.time = real


def hear_stops(bench):
    """Return a list to which the time of each stop is appended."""
    stops = []

    def command(twist):
        if twist == Twist():
            stops.append(time.monotonic())

    bench.tester.create_subscription(Twist, 'cmd_vel', command, 9)
    return stops


@tasks.add
def choose_the_qos(laser_qos, map_qos):
    @cached
    def hear_laser():
        """Return the scans heard after a pause, and whether silence was reported."""
        must_be_profile('laser_qos', laser_qos)
        heard, missed = [], []
        offered = QoSProfile(
            depth=10, reliability=ReliabilityPolicy.BEST_EFFORT, deadline=Duration(seconds=0.2)
        )
        with Bench() as bench:
            laser = bench.tester.create_publisher(
                LaserScan, 'scan', offered, event_callbacks=NO_WARNING
            )
            node, refused = subscriber(LaserScan, 'scan', heard, laser_qos, deadline=missed.append)
            for number in range(5):
                laser.publish(scan(number))
            bench.spin(node)
            bench.wait(lambda: refused or laser.get_subscription_count())
            bench.quiet()
            must_be_connected('the laser', refused)
            soon = Duration() < laser_qos.deadline <= Duration(seconds=2)
            told = soon and bench.wait(lambda: missed, 4)
        return [number_of(message) for message in heard], told

    def newest():
        heard, _ = hear_laser()
        return expect(heard, [4], 'of scans 0 to 4 your node received')

    def silence():
        _, told = hear_laser()
        return told or 'no event came in 2 s'

    def the_map():
        """Publish maps 1 to 3, join, and publish map 4."""
        must_be_profile('map_qos', map_qos)
        heard = []
        offered = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        with Bench() as bench:
            server = bench.tester.create_publisher(
                Int32, 'map', offered, event_callbacks=NO_WARNING
            )
            for number in (1, 2, 3):
                server.publish(Int32(data=number))
            node, refused = subscriber(Int32, 'map', heard, map_qos)
            bench.spin(node)
            bench.wait(lambda: refused or server.get_subscription_count())
            server.wait_for_all_acked()  # the old maps are there, if any are to come
            bench.quiet()
            server.publish(Int32(data=4))
            bench.wait(lambda: refused or (heard and heard[-1].data == 4))
        must_be_connected('the map server', refused)
        return expect([message.data for message in heard], [3, 4], 'your node received')

    hint = 'Ask for no more than is offered. Then: how many places does the queue have?'
    late = 'A deadline of at most 2 s, and at least what the laser promises.'
    return [
        ('only the newest scan', newest, hint),
        ('silence is noticed', silence, late),
        ('the map is received', the_map, 'Which two things must be right on both sides?'),
    ]


NO_WARNING = PublisherEventCallbacks(use_default_callbacks=False)


def subscriber(kind, topic, heard, qos, **events):
    """Return a node that hears a topic, and a list of the policies that do not match."""
    node, refused = Node('your_node'), []
    events = SubscriptionEventCallbacks(incompatible_qos=refused.append, **events)
    node.create_subscription(kind, topic, heard.append, qos, event_callbacks=events)
    return node, refused


def must_be_connected(publisher, refused):
    """Raise Failed, with the policies, if a subscription has refused a publisher."""
    if refused:
        names = ', '.join(qos_policy_name_from_kind(event.last_policy_kind) for event in refused)
        raise Failed(f'{publisher} and your node are not connected: {names}')


def must_be_profile(name, qos):
    """Raise Failed if this is no QoSProfile."""
    if not isinstance(qos, QoSProfile):
        raise Failed(f'{name} is {qos!r}, and no QoSProfile')
