"""The filter against robot_localization and the textbook, its tables, and the simulated drive."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.fusion import (
    SENSORS,
    VARIANCES,
    ExtendedKalmanFilter,
    errors,
    fuse,
    fuse_with_innovations,
    rmse,
    simulate,
)
from helpers.fusion.filter import STATE, motion

DATA = Path(__file__).parent / 'data'
ODOM, ODOM_IMU = ('odom',), ('odom', 'imu')


@cache
def drive(number):
    """Return the measurements, the truth, and what robot_localization estimated."""
    table = pd.read_csv(DATA / f'drive{number}.csv.gz')
    truth = table[['t']].assign(x=table['true_x'], y=table['true_y'], yaw=table['true_yaw'])
    return table.loc[:, 't':'gps_y'], truth, table.filter(like='rl_')


def table(rows=5, **columns):
    return drive(101)[0][:rows].assign(**columns)


def innovations(*arguments, **options):
    return fuse_with_innovations(*arguments, **options)[1]


def same(one, other):
    pd.testing.assert_frame_equal(one, other)


# --- Against robot_localization ------------------------------------------------------------------


@pytest.mark.parametrize(
    ('number', 'sensors', 'rows'),
    [(101, SENSORS, None), (101, ODOM, 2500), (102, ODOM_IMU, 2500), (102, SENSORS, 2500)],
)
def test_the_path_of_robot_localization(number, sensors, rows):
    measurements, _, reference = (each[:rows] for each in drive(number))
    estimate = fuse(measurements, sensors=sensors)
    name = 'rl_' + '_'.join(sensors)
    apart = estimate[['x', 'y']].to_numpy() - reference[[f'{name}_x', f'{name}_y']].to_numpy()
    # The columns have six decimals, of the estimates and of what they were made from.
    assert np.abs(apart).max() < (1e-5 if sensors == ODOM else 2e-6)


# --- The filter ----------------------------------------------------------------------------------

angles = st.floats(-math.pi, math.pi)
speeds = st.floats(-5, 5)
states = st.tuples(speeds, speeds, angles, *[speeds] * 5).map(np.array)


def covariance(size, seed):
    root = np.random.default_rng(seed).normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


def knowing(state, matrix, **options):
    """Return a filter that has this state and covariance at second 0: its first message said so."""
    ekf = ExtendedKalmanFilter(**options)
    assert ekf.t is None
    assert ekf.process(0.0, STATE, state, matrix) is None
    return ekf


@settings(max_examples=30)
@given(states, st.floats(0, 0.5))
def test_the_motion_and_its_derivative(state, dt):
    x, y, yaw, vx, vy, vyaw, ax, ay = state
    forwards, sideways = vx * dt + ax * dt**2 / 2, vy * dt + ay * dt**2 / 2
    moved, jacobian = motion(state, dt)
    expected = [
        x + forwards * math.cos(yaw) - sideways * math.sin(yaw),
        y + forwards * math.sin(yaw) + sideways * math.cos(yaw),
        math.remainder(yaw + vyaw * dt, math.tau),
        *(vx + ax * dt, vy + ay * dt, vyaw, ax, ay),
    ]
    assert np.allclose(moved, expected, rtol=0, atol=1e-12)
    step = 1e-6 * np.eye(8)
    both = [motion(state + side, dt)[0] - motion(state - side, dt)[0] for side in step]
    both = np.array(both)
    both[:, 2] = np.remainder(both[:, 2] + math.pi, math.tau) - math.pi
    assert np.allclose(jacobian, both.T / 2e-6, rtol=0, atol=1e-7)


subsets = st.lists(st.sampled_from(range(8)), min_size=1, max_size=8, unique=True)


@settings(max_examples=40)
@given(subsets, st.integers(0, 1000), st.sampled_from([None, 0.5, 2.0]))
def test_the_update_is_the_textbook_one(index, seed, gate):
    k = len(index)
    values = np.random.default_rng(seed).uniform(-1, 1, k)
    prior, noise = covariance(8, seed), covariance(k, seed + 1)
    ekf = knowing(np.zeros(8), prior)
    innovation = ekf.process(0.0, [STATE[i] for i in index], values, noise, gate)
    h = np.eye(8)[index]
    expected = h @ prior @ h.T + noise
    nis = values @ np.linalg.solve(expected, values)
    gain = prior @ h.T @ np.linalg.inv(expected)
    if innovation.accepted:
        moved = gain @ values
        moved[2] = math.remainder(moved[2], math.tau)
        assert np.allclose(ekf.state, moved)
        assert np.allclose(ekf.covariance, (np.eye(8) - gain @ h) @ prior)
    else:
        assert (ekf.state == 0).all()
        assert (ekf.covariance == prior).all()
    assert innovation.accepted == (gate is None or math.sqrt(nis) < gate)
    assert np.allclose(innovation.value, values)
    assert np.allclose(innovation.covariance, expected)
    assert innovation.nis == pytest.approx(nis)


def test_yaw_goes_the_short_way():
    ekf = knowing([0, 0, 9.0, 0, 0, 0, 0, 0], [1] * 8)
    assert ekf.state[2] == pytest.approx(9 - math.tau)
    ekf = knowing([0, 0, 3.1, 0, 0, 0, 0, 0], [1] * 8)
    innovation = ekf.process(0.0, ['x', 'yaw'], [4, -3.1], [1, 1])
    assert innovation.value == pytest.approx([4, math.tau - 6.2])
    assert ekf.state[2] == pytest.approx(math.pi)
    ekf.process(0.0, ['yaw'], [-3.1 - 4 * math.tau], [1])
    assert ekf.state[2] == pytest.approx(-math.pi + (math.pi - 3.1) / 3)


def test_a_late_message_corrects_the_present():
    late, now = ExtendedKalmanFilter(), ExtendedKalmanFilter()
    for ekf, t in ((late, 0.4), (now, 1.0)):
        ekf.process(0.0, ('x', 'vx'), [0, 1], [0.1, 0.1])
        ekf.process(1.0, ['vx'], [1], [0.1])
        ekf.process(t, ['x'], [0.4], [0.1])
        assert ekf.t == 1
    assert (late.state == now.state).all()
    assert (late.covariance == now.covariance).all()


# --- Over a table --------------------------------------------------------------------------------


def test_the_columns_of_an_estimate():
    measurements = table(200)
    before = measurements.copy()
    estimate = fuse(measurements)
    same(measurements, before)
    assert list(estimate) == [
        *('t', 'x', 'y', 'yaw', 'vx', 'vy', 'vyaw'),
        *('var_x', 'cov_x_y', 'cov_x_yaw', 'var_y', 'cov_y_yaw', 'var_yaw'),
    ]
    assert estimate['t'].tolist() == measurements['t'].tolist()
    assert estimate.notna().all(axis=None)


def test_the_innovations_of_a_row():
    rows = innovations(table(51))
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


def test_incomplete_messages_are_left_out():
    measurements = table(121)
    measurements.loc[100, 'vx'] = np.nan
    measurements.loc[120, ['vyaw', 'imu_yaw']] = np.nan
    rows = innovations(measurements)
    assert set(rows.loc[rows['t'] == 2.0, 'sensor']) == {'imu', 'gps'}
    assert rows.loc[rows['t'] == 2.4, 'variable'].tolist() == ['vyaw', 'ax']


def test_config_leaves_parts_out():
    measurements = table(200)
    rows = innovations(measurements, config={'odom': ('vy', 'vx')})
    assert set(rows.loc[rows['sensor'] == 'odom', 'variable']) == {'vx', 'vy'}
    assert set(rows.loc[rows['sensor'] == 'imu', 'variable']) == {'yaw', 'vyaw', 'ax'}
    used = {'odom': ('vx', 'vy', 'vyaw'), 'imu': ('vyaw', 'ax', 'yaw'), 'gps': ('x', 'y')}
    same(fuse(measurements, config=used), fuse(measurements))
    lone = fuse(measurements[['t', 'imu_yaw']], ('imu',), config={'imu': ['yaw']})
    assert lone['vx'].abs().max() == 0


def test_variances_and_gates_by_sensor():
    measurements, _ = simulate(0, seconds=20)
    measurements.loc[range(150, 950, 150), 'gps_x'] += 20
    deaf = fuse(measurements, variances={'gps_x': 1e12, 'gps_y': 1e12})
    assert np.allclose(deaf, fuse(measurements, ODOM_IMU), rtol=0, atol=1e-6)
    assert innovations(measurements)['accepted'].all()
    rows = innovations(measurements, gate={'gps': 3.0})
    assert rows.loc[rows['sensor'] != 'gps', 'accepted'].all()
    refused = rows[~rows['accepted']]
    assert (refused['nis'] >= 9).all()
    assert (rows.loc[rows['accepted'] & (rows['sensor'] == 'gps'), 'nis'] < 9).all()
    assert 6 <= refused['t'].nunique() <= 8


# --- Evaluation ----------------------------------------------------------------------------------


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


# --- The simulated drive -------------------------------------------------------------------------


def test_each_sensor_has_its_noise_and_bias():
    measurements, truth = simulate(1)
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


def test_faults_appear_only_as_requested():
    plain, truth = simulate(3, 20)
    slipped, _ = simulate(3, 20, slip=(4, 5), slip_speed=0.7)
    more = slipped['vx'] - plain['vx']
    assert np.allclose(more, np.where((plain['t'] >= 4) & (plain['t'] < 5), 0.7, 0))
    assert plain.dropna()['t'].tolist() == list(range(21))
    turned, _ = simulate(3, 20, imu_mounting=0.3)
    assert np.allclose(turned['imu_vyaw'], plain['imu_vyaw'])
    assert np.allclose(np.sin(turned['imu_yaw'] - plain['imu_yaw']), math.sin(0.3))
    # What it feels is seen from its own axes; the noise is the same.
    felt, said, noise = (
        each['ax'].to_numpy() + 1j * each['ay'].to_numpy()
        for each in (truth, turned, plain - truth[['ax', 'ay']])
    )
    assert np.allclose(said - noise, felt * np.exp(-0.3j))


# --- Bad input: one sentence that says what to do -------------------------------------------------


def refused(said, call, *arguments, **options):
    with pytest.raises((TypeError, ValueError)) as failure:
        call(*arguments, **options)
    assert str(failure.value).startswith(said)
    assert str(failure.value).endswith('.')


@pytest.mark.parametrize(
    ('options', 'said'),
    [
        ({'measurements': table()[['t', 'vx']]}, 'The table lacks the column(s) ax, gps_x, gps_y'),
        ({'measurements': table(vx='fast')}, 'The column vx must hold numbers.'),
        ({'measurements': table(t=[0, 1, 1, 2, 3])}, 'The times must increase from row to row'),
        ({'sensors': 'odom'}, "sensors must be a list of some of odom, imu, gps, not 'odom'."),
        ({'gates': 3.0}, "options can name process_noise, variances, config, gate, not 'gates'."),
        ({'variances': {'vx': 0}}, "variances['vx'] must be a positive number, not 0."),
        ({'process_noise': {'x': -1}}, "process_noise['x'] must be a number, zero or more, not -1"),
        ({'config': {'odom': ['yaw']}}, "config['odom'] must be a list of some of vx, vy, vyaw, "),
        ({'gate': 3.0}, 'gate must be a dict, not 3.0.'),
    ],
)
def test_a_bad_table_or_option(options, said):
    refused(said, fuse, **{'measurements': table()} | options)


COVARIANCE = 'covariance must be symmetric, and its variances more than zero, not '


@pytest.mark.parametrize(
    ('changed', 'said'),
    [
        ({'measured': ['z', 'x']}, 'measured must be a list of some of x, y, yaw, vx, vy, vyaw, a'),
        ({'values': [1, math.nan]}, 'values must be 2 finite numbers, not [1.0, nan]: leave out'),
        ({'covariance': [1]}, 'covariance must be 2 by 2, or 2 variances, not [1].'),
        ({'covariance': [0, 0]}, COVARIANCE + '[0, 0]: where a message has only zeros, its cov'),
        ({'covariance': [1, -1]}, COVARIANCE),
        ({'covariance': [[1, 0.5], [0, 1]]}, COVARIANCE),
    ],
)
def test_a_bad_message(changed, said):
    good = {'t': 0.0, 'measured': ['x', 'y'], 'values': [1, 2], 'covariance': [1, 1]}
    ekf = ExtendedKalmanFilter()
    refused(said, ekf.process, **good | changed)
    assert ekf.t is None
