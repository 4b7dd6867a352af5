"""What the tasks of the lesson "Keep what is fresh" are judged by."""

import math
import threading
import time
from contextlib import contextmanager

from geometry_msgs.msg import Twist
from rclpy.clock import ClockType
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_policy_name_from_kind
from rclpy.time import Time
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Empty, Int32

from helpers.checks.bench import Bench, must_define
from helpers.checks.errors import Failed, sentence
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks
from helpers.ros import ros_session
from helpers.trials import stop_while_looking

tasks = Tasks()
check = tasks.check


@tasks.add
def say_none_if_you_do_not_know(distance_ahead):
    def says(right, *beams, others=9.0, behind=False, limits=(0.12, 8.0)):
        """Ask for a scan with these ranges straight ahead, and with `others` elsewhere."""
        scan = scan_ahead(beams, others, behind, limits)
        found = distance_ahead(scan)
        is_right = found is None if right is None else is_near(found, right)
        unlike = ', counted from 0 to 2 pi' if behind else ''
        ahead = f'ahead are {", ".join(f"{beam:g}" for beam in beams)}{unlike}'
        return is_right or f'{ahead}: it returns {found!r}, not {right}'

    def all_of(*trials):
        for trial in trials:
            if (found := trial()) is not True:
                return found
        return True

    none = 'Count the known ones: fewer than half of len(ahead), or none at all, is None.'
    return [
        (
            'the least of the ranges ahead, whatever is at the sides',
            lambda: all_of(
                lambda: says(2.0, 2.5, 2.0, 3.0, others=0.3),
                lambda: says(0.4, 0.4, 5.0, 5.0),
                lambda: says(1.5, 1.5, 4.0, 3.0, others=0.3, behind=True),
            ),
            'Of the known ranges in `ahead`, the least.',
        ),
        (
            'what is unknown does not count: NaN, 0.0, too near, too far',
            lambda: all_of(
                lambda: says(2.0, NAN, 2.0, 3.0),
                lambda: says(2.0, 2.0, 3.0, NAN),
                lambda: says(3.0, 0.0, 3.0, 4.0),
                lambda: says(3.0, 0.0, 3.0, 4.0, limits=(0.0, 100.0)),
                lambda: says(3.0, 0.05, 3.0, 4.0),
                lambda: says(1.0, 1.0, 9.5, 9.5, 4.0),
            ),
            'scan.range_min <= r <= scan.range_max and r > 0 is False for each of these.',
        ),
        (
            'inf is range_max, -inf is 0.0',
            lambda: all_of(
                lambda: says(8.0, math.inf, math.inf, math.inf),
                lambda: says(3.5, math.inf, math.inf, limits=(0.12, 3.5)),
                lambda: says(2.0, math.inf, 2.0, math.inf),
                lambda: says(0.0, 2.0, -math.inf, 2.0),
            ),
            'Compare with math.inf and -math.inf first.',
        ),
        (
            'None if fewer than half are known, or if there is no beam',
            lambda: all_of(
                lambda: says(None, NAN, NAN, NAN),
                lambda: says(None, NAN, 2.0, NAN),
                lambda: says(2.0, NAN, 2.0, NAN, 3.0),
                lambda: says(None, 0.0, 0.0, 0.0, 2.0),
                lambda: says(None),
            ),
            none,
        ),
    ]


NAN = math.nan


def scan_ahead(beams, others, behind, limits):
    """Return a scan all around: just these beams are within 10 degrees of straight ahead.

    It counts from about -160 degrees, or from 0 if `behind`, so that the beams are at both ends.
    Without beams it looks to the left only.
    """
    least, most = limits
    count = len(beams)
    if not count:
        return LaserScan(
            angle_min=0.5,
            angle_increment=0.1,
            ranges=[others] * 20,
            range_min=least,
            range_max=most,
        )
    step = math.radians(20 / count)
    around = [*beams, *[others] * (17 * count)]  # to the left, from the first beam on
    begin = count // 2 if behind else -8 * count
    return LaserScan(
        angle_min=(begin - (count - 1) / 2) * step,
        angle_increment=step,
        ranges=around[begin:] + around[:begin],
        range_min=least,
        range_max=most,
    )


def is_near(found, right):
    return isinstance(found, int | float) and abs(found - right) < 1e-3


@tasks.add
def brake_before_the_wall(Brake):
    def brakes(distances, right, speed):
        scans = [(metres, 0) for metres in distances]
        found = speeds_after(Brake, scans, depth=9, speed=speed)
        return found == right or f'at {distances} m with speed {speed} it commands {found}'

    compare = 'Make a Twist, set its linear.x, publish it. Compare self.look(scan) with LIMIT_M.'
    return [
        (
            'it drives where the way is free, and stops where a wall is near',
            lambda: brakes([2.0, 0.7, 0.5, 0.2, 3.0], [0.5, 0.5, 0.0, 0.0, 0.5], 0.5),
            compare,
        ),
        (
            'it stops where the scan does not say it: None',
            lambda: brakes([2.0, None, None, 3.0], [0.5, 0.0, 0.0, 0.5], 0.5),
            'if distance is None or distance < LIMIT_M',
        ),
        (
            'the same at 0.25 m/s',
            lambda: brakes([0.1, 5.0], [0.0, 0.25], 0.25),
            'The speed of this brake is self.speed.',
        ),
    ]


def speeds_after(make_brake, scans, **options):
    """Let a brake hear scans one by one, and return the speeds that it commands.

    A scan is what `look` says of it, in metres, and its age in seconds.
    """
    distances = [metres for metres, _ in scans]
    with Bench() as bench:
        commands = bench.hear('cmd_vel', Twist)
        brake = make_brake(look=lambda scan: distances[number_of(scan)], **options)
        bench.spin(brake)
        for number, (_, age_s) in enumerate(scans):
            say_and_wait(bench, 'scan', scan_with(bench, number, age_s), commands)
        bench.quiet()
    return [twist.linear.x for twist in commands]


def say_and_wait(bench, topic, message, commands):
    """Publish a message, and wait for a command, or until it is handled without one."""
    before = len(commands)
    bench.say(topic, message, at_once=True)
    if not bench.wait(lambda: len(commands) > before, 0.3):
        bench.quiet()


def scan_with(bench, number, age_s=0):
    """Return a scan with a number, as old as this."""
    scan = LaserScan(ranges=[float(number)] * 181)
    scan.header.stamp = (bench.tester.get_clock().now() - Duration(seconds=age_s)).to_msg()
    return scan


def number_of(scan):
    return round(scan.ranges[90])


@tasks.add
def how_old_is_a_scan(AgeBrake):
    def notes(*ages_s):
        brakes, noted_before_look = [], []

        def make(look, **options):
            def look_and_count(scan):
                noted_before_look.append(len(brakes[0].ages_s))
                return look(scan)

            brakes.append(AgeBrake(look=look_and_count, **options))
            return brakes[0]

        speeds_after(make, [(2.0, age_s) for age_s in ages_s], depth=9)
        found = brakes[0].ages_s
        right = len(found) == len(ages_s) and all(
            0 <= noted_s - age_s < 5 for noted_s, age_s in zip(found, ages_s, strict=True)
        )
        if not right:
            ages = ', '.join(map(shortly, found)) or 'nothing'
            return f'of scans that are {[*ages_s]} s old, it noted: {ages}'
        if not noted_before_look:
            return 'it noted the ages, and did not look'
        return noted_before_look == [1, 2, 3] or 'the age was not noted before the look'

    def uses_the_clock_of_the_node():
        with Bench() as bench:
            brake = AgeBrake(depth=9, look=lambda scan: 2.0)
            brake.set_parameters([Parameter('use_sim_time', value=True)])
            bench.spin(brake)
            bench.advance(20, step_s=20)
            scan = scan_with(bench, 0)
            scan.header.stamp = Time(seconds=15).to_msg()
            bench.say('scan', scan)
        ages = ', '.join(map(shortly, brake.ages_s)) or 'nothing'
        is_right = [round(age_s, 3) for age_s in brake.ages_s] == [5.0]
        return is_right or f'in a simulation, a scan of 15 s came at 20 s, and it noted: {ages}'

    hint = 'self.get_clock().now() - Time.from_msg(scan.header.stamp): its nanoseconds / 1e9.'
    return [
        ('scans of 0, 10 and 3600 s', lambda: notes(0, 10, 3600), hint),
        ('scans of 90, 20 and 0 s', lambda: notes(90, 20, 0), hint),
        (
            'the time is that of the node, even in a simulation',
            uses_the_clock_of_the_node,
            'self.get_clock().now() is the time of the node, time.time() that of the computer.',
        ),
    ]


def shortly(age_s):
    return f'{age_s:.0f}' if abs(age_s) < 1e6 else 'more than a million'


@tasks.add
def how_late_is_too_late(allowed_s):
    def computes(speed, limit, right):
        found = allowed_s(speed, limit)
        if not isinstance(found, int | float):
            return f'{speed} m/s, {limit} m: your function returns {found}'
        said = f'{speed} m/s, {limit} m: your function returns {found:.3g} s'
        return abs(found - right) < 0.005 or said

    hint = 'Subtract RADIUS_M and speed**2 / (2 * BRAKING) from limit.'
    return [
        ('0.5 m/s, 0.6 m: 0.88 s', lambda: computes(0.5, 0.6, 0.88), hint),
        ('1.0 m/s, 0.6 m: 0.29 s', lambda: computes(1.0, 0.6, 0.29), hint),
        ('0.5 m/s, 1.0 m: 1.68 s', lambda: computes(0.5, 1.0, 1.68), hint),
    ]


@tasks.add
def stop_if_you_do_not_know(CarefulBrake):
    def is_careful(most_s, scans, right):
        must_define(CarefulBrake, '__init__')
        looked_at = []

        def make(look, **options):
            def look_and_note(scan):
                looked_at.append(number_of(scan))
                return look(scan)

            return CarefulBrake(look=look_and_note, **options)

        speeds = speeds_after(make, scans, depth=9, most_s=most_s)
        ages = [age_s for _, age_s in scans]
        if speeds != right:
            return f'most_s={most_s}, scans of {ages} s: it commands {speeds}, not {right}'
        fresh = [number for number, age_s in enumerate(ages) if -0.1 < age_s < most_s]
        return looked_at == fresh or f'it looked at these scans: {looked_at}, not {fresh}'

    hint = 'The age is that of task 3. Compare its nanoseconds / 1e9 with self.most_s.'
    both = 'A stamp from the future has an age below 0. Below -FUTURE_S it is unknown: stop.'
    return [
        (
            'at most 5 s: the old ones stop it',
            lambda: is_careful(5, [(2.0, 0), (2.0, 60), (2.0, 6), (0.3, 0)], [0.5, 0.0, 0.0, 0.0]),
            hint,
        ),
        (
            'at most a minute: a scan of 6 s is used',
            lambda: is_careful(60, [(2.0, 6), (2.0, 3600), (2.0, 30)], [0.5, 0.0, 0.5]),
            hint,
        ),
        (
            'a scan from the future stops it, one that is 0.05 s ahead does not',
            lambda: is_careful(60, [(2.0, -1), (2.0, -0.05), (2.0, -3600)], [0.0, 0.5, 0.0]),
            both,
        ),
    ]


@tasks.add
def the_red_button(StopBrake):
    def after(*topics):
        """Send scans and stops, and return the speeds that it commands."""
        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist)
            bench.spin(StopBrake(9, most_s=60, look=lambda scan: 9.0))
            for topic in topics:
                message = scan_with(bench, 0) if topic == 'scan' else Empty()
                say_and_wait(bench, topic, message, commands)
            bench.quiet()
        return [twist.linear.x for twist in commands]

    def commands(right, *topics):
        speeds = after(*topics)
        return speeds == right or f'after {", ".join(topics)} it commanded {speeds}'

    def keeps_the_scans():
        with ros_session():
            topic = StopBrake(9, look=lambda scan: 9.0).subscription.topic_name
        return topic == '/scan' or f'self.subscription is now that of {topic}'

    hint = "create_subscription(Empty, 'stop', ...); self.stopped.set(), then self.command(0.0)."
    kept = 'Brake keeps its subscription there. Keep yours under another name.'
    return [
        ('stop, then a scan: it stays', lambda: commands([0.0, 0.0], 'stop', 'scan'), hint),
        (
            'two scans, stop, a scan: it stops and stays',
            lambda: commands([0.5, 0.5, 0.0, 0.0], 'scan', 'scan', 'stop', 'scan'),
            hint,
        ),
        ('self.subscription is still that of scan', keeps_the_scans, kept),
    ]


@tasks.add
def a_place_for_one(Newest):
    def takes(right, *rounds):
        """Put some, take one, and so on, in a thread that may wait for ever."""
        place, found = Newest(), []

        def work():
            for numbers in rounds:
                for number in numbers:
                    place.put(number)
                found.append(place.take())

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        thread.join(timeout=2)
        return found == right or f'put in turn: {[*rounds]}. Taken: {found or "nothing"}'

    def forgets():
        place = Newest()
        for number in (1, 2, 3):
            place.put(number)
        waiting = place.waiting
        return len(waiting) == 1 or f'after 1, 2, 3 were put, these wait: {waiting}'

    def wakes():
        place, found = Newest(), []
        thread = threading.Thread(target=lambda: found.append(place.take()), daemon=True)
        thread.start()
        thread.join(timeout=0.2)
        place.put(7)
        thread.join(timeout=2)
        return found == [7] or 'a thread that waits in take is not woken by put'

    hint = 'The list holds one scan or none: self.waiting = ...'
    return [
        ('1, 2, 3 are put: 3 is taken', lambda: takes([3], [1, 2, 3]), hint),
        ('then 4, 5 are put: 5 is taken', lambda: takes([3, 5], [1, 2, 3], [4, 5]), hint),
        ('the replaced ones are forgotten', forgets, hint),
        ('a thread that waits is woken', wakes, 'put must notify, inside the lock.'),
    ]


@tasks.add
def a_worker(NewestBrake):
    stopped_while_looking = cached(lambda: stop_while_looking(make))
    ended = threading.Thread(target=int)
    ended.start()

    def make(*arguments, **options):
        """Return a brake whose destroy_node does not wait for a worker that never ends."""
        brake = NewestBrake(*arguments, **options)
        brake.worker = ended
        return brake

    def stop_is_heard():
        stopped, _ = stopped_while_looking()
        return stopped or 'stop waited until the look was over'

    def newest_are_looked_at():
        _, numbers = stopped_while_looking()
        return numbers == [0, 20] or f'of 21 scans, the worker looked at {numbers}'

    def commands(right, distances):
        speeds = speeds_after(make, [(metres, 0) for metres in distances], depth=1)
        return speeds == right or f'at {distances} m it commands {speeds}'

    def tests_the_age():
        scans = [(2.0, 0), (2.0, 30), (2.0, -30), (2.0, 0)]
        speeds = speeds_after(make, scans, depth=1, most_s=5)
        ages = [age_s for _, age_s in scans]
        right = [0.5, 0.0, 0.0, 0.5]
        return (
            speeds == right or f'of scans that are {ages} s old it commands {speeds}, not {right}'
        )

    def worker_ends():
        errors = []
        threading.excepthook = lambda error: errors.append(error.exc_value)
        with ros_session():
            brake = NewestBrake(1)
        if errors:
            return f'it ended with {sentence(errors[0])}'
        return not brake.worker.is_alive() or 'it has not ended 5 s after None'

    looks = 'super().scan_callback(scan) tests, looks and commands.'
    return [
        ('stop is received while it looks', stop_is_heard, 'Slow work does not belong there.'),
        (
            'it looks at 0 and at the newest',
            newest_are_looked_at,
            'A loop: take, and look at that.',
        ),
        ('it brakes as before', lambda: commands([0.5, 0.0, 0.5], [2.0, 0.4, 0.9]), looks),
        ('it stops for a scan that is old, or from the future', tests_the_age, looks),
        ('its worker ends', worker_ends, 'Test for None first: None ends the loop.'),
    ]


@tasks.add
def a_watchdog(LaserWatchdog):
    long_s, middle_s, short_s = 1.3, 0.9, 0.3

    @cached
    def trial():
        """Let it hear nothing, then one scan, then nothing."""
        with Bench() as bench:
            stops, begun_s = hear_stops(bench), time.monotonic()
            bench.spin(LaserWatchdog(long_s))
            bench.wait(lambda: stops, long_s + LATE_S)
            without = [at_s - begun_s for at_s in stops]
            again = bench.wait(lambda: len(stops) >= 3, LATE_S) if stops else False
            scan_s = time.monotonic()
            bench.say('scan', scan_with(bench, 0))
            stops.clear()  # those that came before the scan was handled
            bench.wait(lambda: stops, long_s + LATE_S)
            after = [at_s - scan_s for at_s in stops]
        return without, again, after

    def stops_without_a_scan():
        without, again, _ = trial()
        if not without:
            waited_s = long_s + LATE_S
            return f'with most_s={long_s}, no scan ever came, and in {waited_s} s no stop came'
        if without[0] < long_s:
            return f'with most_s={long_s} it stopped {without[0]:.1f} s after it was made'
        return again or 'one stop came, and then no more'

    def stops_after_a_scan():
        _, _, after = trial()
        return bool(after) or 'one scan came, and then no stop'

    def is_quiet_after_a_scan():
        without, _, after = trial()
        if not without and not after:
            return NEVER
        if after and after[0] < long_s:
            return f'with most_s={long_s} it stopped {after[0]:.1f} s after a scan'
        return True

    def waits_for_most_s():
        without, _, after = trial()
        if not without and not after:
            return NEVER
        with Bench() as bench:
            stops = hear_stops(bench)
            bench.spin(LaserWatchdog(short_s))
            bench.say('scan', scan_with(bench, 0))
            bench.wait(lambda: stops, short_s + LATE_S)
        waited_s = short_s + LATE_S
        return bool(stops) or f'with most_s={short_s}, {waited_s} s after a scan no stop came'

    def silence_until_a_stop(age_s, set_s):
        """Return how long after one scan it stopped (s), or None."""
        with Bench() as bench:
            stops = hear_stops(bench)
            bench.spin(LaserWatchdog(middle_s))
            begun_s = time.monotonic()
            bench.say('scan', scan_with(bench, 0, age_s))
            with clock_set_by(set_s):
                bench.wait(lambda: stops, middle_s + LATE_S)
        return stops[0] - begun_s if stops else None

    def counts_when_a_scan_came():
        """Let a scan come with another stamp, and set the clock of the computer."""
        without, _, after = trial()
        if not without and not after:
            return NEVER
        for what, age_s, set_s in (
            ('a scan came that was stamped an hour ago', 3600, 0),
            ('a scan came that was stamped an hour ahead', -3600, 0),
            ('a scan came, then somebody set the clock of the computer', 0, 3600),
        ):
            waited_s = silence_until_a_stop(age_s, set_s)
            if waited_s is None:
                return f'{what}, and in {middle_s + LATE_S} s no stop came'
            if waited_s < middle_s:
                return f'{what}, and with most_s={middle_s} it stopped after {waited_s:.1f} s'
        return True

    def needs_no_clock():
        with Bench() as bench:
            stops = hear_stops(bench)
            watchdog = LaserWatchdog(short_s)
            watchdog.set_parameters([Parameter('use_sim_time', value=True)])
            bench.spin(watchdog)
            bench.say('scan', scan_with(bench, 0))
            bench.wait(lambda: stops, short_s + LATE_S)
            clocks = {timer.clock.clock_type for timer in watchdog.timers}
        if ClockType.SYSTEM_TIME in clocks:
            return 'its timer is on the system clock, which jumps when somebody sets it'
        if not stops and clocks == {ClockType.STEADY_TIME}:
            return 'its timer is steady, but the times that it compares stand still without /clock'
        waited_s = short_s + LATE_S
        return bool(stops) or f'with use_sim_time and no /clock, no stop came in {waited_s} s'

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


LATE_S = 1.0  # that a stop may come late
NEVER = 'it never stops at all'


def hear_stops(bench):
    """Return a list to which the time of each stop is appended. Raises Failed for other speeds."""
    stops = []

    def command(twist):
        if twist != Twist():
            raise Failed(f'it commands the speed {twist.linear.x}')
        stops.append(time.monotonic())

    bench.tester.create_subscription(Twist, 'cmd_vel', command, 9)
    return stops


@tasks.add
def listen_for_two_events(listen):
    @cached
    def events():
        """Send one scan and none after it, then take the laser away."""
        missed, counts, tester_missed = [], [], []
        qos = QoSProfile(depth=1, deadline=Duration(seconds=0.3))
        with Bench() as bench:
            laser, brake = Node('laser'), Node('brake')
            publisher = laser.create_publisher(LaserScan, 'scan', qos)
            listen(brake, qos, missed, counts)
            late = SubscriptionEventCallbacks(deadline=tester_missed.append)
            bench.tester.create_subscription(
                LaserScan, 'scan', lambda scan: None, qos, event_callbacks=late
            )
            bench.spin(brake)
            publisher.publish(LaserScan())
            bench.wait(lambda: len(tester_missed) >= 3, 10)
            bench.wait(lambda: missed and counts, 1)
            while_silent = counts[-1:]
            laser.destroy_node()
            bench.wait(lambda: counts[-1:] == [0], 4 if counts else 0)
        return missed, while_silent, counts[-1:]

    def silent():
        missed, counts, _ = events()
        if not missed:
            return 'no deadline event was kept'
        return counted(counts, 1)

    def gone():
        return counted(events()[2], 0)

    def counted(counts, right):
        if not counts:
            return 'no matched event was kept'
        if not isinstance(counts[0], int):
            return f'no number was kept, but {type(counts[0]).__name__}'
        return counts[0] == right or f'the last count is {counts[0]}, not {right}'

    hint = 'matched gets an event: lambda event: counts.append(event.current_count). missed.append?'
    return [
        ('a silent laser', silent, hint),
        ('a laser that has gone', gone, hint),
    ]


@tasks.add
def choose_the_qos(laser_qos, map_qos):
    @cached
    def hear_laser():
        """Return the scans heard after a pause, and whether silence was reported."""
        must_be_profile('laser_qos', laser_qos)
        heard, missed, refused = [], [], []
        offered = QoSProfile(
            depth=10, reliability=ReliabilityPolicy.BEST_EFFORT, deadline=Duration(seconds=0.2)
        )
        with Bench() as bench:
            publisher = bench.tester.create_publisher(
                LaserScan, 'scan', offered, event_callbacks=NO_WARNING
            )
            events = SubscriptionEventCallbacks(
                deadline=missed.append, incompatible_qos=refused.append
            )
            node = Node('your_node')
            node.create_subscription(
                LaserScan,
                'scan',
                lambda scan: heard.append(number_of(scan)),
                laser_qos,
                event_callbacks=events,
            )
            for number in range(5):
                publisher.publish(scan_with(bench, number))
            bench.spin(node)
            bench.wait(lambda: refused or publisher.get_subscription_count())
            bench.quiet()
            if refused:
                names = ', '.join(map(policy_of, refused))
                raise Failed(f'the laser and your node are not connected: {names}')
            soon = Duration() < laser_qos.deadline <= Duration(seconds=2)
            told = soon and bench.wait(lambda: missed, 4)
        return heard, told

    def newest():
        heard, _ = hear_laser()
        return heard == [4] or f'of scans 0 to 4 your node received {heard or "none"}'

    def silence():
        _, told = hear_laser()
        return told or 'no event came in 2 s'

    def the_map():
        """Publish maps 1 to 3, join, and publish map 4."""
        must_be_profile('map_qos', map_qos)
        heard, refused = [], []
        offered = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        with Bench() as bench:
            publisher = bench.tester.create_publisher(
                Int32, 'map', offered, event_callbacks=NO_WARNING
            )
            for number in (1, 2, 3):
                publisher.publish(Int32(data=number))
            node = Node('your_node')
            node.create_subscription(
                Int32,
                'map',
                lambda message: heard.append(message.data),
                map_qos,
                event_callbacks=SubscriptionEventCallbacks(incompatible_qos=refused.append),
            )
            bench.spin(node)
            bench.wait(lambda: refused or publisher.get_subscription_count())
            publisher.wait_for_all_acked()  # the old maps are there, if any are to come
            bench.quiet()
            publisher.publish(Int32(data=4))
            bench.wait(lambda: refused or 4 in heard)
        if refused:
            names = ', '.join(map(policy_of, refused))
            return f'the map server and your node are not connected: {names}'
        return heard == [3, 4] or f'your node received {heard}, not [3, 4]'

    hint = 'Ask for no more than is offered. Then: how many places does the queue have?'
    late = 'A deadline of at most 2 s, and at least what the laser promises.'
    return [
        ('only the newest scan', newest, hint),
        ('silence is noticed', silence, late),
        ('the map is received', the_map, 'Which two things must be right on both sides?'),
    ]


NO_WARNING = PublisherEventCallbacks(use_default_callbacks=False)


def must_be_profile(name, qos):
    """Raise Failed if this is no QoSProfile."""
    if not isinstance(qos, QoSProfile):
        raise Failed(f'{name} is {qos!r}, and no QoSProfile')


def policy_of(event):
    return qos_policy_name_from_kind(event.last_policy_kind)
