"""Of "Keep what is fresh": the way ahead, the brake, the age of a scan, the newest one."""

import math
import threading
from contextlib import contextmanager

from geometry_msgs.msg import Twist
from rclpy.parameter import Parameter
from rclpy.time import Time
from std_msgs.msg import Empty

from helpers.checks.bench import Bench, must_define, scan
from helpers.checks.errors import sentence
from helpers.checks.lessons.keep_what_is_fresh.shared import tasks
from helpers.checks.points import all_of, cached, expect, in_turn, rows
from helpers.ros import ros_session
from helpers.trials import stop_while_looking

NAN, INF = math.nan, math.inf


@tasks.add
def say_none_if_you_do_not_know(distance_ahead):
    def says(right, *beams, others=9.0, behind=False, limits=(0.12, 8.0)):
        """Ask for a scan with these ranges straight ahead, and with `others` elsewhere."""
        found = distance_ahead(scan_ahead(beams, others, behind, limits))
        unlike = ', counted from 0 to 2 pi' if behind else ''
        ahead = ', '.join(f'{beam:g}' for beam in beams) or 'no beams'
        what = f'ahead are {ahead}{unlike}: it returns'
        return expect(found, right, what, within=None if right is None else 0.001)

    def least_ahead():
        return all_of(
            says(2.0, 2.5, 2.0, 3.0, others=0.3),
            says(0.4, 0.4, 5.0, 5.0),
            says(1.5, 1.5, 4.0, 3.0, others=0.3, behind=True),
            # A range may be just the least or the greatest one; both have an exact float32.
            says(0.125, 0.125, NAN, NAN, 3.0, limits=(0.125, 8.0)),
            says(8.0, 8.0, NAN, NAN, 8.0, limits=(0.125, 8.0)),
        )

    def unknown_does_not_count():
        return all_of(
            says(2.0, NAN, 2.0, 3.0),
            says(2.0, 2.0, 3.0, NAN),
            says(3.0, 0.0, 3.0, 4.0),
            says(3.0, 0.0, 3.0, 4.0, limits=(0.0, 100.0)),
            says(3.0, 0.05, 3.0, 4.0),
            says(1.0, 1.0, 9.5, 9.5, 4.0),
        )

    def inf_is_known():
        return all_of(
            says(8.0, INF, INF, INF),
            says(3.5, INF, INF, limits=(0.12, 3.5)),
            says(2.0, INF, 2.0, INF),
            says(0.0, 2.0, -INF, 2.0),
            says(0.0, 2.0, 2.0, -INF, NAN),
        )

    def none_if_unknown():
        return in_turn(with_beams, lambda: says(None))  # without a beam, `min` raises

    def with_beams():
        return all_of(
            says(None, NAN, NAN, NAN),
            says(None, NAN, 2.0, NAN),
            says(None, 9.5, 2.0, 9.5),
            says(None, NAN, INF, NAN, NAN),
            says(None, NAN, -INF, NAN, NAN),
            says(2.0, NAN, 2.0, NAN, 3.0),
            says(None, 0.0, 0.0, 0.0, 2.0, 3.0),
        )

    known = 'scan.range_min <= r <= scan.range_max and r > 0 is False for each of these.'
    none = 'Count the known ones: fewer than half of len(ahead), or none at all, is None.'
    return [
        (
            'the least of the ranges ahead, whatever is at the sides',
            least_ahead,
            'Of the known ranges in `ahead`, the least.',
        ),
        (
            'what is unknown does not count: NaN, 0.0, too near, too far',
            unknown_does_not_count,
            known,
        ),
        (
            'inf is range_max, -inf is 0.0',
            inf_is_known,
            'Compare with math.inf and -math.inf first.',
        ),
        ('None if fewer than half are known, or if there is no beam', none_if_unknown, none),
    ]


def scan_ahead(beams, others, behind, limits):
    """Return a scan all around: just these beams are within 10 degrees of straight ahead.

    It counts from about -160 degrees, or from 0 if `behind`, so that the beams are at both ends.
    Without beams it looks to the left only.
    """
    count = len(beams)
    if not count:
        return scan([others] * 20, first=0.5, step=0.1, limits=limits)
    step = math.radians(20 / count)
    around = [*beams, *[others] * (17 * count)]  # to the left, from the first beam on
    begin = count // 2 if behind else -8 * count
    first = (begin - (count - 1) / 2) * step
    return scan(around[begin:] + around[:begin], first=first, step=step, limits=limits)


@tasks.add
def brake_before_the_wall(Brake):
    def brakes(distances, right, speed):
        scans = [(metres, 0) for metres in distances]
        speeds, looked_at = speeds_after(Brake, scans, depth=9, speed=speed)
        return all_of(
            expect(speeds, right, f'at {distances} m with speed {speed} it commands'),
            # A look may take long, and may say something else the next time.
            expect(looked_at, [*range(len(scans))], 'one after the other it looks at the scans'),
        )

    compare = 'Make a Twist, set its linear.x, publish it. Compare self.look(scan) with LIMIT_M.'
    return rows(
        brakes,
        compare,
        (
            'it drives where the way is free, and stops where a wall is near',
            [2.0, 0.7, 0.5, 0.2, 3.0],
            [0.5, 0.5, 0.0, 0.0, 0.5],
            0.5,
        ),
        (
            'it stops where the scan does not say it: None',
            [2.0, None, None, 3.0],
            [0.5, 0.0, 0.0, 0.5],
            0.5,
        ),
        ('the same at 0.25 m/s', [0.1, 5.0], [0.0, 0.25], 0.25),
    )


def speeds_after(make_brake, scans, **options):
    """Let a brake hear scans one by one. Return the speeds that it commands, and what it looks at.

    A scan is what `look` says of it, in metres, or the error that it raises, and its age in
    seconds. Looks are the numbers of the scans.
    """
    looked_at = []

    def look(message):
        looked_at.append(number_of(message))
        sees = scans[looked_at[-1]][0]
        if isinstance(sees, Exception):
            raise sees
        return sees

    with Bench() as bench:
        commands = bench.hear('cmd_vel', Twist)
        bench.spin(make_brake(look=look, **options))
        for number, (_, age_s) in enumerate(scans):
            say_and_wait(bench, 'scan', scan(number, age_s=age_s), commands)
        bench.quiet()
    return [twist.linear.x for twist in commands], looked_at


def say_and_wait(bench, topic, message, commands):
    """Publish a message, and wait for a command, or until it is handled without one."""
    before = len(commands)
    bench.say(topic, message, at_once=True)
    if not bench.wait(lambda: len(commands) > before, 0.3):
        bench.quiet()


def number_of(message):
    """Return the number of a scan: each of its ranges is this number."""
    return round(message.ranges[90])


@tasks.add
def how_old_is_a_scan(AgeBrake):
    def notes(*ages_s):
        brakes, noted_before_look = [], []

        def make(look, **options):
            def look_and_count(message):
                noted_before_look.append(len(brakes[0].ages_s))
                return look(message)

            brakes.append(AgeBrake(look=look_and_count, **options))
            return brakes[0]

        speeds_after(make, [(2.0, age_s) for age_s in ages_s], depth=9)
        found = brakes[0].ages_s
        is_right = len(found) == len(ages_s) and all(
            0 <= noted_s - age_s < 5 for noted_s, age_s in zip(found, ages_s, strict=True)
        )
        if not is_right:
            return f'of scans that are {[*ages_s]} s old, it noted: {shortly(found)}'
        if not noted_before_look:
            return 'it noted the ages, and did not look'
        each_before = {*noted_before_look} == {*range(1, len(ages_s) + 1)}
        return each_before or 'the age was not noted before the look'

    def uses_the_clock_of_the_node():
        with Bench() as bench:
            brake = AgeBrake(depth=9, look=lambda scan: 2.0)
            brake.set_parameters([Parameter('use_sim_time', value=True)])
            bench.spin(brake)
            bench.advance(20, step_s=20)
            bench.say('scan', scan(0, stamp=Time(seconds=15, nanoseconds=250_000_000).to_msg()))
        came = 'in a simulation, a scan of 15.25 s came at 20 s'
        is_right = [round(age_s, 3) for age_s in brake.ages_s] == [4.75]
        return is_right or f'{came}, and it noted: {shortly(brake.ages_s)}, not 4.75'

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


def shortly(ages_s):
    """Name ages in a sentence: '4.75, 10', 'more than a million' for those since 1970."""
    named = (f'{age_s:.2f}'.rstrip('0').rstrip('.') for age_s in ages_s)
    shortened = (
        name if abs(age_s) < 1e6 else 'more than a million'
        for name, age_s in zip(named, ages_s, strict=True)
    )
    return ', '.join(shortened) or 'nothing'


@tasks.add
def how_late_is_too_late(allowed_s):
    def computes(speed, limit, right):
        what = f'{speed} m/s, {limit} m: your function returns'
        return expect(allowed_s(speed, limit), right, what, within=0.005, unit='s')

    hint = 'Subtract RADIUS_M and speed**2 / (2 * BRAKING) from limit, and divide by the speed.'
    return rows(
        computes,
        hint,
        ('0.5 m/s, 0.6 m: 0.88 s', 0.5, 0.6, 0.88),
        ('1.0 m/s, 0.6 m: 0.29 s', 1.0, 0.6, 0.29),
        ('0.5 m/s, 1.0 m: 1.68 s', 0.5, 1.0, 1.68),
    )


@tasks.add
def stop_if_you_do_not_know(CarefulBrake):
    def is_careful(most_s, scans, right):
        must_define(CarefulBrake, '__init__')
        speeds, looked_at = speeds_after(CarefulBrake, scans, depth=9, most_s=most_s)
        ages = [age_s for _, age_s in scans]
        fresh = [number for number, age_s in enumerate(ages) if -0.1 < age_s < most_s]
        return all_of(
            expect(speeds, right, f'most_s={most_s}, scans of {ages} s: it commands'),
            expect([*dict.fromkeys(looked_at)], fresh, 'it looked at the scans'),
        )

    def goes_by_the_clock_of_the_node():
        """Let a scan come, and a minute later another one that is as old."""
        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist)
            brake = CarefulBrake(9, 5, look=lambda scan: 2.0)
            brake.set_parameters([Parameter('use_sim_time', value=True)])
            bench.spin(brake)
            for minute in 20, 60:
                bench.advance(minute, step_s=minute)
                say_and_wait(bench, 'scan', scan(0, stamp=Time(seconds=20).to_msg()), commands)
            speeds = [twist.linear.x for twist in commands]
        what = 'most_s=5, in a simulation, a scan of 20 s came at 20 s and at 80 s: it commands'
        return expect(speeds, [0.5, 0.0], what)

    def stops_for_old_ones():
        scans, right = [(2.0, 0), (2.0, 60), (2.0, 6), (0.3, 0)], [0.5, 0.0, 0.0, 0.0]
        return in_turn(lambda: is_careful(5, scans, right), goes_by_the_clock_of_the_node)

    hint = 'The age is that of task 3. Compare its nanoseconds / 1e9 with self.most_s.'
    both = 'A stamp from the future has an age below 0. Below -FUTURE_S it is unknown: stop.'
    return [
        (
            'at most 5 s: the old ones stop it',
            stops_for_old_ones,
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
    def commands(right, *topics):
        """Send scans and stops, and look at the speeds that it commands."""
        with Bench() as bench:
            heard = bench.hear('cmd_vel', Twist)
            bench.spin(StopBrake(9, most_s=60, look=lambda scan: 9.0))
            for topic in topics:
                message = scan(0) if topic == 'scan' else Empty()
                say_and_wait(bench, topic, message, heard)
            bench.quiet()
        speeds = [twist.linear.x for twist in heard]
        return expect(speeds, right, f'after {", ".join(topics)} it commanded')

    def stops_and_stays():
        right = [0.5, 0.5, 0.0, 0.0]
        return in_turn(lambda: commands(right, 'scan', 'scan', 'stop', 'scan'), stops_last)

    def stops_last():
        """Let a scan be handled just before the event is set: the stop must come behind it."""

        class SetLate(threading.Event):
            def set(self):
                thread = threading.Thread(target=brake.scan_callback, args=[scan(0)], daemon=True)
                thread.start()
                thread.join(timeout=0.5)  # it waits if the lock is taken
                super().set()

        with Bench() as bench:
            heard = bench.hear('cmd_vel', Twist)
            brake = bench.spin(StopBrake(9, most_s=60, look=lambda scan: 9.0))
            brake.stopped = SetLate()
            say_and_wait(bench, 'stop', Empty(), heard)
            bench.quiet()
        last = heard[-1].linear.x if heard else None
        what = 'another thread handles a scan just before `stopped` is set: the last command is'
        return expect(last, 0.0, what)

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
            stops_and_stays,
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
        return expect(found, right, f'put in turn: {[*rounds]}. Taken:')

    def forgets():
        place = Newest()
        for number in (1, 2, 3):
            place.put(number)
        return expect([*place.waiting], [3], 'after 1, 2, 3 were put, these wait:')

    def wakes():
        place, found = Newest(), []
        thread = threading.Thread(target=lambda: found.append(place.take()), daemon=True)
        thread.start()
        thread.join(timeout=0.2)
        place.put(7)
        thread.join(timeout=2)
        if found != [7]:
            return 'a thread that waits in take is not woken by put'
        with place.condition:
            thread = threading.Thread(target=place.put, args=[8], daemon=True)
            thread.start()
            thread.join(timeout=0.2)
            early = [*place.waiting]
        return not early or 'put changes what waits while another thread has the lock'

    def stays_closed():
        place = Newest()
        place.put(1)
        place.close()
        place.put(2)
        found = []
        thread = threading.Thread(target=lambda: found.append(place.take()), daemon=True)
        thread.start()
        thread.join(timeout=2)
        return expect(found, [None], '1 was put, close was called, 2 was put. Taken:')

    hint = 'The list holds one scan or none: self.waiting = ...'
    return [
        ('1, 2, 3 are put: 3 is taken', lambda: takes([3], [1, 2, 3]), hint),
        ('then 4, 5 are put: 5 is taken', lambda: takes([3, 5], [1, 2, 3], [4, 5]), hint),
        ('the replaced ones are forgotten', forgets, hint),
        ('a thread that waits is woken', wakes, 'put must replace and notify inside the lock.'),
        ('closed, it stays closed', stays_closed, 'Leave close and take as they are.'),
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
        return expect([*dict.fromkeys(numbers)], [0, 20], 'of 21 scans, the worker looked at')

    def commands(right, scans, **options):
        with errors_of_threads() as errors:
            speeds, _ = speeds_after(make, scans, depth=1, **options)
        found = expect(speeds, right, f'of scans at {named(scans)} it commands')
        if found is not True and errors:
            return f'the worker ended with {sentence(errors[0])}'
        return found

    def named(scans):
        return ', '.join(
            'an error in the look' if isinstance(sees, Exception) else f'{sees} m ({age_s} s old)'
            for sees, age_s in scans
        )

    def brakes():
        return commands([0.5, 0.0, 0.5], [(2.0, 0), (0.4, 0), (0.9, 0)])

    def tests_the_age():
        scans = [(2.0, 0), (2.0, 30), (2.0, -30), (2.0, 0)]
        return commands([0.5, 0.0, 0.0, 0.5], scans, most_s=5)

    def survives_an_error():
        scans = [(2.0, 0), (KeyError('lens'), 0), (2.0, 0), (ValueError('dust'), 0), (0.4, 0)]
        return commands([0.5, 0.0, 0.5, 0.0, 0.0], scans)

    def says_the_error():
        with Bench() as bench, errors_of_threads():
            brake = make(1, look=lambda scan: 1 / 0)
            commands = bench.hear('cmd_vel', Twist)
            bench.spin(brake)
            for _ in range(2):
                say_and_wait(bench, 'scan', scan(0), commands)
            bench.wait(lambda: len(bench.log('brake')) > 1, 1.0)
            lines = [line for line in bench.log('brake') if line.startswith('[ERROR]')]
        if not lines:
            return 'nothing is logged as an error'
        return len(lines) > 1 or 'a second error is not logged'

    def worker_ends():
        with errors_of_threads() as errors, ros_session():
            brake = NewestBrake(1)
            brake.newest.close()
            brake.scan_callback(scan(0))  # it comes after the end
            brake.worker.join(timeout=2)
            goes_on = brake.worker.is_alive()
        if errors:
            return f'it ended with {sentence(errors[0])}'
        return not goes_on or 'it has not ended 2 s after close()'

    looks = 'super().scan_callback(scan) tests, looks and commands.'
    fails = 'Inside the loop: try: ... except Exception as error: ...'
    return [
        ('stop is received while it looks', stop_is_heard, 'Slow work does not belong there.'),
        (
            'it looks at 0 and at the newest',
            newest_are_looked_at,
            'A loop: take, and look at that.',
        ),
        ('it brakes as before', brakes, looks),
        ('it stops for a scan that is old, or from the future', tests_the_age, looks),
        ('a look that fails: it stops, and goes on with the next scan', survives_an_error, fails),
        ('it logs the error', says_the_error, fails),
        ('its worker ends', worker_ends, 'Test for None first: None ends the loop.'),
    ]


@contextmanager
def errors_of_threads():
    """Keep the errors that end threads, in place of printing them."""
    errors, before = [], threading.excepthook
    threading.excepthook = lambda error: errors.append(error.exc_value)
    try:
        yield errors
    finally:
        threading.excepthook = before
