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
from helpers.checks.points import all_of, cached, expect
from helpers.checks.tasks import Tasks
from helpers.fusion import VARIANCES, ExtendedKalmanFilter, from_odometry, simulate
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
            return f'it returns {turn!r}, not a Quaternion'
        squares = turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2
        found = math.remainder(yaw_of(turn), math.tau)
        case = f'for {yaw:.2f} rad'
        return all_of(
            expect(squares, 1, f'{case} the squares of the four add up to', within=1e-6),
            expect(rounded([turn.x, turn.y]), [0.0, 0.0], f'{case} x and y are'),
            expect(found, yaw, f'{case} it gives a yaw of', within=1e-6, unit='rad'),
        )

    return [
        ('0 rad', lambda: turns(0.0), 'Without a turn w is 1: the cosine of 0.'),
        ('a quarter to the left', lambda: turns(math.pi / 2), 'Half the angle, in both.'),
        ('more than a quarter to the right', lambda: turns(-2.5), 'The sine keeps the sign.'),
    ]


def rounded(numbers):
    """Return numbers, or those of a matrix row by row, as a list that can be compared."""
    return [round(float(number), 6) for number in np.ravel(numbers)]


@tasks.add
def fill_in_an_imu(imu_message):
    def sent(*values):
        """Return the message as a node hears it."""
        message = imu_message(stamp_of(2.5), *values)
        if not isinstance(message, Imu):
            raise Failed(f'it returns {message!r}, not an Imu')
        for part in ('orientation', 'angular_velocity', 'linear_acceleration'):
            shape = np.shape(getattr(message, f'{part}_covariance'))
            if shape != (9,):  # it would be sent, with other numbers
                raise Failed(f'{part}_covariance has the shape {shape}, not nine numbers in a row')
        return deserialize_message(serialize_message(message), Imu)

    def has_header():
        header = sent(0.5, 0.1, 1.0, 2.0).header
        return all_of(
            expect(header.frame_id, 'imu_link', 'its frame is'),
            expect(seconds_of(header.stamp), 2.5, 'its stamp is', unit='s'),
        )

    def accelerates(ax, ay):
        found = sent(0.5, 0.1, ax, ay).linear_acceleration
        what = f'for {ax}, {ay} the acceleration is'
        return expect(rounded([found.x, found.y, found.z]), [ax, ay, 9.81], what)

    def faces(yaw):
        message = sent(yaw, 0.1, 0.0, 0.0)
        found, turning = yaw_of(message.orientation), message.angular_velocity.z
        return all_of(
            expect(found, yaw, f'for {yaw} rad the yaw is', within=1e-6, unit='rad'),
            expect(turning, 0.1, 'for 0.1 rad/s the turning rate is', within=1e-6, unit='rad/s'),
        )

    def has_covariance(message, part, variance):
        found = rounded(getattr(message, f'{part}_covariance'))
        return expect(found, rounded(variance * np.eye(3)), f'{part}_covariance is')

    def has_covariances(yaw):
        message = sent(yaw, 0.1, 1.0, 2.0)
        if yaw is None:
            mark = 'without a compass, orientation_covariance[0] is'
            of_yaw = expect(message.orientation_covariance[0], -1, mark)
        else:
            of_yaw = has_covariance(message, 'orientation', VARIANCES['imu_yaw'])
        return all_of(
            of_yaw,
            has_covariance(message, 'angular_velocity', VARIANCES['imu_vyaw']),
            has_covariance(message, 'linear_acceleration', VARIANCES['ax']),
        )

    mark = 'covariance[0] = -1, for the orientation only.'
    return [
        ('stamp and frame', has_header, 'message.header.frame_id'),
        ('acceleration 1, 2', lambda: accelerates(1.0, 2.0), 'z is part of it.'),
        ('acceleration -0.5, 0', lambda: accelerates(-0.5, 0.0), 'ax and ay as they are given.'),
        ('yaw 0.5', lambda: faces(0.5), 'quaternion_of(yaw)'),
        ('yaw 0 is a yaw', lambda: has_covariances(0.0), 'if yaw is None, not: if not yaw.'),
        ('all covariances', lambda: has_covariances(0.5), 'np.diag([variance] * 3).ravel()'),
        ('no compass', lambda: has_covariances(None), mark),
    ]


@tasks.add
def what_an_imu_has_measured(from_imu):
    def takes(right, **message):
        taken = {
            names[0]: rounded([*values, *np.ravel(variances)])
            for names, values, variances in from_imu(imu(**message))
        }
        return all_of(
            expect(sorted(taken), sorted(right), 'it takes'),
            *(
                expect(taken.get(name), right[name], f'{name}: value and variance are')
                for name in right
            ),
        )

    yaw, vyaw, ax = {'yaw': [0.5, 3.0]}, {'vyaw': [-0.2, 6.0]}, {'ax': [0.7, 7.0]}
    others = {'yaw': [-1.0, 3.0], 'vyaw': [0.0, 6.0], 'ax': [2.0, 7.0]}
    other_values = {'yaw': -1.0, 'vyaw': 0.0, 'ax': 2.0}
    mark = 'covariance[0] of a part is -1 if the IMU does not measure it.'
    return [
        ('all three, with their variances', lambda: takes(yaw | vyaw | ax), 'angular_velocity.z'),
        ('other values', lambda: takes(others, **other_values), 'linear_acceleration.x'),
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
    def is_at(east, north, up=0.0, variances=(0.25, 0.25)):
        readings = from_fix(fix(east, north, up, variances=variances))
        if len(readings) != 1:
            return f'of one fix it returns {len(readings)} readings'
        names, values, covariance = readings[0]
        between = min(variances) / 4
        right = [[variances[0], between], [between, variances[1]]]
        metres = [round(float(value), 3) for value in values]
        return all_of(
            expect(tuple(names), ('x', 'y'), 'the names of what it returns are'),
            expect(metres, [east, north], f'for {east:g} m east, {north:g} m north it returns'),
            expect(np.array(covariance, float).tolist(), right, 'the covariance is'),
        )

    def returns(count, name):
        status = getattr(NavSatStatus, name)
        readings = from_fix(fix(1.0, 2.0, status=status))
        return expect(len(readings), count, f'with {name}, {status}, the number of readings is')

    matrix = 'np.reshape(message.position_covariance, (3, 3))[:2, :2]'
    altitude = 'geodetic2enu needs the altitude of the message, too.'
    below = 'Below is <, not !=, and not ==.'
    return [
        ('10 m east, 20 m north', lambda: is_at(10.0, 20.0), 'geodetic2enu, and leave out "up".'),
        ('5 m west', lambda: is_at(-5.0, 0.0), 'x is east, y is north.'),
        ('2 km away, on a hill of 500 m', lambda: is_at(2000.0, -1000.0, 500.0), altitude),
        ('another covariance', lambda: is_at(1.0, 1.0, variances=(4.0, 9.0)), matrix),
        ('no fix, no reading', lambda: returns(0, 'STATUS_NO_FIX'), 'Return [] first.'),
        ('an unknown status, no reading', lambda: returns(0, 'STATUS_UNKNOWN'), below),
        ('better than a fix', lambda: returns(1, 'STATUS_GBAS_FIX'), below),
    ]


def fix(east, north, up=0.0, status=NavSatStatus.STATUS_FIX, variances=(0.25, 0.25)):
    """Return a message of GPS at a place in metres from the datum."""
    message = NavSatFix()
    message.status.status = status
    place = pymap3d.enu2geodetic(east, north, up, *DATUM)
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
                answered = len(estimates) > before
                if topic == 'odom' and not answered:
                    raise Failed('it publishes nothing after a message of the wheels')
                if topic != 'odom' and answered:
                    raise Failed(
                        f'it also publishes after a message of {topic}: only odom is answered'
                    )
        return estimates

    def has_stamp_of(message, estimate):
        found, right = seconds_of(estimate.header.stamp), seconds_of(message.header.stamp)
        return expect(found, right, 'the stamp of its estimate is', within=0.01, unit='s')

    def answers(count):
        times = [number / 10 for number in range(count)]
        estimates = estimates_after(*(wheels(t, 1.0) for t in times))
        found = [round(seconds_of(estimate.header.stamp), 3) for estimate in estimates]
        return expect(found, times, 'the stamps (s) of its estimates are')

    def drives_to(x, *messages):
        found = estimates_after(*messages)[-1].pose.pose.position.x
        return expect(found, x, 'it is at x =', within=0.1, unit='m')

    def turns_to(yaw):
        message = imu(yaw=yaw, vyaw=0.0)
        message.orientation_covariance = np.diag([1e-4] * 3).ravel()
        messages = again(message)
        last = estimates_after(*messages)[-1]
        found = yaw_of(last.pose.pose.orientation)
        return all_of(
            has_stamp_of(messages[-1], last),
            expect(found, yaw, 'it has a yaw of', within=0.2, unit='rad'),
        )

    def goes_to_a_fix():
        messages = again(fix(0.0, 3.0, variances=(1e-4, 1e-4)))
        last = estimates_after(*messages)[-1]
        y = last.pose.pose.position.y
        return all_of(
            has_stamp_of(messages[-1], last),
            expect(y, 3, 'after precise fixes at y = 3 m it is at y =', within=0.1, unit='m'),
        )

    def says_how_sure():
        last = estimates_after(wheels(0.0), wheels(2.0))[-1]
        of_x, of_vx = last.pose.covariance[0], last.twist.covariance[0]
        if not 0.09 < of_x < 0.13:
            return f'a variance of x of {of_x:.2f} m²: in 2 s the process noise alone makes 0.10'
        return 0 < of_vx < 0.01 or (
            f'a variance of vx of {of_vx:.2f}: the wheels measure it, and it is below 0.01'
        )

    def is_that_of_the_filter():
        messages, ekf = drive_of_all_sensors(), ExtendedKalmanFilter()
        for message in messages:
            for reading in readings_of(message):
                ekf.process(seconds_of(message.header.stamp), *reading)
        last = estimates_after(*messages)[-1]
        pose = last.pose
        found = [pose.pose.position.x, pose.pose.position.y, yaw_of(pose.pose.orientation)]
        sure = [pose.covariance[0], pose.covariance[7], pose.covariance[35]]
        return all_of(
            expect(last.header.frame_id, 'odom', 'the frame of its estimate is'),
            expect(rounded(found), rounded(ekf.state[:3]), 'after a drive, x, y and yaw are'),
            expect(rounded(sure), rounded(np.diag(ekf.covariance)[:3]), 'their variances are'),
        )

    publish, after = 'self.publisher.publish(...)', 'Publish after take, not before.'
    process = 'self.ekf.process(seconds_of(stamp), *reading)'
    fast, slow = (wheels(0.0, 1.0), wheels(2.0, 1.0)), (wheels(0.0, 0.5), wheels(4.0, 0.5))
    return [
        ('each message of the wheels is answered', lambda: answers(3), publish),
        ('2 s at 1 m/s are 2 m', lambda: drives_to(2.0, *fast), process),
        ('4 s at 0.5 m/s are 2 m', lambda: drives_to(2.0, *slow), after),
        ('it turns with the IMU', lambda: turns_to(1.0), 'imu/data, from_imu'),
        ('it goes to a precise fix', goes_to_a_fix, 'gps/fix, from_fix'),
        ('it says how sure it is', says_how_sure, 'covariance[:3, :3] and covariance[3:6, 3:6]'),
        (
            'each reading counts once, when it comes',
            is_that_of_the_filter,
            'One take for each message, in its callback; one process for each reading.',
        ),
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


def drive_of_all_sensors():
    """Return messages of all three sensors, each later than the one before."""
    messages = []
    for number in range(3):
        turn, place = imu(0.1 * number, 0.2, 0.3), fix(0.5 * number, 0.2)
        turn.header, place.header = wheels(number + 0.2).header, wheels(number + 0.4).header
        messages += [wheels(number, 0.5, 0.2), turn, place]
    return [*messages, wheels(3.0, 0.5, 0.2)]


def readings_of(message):
    """Return what a filter takes from a message of `drive_of_all_sensors`."""
    if isinstance(message, Odometry):
        return from_odometry(message)
    if isinstance(message, NavSatFix):
        position = message.latitude, message.longitude, message.altitude
        east, north, _ = pymap3d.geodetic2enu(*position, *DATUM)
        covariance = np.reshape(message.position_covariance, (3, 3))[:2, :2]
        return [(('x', 'y'), (east, north), covariance)]
    yaw, vyaw, ax = (
        message.orientation_covariance[8],
        message.angular_velocity_covariance[8],
        message.linear_acceleration_covariance[0],
    )
    return [
        (('yaw',), (yaw_of(message.orientation),), (yaw,)),
        (('vyaw',), (message.angular_velocity.z,), (vyaw,)),
        (('ax',), (message.linear_acceleration.x,), (ax,)),
    ]


@tasks.add
def find_the_process_noise(best_noise):
    drive = cached(lambda: simulate(1, seconds=20))
    # In the one drive x decides, in the other y.
    other_drives = cached(lambda: [simulate(seed, seconds=20) for seed in (5, 6)])

    def finds(right, candidates, drive):
        found = best_noise(candidates, drive.measurements, drive.truth)
        return expect(found, right, f'of {candidates} it returns')

    def finds_on_others():
        return all_of(*(finds(0.002, [0.01, 0.002, 1e-6], drive) for drive in other_drives()))

    key, compare = 'min(candidates, key=...)', 'Compare the RMSE of each.'
    return [
        ('0.002 of three', lambda: finds(0.002, [0.002, 0.05, 0.5], drive()), key),
        ('the last one of two', lambda: finds(0.01, [1.0, 0.01], drive()), compare),
        ('on another drive', finds_on_others, 'Pass x and y.'),
    ]


@tasks.add
def a_gate(is_taken):
    def judges(right, innovation, covariance, gate=3.0):
        found = is_taken(np.array(innovation), np.array(covariance), gate)
        return expect(bool(found), right, f'{innovation} with {covariance} and a gate of {gate}:')

    def two_on_a_circle():
        return all_of(judges(True, (2.9, 0.0), circle), judges(False, (3.0, 0.0), circle))

    def two_on_a_tilted_one():
        along, across = (3.0, 3.0), (2.0, -2.0)
        return all_of(judges(True, along, tilted), judges(False, across, tilted, 2.5))

    def another_gate():
        takes_nan = judges(False, (math.nan, 0.0), circle)
        if takes_nan is not True:
            hint = 'Every comparison with NaN is false: ask what is taken, not what is left out.'
            raise Failed(takes_nan, hint=hint)
        return judges(False, (2.0, 0.0), circle, 1.5)

    circle, long = [[1.0, 0.0], [0.0, 1.0]], [[4.0, 0.0], [0.0, 0.25]]
    tilted = [[2.0, 1.5], [1.5, 2.0]]
    divide, whole = 'Divide by the covariance.', 'Use the whole matrix, not its diagonal.'
    return [
        ('2.9 and 3 sigma', two_on_a_circle, 'Less than gate * gate.'),
        ('along a long ellipse', lambda: judges(True, (5.0, 0.0), long), divide),
        ('across a long ellipse', lambda: judges(False, (0.0, 2.0), long), divide),
        ('a tilted ellipse', two_on_a_tilted_one, whole),
        ('another gate', another_gate, 'Use gate.'),
    ]
