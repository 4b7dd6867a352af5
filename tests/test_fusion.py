import math
import time
from functools import cache
from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import Imu, NavSatFix
from support.nodes import LIMIT_S

from helpers.fusion import (
    PROCESS_NOISE,
    SENSORS,
    STATE,
    VARIANCES,
    ExtendedKalmanFilter,
    chi_square_bounds,
    covariances,
    errors,
    fuse,
    innovations,
    motion,
    nees,
    rmse,
    simulate,
)
from helpers.session import ros_session

DATA = Path(__file__).parent / 'data'
ODOM, ODOM_IMU = ('odom',), ('odom', 'imu')
SEEDS = pytest.mark.parametrize('seed', [1, 2, 3])


@cache
def drive(number):
    """Return the measurements, the truth, and what robot_localization estimated."""
    table = pd.read_csv(DATA / f'drive{number}.csv.gz')
    truth = table[['t']].assign(x=table['true_x'], y=table['true_y'], yaw=table['true_yaw'])
    return table.loc[:, 't':'gps_y'], truth, table.filter(like='rl_')


@cache
def simulated(seed, **settings):
    return simulate(seed, **settings)


# --- Against robot_localization ------------------------------------------------------------------


@pytest.mark.parametrize(
    ('number', 'sensors', 'expected_m'),
    [
        (101, ODOM, 3.761),
        (101, ODOM_IMU, 0.118),
        (101, SENSORS, 0.320),
        (102, ODOM, 6.889),
        (102, ODOM_IMU, 0.192),
        (102, SENSORS, 0.302),
    ],
)
def test_the_path_of_robot_localization(number, sensors, expected_m):
    measurements, truth, reference = drive(number)
    estimate = fuse(measurements, sensors=sensors)
    name = 'rl_' + '_'.join(sensors)
    apart = estimate[['x', 'y']].to_numpy() - reference[[f'{name}_x', f'{name}_y']].to_numpy()
    # The columns have six decimals, of the estimates and of what they were made from.
    assert np.abs(apart).max() < (1e-5 if sensors == ODOM else 2e-6)
    assert rmse(estimate, truth) == pytest.approx(expected_m, abs=5e-4)


def test_the_columns():
    measurements, _, _ = drive(101)
    measurements = measurements[:200]
    before = measurements.copy()
    estimate = fuse(measurements)
    pd.testing.assert_frame_equal(measurements, before)
    assert list(estimate) == [
        *('t', 'x', 'y', 'yaw', 'vx', 'vy', 'vyaw'),
        *('var_x', 'cov_x_y', 'cov_x_yaw', 'var_y', 'cov_y_yaw', 'var_yaw'),
        *('var_vx', 'cov_vx_vy', 'cov_vx_vyaw', 'var_vy', 'cov_vy_vyaw', 'var_vyaw'),
    ]
    assert estimate['t'].tolist() == measurements['t'].tolist()
    assert estimate.notna().all(axis=None)
    assert (estimate.filter(like='var_') > 0).all(axis=None)


def test_what_does_not_matter():
    measurements = drive(101)[0][:200]
    estimate = fuse(measurements)
    other = measurements[measurements.columns[::-1]].assign(note='text')
    other.index = other.index[::-1]
    pd.testing.assert_frame_equal(fuse(other), estimate)
    for sensors in permutations(SENSORS):
        pd.testing.assert_frame_equal(fuse(measurements, list(sensors)), estimate)
    pd.testing.assert_frame_equal(fuse(measurements.astype({'vx': 'Float64'})), estimate)


def test_a_sensor_needs_only_its_own_columns():
    measurements = drive(101)[0][:200]
    pd.testing.assert_frame_equal(
        fuse(measurements[['t', 'vx', 'vyaw']], ODOM), fuse(measurements, ODOM)
    )
    dead = measurements.assign(gps_x=np.nan, gps_y=np.nan)
    pd.testing.assert_frame_equal(fuse(dead), fuse(measurements, ODOM_IMU))


def test_times_that_begin_elsewhere():
    measurements = drive(101)[0][:500]
    later = fuse(measurements.assign(t=measurements['t'] + 1e6)).drop(columns='t')
    assert np.allclose(later, fuse(measurements).drop(columns='t'), rtol=0, atol=1e-6)


def test_6000_rows_in_less_than_a_second_and_a_half():
    measurements, _, _ = drive(101)
    took = []
    for _ in range(3):
        started = time.thread_time()  # not what other processes take away
        fuse(measurements)
        took.append(time.thread_time() - started)
    assert min(took) < 1.5


# --- Predict -------------------------------------------------------------------------------------

angles = st.floats(-math.pi, math.pi)
speeds = st.floats(-5, 5)
states = st.tuples(speeds, speeds, angles, *[speeds] * 5).map(np.array)


@given(states, st.floats(0, 0.5))
def test_the_jacobian_is_the_derivative(state, dt):
    state[2] *= 0.2  # the yaw stays away from the place where it is wrapped
    state[5] *= 0.2
    step = 1e-6
    columns = [
        (motion(state + step * axis, dt)[0] - motion(state - step * axis, dt)[0]) / (2 * step)
        for axis in np.eye(8)
    ]
    assert np.allclose(motion(state, dt)[1], np.transpose(columns), rtol=0, atol=1e-7)


@given(states, st.floats(0, 0.5))
def test_the_motion(state, dt):
    x, y, yaw, vx, vy, vyaw, ax, ay = state
    forwards, sideways = vx * dt + ax * dt**2 / 2, vy * dt + ay * dt**2 / 2
    moved, _ = motion(state, dt)
    expected = [
        x + forwards * math.cos(yaw) - sideways * math.sin(yaw),
        y + forwards * math.sin(yaw) + sideways * math.cos(yaw),
        math.remainder(yaw + vyaw * dt, math.tau),
        vx + ax * dt,
        vy + ay * dt,
        vyaw,
        ax,
        ay,
    ]
    assert np.allclose(moved, expected, rtol=0, atol=1e-12)


def test_predict_adds_the_process_noise_of_the_time():
    ekf = ExtendedKalmanFilter()
    ekf.predict(0.5)
    assert np.diag(ekf.covariance)[-2:] == pytest.approx([0.005, 0.005])
    still = ExtendedKalmanFilter(process_noise=np.zeros((8, 8)))
    still.predict(0.5)
    assert np.allclose(still.covariance, 1e-9 * np.eye(8), rtol=0, atol=1e-9)
    ekf.predict(0)
    assert ekf.t is None


def test_three_ways_to_give_the_process_noise():
    diagonal = list((PROCESS_NOISE | {'x': 0.001}).values())
    for noise in ({'x': 0.001}, diagonal, np.diag(diagonal)):
        assert (ExtendedKalmanFilter(noise).process_noise == np.diag(diagonal)).all()


# --- Update --------------------------------------------------------------------------------------


def positive(size, seed):
    """A covariance."""
    root = np.random.default_rng(seed).normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


subsets = st.lists(st.sampled_from(range(8)), min_size=1, max_size=8, unique=True)


@given(subsets, st.integers(0, 1000))
def test_update_is_the_textbook_one(index, seed):
    k = len(index)
    values = np.random.default_rng(seed).uniform(-1, 1, k)
    prior, noise = positive(8, seed), positive(k, seed + 1)
    ekf = ExtendedKalmanFilter(initial_state=np.zeros(8), initial_covariance=prior)
    innovation = ekf.update([STATE[i] for i in index], values, noise)
    h = np.eye(8)[index]
    expected = h @ prior @ h.T + noise
    gain = prior @ h.T @ np.linalg.inv(expected)
    wrapped = gain @ values
    wrapped[2] = math.remainder(wrapped[2], math.tau)
    assert np.allclose(ekf.state, wrapped)
    assert np.allclose(ekf.covariance, (np.eye(8) - gain @ h) @ prior)
    assert innovation.measured == tuple(STATE[i] for i in index)
    assert np.allclose(innovation.value, values)
    assert np.allclose(innovation.covariance, expected)
    assert innovation.nis == pytest.approx(values @ np.linalg.solve(expected, values))
    assert innovation.accepted


def test_booleans_and_names_are_the_same():
    config = [name in ('x', 'vx', 'vyaw') for name in STATE]
    by_config, by_name = (ExtendedKalmanFilter(initial_covariance=positive(8, 1)) for _ in '12')
    by_config.update(config, [1, 2, 3], [0.1, 0.2, 0.3])
    by_name.update(('vyaw', 'x', 'vx'), [3, 1, 2], np.diag([0.3, 0.1, 0.2]))
    assert np.allclose(by_config.state, by_name.state)
    assert np.allclose(by_config.covariance, by_name.covariance)


@given(st.permutations(range(4)), st.integers(0, 1000))
def test_the_order_of_messages_of_one_instant_does_not_matter(order, seed):
    rng = np.random.default_rng(seed)
    messages = [
        (('vx', 'vy', 'vyaw'), rng.normal(size=3), positive(3, seed)),
        (('yaw',), rng.normal(scale=0.1, size=1), [0.3]),
        (('x', 'y'), rng.normal(size=2), positive(2, seed)),
        (('vyaw', 'ax'), rng.normal(size=2), [0.1, 0.2]),
    ]
    filters = [
        ExtendedKalmanFilter(initial_state=np.zeros(8), initial_covariance=0.1 * positive(8, seed))
        for _ in '12'
    ]
    for ekf, chosen in zip(filters, (range(4), order), strict=True):
        for i in chosen:
            ekf.process(1.0, *messages[i])
    assert np.allclose(filters[0].state, filters[1].state)
    assert np.allclose(filters[0].covariance, filters[1].covariance)


def test_yaw_goes_the_short_way():
    ekf = ExtendedKalmanFilter(initial_state=[0, 0, 3.1, 0, 0, 0, 0, 0], initial_covariance=[1] * 8)
    innovation = ekf.update(['yaw'], [-3.1], [1])
    assert innovation.value == pytest.approx([math.tau - 6.2])
    assert ekf.state[2] == pytest.approx(math.pi)
    ekf.update(['yaw'], [-3.1 - 4 * math.tau], [1])
    assert ekf.state[2] == pytest.approx(-math.pi + (math.pi - 3.1) / 3)
    turned = ExtendedKalmanFilter(initial_state=[0, 0, 9.0, 0, 0, 0, 0, 0])
    assert turned.state[2] == pytest.approx(9 - math.tau)


def test_values_that_are_nan_are_left_out():
    some, part = (ExtendedKalmanFilter(initial_covariance=positive(8, 1)) for _ in '12')
    noise = positive(3, 2)
    innovation = some.update(('x', 'y', 'vx'), [1, np.nan, 2], noise)
    part.update(('x', 'vx'), [1, 2], noise[np.ix_([0, 2], [0, 2])])
    assert innovation.measured == ('x', 'vx')
    assert (some.state == part.state).all()
    state, covariance = some.state.copy(), some.covariance.copy()
    assert some.update(('x', 'y'), [np.nan, np.nan], [1, 1]) is None
    assert (some.state == state).all()
    assert (some.covariance == covariance).all()


@pytest.mark.parametrize(('x', 'accepted'), [(2.9, True), (3.1, False), (-3.1, False)])
def test_the_gate(x, accepted):
    ekf = ExtendedKalmanFilter(initial_state=np.zeros(8), initial_covariance=[0.5] * 8)
    innovation = ekf.update(['x'], [x], [0.5], gate=3)  # sigma 1
    assert innovation.accepted is accepted
    assert innovation.nis == pytest.approx(x * x)
    assert ekf.state[0] == pytest.approx(x / 2 if accepted else 0)
    assert ekf.covariance[0, 0] == pytest.approx(0.25 if accepted else 0.5)


steps = st.tuples(
    st.sampled_from([0.0, 0.001, 0.02, 1.0, 30.0]),
    subsets,
    st.floats(-1e3, 1e3),
    st.sampled_from([1e-8, 1e-3, 1.0, 1e6]),
    st.sampled_from([None, 1.0, 5.0]),
)


@given(st.lists(steps, min_size=1, max_size=40))
def test_the_covariance_stays_one_and_the_yaw_an_angle(messages):
    ekf = ExtendedKalmanFilter()
    t = 0.0
    for dt, index, value, variance, gate in messages:
        t += dt
        k = len(index)
        ekf.process(t, [STATE[i] for i in index], [value] * k, [variance] * k, gate)
        scale = np.sqrt(np.diag(ekf.covariance))
        correlation = ekf.covariance / np.outer(scale, scale)
        assert np.allclose(correlation, correlation.T, rtol=0, atol=1e-6)
        assert np.linalg.eigvalsh((correlation + correlation.T) / 2)[0] > -1e-6
        assert abs(ekf.state[2]) <= math.pi
        assert ekf.t == t


# --- Message by message --------------------------------------------------------------------------


def test_the_first_message_sets_what_it_measures():
    ekf = ExtendedKalmanFilter()
    assert ekf.process(5.0, ('vx', 'yaw'), [2, 9], positive(2, 1), gate=0.001) is None
    assert ekf.t == 5
    assert ekf.state == pytest.approx([0, 0, 9 - math.tau, 2, 0, 0, 0, 0])
    assert np.allclose(ekf.covariance[np.ix_([3, 2], [3, 2])], positive(2, 1))
    assert ekf.covariance[0, 0] == 1e-9
    known = ExtendedKalmanFilter(initial_state=[1, 0, 0, 0, 0, 0, 0, 0])
    assert known.process(5.0, ['x'], [2], [1e-9]).value == [1]
    assert known.state[0] == pytest.approx(1.5)


def test_a_first_message_without_values_sets_nothing():
    ekf = ExtendedKalmanFilter()
    assert ekf.process(1.0, ['x'], [np.nan], [1]) is None
    assert ekf.t is None
    ekf.process(2.0, ['x', 'y'], [np.nan, 3], [1, 1])
    assert (ekf.t, *ekf.state[:2]) == (2, 0, 3)


def test_a_late_message_corrects_the_present():
    late, now = ExtendedKalmanFilter(), ExtendedKalmanFilter()
    for ekf, t in ((late, 0.4), (now, 1.0)):
        ekf.process(0.0, ('x', 'vx'), [0, 1], [0.1, 0.1])
        ekf.process(1.0, ['vx'], [1], [0.1])
        ekf.process(t, ['x'], [0.4], [0.1])
        assert ekf.t == 1
    assert (late.state == now.state).all()
    assert (late.covariance == now.covariance).all()


def test_predict_moves_the_time():
    ekf = ExtendedKalmanFilter()
    ekf.process(1.0, ['vx'], [1], [0.1])
    ekf.predict(0.5)
    assert (ekf.t, ekf.state[0]) == (1.5, 0.5)


def test_rows_before_the_first_message_and_after_the_last():
    measurements = pd.DataFrame({'t': [0.0, 1, 2, 3], 'vx': [np.nan, 1, 1, np.nan]})
    measurements['vyaw'] = np.where(measurements['vx'].isna(), np.nan, 0.0)
    estimate = fuse(measurements, ODOM)
    assert estimate.loc[0].isna().tolist() == [False] + [True] * 18
    assert estimate['x'][1:].tolist() == pytest.approx([0, 1, 2], abs=1e-6)
    assert estimate['var_x'][1:].is_monotonic_increasing
    known = fuse(measurements, ODOM, initial_state=[5, 0, 0, 1, 0, 0, 0, 0])
    assert known['x'][1:].tolist() == pytest.approx([5, 6, 7], abs=1e-6)


def test_a_value_that_is_missing_in_a_row():
    measurements = drive(101)[0][:200].copy()
    measurements.loc[100, 'vx'] = np.nan
    measurements.loc[120, ['vyaw', 'imu_yaw']] = np.nan
    rows = innovations(measurements)
    assert rows.loc[(rows['t'] == 2.0) & (rows['sensor'] == 'odom'), 'variable'].tolist() == [
        'vy',
        'vyaw',
    ]
    assert rows.loc[rows['t'] == 2.4, 'variable'].tolist() == ['vx', 'vy', 'vyaw', 'ax']


def test_config_leaves_parts_out():
    measurements = drive(101)[0][:200]
    booleans = [name in ('vx', 'vy') for name in STATE]
    for config in ({'odom': ('vy', 'vx')}, {'odom': booleans}):
        rows = innovations(measurements, config=config)
        assert set(rows.loc[rows['sensor'] == 'odom', 'variable']) == {'vx', 'vy'}
    used = {'odom': ('vx', 'vy', 'vyaw'), 'imu': ('vyaw', 'ax', 'yaw'), 'gps': ('x', 'y')}
    pd.testing.assert_frame_equal(fuse(measurements, config=used), fuse(measurements))
    lone = fuse(measurements[['t', 'imu_yaw']], ('imu',), config={'imu': ['yaw']})
    assert lone['vx'].abs().max() == 0


def test_variances_and_gates_by_sensor():
    measurements, _ = simulated(0, seconds=20, gps_outliers=5)
    deaf = fuse(measurements, variances={'gps_x': 1e12, 'gps_y': 1e12}, initial_state=[0] * 8)
    without = fuse(measurements, ODOM_IMU, initial_state=[0] * 8)
    assert np.allclose(deaf, without, rtol=0, atol=1e-6)
    rows = innovations(measurements, gate={'gps': 3.0})
    assert rows.loc[rows['sensor'] != 'gps', 'accepted'].all()
    refused = rows[~rows['accepted']]
    assert (refused['nis'] >= 9).all()
    assert (rows.loc[rows['accepted'] & (rows['sensor'] == 'gps'), 'nis'] < 9).all()
    assert 5 <= refused['t'].nunique() <= 7
    assert innovations(measurements)['accepted'].all()


def test_the_innovations_of_a_row():
    measurements = drive(101)[0][:51]
    rows = innovations(measurements)
    last = rows[rows['t'] == 1.0]
    assert last['sensor'].tolist() == ['odom'] * 3 + ['imu'] * 3 + ['gps'] * 2
    assert last['variable'].tolist() == ['vx', 'vy', 'vyaw', 'yaw', 'vyaw', 'ax', 'x', 'y']
    assert last['dof'].tolist() == [3, 3, 3, 1, 1, 1, 2, 2]
    alone = last[last['dof'] == 1]
    assert np.allclose((alone['innovation'] / alone['sigma']) ** 2, alone['nis'])
    assert (last['sigma'] ** 2 > list(VARIANCES.values())).all()
    assert last['nis'].nunique() == 5
    # The first message of all sets the state.
    assert rows.loc[rows['t'] == 0, 'sensor'].tolist() == ['imu'] * 3 + ['gps'] * 2


class FilterNode(Node):
    """Feeds the filter from real messages, one at a time."""

    def __init__(self, origin):
        super().__init__('filter')
        self.origin = origin
        self.start = None
        self.ekf = ExtendedKalmanFilter()
        self.create_subscription(Odometry, 'odom', self.odometry, 10)
        self.create_subscription(Imu, 'imu', self.imu, 10)
        self.create_subscription(NavSatFix, 'fix', self.fix, 10)

    def seconds(self, message):
        stamp = Time.from_msg(message.header.stamp)
        self.start = self.start or stamp
        return (stamp - self.start).nanoseconds / 1e9

    def odometry(self, message):
        twist = message.twist.twist
        covariance = np.reshape(message.twist.covariance, (6, 6))[np.ix_([0, 1, 5], [0, 1, 5])]
        values = [twist.linear.x, twist.linear.y, twist.angular.z]
        self.ekf.process(self.seconds(message), ('vx', 'vy', 'vyaw'), values, covariance)

    def imu(self, message):
        t, q = self.seconds(message), message.orientation
        yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))
        self.ekf.process(t, ['yaw'], [yaw], [message.orientation_covariance[8]])
        turning = message.angular_velocity.z, message.angular_velocity_covariance[8]
        self.ekf.process(t, ['vyaw'], turning[:1], turning[1:])
        pushing = message.linear_acceleration.x, message.linear_acceleration_covariance[0]
        self.ekf.process(t, ['ax'], pushing[:1], pushing[1:])

    def fix(self, message):
        east, north, _ = pymap3d.geodetic2enu(
            message.latitude, message.longitude, message.altitude, *self.origin
        )
        covariance = np.reshape(message.position_covariance, (3, 3))[:2, :2]
        self.ekf.process(self.seconds(message), ('x', 'y'), [east, north], covariance)


def diagonal(size, **variances):
    """A covariance of a message: its variances by place."""
    matrix = np.zeros((size, size))
    for place, variance in variances.items():
        matrix[int(place[1:]), int(place[1:])] = variance
    return matrix.ravel().tolist()


def messages_of(row, stamp, origin):
    """What the sensors publish of a row."""
    odometry, imu = Odometry(), Imu()
    odometry.header.stamp = imu.header.stamp = stamp
    odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = row.vx, row.vyaw
    odometry.twist.covariance = diagonal(6, _0=0.0025, _1=0.01, _5=0.0025)
    imu.orientation.w, imu.orientation.z = math.cos(row.imu_yaw / 2), math.sin(row.imu_yaw / 2)
    imu.orientation_covariance = diagonal(3, _2=0.0004)
    imu.angular_velocity.z = row.imu_vyaw
    imu.angular_velocity_covariance = diagonal(3, _2=0.0001)
    imu.linear_acceleration.x = row.ax
    imu.linear_acceleration_covariance = diagonal(3, _0=0.01)
    yield 'odom', odometry
    yield 'imu', imu
    if not math.isnan(row.gps_x):
        fix = NavSatFix()
        fix.header.stamp = stamp
        fix.latitude, fix.longitude, fix.altitude = pymap3d.enu2geodetic(
            row.gps_x, row.gps_y, 0.0, *origin
        )
        fix.position_covariance = diagonal(3, _0=0.25, _1=0.25)
        yield 'fix', fix


def test_a_node_gives_the_same_numbers():
    measurements = drive(101)[0][:500]
    origin = 48.0, 11.0, 500.0
    began_ns = 1_700_000_000_123_456_789
    states, matrices = [], []
    with ros_session():
        node, robot = FilterNode(origin), Node('robot')
        kinds = {'odom': Odometry, 'imu': Imu, 'fix': NavSatFix}
        publishers = {topic: robot.create_publisher(kinds[topic], topic, 10) for topic in kinds}
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        for row in measurements.itertuples():
            stamp = Time(nanoseconds=began_ns + round(row.t * 1e9)).to_msg()
            for topic, message in messages_of(row, stamp, origin):
                publishers[topic].publish(message)
                executor.spin_once(timeout_sec=LIMIT_S)
            states.append(node.ekf.state)
            matrices.append(node.ekf.covariance)
        executor.shutdown()
    estimate = fuse(measurements)
    assert np.allclose(np.array(states)[:, :6], estimate.loc[:, 'x':'vyaw'], rtol=0, atol=1e-6)
    for names, part in ((STATE[:3], slice(3)), (STATE[3:6], slice(3, 6))):
        expected = covariances(estimate, names)
        assert np.allclose(np.array(matrices)[:, part, part], expected, rtol=0, atol=1e-9)


# --- Is it consistent? ---------------------------------------------------------------------------


def test_the_filter_believes_what_is_true_of_its_own_model():
    """A robot that moves just as the model says, many times: NEES and NIS of every instant."""
    runs, steps, dt = 60, 25, 0.1
    rng = np.random.default_rng(1)
    noise = np.diag(list(PROCESS_NOISE.values()))
    prior = np.diag([0.1, 0.1, 0.01, 0.1, 0.1, 0.01, 0.01, 0.01])
    gps, wheels = np.diag([0.25, 0.25]), np.diag([0.0025, 0.01, 0.0025])
    of_state, of_gps = np.zeros((runs, steps)), np.zeros((runs, steps))
    for run in range(runs):
        ekf = ExtendedKalmanFilter(initial_state=np.zeros(8), initial_covariance=prior)
        truth = rng.multivariate_normal(np.zeros(8), prior)
        for i in range(steps):
            truth = motion(truth, dt)[0] + rng.multivariate_normal(np.zeros(8), dt * noise)
            ekf.predict(dt)
            ekf.update(('vx', 'vy', 'vyaw'), rng.multivariate_normal(truth[3:6], wheels), wheels)
            fix = rng.multivariate_normal(truth[:2], gps)
            of_gps[run, i] = ekf.update(('x', 'y'), fix, gps).nis
            off = truth - ekf.state
            off[2] = math.remainder(off[2], math.tau)
            of_state[run, i] = off @ np.linalg.solve(ekf.covariance, off)
    for values, dof in ((of_state, 8), (of_gps, 2)):
        low, high = chi_square_bounds(dof, runs, 0.95)
        inside = (low <= values.mean(axis=0)) & (values.mean(axis=0) <= high)
        assert inside.mean() >= 0.8


@pytest.mark.parametrize(
    ('dof', 'probability', 'low', 'high'),
    [  # of the printed tables
        (1, 0.95, 0.000982, 5.0239),
        (2, 0.95, 0.0506, 7.3778),
        (3, 0.95, 0.2158, 9.3484),
        (8, 0.95, 2.1797, 17.5345),
        (100, 0.95, 74.222, 129.561),
        (2, 0.99, 0.0100, 10.5966),
        (5, 0.9, 1.1455, 11.0705),
    ],
)
def test_chi_square_bounds(dof, probability, low, high):
    assert chi_square_bounds(dof, probability=probability) == pytest.approx((low, high), rel=5e-3)
    if dof > 1:
        assert chi_square_bounds(1, dof, probability) == pytest.approx(
            (low / dof, high / dof), 5e-3
        )


def test_chi_square_bounds_of_many():
    low, high = chi_square_bounds(2, 5000, 0.95)
    assert (low, high) == pytest.approx(
        (2 - 1.96 * 2 / math.sqrt(5000), 2 + 1.96 * 2 / 5000**0.5), 1e-3
    )
    numbers = np.random.default_rng(1).chisquare(3, 20000)
    low, high = chi_square_bounds(3, probability=0.8)
    assert ((low < numbers) & (numbers < high)).mean() == pytest.approx(0.8, abs=0.01)


def test_errors():
    truth = pd.DataFrame({'t': [0.0, 2, 4], 'x': [0.0, 2, 4], 'y': 1.0, 'yaw': [3.0, -3.2, -3.0]})
    estimate = pd.DataFrame(
        {'t': [0.0, 1, 4], 'x': [0.0, 4, 4], 'y': [1.0, 5, 1], 'yaw': [-3.0] * 3}
    )
    off = errors(estimate, truth)
    assert list(off) == ['t', 'x', 'y', 'yaw', 'distance']
    assert off['x'].tolist() == [0, 3, 0]
    assert off['y'].tolist() == [0, 4, 0]
    assert off['distance'].tolist() == [0, 5, 0]
    between = (3.0 + math.tau - 3.2) / 2
    assert off['yaw'].tolist() == pytest.approx([math.tau - 6, math.tau - 3 - between, 0])
    assert rmse(estimate, truth) == pytest.approx(math.sqrt(25 / 3))
    assert math.isclose(rmse(estimate.assign(x=[0.0, np.nan, 4]), truth), 0, abs_tol=1e-9)


def test_nees():
    truth = pd.DataFrame({'t': [0.0, 1], 'x': 0.0, 'y': 0.0, 'yaw': 0.0})
    matrix = positive(3, 1)
    off = np.array([0.1, 0.2, 0.3])
    estimate = truth + [0, *off]
    for i, a in enumerate(('x', 'y', 'yaw')):
        for j, b in enumerate(('x', 'y', 'yaw')):
            estimate[f'var_{a}' if a == b else f'cov_{a}_{b}'] = matrix[i, j]
    assert np.allclose(covariances(estimate), matrix[:2, :2])
    assert np.allclose(covariances(estimate, ('yaw', 'x')), matrix[np.ix_([2, 0], [2, 0])])
    for k in (1, 2, 3):
        expected = off[:k] @ np.linalg.solve(matrix[:k, :k], off[:k])
        values = nees(estimate, truth, ('x', 'y', 'yaw')[:k])
        assert values.shape == (2,)
        assert np.allclose(values, expected)


# --- The simulated drive -------------------------------------------------------------------------


def test_a_drive_is_of_the_kind_of_the_stored_ones():
    measurements, truth = simulated(1)
    stored, stored_truth, _ = drive(101)
    assert [name for name in measurements if name != 'ay'] == list(stored)
    assert list(truth) == ['t', *STATE]
    assert np.allclose(truth['t'], stored_truth['t'])
    assert np.allclose(measurements['t'], stored['t'])
    # The stored truth is integrated with longer steps.
    assert errors(stored_truth, truth)[['x', 'y', 'yaw']].abs().max(axis=None) < 0.1
    assert measurements['gps_x'].notna().tolist() == stored['gps_x'].notna().tolist()
    assert measurements.drop(columns=['gps_x', 'gps_y']).notna().all(axis=None)
    said = {'imu_yaw': 'yaw', 'imu_vyaw': 'vyaw', 'gps_x': 'x', 'gps_y': 'y'}
    off = measurements - truth.assign(**{name: truth[said[name]] for name in said})
    off['vx'] -= 0.04 * truth['vx']
    off['vyaw'] -= 0.05 * truth['vyaw'] + 0.012
    off['imu_vyaw'] -= 0.002
    off['imu_yaw'] = np.remainder(off['imu_yaw'] + math.pi, math.tau) - math.pi
    for name in measurements.columns.drop('t'):
        sigma = math.sqrt(VARIANCES[{'ay': 'ax'}.get(name, name)])
        heard = off[name].dropna()
        assert heard.std() == pytest.approx(sigma, rel=0.25 if 'gps' in name else 0.05)
        assert abs(heard.mean()) < 4 * sigma / math.sqrt(len(heard))


def test_the_truth_is_a_unicycle():
    _, truth = simulated(1)
    now, then = truth[:-1].reset_index(), truth[1:].reset_index()
    step, middle = then - now, (then + now) / 2
    assert np.allclose(np.hypot(step['x'], step['y']), middle['vx'].abs() * 0.02, atol=1e-4)
    along = np.unwrap(truth['yaw'])[:-1] + np.diff(np.unwrap(truth['yaw'])) / 2
    assert np.allclose(np.sin(along) * step['x'], np.cos(along) * step['y'], atol=1e-6)
    assert np.allclose(np.diff(np.unwrap(truth['yaw'])), middle['vyaw'] * 0.02, atol=1e-6)
    turn_of_phase = np.abs(now['t'] - 2) < 0.05
    assert np.allclose(step['vx'][~turn_of_phase], middle['ax'][~turn_of_phase] * 0.02, atol=1e-5)
    assert np.allclose(truth['ay'], truth['vx'] * truth['vyaw'])
    assert (truth['vy'] == 0).all()


def test_the_seed_decides_the_noise_and_nothing_else():
    for one, same in zip(simulate(3, 10), simulate(3, 10), strict=True):
        pd.testing.assert_frame_equal(one, same)
    one, other = simulate(3, 10), simulate(4, 10)
    pd.testing.assert_frame_equal(one.truth, other.truth)
    assert (one.measurements['vx'] != other.measurements['vx']).all()
    # What is switched on changes nothing else.
    changed = simulate(
        3, 10, slip=(4, 5), gps_outliers=2, gps_gap=(6, 8), wheel_scale=1, gyro_bias=0
    )
    assert (changed.measurements['ax'] == one.measurements['ax']).all()


def test_what_goes_wrong_goes_wrong_where_it_is_said():
    plain, _ = simulate(3, 20)
    slipped, _ = simulate(3, 20, slip=(4, 5), slip_speed=0.7)
    more = slipped['vx'] - plain['vx']
    assert np.allclose(more, np.where((plain['t'] >= 4) & (plain['t'] < 5), 0.7, 0))
    gap, _ = simulate(3, 20, gps_gap=(6, 8))
    assert sorted(set(plain.dropna()['t']) - set(gap.dropna()['t'])) == [6, 7]
    jumps, _ = simulate(3, 20, gps_outliers=4, gps_jump=15)
    far = np.hypot(jumps['gps_x'] - plain['gps_x'], jumps['gps_y'] - plain['gps_y']).dropna()
    assert sorted(far.round(6))[-5:] == [0, 15, 15, 15, 15]
    assert far.iloc[0] == 0
    loud, truth = simulate(3, 100, variances={'gps_x': 25.0}, gps_period=0.1)
    assert (loud['gps_x'] - truth['x']).std() == pytest.approx(5, rel=0.1)
    assert loud['gps_x'].notna().sum() == 1001
    slow, _ = simulate(3, 20, rate=10)
    assert (len(slow), slow['t'].iloc[-1]) == (201, 20)


# --- What the lesson claims, on several seeds ----------------------------------------------------

# Less than robot_localization's default: GPS may then not pull the position so far.
LOW = {'x': 0.002, 'y': 0.002}


@cache
def estimated(seed, sensors=SENSORS, low=True, **settings):
    noise = LOW if low else None
    return fuse(simulated(seed, **settings).measurements, sensors, process_noise=noise)


def rmse_m(seed, *choice, **settings):
    return rmse(estimated(seed, *choice, **settings), simulated(seed).truth)


@SEEDS
def test_the_imu_matters_most_and_gps_needs_less_process_noise(seed):
    odom, odom_imu, all_three = (
        rmse_m(seed, sensors, False) for sensors in (ODOM, ODOM_IMU, SENSORS)
    )
    assert odom > 15 * odom_imu
    assert all_three > 1.03 * odom_imu
    assert rmse_m(seed) < 0.98 * odom_imu
    assert rmse_m(seed) < 0.7 * all_three


@pytest.mark.parametrize('number', [101, 102])
def test_gps_needs_less_process_noise_on_the_stored_drives(number):
    measurements, truth, _ = drive(number)
    odom_imu, all_three = (rmse(fuse(measurements, s), truth) for s in (ODOM_IMU, SENSORS))
    low = rmse(fuse(measurements, process_noise={'x': 0.001, 'y': 0.001}), truth)
    assert all_three > 1.5 * odom_imu
    assert low < 0.95 * odom_imu


@SEEDS
def test_the_wheels_are_missed_most(seed):
    no_wheels, no_imu, no_gps = (
        rmse_m(seed, sensors, False)
        for sensors in (('imu', 'gps'), ('odom', 'gps'), ('odom', 'imu'))
    )
    assert no_wheels > 1.2 * no_imu
    assert no_imu > 1.2 * no_gps
    assert rmse_m(seed, ('gps',), False) > no_wheels


@SEEDS
def test_the_process_noise_is_the_gain_of_gps(seed):
    measurements, truth = simulated(seed)
    fixes = measurements['gps_x'].notna() & (measurements['t'] > 10)
    default, lowered = estimated(seed, SENSORS, False), estimated(seed)
    for estimate, gain in ((default, 0.36), (lowered, 0.09)):
        assert estimate.loc[fixes, 'var_x'].mean() / 0.25 == pytest.approx(gain, abs=0.01)
    # How far the pose jumps, beyond what the robot moves.
    jump_m = {
        name: errors(table, truth)[['x', 'y']].diff().pow(2).sum(axis=1).pow(0.5).max()
        for name, table in {'map': lowered, 'odom': estimated(seed, ODOM_IMU, False)}.items()
    }
    assert jump_m['map'] > 0.1
    assert jump_m['odom'] < 0.01


@SEEDS
def test_the_estimate_is_consistent(seed):
    measurements, truth = simulated(seed)
    low, high = chi_square_bounds(2)
    values = nees(estimated(seed), truth)
    assert ((low < values) & (values < high)).mean() > 0.85
    assert 0.7 < values.mean() < 2.5
    rows = innovations(measurements, process_noise=LOW)
    fixes = rows[rows['sensor'] == 'gps'].drop_duplicates('t')
    low, high = chi_square_bounds(2, len(fixes), 0.99)
    assert low < fixes['nis'].mean() < high
    # A filter that believes its wheels too much is not.
    sure = fuse(measurements, process_noise={'x': 1e-6, 'y': 1e-6})
    assert nees(sure, truth).mean() > 8


@SEEDS
def test_an_imu_mounted_turned(seed):
    turn = math.radians(20)
    assert rmse_m(seed, ODOM_IMU, False, imu_mounting=turn) > 5 * rmse_m(seed, ODOM_IMU, False)
    assert rmse_m(seed, imu_mounting=turn) > 4 * rmse_m(seed)
    measurements, truth = simulated(seed, imu_mounting=turn)
    mended = measurements.assign(
        imu_yaw=measurements['imu_yaw'] - turn,
        ax=math.cos(turn) * measurements['ax'] - math.sin(turn) * measurements['ay'],
    )
    estimate = fuse(mended, process_noise=LOW)
    assert rmse(estimate, truth) == pytest.approx(rmse_m(seed), rel=0.05)


@SEEDS
def test_gps_jumps(seed):
    assert rmse_m(seed, gps_outliers=8) > 3 * rmse_m(seed)
    gated = simulated(seed, gps_outliers=8)
    rows = innovations(gated.measurements, process_noise=LOW, gate={'gps': 4})
    assert rows.loc[~rows['accepted'], 't'].nunique() == 8
    estimate = fuse(gated.measurements, process_noise=LOW, gate={'gps': 4})
    assert rmse(estimate, gated.truth) < 1.2 * rmse_m(seed)


@SEEDS
def test_gps_falls_silent(seed):
    estimate, truth = estimated(seed, gps_gap=(60, 80)), simulated(seed).truth
    sigma = np.sqrt(covariances(estimate)[:, 0, 0])
    gap = (estimate['t'] >= 60) & (estimate['t'] < 80)
    assert (np.diff(sigma[gap]) > 0).all()
    assert sigma[gap][-1] > 1.5 * sigma[gap][0]
    assert errors(estimate, truth)['distance'][gap].max() < 3 * sigma[gap][-1]


@SEEDS
def test_wheels_slip(seed):
    assert rmse_m(seed, ODOM_IMU, False, slip=(60, 64)) > 4 * rmse_m(seed, ODOM_IMU, False)
    assert rmse_m(seed, slip=(60, 64)) < 0.4 * rmse_m(seed, ODOM_IMU, False, slip=(60, 64))
    measurements, truth = simulated(seed, slip=(60, 64))
    wary = fuse(measurements, process_noise=LOW, variances={'vx': 1.0})
    assert rmse(wary, truth) < 0.85 * rmse_m(seed, slip=(60, 64))


# --- Bad input -----------------------------------------------------------------------------------


def table(**columns):
    return drive(101)[0][:5].assign(**columns)


@pytest.mark.parametrize(
    ('measurements', 'error', 'said'),
    [
        (None, TypeError, 'The table must be a DataFrame, not NoneType.'),
        ({'t': [0]}, TypeError, 'The table must be a DataFrame, not dict.'),
        (lambda: table()[:0], ValueError, 'The table is empty.'),
        (
            lambda: table().drop(columns=['t', 'ax']),
            ValueError,
            'The table lacks the column(s) t, ax.',
        ),
        (
            lambda: pd.concat([table(), table()['vx']], axis=1),
            ValueError,
            'The table has the column(s) vx more than once.',
        ),
        (lambda: table(vx='fast'), TypeError, 'The column vx must hold numbers.'),
        (lambda: table(vx=[[1]] * 5), TypeError, 'The column vx must hold numbers.'),
        (lambda: table(vx=1j), TypeError, 'The column vx must hold numbers.'),
        (
            lambda: table(t=pd.Timestamp('2026-01-01')),
            TypeError,
            'The column t must hold numbers.',
        ),
        (
            lambda: table(t=[0, 0.1, np.nan, 0.2, 0.3]),
            ValueError,
            'Every row needs its time: the column t has a NaN.',
        ),
        (
            lambda: table(t=[0, 0.2, 0.1, 0.3, 0.4]),
            ValueError,
            'The times must increase from row to row: sort t, and join equal times.',
        ),
        (
            lambda: table(t=[0, 0.1, 0.1, 0.3, 0.4]),
            ValueError,
            'The times must increase from row to row: sort t, and join equal times.',
        ),
        (
            lambda: table(ax=[0, 1, np.inf, 1, 1]),
            ValueError,
            'The column ax must be finite, or NaN where it has no value.',
        ),
        (
            lambda: table(**dict.fromkeys(table().columns.drop('t'), np.nan)),
            ValueError,
            'The table has no measurement of odom, imu, gps: all are NaN.',
        ),
        (
            lambda: table(**dict.fromkeys(table().columns, np.nan)),
            ValueError,
            'Every row needs its time: the column t has a NaN.',
        ),
    ],
)
def test_bad_table(measurements, error, said):
    measurements = measurements() if callable(measurements) else measurements
    for function in (fuse, innovations):
        with pytest.raises(error) as failure:
            function(measurements)
        assert str(failure.value) == said


@pytest.mark.parametrize(
    ('settings', 'error', 'said'),
    [
        ({'sensors': 'odom'}, TypeError, "sensors must be a tuple of odom, imu, gps, not 'odom'."),
        ({'sensors': None}, TypeError, 'sensors must be a tuple of odom, imu, gps, not None.'),
        ({'sensors': ()}, ValueError, 'sensors must be at least one of odom, imu, gps.'),
        ({'sensors': ['lidar']}, ValueError, "sensors can name odom, imu, gps, not 'lidar'."),
        ({'variances': {'vx': 0}}, ValueError, "variances['vx'] must be positive, not 0.0."),
        (
            {'variances': {'gps_x': -1}},
            ValueError,
            "variances['gps_x'] must be positive, not -1.0.",
        ),
        ({'variances': {'vx': np.nan}}, ValueError, "variances['vx'] must be finite, not nan."),
        ({'variances': {'vx': '1'}}, TypeError, "variances['vx'] must be a number, not '1'."),
        ({'variances': {'gps': 1}}, ValueError, None),
        ({'variances': [1, 2]}, TypeError, 'variances must be a dict, not [1, 2].'),
        ({'process_noise': {'z': 1}}, ValueError, None),
        (
            {'process_noise': {'x': -1}},
            ValueError,
            'process_noise must be positive semidefinite: no variance less than zero.',
        ),
        ({'process_noise': 'none'}, TypeError, 'process_noise must be a matrix or variances'),
        ({'process_noise': [1, 2]}, ValueError, 'process_noise must be 8 by 8, or 8 variances'),
        ({'config': {'odom': ['yaw']}}, ValueError, 'odom cannot measure yaw.'),
        ({'config': {'lidar': ['x']}}, ValueError, "config can name odom, imu, gps, not 'lidar'."),
        ({'config': ['vx']}, TypeError, "config must be a dict, not ['vx']."),
        ({'config': {'odom': []}}, ValueError, None),
        ({'gate': 0}, ValueError, 'gate must be positive, not 0.'),
        ({'gate': '3'}, TypeError, "gate must be a number, not '3'."),
        ({'gate': {'lidar': 3}}, ValueError, "gate can name odom, imu, gps, not 'lidar'."),
        ({'initial_state': [0] * 7}, ValueError, 'initial_state must be 8 numbers'),
        ({'initial_state': [np.nan] * 8}, ValueError, 'initial_state must be finite'),
        (
            {'initial_covariance': [0] * 8},
            ValueError,
            'initial_covariance must be positive definite',
        ),
    ],
)
def test_bad_setting(settings, error, said):
    with pytest.raises(error) as failure:
        fuse(table(), **settings)
    message = str(failure.value)
    assert message.startswith(said or '')
    assert message.endswith('.')
    assert message.count('\n') == 0


@pytest.mark.parametrize(
    ('measured', 'values', 'covariance', 'error', 'said'),
    [
        (['x', 'x'], [1, 1], [1, 1], ValueError, 'measured must name at least one part'),
        ([False] * 8, [], [], ValueError, 'measured must name at least one part'),
        ([True] * 15, [0] * 15, [1] * 15, ValueError, 'measured must be 8 booleans or some'),
        (['z'], [1], [1], ValueError, 'measured must be 8 booleans or some of the names x, y'),
        ('yaw', [1], [1], ValueError, 'measured must be 8 booleans or some of the names x, y'),
        (None, [1], [1], TypeError, 'measured must be 8 booleans or some of the names x, y'),
        (['x'], [1, 2], [1], ValueError, 'values must be 1 numbers, not [1, 2].'),
        (['x'], ['far'], [1], TypeError, "values must be 1 numbers, not ['far']."),
        (['x'], [np.inf], [1], ValueError, 'values must be finite, not [inf].'),
        (['x'], [1], [0], ValueError, 'covariance must be positive definite'),
        (['x'], [1], [-1], ValueError, 'covariance must be positive definite'),
        (['x'], [1], [np.nan], ValueError, 'covariance must be finite.'),
        (['x'], [1], [1, 2], ValueError, 'covariance must be 1 by 1, or 1 variances'),
        (['x'], [1], ['1m'], TypeError, "covariance must be a matrix or variances, not ['1m']."),
        (['x'], [1], 1.0, ValueError, 'covariance must be 1 by 1, or 1 variances'),
        (['x', 'y'], [1, 1], [[1, 2], [2, 1]], ValueError, 'covariance must be positive definite'),
        (['x', 'y'], [1, 1], [[1, 1], [1, 1]], ValueError, 'covariance must be positive definite'),
        (['x', 'y'], [1, 1], [[1, 0.5], [0, 1]], ValueError, 'covariance must be symmetric.'),
    ],
)
def test_bad_message(measured, values, covariance, error, said):
    ekf = ExtendedKalmanFilter()
    for take in (ekf.update, lambda *message: ekf.process(0.0, *message)):
        with pytest.raises(error) as failure:
            take(measured, values, covariance)
        assert str(failure.value).startswith(said)
    assert ekf.t is None


def test_bad_time():
    ekf = ExtendedKalmanFilter()
    with pytest.raises(ValueError, match=r'^dt must be zero or more seconds, not -0\.1\.$'):
        ekf.predict(-0.1)
    with pytest.raises(ValueError, match=r'^t must be finite, not nan\.$'):
        ekf.process(math.nan, ['x'], [1], [1])
    with pytest.raises(TypeError, match=r"^t must be a number, not '1'\.$"):
        ekf.process('1', ['x'], [1], [1])


@pytest.mark.parametrize(
    ('settings', 'error', 'said'),
    [
        ({'seed': -1}, ValueError, 'seed must be zero or more, not -1.'),
        ({'seed': None}, TypeError, 'seed must be a whole number, not None.'),
        ({'seconds': 0}, ValueError, 'seconds must be positive, not 0.'),
        ({'rate': -1}, ValueError, 'rate must be positive, not -1.'),
        ({'gps_period': '1'}, TypeError, "gps_period must be a number, not '1'."),
        ({'slip': (4, 3)}, ValueError, 'slip must be (from, to) in seconds, not (4, 3).'),
        ({'gps_gap': 3}, ValueError, 'gps_gap must be 2 numbers, not 3.'),
        ({'gps_outliers': 100}, ValueError, 'gps_outliers must be 0 to 10, not 100.'),
        ({'gps_outliers': 1.5}, TypeError, 'gps_outliers must be a whole number, not 1.5.'),
        ({'wheel_scale': None}, TypeError, 'wheel_scale must be a number, not None.'),
        ({'variances': {'vx': -1}}, ValueError, "variances['vx'] must be positive, not -1.0."),
    ],
)
def test_bad_drive(settings, error, said):
    with pytest.raises(error) as failure:
        simulate(**({'seed': 1, 'seconds': 10} | settings))
    assert str(failure.value) == said


def test_bad_truth_and_names():
    measurements, truth = simulated(0, seconds=10)
    estimate = fuse(measurements, ODOM)
    with pytest.raises(ValueError, match=r'^The truth must cover all times of the estimate\.$'):
        errors(estimate, truth[:-1])
    with pytest.raises(ValueError, match=r'^The truth needs rows whose times increase\.$'):
        errors(estimate, truth[::-1])
    with pytest.raises(ValueError, match=r'^The table lacks the column\(s\) x, y, yaw\.$'):
        errors(estimate, measurements)
    for names in ((), ('x', 'vx'), ('z',), ('ax',)):
        with pytest.raises(ValueError, match='^names must be some of x, y, yaw or some of vx, vy'):
            covariances(estimate, names)
    with pytest.raises(ValueError, match=r"^names must be some of x, y, yaw, not \('vx',\)\.$"):
        nees(estimate, truth, ('vx',))
    with pytest.raises(ValueError, match=r'^The covariance of each row must be positive definite'):
        nees(estimate.assign(var_x=0.0, cov_x_y=0.0), truth)
    with pytest.raises(TypeError, match=r'^The table must be a DataFrame, not dict\.$'):
        rmse({}, truth)
    for bad in ({'dof': 0}, {'dof': 2, 'runs': -1}, {'dof': 2, 'probability': 1}):
        with pytest.raises(ValueError, match='must be'):
            chi_square_bounds(**bad)
    with pytest.raises(TypeError, match=r'^dof must be a whole number, not 1\.5\.$'):
        chi_square_bounds(1.5)
