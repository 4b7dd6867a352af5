"""The filter over a table of what the sensors said: the estimate, and the innovations.

The same calls of the filter as in a node that gets all messages in order, without the messages.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
import pandas as pd

from helpers.fusion import settings
from helpers.fusion.filter import STATE, ExtendedKalmanFilter, Innovation, part_of_state
from helpers.notebook import check_columns, chosen, column_of_numbers
from helpers.robot import VARIANCES

# What a row says, in the order in which it is applied: each message has the column of each part of
# the state that it measures. The IMU's parts are applied one after the other.
MESSAGES = {
    'odom': ({'vx': 'vx', 'vy': 'vy', 'vyaw': 'vyaw'},),
    'imu': ({'yaw': 'imu_yaw'}, {'vyaw': 'imu_vyaw'}, {'ax': 'ax'}),
    'gps': ({'x': 'gps_x', 'y': 'gps_y'},),
}
SENSORS = tuple(MESSAGES)
POSE = STATE[:3]
INNOVATION_COLUMNS = ('t', 'sensor', 'variable', 'innovation', 'sigma', 'nis', 'dof', 'accepted')


def fuse(measurements: pd.DataFrame, sensors: Iterable[str] = SENSORS, **options) -> pd.DataFrame:
    """Estimate the path from a table of what the sensors said.

    `measurements` has the column `t` (s, increasing) and those of the chosen sensors, NaN while a
    sensor is silent: `vx` (m/s) and `vyaw` (rad/s) for 'odom'; `imu_yaw` (rad), `imu_vyaw` (rad/s)
    and `ax` (m/s^2) for 'imu'; `gps_x` and `gps_y` (m) for 'gps'. In a row, odom is applied first
    (with vy = 0, because its wheels cannot move sideways), then yaw, vyaw and ax of the imu one
    after the other, then gps: the calls of `ExtendedKalmanFilter.process` that MESSAGES lists.

    The options, each a dict:
    - `process_noise`: replaces some of PROCESS_NOISE, {'x': 0.002, 'y': 0.002};
    - `variances`: replaces some of VARIANCES, {'vx': 0.25};
    - `config`: the parts of the state that a sensor measures, if not all that it can,
      {'odom': ('vx', 'vy')};
    - `gate`: the Mahalanobis distance at which a message of a sensor is kept out, {'gps': 3.0}. The
      other sensors have none.

    Returns a table with a row for each time: `t`, `x`, `y`, `yaw`, `vx`, `vy`, `vyaw`, and the
    covariance of the pose: `var_x`, `cov_x_y`, `cov_x_yaw`, `var_y`, `cov_y_yaw`, `var_yaw` (NaN
    before the first message).

    Raises ValueError or TypeError, with a sentence that says what to change, for a table or an
    option that cannot be used.
    """
    return _estimates(_run(measurements, sensors, options))


def fuse_with_innovations(
    measurements: pd.DataFrame, sensors: Iterable[str] = SENSORS, **options
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return what `fuse` returns, and how each message differed from the expected.

    That table has a row for each number measured: `t`, `sensor`, `variable` (its name in STATE),
    `innovation` (measured minus expected), `sigma` (the standard deviation that the filter expects
    of it), and of the whole message `nis`, `dof` (how many numbers it measured) and `accepted`.
    """
    steps = _run(measurements, sensors, options)
    return _estimates(steps), _innovations(steps)


def columns_of(table: pd.DataFrame, names: Iterable[str]) -> dict[str, np.ndarray]:
    names = list(names)
    check_columns(table, names)
    return {name: column_of_numbers(table, name) for name in names}


class _Step(NamedTuple):
    """A row after it was fed to the filter: the estimate, and each message as it was heard."""

    t: float
    state: np.ndarray
    covariance: np.ndarray
    heard: list[tuple[str, Sequence[str], Innovation]]


def _estimates(steps: list[_Step]) -> pd.DataFrame:
    times, states, matrices, _ = zip(*steps, strict=True)
    columns = {'t': times} | dict(zip(STATE[:6], np.array(states).T, strict=True))
    matrices = np.array(matrices)
    for i, j in combinations_with_replacement(range(len(POSE)), 2):
        name = f'var_{POSE[i]}' if i == j else f'cov_{POSE[i]}_{POSE[j]}'
        columns[name] = matrices[:, i, j]
    return pd.DataFrame(columns)


def _innovations(steps: list[_Step]) -> pd.DataFrame:
    rows = [
        (step.t, sensor, *number, message.nis, len(names), message.accepted)
        for step in steps
        for sensor, names, message in step.heard
        for number in zip(names, message.value, np.sqrt(message.covariance.diagonal()), strict=True)
    ]
    return pd.DataFrame(rows, columns=INNOVATION_COLUMNS)


def _run(measurements: pd.DataFrame, sensors: Iterable[str], options: Mapping) -> list[_Step]:
    """Feed the rows to a filter. A message of which one number is NaN is left out."""
    chosen('options', options, ('process_noise', 'variances', 'config', 'gate'))
    ekf = ExtendedKalmanFilter(options.get('process_noise'))
    variances = settings.variances('variances', options.get('variances'), VARIANCES)
    gates = chosen('gate', options.get('gate'), SENSORS)
    gates = {sensor: settings.positive(f'gate[{sensor!r}]', gates[sensor]) for sensor in gates}
    messages = _messages(sensors, options.get('config'))
    table = _table(measurements, {name for _, parts in messages for name in parts.values()})
    prepared = []
    for sensor, parts in messages:
        values = np.column_stack([table[column] for column in parts.values()])
        noise = np.diag([variances[column] for column in parts.values()])
        is_complete = ~np.isnan(values).any(axis=1)
        prepared.append(
            (sensor, tuple(parts), part_of_state(tuple(parts)), noise, values, is_complete)
        )
    steps = []
    for row, t in enumerate(table['t'].tolist()):
        heard = []
        for sensor, names, part, noise, values, is_complete in prepared:
            if is_complete[row]:
                gate = gates.get(sensor)
                innovation = ekf.process_unchecked(t, part, values[row], noise, gate)
                if innovation is not None:
                    heard.append((sensor, names, innovation))
        if ekf.t is not None:
            ekf.predict(t)
        known = np.nan if ekf.t is None else 1.0
        steps.append(_Step(t, known * ekf.state[:6], known * ekf.covariance[:3, :3], heard))
    return steps


def _messages(sensors: Iterable[str], config) -> list[tuple[str, dict[str, str]]]:
    """Return the messages of the sensors, without the parts that are not to be used."""
    sensors = sensors if isinstance(sensors, str) else tuple(sensors)
    settings.some_of('sensors', sensors, SENSORS)
    config = chosen('config', config, SENSORS)
    for sensor, names in config.items():
        can = [name for parts in MESSAGES[sensor] for name in parts]
        settings.some_of(f'config[{sensor!r}]', names, can)
    messages = [
        (sensor, {n: column for n, column in parts.items() if n in config.get(sensor, parts)})
        for sensor in SENSORS
        if sensor in sensors
        for parts in MESSAGES[sensor]
    ]
    return [(sensor, parts) for sensor, parts in messages if parts]


def _table(measurements: pd.DataFrame, columns: set[str]) -> dict[str, np.ndarray]:
    if 'vy' in columns:  # no column: the wheels say 0 whenever they say vx
        columns = columns - {'vy'} | {'vx'}
    table = columns_of(measurements, ['t', *sorted(columns)])
    if not (np.diff(table['t']) > 0).all():
        raise ValueError('The times must increase from row to row: sort t, and join equal times.')
    if 'vx' in columns:
        table['vy'] = 0 * table['vx']
    return table
