"""Of the sensors: transforms at a time, and scans that wait for one."""

import math
import sys
from functools import partial

import numpy as np
from geometry_msgs.msg import Transform, TransformStamped, Vector3

from helpers.checks.bench import Bench, override, scan
from helpers.checks.errors import Failed
from helpers.checks.lessons.put_the_sensors_on_the_robot.shared import in_text, tasks, tf_message
from helpers.checks.points import all_of, expect
from helpers.ros import quaternion, seconds_of, stamp_of, yaw_of


@tasks.add
def between_two_transforms(between):
    def goes(old, new, part, right):
        found = between(transform_of(*old), transform_of(*new), part)
        case = f'{part:g} of the way from x, y, yaw = {in_text(old)} to {in_text(new)}'
        return is_transform_to(found, right, f'{case}:')

    def leaves_both():
        old, new = transform_of(1.0, 2.0, 0.1), transform_of(3.0, 4.0, 0.3)
        between(old, new, 0.5)
        kept = (old, new) == (transform_of(1.0, 2.0, 0.1), transform_of(3.0, 4.0, 0.3))
        return kept or 'it changes the transforms that it gets'

    half = (1.0, 2.0, 0.0), (2.0, 4.0, 0.4), 0.5, (1.5, 3.0, 0.2)
    quarter = (2.0, 0.0, 0.6), (-2.0, 1.0, -1.4), 0.25, (1.0, 0.25, 0.1)
    to_the_left = (0.0, 0.0, 3.0), (0.0, 0.0, 3.2 - math.tau), 0.5, (0.0, 0.0, 3.1)
    to_the_right = (0.0, 0.0, -3.1), (0.0, 0.0, 3.1), 0.0, (0.0, 0.0, -3.1)
    short = 'math.remainder(turn, math.tau), before you take a part of it.'
    return [
        ('half of the way', lambda: goes(*half), 'start.x + part * (end.x - start.x)'),
        ('a quarter, back and to the right', lambda: goes(*quarter), 'part * turn, as well.'),
        ('over pi, to the left', lambda: goes(*to_the_left), short),
        ('over pi, to the right', lambda: goes(*to_the_right), short),
        ('both stay as they are', leaves_both, 'Make a new Vector3.'),
    ]


def is_transform_to(found, right, what):
    """Return whether a Transform has this x (m), y (m) and yaw (rad), or else both in a text."""
    if not isinstance(found, Transform):
        return f'{what} it returns {type(found).__name__}, not a Transform'
    x, y, yaw = found.translation.x, found.translation.y, yaw_of(found.rotation)
    off = x - right[0], y - right[1], math.remainder(yaw - right[2], math.tau)
    is_near = np.allclose(off, 0, atol=1e-6)
    if is_near and not np.allclose([found.rotation.x, found.rotation.y], 0, atol=1e-6):
        return f'{what} it also turns about x or y'
    return is_near or f'{what} x, y, yaw = {in_text((x, y, yaw))}, not {in_text(right)}'


def transform_of(x, y, yaw):
    return Transform(translation=Vector3(x=x, y=y), rotation=quaternion(0, 0, yaw))


def stamped_at(t, x, y, yaw, child='base_footprint'):
    stamped = TransformStamped(child_frame_id=child, transform=transform_of(x, y, yaw))
    stamped.header.frame_id, stamped.header.stamp = 'odom', stamp_of(t)
    return stamped


@tasks.add
def look_it_up(Buffer):
    KEPT = (0.5, 1.0, 0.0, 0.0), (0.75, 2.0, 0.0, 0.4), (1.25, 4.0, 1.0, 0.0)

    def filled(kept=KEPT):
        buffer = Buffer()
        for t, *place in kept:
            buffer.add(stamped_at(t, *place))
            buffer.add(stamped_at(t, 7.0, 7.0, 0.7, child='wheel'))
        return buffer

    def finds(t, *right, child='base_footprint'):
        found = filled().lookup(child, t)
        return is_transform_to(found, right, f'of {child} at {t:g} s:')

    def finds_the_only_one():
        found = filled(KEPT[:1]).lookup('base_footprint', 0.5)
        return is_transform_to(found, (1.0, 0.0, 0.0), 'of one transform, at its stamp:')

    def refuses(t, where, other):
        try:
            filled().lookup('base_footprint', t)
        except Exception as error:
            if type(error).__name__ != 'ExtrapolationException':
                raise
            text = str(error)
        else:
            times = ', '.join(f'{kept[0]:g}' for kept in KEPT)
            return f'transforms of {times} s, asked for {t:g} s: it raises nothing'
        names_both = f'{t:.6f}' in text and f'{other:.6f}' in text
        return all_of(
            f'into the {where}' in text or f'at {t:g} s it says: {text}',
            names_both or f'it does not name the times {t:g} and {other:g}: {text}',
        )

    at_a_stamp = 'kept[bisect_left(times, t)].transform'
    no_second = 'if times[after] == t: no other transform is needed.'
    part = 'part is (t - before) / (after - before), in times.'
    future = 'raise ExtrapolationException(FUTURE.format(t, times[-1]))'
    past = 'raise ExtrapolationException(PAST.format(t, times[0]))'
    return [
        ('at a stamp', lambda: finds(0.75, 2.0, 0.0, 0.4), at_a_stamp),
        ('at the newest', lambda: finds(1.25, 4.0, 1.0, 0.0), 'Only t > times[-1] is too late.'),
        ('at the oldest', lambda: finds(0.5, 1.0, 0.0, 0.0), 'Only t < times[0] is too early.'),
        ('at the only one', finds_the_only_one, no_second),
        ('between the first two', lambda: finds(0.55, 1.2, 0.0, 0.08), part),
        ('between the last two', lambda: finds(1.0, 3.0, 0.5, 0.2), 'between(old, new, part)'),
        ('another child', lambda: finds(1.0, 7.0, 7.0, 0.7, child='wheel'), 'transforms[child]'),
        ('in the future', lambda: refuses(1.5, 'future', 1.25), future),
        ('in the past', lambda: refuses(0.25, 'past', 0.5), past),
    ]


BROKEN_S = 99.0  # the time of a scan at which the buffer has an error of another kind


@tasks.add
def keep_it_until_its_transform_is_there(PatientMapper, in_robot):
    def scan_of(t):
        return scan([1.0], first=0.0, step=0.1, limits=(0.1, 8.0), stamp=stamp_of(t))

    def after(*messages):
        """Let scans ('scan', t) and transforms ('tf', t) come: at t the robot is at x = t - 1.

        Return the mapper, and how many scans it had placed after each message.
        """
        # To write these two are other tasks: this one is judged without them.
        override(PatientMapper, Buffer=partial(OwnBuffer, PatientMapper), to_parent=shifted)
        placed = []
        with Bench() as bench:
            mapper = bench.spin(PatientMapper())
            for kind, t in messages:
                if kind == 'scan':
                    mapper.scan_callback(scan_of(t))
                else:
                    stamped = stamped_at(t, t - 1.0, 0.0, 0.0)
                    mapper.tf_callback(tf_message()(transforms=[stamped]))
                placed.append(len(mapper.found))
        return mapper, placed

    def places(right, *messages):
        _, placed = after(*messages)
        came = ', '.join(f'{kind} of {t:g} s' for kind, t in messages)
        return expect(placed, right, f'{came}: after each of these it has placed')

    def others_wait():
        placed = places([0, 0, 0, 0, 2, 3], *three)
        return placed if placed is not True else tells_another_error()

    def tells_another_error():
        """Let a scan come while the buffer has an error of another kind."""
        try:
            after(('tf', 1.0), ('scan', BROKEN_S))
        except ValueError:
            return True
        hint = 'except ExtrapolationException, and nothing else.'
        raise Failed('it hides every error: a ValueError of self.buffer is lost', hint=hint)

    def at_its_place():
        mapper, placed = after(*early)
        if placed[-1] != 1:
            return 'the scan is not placed'
        x = float(np.ravel(mapper.found[0])[0])
        right = 0.5 + float(np.ravel(in_robot(scan_of(1.5)))[0])
        return expect(x, right, 'the scan is placed at x =', within=1e-6, unit='m')

    def not_for_ever():
        stamps = [round(2 + number / 10, 1) for number in range(15)]
        mapper, _ = after(('tf', 1.0), *(('scan', t) for t in stamps))
        waiting = [round(seconds_of(scan.header.stamp), 1) for scan in mapper.waiting]
        return expect(waiting, stamps[5:], 'of 15 scans without a transform wait those of (s)')

    in_time = ('tf', 1.0), ('tf', 2.0), ('scan', 1.5)
    early = ('tf', 1.0), ('scan', 1.5), ('tf', 2.0)
    three = ('tf', 1.0), ('scan', 1.2), ('scan', 1.4), ('scan', 2.5), ('tf', 2.0), ('tf', 3.0)
    calls = 'scan_callback calls try_again.'
    new_list = 'except ExtrapolationException: it goes into a new list.'
    each = 'A try for each scan. A loop skips some if its list changes meanwhile.'
    newest = 'self.waiting = too_early[-AT_MOST:]'
    return [
        ('a scan whose transform is there', lambda: places([0, 0, 1], *in_time), calls),
        (
            'a scan that is too early',
            lambda: places([0, 0, 1, 1], *early, ('tf', 3.0)),
            new_list,
        ),
        ('it is placed where the robot was', at_its_place, 'self.place(scan)'),
        ('the others go on waiting', others_wait, each),
        ('at most ten wait, the newest', not_for_ever, newest),
    ]


class OwnBuffer:
    """A buffer for a robot that does not turn. It raises the notebook's ExtrapolationException."""

    def __init__(self, of_notebook):
        names = vars(sys.modules[of_notebook.__module__])
        self.error, self.future = names['ExtrapolationException'], names['FUTURE']
        self.times, self.places = [], []

    def add(self, stamped):
        self.times.append(seconds_of(stamped.header.stamp))
        self.places.append(stamped.transform.translation.x)

    def lookup(self, child, t):
        if t == BROKEN_S:
            raise ValueError(child)
        if t > self.times[-1]:
            raise self.error(self.future.format(t, self.times[-1]))
        return transform_of(float(np.interp(t, self.times, self.places)), 0.0, 0.0)


def shifted(x, y, transform):
    return x + transform.translation.x, y + transform.translation.y
