"""What goes wrong in lesson 09, on several seeds. Its other claims are in test_fusion.py."""

import numpy as np
import pandas as pd
import pytest

from helpers.fusion import chi_square_bounds, errors, fuse, innovations, rmse, simulate

SEEDS = [1, 2, 3]
CALM = {'x': 0.002, 'y': 0.002}
GATE = {'gps': 3.0}
COLUMNS = {
    'odom': ['vx', 'vyaw'],
    'imu': ['imu_yaw', 'imu_vyaw', 'ax'],
    'gps': ['gps_x', 'gps_y'],
}


def of_gps(measurements, **settings):
    told = innovations(measurements, **settings)
    return told[(told['sensor'] == 'gps') & (told['variable'] == 'x')]


def distances_m(drive, **settings):
    return errors(fuse(drive.measurements, process_noise=CALM, **settings), drive.truth)['distance']


def test_the_default_is_too_careful_and_the_lowered_noise_is_honest():
    tables = [simulate(seed).measurements for seed in SEEDS]
    default, lowered = (
        pd.concat([of_gps(table, process_noise=noise) for table in tables])['nis']
        for noise in (None, CALM)
    )
    low, high = chi_square_bounds(2, len(default))
    assert default.mean() < 0.95 * low
    assert low < lowered.mean() < high


@pytest.mark.parametrize('seed', SEEDS)
def test_the_pose_does_not_run_away_when_a_sensor_dies(seed):
    drive = simulate(seed)
    for columns in COLUMNS.values():
        silent = drive.measurements.copy()
        silent.loc[silent['t'] >= 60, columns] = np.nan
        assert distances_m(drive._replace(measurements=silent)).max() < 2.5


@pytest.mark.parametrize('seed', SEEDS)
def test_a_gate_keeps_jumps_out(seed):
    drive, clean = simulate(seed, gps_outliers=6), simulate(seed)
    assert distances_m(drive).max() > 3 * distances_m(drive, gate=GATE).max()
    jumped = (drive.measurements['gps_x'] - clean.measurements['gps_x']).abs() > 1e-6
    fixes = of_gps(drive.measurements, process_noise=CALM, gate=GATE)
    kept_out = set(fixes['t'][~fixes['accepted']])
    assert set(drive.measurements['t'][jumped]) <= kept_out
    assert len(kept_out) <= 6 + 4


@pytest.mark.parametrize('seed', SEEDS)
def test_a_gate_keeps_the_truth_out_after_the_wheels_slipped(seed):
    drive = simulate(seed, slip=(50, 60), slip_speed=1.0)
    assert distances_m(drive, gate=GATE).iloc[-1] > 5
    assert distances_m(drive).iloc[-1] < 1
    fixes = of_gps(drive.measurements, process_noise=CALM, gate=GATE)
    assert not fixes['accepted'][fixes['t'] > 65].any()


@pytest.mark.parametrize('seed', [11, 12])
def test_without_the_speed_of_the_wheels_slip_does_no_harm(seed):
    settings = {'process_noise': CALM, 'gate': GATE}
    for trouble in (
        {'slip': (20, 30), 'slip_speed': 1.0},
        {'slip': (35, 42), 'slip_speed': 2.0},
        {'gps_outliers': 6},
    ):
        drive = simulate(seed, 60, **trouble)
        estimate = fuse(drive.measurements, config={'odom': ('vy', 'vyaw')}, **settings)
        assert rmse(estimate, drive.truth) < 0.8
        if 'slip' in trouble:
            assert rmse(fuse(drive.measurements, **settings), drive.truth) > 3


@pytest.mark.parametrize('seed', [21, 22])
def test_a_sensor_with_a_wrong_covariance_sticks_out(seed):
    true = {'gps_x': 1.0, 'gps_y': 1.0}
    drive = simulate(seed, variances=true)
    means = []
    for variances in (None, true):
        told = innovations(drive.measurements, process_noise=CALM, variances=variances)
        squared = (told['innovation'] / told['sigma']) ** 2
        means.append(squared.groupby([told['sensor'], told['variable']]).mean())
    assert means[0]['gps'].min() > 3
    assert means[0].drop('gps').max() < 1.2
    assert 0.75 < means[1].max() < 1.35
