"""What the tasks of the lesson "Fuse odometry, IMU and GPS" are judged by."""

import copy
import math

import numpy as np
import pymap3d
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus

from helpers.checks.bench import Bench
from helpers.checks.errors import Failed
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks
from helpers.fusion import VARIANCES, simulate
from helpers.robot import odometry_message
from helpers.ros import seconds_of, stamp_of, yaw_of

tasks = Tasks()
check = tasks.check

DATUM = (10.7769, 106.7009, 0.0)  # that of `where_a_fix_is`
TOPICS = {Odometry: 'odom', Imu: 'imu/data', NavSatFix: 'gps/fix'}


@tasks.add
def from_a_yaw_to_a_quaternion(quaternion_of):
    def turns(yaw):
        turn = quaternion_of(yaw)
        if not isinstance(turn, Quaternion):
            return f'it returns {turn!r}'
        length = math.hypot(turn.x, turn.y, turn.z, turn.w)
        if abs(length - 1) > 1e-6:
            return f'for {yaw:.2f} rad the squares of the four add up to {length**2:.2f}, not to 1'
        found = math.remainder(yaw_of(turn), math.tau)
        right = abs(math.remainder(found - yaw, math.tau)) < 1e-6
        about_z = abs(turn.x) + abs(turn.y) < 1e-9
        return (right and about_z) or f'for {yaw:.2f} rad it gives a yaw of {found:.2f} rad'

    return [
        ('0 rad', lambda: turns(0.0), 'Without a turn w is 1: the cosine of 0.'),
        ('a quarter to the left', lambda: turns(math.pi / 2), 'Half the angle, in both.'),
        ('more than a quarter to the right', lambda: turns(-2.5), 'The sine keeps the sign.'),
    ]


@tasks.add
def fill_in_an_imu(imu_message):
    def sent(*values):
        """Return the message as a node hears it."""
        message = imu_message(stamp_of(2.5), *values)
        if not isinstance(message, Imu):
            raise Failed(f'it returns {message!r}')
        for part in ('orientation', 'angular_velocity', 'linear_acceleration'):
            shape = np.shape(getattr(message, f'{part}_covariance'))
            if shape != (9,):  # it would be sent, with other numbers
                raise Failed(f'{part}_covariance has the shape {shape}, not nine numbers in a row')
        return deserialize_message(serialize_message(message), Imu)

    def has_header():
        header = sent(0.5, 0.1, 1.0, 2.0).header
        right = (header.frame_id, header.stamp) == ('imu_link', stamp_of(2.5))
        return right or f'the frame {header.frame_id!r}, at {seconds_of(header.stamp)} s'

    def accelerates(ax, ay):
        found = sent(0.5, 0.1, ax, ay).linear_acceleration
        found = found.x, found.y, found.z
        return np.allclose(found, (ax, ay, 9.81)) or f'for {ax}, {ay} the acceleration is {found}'

    def faces(yaw):
        found = yaw_of(sent(yaw, 0.1, 0.0, 0.0).orientation)
        return abs(found - yaw) < 1e-6 or f'for {yaw} rad the yaw is {found:.2f}'

    def has_covariances(yaw):
        message = sent(yaw, 0.1, 1.0, 2.0)
        variances = {
            'orientation': VARIANCES['imu_yaw'],
            'angular_velocity': VARIANCES['imu_vyaw'],
            'linear_acceleration': VARIANCES['ax'],
        }
        for part, variance in variances.items():
            covariance = getattr(message, f'{part}_covariance')
            if part == 'orientation' and yaw is None:
                if covariance[0] != -1:
                    return f'without a compass, orientation_covariance[0] is {covariance[0]}'
            elif not np.allclose(covariance, variance * np.eye(3).ravel()):
                numbers = ', '.join(f'{number:g}' for number in covariance)
                return f'{part}_covariance is {numbers}'
        return True

    return [
        ('stamp and frame', has_header, 'message.header.frame_id'),
        ('acceleration 1, 2', lambda: accelerates(1.0, 2.0), 'z is part of it.'),
        ('acceleration -0.5, 0', lambda: accelerates(-0.5, 0.0), 'ax and ay as they are given.'),
        ('yaw 0.5', lambda: faces(0.5), 'quaternion_of(yaw)'),
        ('yaw 0 is a yaw', lambda: has_covariances(0.0), 'if yaw is None, not: if not yaw.'),
        ('all covariances', lambda: has_covariances(0.5), 'np.diag([variance] * 3).ravel()'),
        (
            'no compass',
            lambda: has_covariances(None),
            'covariance[0] = -1, for the orientation only.',
        ),
    ]


@tasks.add
def what_an_imu_has_measured(from_imu):
    def takes(expected, **message):
        readings = from_imu(imu(**message))
        taken = {
            names[0]: (*values, *map(float, np.ravel(variances)))
            for names, values, variances in readings
        }
        if set(taken) != set(expected):
            return f'it takes {", ".join(taken) or "nothing"}'
        for name in expected:
            if not np.allclose(taken[name], expected[name]):
                return f'{name}: value and variance are {taken[name]}'
        return True

    yaw, vyaw, ax = {'yaw': (0.5, 3.0)}, {'vyaw': (-0.2, 6.0)}, {'ax': (0.7, 7.0)}
    others = {'yaw': (-1.0, 3.0), 'vyaw': (0.0, 6.0), 'ax': (2.0, 7.0)}
    mark = 'covariance[0] of a part is -1 if the IMU does not measure it.'
    return [
        ('all three, with their variances', lambda: takes(yaw | vyaw | ax), 'angular_velocity.z'),
        (
            'other values',
            lambda: takes(others, yaw=-1.0, vyaw=0.0, ax=2.0),
            'linear_acceleration.x',
        ),
        ('no compass', lambda: takes(vyaw | ax, without='orientation'), mark),
        ('no gyroscope', lambda: takes(yaw | ax, without='angular_velocity'), mark),
        ('no accelerometer', lambda: takes(yaw | vyaw, without='linear_acceleration'), mark),
    ]


def imu(yaw=0.5, vyaw=-0.2, ax=0.7, without=''):
    """Return a message of an IMU, `without` a part: its variances are all different."""
    message = Imu(orientation=Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2)))
    message.angular_velocity.z, message.linear_acceleration.x = vyaw, ax
    message.linear_acceleration.z = 9.81
    message.orientation_covariance = np.diag([1.0, 2.0, 3.0]).ravel()
    message.angular_velocity_covariance = np.diag([4.0, 5.0, 6.0]).ravel()
    message.linear_acceleration_covariance = np.diag([7.0, 8.0, 9.0]).ravel()
    if without:
        getattr(message, f'{without}_covariance')[0] = -1
    return message


@tasks.add
def where_a_fix_is(from_fix):
    def is_at(east, north, variances=(0.25, 0.25)):
        readings = from_fix(fix(east, north, variances=variances))
        if len(readings) != 1:
            return f'{len(readings)} readings of one fix'
        names, values, covariance = readings[0]
        if tuple(names) != ('x', 'y') or not np.allclose(values, (east, north), atol=1e-3):
            numbers = ', '.join(f'{value:.2f}' for value in values)
            return f'for {east} m east, {north} m north: {tuple(names)}, {numbers}'
        between = min(variances) / 4
        right = [[variances[0], between], [between, variances[1]]]
        found = np.array(covariance, float).tolist()
        return found == right or f'the covariance {found}, not {right}'

    def is_left_out(name):
        status = getattr(NavSatStatus, name)
        readings = from_fix(fix(1.0, 2.0, status))
        return len(readings) == 0 or f'with {name}, {status}, it returns {len(readings)} reading'

    def is_taken(name):
        status = getattr(NavSatStatus, name)
        readings = from_fix(fix(1.0, 2.0, status))
        return len(readings) == 1 or f'with {name}, {status}, it returns {len(readings)} readings'

    matrix = 'np.reshape(message.position_covariance, (3, 3))[:2, :2]'
    below = 'Below is <, not !=, and not ==.'
    return [
        ('10 m east, 20 m north', lambda: is_at(10.0, 20.0), 'geodetic2enu, and leave out "up".'),
        ('5 m west', lambda: is_at(-5.0, 0.0), 'x is east, y is north.'),
        ('another covariance', lambda: is_at(1.0, 1.0, (4.0, 9.0)), matrix),
        ('no fix, no reading', lambda: is_left_out('STATUS_NO_FIX'), 'Return [] first.'),
        ('an unknown status, no reading', lambda: is_left_out('STATUS_UNKNOWN'), below),
        ('better than a fix', lambda: is_taken('STATUS_GBAS_FIX'), below),
    ]


def fix(east, north, status=NavSatStatus.STATUS_FIX, variances=(0.25, 0.25)):
    """Return a message of GPS at a place in metres from the datum."""
    message = NavSatFix()
    message.status.status = status
    place = pymap3d.enu2geodetic(east, north, 0.0, *DATUM)
    message.latitude, message.longitude, message.altitude = map(float, place)
    covariance = np.diag([*variances, 4.0])
    covariance[0, 1] = covariance[1, 0] = min(variances) / 4
    message.position_covariance = covariance.ravel()
    return message


@tasks.add
def the_filter_node(FilterNode):
    def estimates_after(*messages):
        with Bench() as bench:
            estimates = bench.hear('odometry/filtered', Odometry)
            bench.spin(FilterNode())
            for message in messages:
                topic, before = TOPICS[type(message)], len(estimates)
                if not bench.tester.count_subscribers(topic):
                    raise Failed(f'nobody hears {topic}')
                bench.say(topic, message)
                if isinstance(message, Odometry) and len(estimates) == before:
                    raise Failed('it publishes nothing after a message of the wheels')
                if not isinstance(message, Odometry) and len(estimates) > before:
                    raise Failed(
                        f'it also publishes after a message of {topic}: only odom is answered'
                    )
        return estimates

    def last_after(*messages):
        """Return the last estimate, which must be as old as the last message."""
        last = estimates_after(*messages)[-1]
        found, right = (seconds_of(one.header.stamp) for one in (last, messages[-1]))
        if abs(found - right) > 0.01:
            raise Failed(f'its time is {found:.1f} s, not {right:.1f} s: it is that of the stamp')
        return last

    def answers(count):
        times = [number / 10 for number in range(count)]
        estimates = estimates_after(*(wheels(t, 1.0) for t in times))
        found = [round(seconds_of(estimate.header.stamp), 3) for estimate in estimates]
        return found == times or f'the stamps of its estimates: {found}, not {times}'

    def drives_to(x, *messages):
        found = estimates_after(*messages)[-1].pose.pose.position.x
        return abs(found - x) < 0.1 or f'x = {found:.1f} m, not {x:.1f} m'

    def turns_to(yaw):
        message = imu(yaw=yaw, vyaw=0.0)
        message.orientation_covariance = np.diag([1e-4] * 3).ravel()
        last = last_after(*again(message))
        found = yaw_of(last.pose.pose.orientation)
        return abs(found - yaw) < 0.2 or f'a yaw of {found:.1f} rad, not {yaw:.1f} rad'

    def goes_to_a_fix():
        last = last_after(*again(fix(0.0, 3.0, variances=(1e-4, 1e-4))))
        y = last.pose.pose.position.y
        return abs(y - 3) < 0.1 or f'y = {y:.1f} m after precise fixes at 3.0 m'

    def says_how_sure():
        last = estimates_after(wheels(0.0), wheels(2.0))[-1]
        of_x, of_vx = last.pose.covariance[0], last.twist.covariance[0]
        if not 0.09 < of_x < 0.13:
            return f'a variance of x of {of_x:.2f} m²: in 2 s the process noise alone makes 0.10'
        return 0 < of_vx < 0.01 or f'a variance of vx of {of_vx:.2f}'

    return [
        (
            'each message of the wheels is answered',
            lambda: answers(3),
            'self.publisher.publish(...)',
        ),
        (
            '2 s at 1 m/s are 2 m',
            lambda: drives_to(2.0, wheels(0.0, 1.0), wheels(2.0, 1.0)),
            'self.ekf.process(seconds_of(stamp), *reading)',
        ),
        (
            '4 s at 0.5 m/s are 2 m',
            lambda: drives_to(2.0, wheels(0.0, 0.5), wheels(4.0, 0.5)),
            'Publish after take, not before.',
        ),
        ('it turns with the IMU', lambda: turns_to(1.0), 'imu/data, from_imu'),
        ('it goes to a precise fix', goes_to_a_fix, 'gps/fix, from_fix'),
        ('it says how sure it is', says_how_sure, 'covariance[:3, :3] and covariance[3:6, 3:6]'),
    ]


def wheels(t, vx=0.0, vyaw=0.0):
    """Return a message of the wheels. Its pose is wrong, and must not be used."""
    variances = np.diag([0.0025, 0.01, 0.0025])
    return odometry_message(t, 'odom', (7.0, 7.0, 0.0, vx, 0.0, vyaw), variances, variances)


def again(message, count=8):
    """Return a message a few times, each followed by one from the wheels."""
    messages = [wheels(0.0)]
    for number in range(count):
        same = copy.copy(message)
        same.header = wheels(1 + number).header
        messages += [same, wheels(1.5 + number)]
    return messages


@tasks.add
def find_the_process_noise(best_noise):
    drive, other_drive = (
        cached(lambda: simulate(1, seconds=20)),
        cached(lambda: simulate(5, seconds=20)),
    )

    def finds(right, candidates, drive):
        found = best_noise(candidates, drive().measurements, drive().truth)
        return found == right or f'of {candidates} it returns {found!r}'

    return [
        (
            '0.002 of three',
            lambda: finds(0.002, [0.05, 0.002, 0.5], drive),
            'min(candidates, key=...)',
        ),
        (
            'the last one of two',
            lambda: finds(0.01, [1.0, 0.01], drive),
            'Compare the RMSE of each.',
        ),
        (
            'on another drive',
            lambda: finds(0.002, [0.01, 0.002, 1e-6], other_drive),
            'Pass x and y.',
        ),
    ]


@tasks.add
def a_gate(is_taken):
    def judges(right, innovation, covariance, gate=3.0):
        found = is_taken(np.array(innovation), np.array(covariance), gate)
        return bool(found) == right or (
            f'{innovation} with {covariance} and a gate of {gate}: {found}'
        )

    def both(*results):
        return next((result for result in results if result is not True), True)

    circle, long = [[1.0, 0.0], [0.0, 1.0]], [[4.0, 0.0], [0.0, 0.25]]
    tilted = [[2.0, 1.5], [1.5, 2.0]]
    return [
        (
            '2.9 and 3 sigma',
            lambda: both(judges(True, (2.9, 0.0), circle), judges(False, (3.0, 0.0), circle)),
            'Less than gate * gate.',
        ),
        (
            'along a long ellipse',
            lambda: judges(True, (5.0, 0.0), long),
            'Divide by the covariance.',
        ),
        (
            'across a long ellipse',
            lambda: judges(False, (0.0, 2.0), long),
            'Divide by the covariance.',
        ),
        (
            'a tilted ellipse',
            lambda: both(judges(True, (3.0, 3.0), tilted), judges(False, (2.0, -2.0), tilted, 2.5)),
            'Use the whole matrix, not its diagonal.',
        ),
        ('another gate', lambda: judges(False, (2.0, 0.0), circle, 1.5), 'Use gate.'),
    ]
