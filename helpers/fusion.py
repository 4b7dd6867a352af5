"""One pose from several imperfect sensors: an extended Kalman filter for a robot on a floor.

The state is where the robot is in the frame `odom` or `map` (x, y in metres, yaw in radians), and
how it moves, in its own frame (vx, vy in m/s, vyaw in rad/s, ax, ay in m/s^2). Any sensor measures
any part of it, when it likes, with its own covariance.

The motion model, the noise model, the order of the steps and the defaults are those of
robot_localization's `ekf_node` in its two-dimensional mode (T. Moore and D. Stouch, "A Generalized
Extended Kalman Filter Implementation for the Robot Operating System", 2014; src/ekf.cpp and
src/filter_base.cpp of that package). On the drives in tests/data both give the same path, to a
hundredth of a millimetre.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
import pandas as pd

from helpers.values import MOST, check_columns, column_of_numbers, is_number, items, shown

STATE = ('x', 'y', 'yaw', 'vx', 'vy', 'vyaw', 'ax', 'ay')

# The variance that each second adds to each part of the state: what the motion model leaves out.
PROCESS_NOISE = {
    'x': 0.05,
    'y': 0.05,
    'yaw': 0.06,
    'vx': 0.025,
    'vy': 0.025,
    'vyaw': 0.02,
    'ax': 0.01,
    'ay': 0.01,
}

# The variance of what each column says. `vy` is no column: wheels that cannot move sideways say 0.
VARIANCES = {
    'vx': 0.0025,
    'vy': 0.01,
    'vyaw': 0.0025,
    'imu_yaw': 0.0004,
    'imu_vyaw': 0.0001,
    'ax': 0.01,
    'gps_x': 0.25,
    'gps_y': 0.25,
}

# What a row says, in the order in which it is applied: each message has the column of each part of
# the state that it measures. The IMU's parts are applied one after the other.
MESSAGES = {
    'odom': ({'vx': 'vx', 'vy': 'vy', 'vyaw': 'vyaw'},),
    'imu': ({'yaw': 'imu_yaw'}, {'vyaw': 'imu_vyaw'}, {'ax': 'ax'}),
    'gps': ({'x': 'gps_x', 'y': 'gps_y'},),
}
SENSORS = tuple(MESSAGES)

POSE, TWIST = STATE[:3], STATE[3:6]
INITIAL_VARIANCE = 1e-9
MOST_ROWS = 10**6

_YAW = STATE.index('yaw')
_TURN = np.where(np.array(STATE) == 'yaw', math.tau, 0.0)
_IDENTITY = np.eye(len(STATE))


class Innovation(NamedTuple):
    """How a message differed from what the filter expected.

    `measured` names the k parts of the state; `value` (k) is measured minus expected, the yaw
    between -pi and pi; `covariance` (k, k) is what the filter expected of `value`; `nis` is
    value' covariance^-1 value, the squared Mahalanobis distance (chi-square with k degrees of
    freedom in a consistent filter); `accepted` is False where the gate kept the message out.
    """

    measured: tuple[str, ...]
    value: np.ndarray
    covariance: np.ndarray
    nis: float
    accepted: bool


def motion(state: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the state (8) `dt` seconds later, and its derivative (8, 8) with respect to `state`.

    The robot keeps its acceleration and its turning rate, and does not turn during the step.
    """
    cos, sin = math.cos(state[_YAW]), math.sin(state[_YAW])
    turned = np.array([[cos, -sin], [sin, cos]])
    transfer = _IDENTITY.copy()
    transfer[:2, 3:5] = turned * dt
    transfer[:2, 6:] = turned * (dt * dt / 2)
    transfer[2, 5] = transfer[3, 6] = transfer[4, 7] = dt
    moved = transfer @ state
    # Turning the robot turns the step that it makes.
    transfer[0, _YAW], transfer[1, _YAW] = state[1] - moved[1], moved[0] - state[0]
    return _wrapped(moved), transfer


class ExtendedKalmanFilter:
    """The filter, message by message.

    `process_noise` is the variance that a second adds: a dict by name (the others keep
    PROCESS_NOISE), 8 variances, or an (8, 8) matrix. Without an `initial_state` (8) the first
    message sets the part of the state that it measures; the rest is zero. `initial_covariance` is
    8 variances or (8, 8); without it 1e-9 on the diagonal.

    `state` (8) in the order of STATE and `covariance` (8, 8) are the estimate at the time `t` in
    seconds (None before the first message).
    """

    def __init__(
        self,
        process_noise: Mapping[str, float] | Sequence | np.ndarray | None = None,
        initial_state: Sequence[float] | None = None,
        initial_covariance: Sequence | np.ndarray | None = None,
    ) -> None:
        self.process_noise = _process_noise(process_noise)
        if initial_covariance is None:
            self.covariance = INITIAL_VARIANCE * _IDENTITY
        else:
            self.covariance = _covariance('initial_covariance', initial_covariance, len(STATE))
        self._empty = initial_state is None
        if initial_state is None:
            self.state = np.zeros(len(STATE))
        else:
            self.state = _wrapped(_vector('initial_state', initial_state, len(STATE)))
        self.t: float | None = None

    def predict(self, dt: float) -> None:
        """Move the estimate `dt` seconds on. Raises ValueError if `dt` is negative."""
        dt = _number('dt', dt)
        if dt < 0:
            raise ValueError(f'dt must be zero or more seconds, not {shown(dt)}.')
        self._predict(dt)
        if self.t is not None:
            self.t += dt

    def update(
        self,
        measured: Sequence[bool] | Sequence[str],
        values: Sequence[float],
        covariance: Sequence | np.ndarray,
        gate: float | None = None,
    ) -> Innovation | None:
        """Correct the estimate with what a sensor measured now.

        `measured` says which parts of the state: 8 booleans in the order of STATE (as
        `odom0_config` of robot_localization), or k names. `values` (k) are in the same order;
        those that are NaN are left out. `covariance` is (k, k), or k variances. With a `gate` the
        message is kept out if its Mahalanobis distance is `gate` or more.

        Returns the innovation, or None if all values are NaN.
        """
        message = _message(measured, values, covariance, gate)
        if message is None:
            return None
        self._empty = False
        return self._correct(*message)

    def process(
        self,
        t: float,
        measured: Sequence[bool] | Sequence[str],
        values: Sequence[float],
        covariance: Sequence | np.ndarray,
        gate: float | None = None,
    ) -> Innovation | None:
        """Take a message of the time `t` (seconds): move the estimate to `t`, and correct it.

        The other arguments are those of `update`. The first message sets what it measures. A
        message that is older than the estimate corrects it as if it were of now, as
        robot_localization does without its history (`smooth_lagged_data`).

        Returns the innovation, or None for the first message and if all values are NaN.
        """
        t = _number('t', t)
        message = _message(measured, values, covariance, gate)
        return None if message is None else self._process(t, *message)

    def _advance(self, t: float) -> None:
        if self.t is None:
            self.t = t
        elif t > self.t:
            self._predict(t - self.t)
            self.t = t

    def _process(self, t, index, values, covariance, gate) -> Innovation | None:
        self._advance(t)
        if not self._empty:
            return self._correct(index, values, covariance, gate)
        self.state[index] = values
        _wrapped(self.state)
        self.covariance[np.ix_(index, index)] = covariance
        self._empty = False
        return None

    def _predict(self, dt: float) -> None:
        self.state, jacobian = motion(self.state, dt)
        self.covariance = jacobian @ self.covariance @ jacobian.T + dt * self.process_noise

    def _correct(self, index, values, covariance, gate) -> Innovation:
        shared = self.covariance[:, index]
        expected = shared[index] + covariance
        inverse = np.linalg.inv(expected)
        innovation = values - self.state[index]
        innovation -= _TURN[index] * np.round(innovation / math.tau)
        nis = float(innovation @ inverse @ innovation)
        accepted = gate is None or nis < gate * gate
        if accepted:
            gain = shared @ inverse
            self.state = _wrapped(self.state + gain @ innovation)
            # Joseph's form: a sum of squares, which rounding cannot make negative.
            kept = _IDENTITY.copy()
            kept[:, index] -= gain
            self.covariance = kept @ self.covariance @ kept.T + gain @ covariance @ gain.T
        names = tuple(STATE[i] for i in index)
        return Innovation(names, innovation, expected, nis, accepted)


def fuse(
    measurements: pd.DataFrame,
    sensors: Iterable[str] = SENSORS,
    *,
    process_noise: Mapping[str, float] | Sequence | np.ndarray | None = None,
    variances: Mapping[str, float] | None = None,
    config: Mapping[str, Sequence[bool] | Sequence[str]] | None = None,
    gate: float | Mapping[str, float] | None = None,
    initial_state: Sequence[float] | None = None,
    initial_covariance: Sequence | np.ndarray | None = None,
) -> pd.DataFrame:
    """Estimate the path from a table of what the sensors said.

    `measurements` has the column `t` (s, increasing) and those of the chosen sensors, NaN where a
    sensor is silent: `vx` (m/s) and `vyaw` (rad/s) for 'odom'; `imu_yaw` (rad), `imu_vyaw` (rad/s)
    and `ax` (m/s^2) for 'imu'; `gps_x` and `gps_y` (m) for 'gps'. In a row, odom is applied first
    (with vy = 0, because its wheels cannot move sideways), then yaw, vyaw and ax of the imu one
    after the other, then gps: the calls of `ExtendedKalmanFilter.process` that MESSAGES lists.

    `variances` replaces some of VARIANCES. `config` says which parts of the state a sensor
    measures, where not all it can: {'odom': ('vx', 'vy')}, or 8 booleans instead of the names.
    `gate` is a Mahalanobis distance for all sensors, or a dict: {'gps': 3.0}. The others are as for
    `ExtendedKalmanFilter`.

    Returns a table with a row for each time: `t`, `x`, `y`, `yaw`, `vx`, `vy`, `vyaw`, and the
    covariances of pose and twist as a nav_msgs/Odometry has them: `var_x`, `cov_x_y`, `cov_x_yaw`,
    ... (NaN before the first message). `covariances` makes matrices of them.

    Raises ValueError or TypeError, with a sentence that says what to change, for a table or a
    setting that cannot be used.
    """
    ekf = ExtendedKalmanFilter(process_noise, initial_state, initial_covariance)
    times, states, matrices = [], [], []
    for t, _ in _run(ekf, measurements, sensors, variances, config, gate):
        known = np.nan if ekf.t is None else 1.0
        times.append(t)
        states.append(known * ekf.state)
        matrices.append(known * ekf.covariance)
    columns = {'t': times} | dict(zip(STATE[:6], np.array(states).T, strict=False))
    matrices = np.array(matrices)
    for block in (POSE, TWIST):
        for a, b in combinations_with_replacement(block, 2):
            columns[_column(a, b)] = matrices[:, STATE.index(a), STATE.index(b)]
    return pd.DataFrame(columns)


def innovations(
    measurements: pd.DataFrame,
    sensors: Iterable[str] = SENSORS,
    *,
    process_noise: Mapping[str, float] | Sequence | np.ndarray | None = None,
    variances: Mapping[str, float] | None = None,
    config: Mapping[str, Sequence[bool] | Sequence[str]] | None = None,
    gate: float | Mapping[str, float] | None = None,
    initial_state: Sequence[float] | None = None,
    initial_covariance: Sequence | np.ndarray | None = None,
) -> pd.DataFrame:
    """Return how each message of `fuse`, with the same arguments, differed from the expected.

    One row for each number measured: `t`, `sensor`, `variable` (its name in STATE), `innovation`
    (measured minus expected), `sigma` (the standard deviation that the filter expects of it), and
    of the whole message `nis`, `dof` (how many numbers it measured) and `accepted`.
    """
    ekf = ExtendedKalmanFilter(process_noise, initial_state, initial_covariance)
    rows = [
        (t, sensor, *number, message.nis, len(message.value), message.accepted)
        for t, heard in _run(ekf, measurements, sensors, variances, config, gate)
        for sensor, message in heard
        for number in zip(
            message.measured,
            message.value,
            np.sqrt(np.diag(message.covariance)),
            strict=True,
        )
    ]
    columns = ['t', 'sensor', 'variable', 'innovation', 'sigma', 'nis', 'dof', 'accepted']
    return pd.DataFrame(rows, columns=columns)


def covariances(estimate: pd.DataFrame, names: Sequence[str] = ('x', 'y')) -> np.ndarray:
    """Return the covariance of `names` in each row of what `fuse` returned: (rows, k, k).

    The names are parts of the pose (x, y, yaw) or of the twist (vx, vy, vyaw), not of both.
    """
    chosen = items(names)
    if not chosen or not any(all(n in block for n in chosen) for block in (POSE, TWIST)):
        raise ValueError(
            f'names must be some of {", ".join(POSE)} or some of {", ".join(TWIST)}, '
            f'not {shown(names)}.'
        )
    columns = _columns(estimate, {_column(a, b) for a in names for b in names})
    return np.array([[columns[_column(a, b)] for b in names] for a in names]).transpose(2, 0, 1)


def errors(estimate: pd.DataFrame, truth: pd.DataFrame) -> pd.DataFrame:
    """Return how far off the estimate is: `t`, `x`, `y`, `distance` (m), `yaw` (rad, -pi to pi).

    `truth` has the columns `t`, `x`, `y`, `yaw`. Between its rows it is interpolated; it must
    cover the times of the estimate.
    """
    estimate, truth = (_columns(table, ('t', *POSE)) for table in (estimate, truth))
    t, known = estimate['t'], truth['t']
    if not (len(known) and np.all(np.diff(known) > 0)):
        raise ValueError('The truth needs rows whose times increase.')
    if not np.all((known[0] <= t) & (t <= known[-1])):
        raise ValueError('The truth must cover all times of the estimate.')
    x, y = (estimate[name] - np.interp(t, known, truth[name]) for name in ('x', 'y'))
    yaw = _angle(estimate['yaw'] - np.interp(t, known, np.unwrap(truth['yaw'])))
    return pd.DataFrame({'t': t, 'x': x, 'y': y, 'yaw': yaw, 'distance': np.hypot(x, y)})


def rmse(estimate: pd.DataFrame, truth: pd.DataFrame) -> float:
    """Return the root mean square of the distances (m) that `errors` finds.

    Rows of the estimate that are NaN do not count.
    """
    return float(np.sqrt((errors(estimate, truth)['distance'] ** 2).mean()))


def nees(
    estimate: pd.DataFrame, truth: pd.DataFrame, names: Sequence[str] = ('x', 'y')
) -> np.ndarray:
    """Return the normalised estimation error squared of each row: error' covariance^-1 error.

    In a consistent filter it is chi-square with len(names) degrees of freedom. `names` are parts
    of the pose.
    """
    if not all(name in POSE for name in items(names) or [None]):
        raise ValueError(f'names must be some of {", ".join(POSE)}, not {shown(names)}.')
    matrices = covariances(estimate, names)
    off = errors(estimate, truth)[list(names)].to_numpy()
    try:
        weighted = np.linalg.solve(matrices, off[..., None])[..., 0]
    except np.linalg.LinAlgError:
        raise ValueError('The covariance of each row must be positive definite.') from None
    return np.sum(off * weighted, axis=1)


def chi_square_bounds(dof: int, runs: int = 1, probability: float = 0.95) -> tuple[float, float]:
    """Return the two values between which the mean of `runs` NIS or NEES lies with `probability`.

    `dof` is how many numbers each has: 1 for a yaw, 2 for a position. The runs are independent,
    and the same probability is left on both sides.
    """
    for name, value in (('dof', dof), ('runs', runs)):
        _positive(name, _whole(name, value))
    if dof * runs > MOST_ROWS:
        raise ValueError(f'dof times runs must be at most {MOST_ROWS}, not {shown(dof * runs)}.')
    if not 0 < _number('probability', probability) < 1:
        raise ValueError(f'probability must be between 0 and 1, not {shown(probability)}.')
    outside = (1 - probability) / 2
    return tuple(_chi_square(dof * runs, p) / runs for p in (outside, 1 - outside))


class Drive(NamedTuple):
    """A simulated drive: what the sensors said, and apart from it, what was true."""

    measurements: pd.DataFrame
    truth: pd.DataFrame


def simulate(
    seed: int,
    seconds: float = 120.0,
    *,
    rate: float = 50.0,
    gps_period: float = 1.0,
    wheel_scale: float = 1.04,
    turn_scale: float = 1.05,
    turn_bias: float = 0.012,
    gyro_bias: float = 0.002,
    slip: tuple[float, float] | None = None,
    slip_speed: float = 0.5,
    gps_outliers: int = 0,
    gps_jump: float = 20.0,
    gps_gap: tuple[float, float] | None = None,
    imu_mounting: float = 0.0,
    variances: Mapping[str, float] | None = None,
) -> Drive:
    """Drive a unicycle for some seconds, and return what its sensors say and what is true.

    The robot starts at 0, 0 towards x, speeds up for two seconds, then swings between forwards and
    backwards, and turns left and right: the path of the drives in tests/data. Wheels and IMU speak
    `rate` times a second, GPS every `gps_period` seconds. The noise is normal with VARIANCES, of
    which `variances` replaces some. The seed decides the noise and the outliers, nothing else.

    What else is wrong with the sensors: the wheels report `wheel_scale` times the speed, and
    `turn_scale` times the turning rate plus `turn_bias` rad/s. While they slip (`slip`: from, to in
    s) they report `slip_speed` m/s more than the robot moves. The gyro reports `gyro_bias` rad/s
    too much. The IMU is mounted turned by `imu_mounting` rad, and reports in its own frame.
    `gps_outliers` of the fixes, never the first, jump `gps_jump` metres away. There is no fix
    during `gps_gap` (from, to in s).

    Returns `Drive(measurements, truth)`. The measurements have the columns that `fuse` reads, and
    `ay`, the IMU's other acceleration (m/s^2), which a turned IMU needs. The truth has `t` and the
    columns of STATE, with the centripetal acceleration as `ay`.

    Raises ValueError or TypeError for a setting that cannot be used.
    """
    if _whole('seed', seed) < 0:
        raise ValueError(f'seed must be zero or more, not {shown(seed)}.')
    for name, value in (('seconds', seconds), ('rate', rate), ('gps_period', gps_period)):
        _positive(name, value)
    if seconds * rate > MOST_ROWS:
        raise ValueError(f'seconds times rate must be at most {MOST_ROWS}: so many rows it makes.')
    for name, value in (
        ('wheel_scale', wheel_scale),
        ('turn_scale', turn_scale),
        ('turn_bias', turn_bias),
        ('gyro_bias', gyro_bias),
        ('slip_speed', slip_speed),
        ('gps_jump', gps_jump),
        ('imu_mounting', imu_mounting),
    ):
        _number(name, value)
    variances = _variances(variances)
    t = np.arange(round(seconds * rate) + 1) / rate
    truth = _path(t)
    slips, gap = _during('slip', slip, t), _during('gps_gap', gps_gap, t)
    cos, sin = math.cos(imu_mounting), math.sin(imu_mounting)
    said = {
        'vx': wheel_scale * truth['vx'] + slip_speed * slips,
        'vyaw': turn_scale * truth['vyaw'] + turn_bias,
        'imu_yaw': truth['yaw'] + imu_mounting,
        'imu_vyaw': truth['vyaw'] + gyro_bias,
        'ax': cos * truth['ax'] + sin * truth['ay'],
        'ay': cos * truth['ay'] - sin * truth['ax'],
        'gps_x': truth['x'],
        'gps_y': truth['y'],
    }
    rng = np.random.default_rng(seed)
    sigma = np.sqrt([variances['ax' if name == 'ay' else name] for name in said])
    measurements = pd.DataFrame(said) + rng.normal(0, sigma, (len(t), len(sigma)))
    measurements.insert(0, 't', t)
    measurements['imu_yaw'] = _angle(measurements['imu_yaw'])
    fix = (np.arange(len(t)) % max(1, round(gps_period * rate)) == 0) & ~gap
    later = np.flatnonzero(fix)[1:]
    if not 0 <= _whole('gps_outliers', gps_outliers) <= len(later):
        raise ValueError(f'gps_outliers must be 0 to {len(later)}, not {shown(gps_outliers)}.')
    direction = rng.uniform(-math.pi, math.pi, gps_outliers)
    measurements.loc[rng.choice(later, gps_outliers, replace=False), ['gps_x', 'gps_y']] += (
        gps_jump * np.column_stack([np.cos(direction), np.sin(direction)])
    )
    measurements.loc[~fix, ['gps_x', 'gps_y']] = np.nan
    return Drive(measurements, truth)


def _during(name: str, interval: tuple[float, float] | None, t: np.ndarray) -> np.ndarray:
    """Which of the times lie in the interval; its end does not."""
    if interval is None:
        return np.zeros(len(t), bool)
    start, end = _vector(name, interval, 2)
    if not start < end:
        raise ValueError(f'{name} must be (from, to) in seconds, not {shown(interval)}.')
    return (start <= t) & (t < end)


def _path(t: np.ndarray) -> pd.DataFrame:
    """The truth at the times `t`: speed and turning rate are given, the rest is integrated."""

    def speed(t):
        return 0.5 * np.minimum(t, 2) + 0.75 * (np.sin(0.4 * t) - math.sin(0.8)) * (t > 2)

    def yaw(t):
        return 0.05 * t + 1.5 * (1 - np.cos(0.2 * t))

    between = (t[1:] + t[:-1]) / 2
    steps = np.diff(t) * speed(between) * np.array([np.cos(yaw(between)), np.sin(yaw(between))])
    x, y = np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)
    vx, vyaw = speed(t), 0.05 + 0.3 * np.sin(0.2 * t)
    ax = np.where(t <= 2, 0.5, 0.3 * np.cos(0.4 * t))
    columns = x, y, _angle(yaw(t)), vx, np.zeros(len(t)), vyaw, ax, vx * vyaw
    return pd.DataFrame({'t': t} | dict(zip(STATE, columns, strict=True)))


# --- The run over a table ------------------------------------------------------------------------


def _run(
    ekf: ExtendedKalmanFilter, measurements: pd.DataFrame, sensors, variances, config, gate
) -> Iterator[tuple[float, list[tuple[str, Innovation]]]]:
    """Feed the rows to the filter. After each, yield its time and the innovations by sensor."""
    sensors = _sensors(sensors)
    variances = _variances(variances)
    messages = _messages(sensors, config)
    gates = gate if isinstance(gate, Mapping) else dict.fromkeys(sensors, gate)
    gates = {_known('gate', sensor, SENSORS): _gate(gates[sensor]) for sensor in gates}
    table = _table(measurements, [name for _, parts in messages for name in parts.values()])
    prepared = []
    for sensor, parts in messages:
        index = np.array([STATE.index(name) for name in parts])
        values = np.column_stack([table[column] for column in parts.values()])
        covariance = np.diag([variances[column] for column in parts.values()])
        silent = np.isnan(values)
        some, whole = ~silent.all(axis=1), ~silent.any(axis=1)
        prepared.append((sensor, index, values, covariance, some.tolist(), whole.tolist()))
    if not any(any(some) for *_, some, _ in prepared):
        raise ValueError(f'The table has no measurement of {", ".join(sensors)}: all are NaN.')
    for row, t in enumerate(table['t'].tolist()):
        heard = []
        for sensor, index, values, covariance, some, whole in prepared:
            if some[row]:
                message = index, values[row], covariance
                if not whole[row]:
                    message = _present(*message)
                innovation = ekf._process(t, *message, gates.get(sensor))
                if innovation is not None:
                    heard.append((sensor, innovation))
        if ekf.t is not None:
            ekf._advance(t)
        yield t, heard


def _column(a: str, b: str) -> str:
    """The name of the column with the covariance of two parts of the state."""
    first, second = sorted((a, b), key=STATE.index)
    return f'var_{a}' if a == b else f'cov_{first}_{second}'


def _wrapped(state: np.ndarray) -> np.ndarray:
    """The same state, with the yaw between -pi and pi. Changes `state` itself."""
    state[_YAW] = math.remainder(state[_YAW], math.tau)
    return state


def _angle(radians):
    """The same angle between -pi and pi."""
    return radians - math.tau * np.round(radians / math.tau)


def _chi_square(dof: int, probability: float) -> float:
    """The value below which a chi-square number with `dof` degrees of freedom is so probably."""
    # P(more than x) = [erfc(sqrt(x / 2)) if dof is odd] + sum of exp(-x / 2) (x / 2)^j / j!
    j = np.arange(dof % 2 / 2, dof / 2)
    factorials = np.array([math.lgamma(i + 1) for i in j])
    low, high = 0.0, dof + 40 * math.sqrt(dof) + 100
    for _ in range(100):
        x = (low + high) / 2
        more = np.exp(j * math.log(x / 2) - x / 2 - factorials).sum()
        if dof % 2:
            more += math.erfc(math.sqrt(x / 2))
        low, high = (x, high) if 1 - more < probability else (low, x)
    return x


# --- What can be used ----------------------------------------------------------------------------


def _message(measured, values, covariance, gate):
    """Check a message, and return the part of it that is not NaN, or None."""
    index = _index(measured)
    values = _vector('values', values, len(index), nan_allowed=True)
    covariance = _covariance('covariance', covariance, len(index))
    gate = _gate(gate)
    if np.isnan(values).all():
        return None
    return *_present(index, values, covariance), gate


def _present(index, values, covariance):
    there = ~np.isnan(values)
    return index[there], values[there], covariance[np.ix_(there, there)]


def _index(measured) -> np.ndarray:
    allowed = (
        f'measured must be {len(STATE)} booleans or some of the names {", ".join(STATE)}, '
        f'not {shown(measured)}.'
    )
    given = measured
    measured = items(given)
    if measured is None:
        raise TypeError(allowed)
    if len(measured) == len(STATE) and all(isinstance(m, bool | np.bool_) for m in measured):
        index = np.flatnonzero(measured)
    elif all(isinstance(name, str) and name in STATE for name in measured):
        index = np.array([STATE.index(name) for name in measured], int)
    else:
        raise ValueError(allowed)
    if len(index) == 0 or len(set(index)) < len(index):
        raise ValueError(
            f'measured must name at least one part, and each once, not {shown(given)}.'
        )
    return index


def _array(values) -> np.ndarray | None:
    """Return an array of floats, or None for what cannot be one."""
    try:
        return np.array(values, float)
    except (TypeError, ValueError, OverflowError):
        return None


def _bound(array) -> str:
    """What the numbers must be that are too large."""
    return f'at most {MOST:g}' if np.isfinite(array).all() else 'finite'


def _vector(name: str, values, size: int, nan_allowed: bool = False) -> np.ndarray:
    vector = _array(values)
    if vector is None:
        raise TypeError(f'{name} must be {size} numbers, not {shown(values)}.')
    if vector.shape != (size,):
        raise ValueError(f'{name} must be {size} numbers, not {shown(values)}.')
    if (np.abs(vector) > MOST).any() or (np.isnan(vector).any() and not nan_allowed):
        raise ValueError(f'{name} must be {_bound(vector)}, not {shown(values)}.')
    return vector


def _symmetric(name: str, matrix, size: int) -> np.ndarray:
    given, matrix = matrix, _array(matrix)
    if matrix is None:
        raise TypeError(f'{name} must be a matrix or variances, not {shown(given)}.')
    if matrix.shape == (size,):
        matrix = np.diag(matrix)
    if matrix.shape != (size, size):
        raise ValueError(
            f'{name} must be {size} by {size}, or {size} variances, not {matrix.shape}.'
        )
    if not (np.abs(matrix) <= MOST).all():
        raise ValueError(f'{name} must be {_bound(matrix)}.')
    if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
        raise ValueError(f'{name} must be symmetric.')
    return matrix


def _covariance(name: str, matrix, size: int) -> np.ndarray:
    matrix = _symmetric(name, matrix, size)
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        raise ValueError(
            f'{name} must be positive definite: variances more than zero, and no two numbers '
            'that always agree.'
        ) from None
    return matrix


def _process_noise(noise) -> np.ndarray:
    if noise is None or isinstance(noise, Mapping):
        noise = list(_merged('process_noise', noise, PROCESS_NOISE).values())
    matrix = _symmetric('process_noise', noise, len(STATE))
    eigenvalues = np.linalg.eigvalsh(matrix)
    if eigenvalues[0] < -1e-9 * abs(eigenvalues[-1]):
        raise ValueError('process_noise must be positive semidefinite: no variance less than zero.')
    return matrix


def _merged(name: str, given: Mapping | None, defaults: Mapping) -> dict[str, float]:
    """The defaults, some of them replaced."""
    if not isinstance(given, Mapping | None):
        raise TypeError(f'{name} must be a dict, not {shown(given)}.')
    return dict(defaults) | {
        _known(name, key, defaults): _number(f'{name}[{key!r}]', value)
        for key, value in (given or {}).items()
    }


def _variances(given: Mapping | None) -> dict[str, float]:
    variances = _merged('variances', given, VARIANCES)
    return {name: _positive(f'variances[{name!r}]', variances[name]) for name in variances}


def _sensors(sensors) -> list[str]:
    if isinstance(sensors, str) or items(sensors) is None:
        raise TypeError(f'sensors must be a tuple of {", ".join(SENSORS)}, not {shown(sensors)}.')
    chosen = [_known('sensors', sensor, SENSORS) for sensor in items(sensors)]
    if not chosen:
        raise ValueError(f'sensors must be at least one of {", ".join(SENSORS)}.')
    return [sensor for sensor in SENSORS if sensor in chosen]


def _messages(sensors: list[str], config) -> list[tuple[str, dict[str, str]]]:
    """The messages of the sensors, without the parts that are not to be used."""
    if not isinstance(config, Mapping | None):
        raise TypeError(f'config must be a dict, not {shown(config)}.')
    used = {sensor: {name for parts in MESSAGES[sensor] for name in parts} for sensor in SENSORS}
    for sensor, measured in (config or {}).items():
        can = used[_known('config', sensor, SENSORS)]
        names = {STATE[i] for i in _index(measured)}
        if not names <= can:
            raise ValueError(f'{sensor} cannot measure {", ".join(sorted(names - can))}.')
        used[sensor] = names
    messages = [
        (sensor, {name: parts[name] for name in parts if name in used[sensor]})
        for sensor in sensors
        for parts in MESSAGES[sensor]
    ]
    return [(sensor, parts) for sensor, parts in messages if parts]


def _gate(gate) -> float | None:
    return None if gate is None else _positive('gate', gate)


def _known(name: str, key, allowed: Iterable[str]) -> str:
    if not isinstance(key, str) or key not in allowed:
        raise ValueError(f'{name} can name {", ".join(allowed)}, not {shown(key)}.')
    return key


def _positive(name: str, value) -> float:
    if _number(name, value) <= 0:
        raise ValueError(f'{name} must be positive, not {shown(value)}.')
    return float(value)


def _whole(name: str, value) -> int:
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise TypeError(f'{name} must be a whole number, not {shown(value)}.')
    return int(value)


def _number(name: str, value) -> float:
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(f'{name} must be a number, not {shown(value)}.')
    if not is_number(value):
        bound = f'at most {MOST:g}' if abs(value) < math.inf else 'finite'
        raise ValueError(f'{name} must be {bound}, not {shown(value)}.')
    return float(value)


def _table(measurements: pd.DataFrame, columns: list[str]) -> dict[str, np.ndarray]:
    """Return `t` and the columns as arrays."""
    if 'vy' in columns:  # no column: the wheels say it whenever they say something
        columns = [*columns, 'vx', 'vyaw']
    needed = ['t', *(name for name in dict.fromkeys(columns) if name != 'vy')]
    table = _columns(measurements, needed)
    if len(measurements) == 0:
        raise ValueError('The table is empty.')
    if np.isnan(table['t']).any():
        raise ValueError('Every row needs its time: the column t has a NaN.')
    if (np.diff(table['t']) <= 0).any():
        raise ValueError('The times must increase from row to row: sort t, and join equal times.')
    if 'vy' in columns:
        silent = np.isnan(table['vx']) & np.isnan(table['vyaw'])
        table['vy'] = np.where(silent, np.nan, 0.0)
    return table


def _columns(table: pd.DataFrame, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Return the columns as arrays of numbers."""
    names = list(names)
    check_columns(table, names)
    return {name: column_of_numbers(table, name) for name in names}
