"""The extended Kalman filter, message by message.

The state is where the robot is in the frame `odom` or `map` (x, y in metres, yaw in radians), and
how it moves, in its own frame (vx, vy in m/s, vyaw in rad/s, ax, ay in m/s^2). Any sensor measures
any part of it, when it likes, with its own covariance.

The motion model, the noise model, the order of the steps and the defaults are those of
robot_localization's `ekf_node` in its two-dimensional mode (T. Moore and D. Stouch, "A Generalized
Extended Kalman Filter Implementation for the Robot Operating System", 2014; src/ekf.cpp and
src/filter_base.cpp of that package). On the drives in tests/data both give the same path, to a
hundredth of a millimetre. Two things differ. A variance of zero is refused here; that package takes
1e-9 instead. And the caller leaves out a message without a value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from helpers.fusion import settings
from helpers.notebook import shown

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

INITIAL_VARIANCE = 1e-9

_YAW = STATE.index('yaw')
_IDENTITY = np.eye(len(STATE))


class Innovation(NamedTuple):
    """How a message of k numbers differed from what the filter expected.

    `value` (k) is measured minus expected, the yaw between -pi and pi; `covariance` (k, k) is what
    the filter expected of `value`; `nis` is value' covariance^-1 value, the squared Mahalanobis
    distance (chi-square with k degrees of freedom in a consistent filter); `accepted` is False
    if the gate kept the message out.
    """

    value: np.ndarray
    covariance: np.ndarray
    nis: float
    accepted: bool


class Part(NamedTuple):
    """Where the numbers of a message are in the state, and which of them is the yaw, if any."""

    places: slice | np.ndarray
    yaw: int | None


def part_of_state(names: Sequence[str]) -> Part:
    """Return where these names are in the state: as a slice, which is fast, if possible."""
    places = [STATE.index(name) for name in names]
    neighbours = places == list(range(places[0], places[-1] + 1))
    return Part(
        slice(places[0], places[-1] + 1) if neighbours else np.array(places),
        places.index(_YAW) if _YAW in places else None,
    )


def motion(state: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the state (8) `dt` seconds later, and its derivative (8, 8) with respect to `state`.

    The robot keeps its acceleration and its turning rate, and does not turn during the step.
    """
    cos, sin = dt * math.cos(state[_YAW]), dt * math.sin(state[_YAW])
    half = dt / 2
    transfer = _IDENTITY.copy()
    transfer[0, 3:5], transfer[0, 6:] = (cos, -sin), (half * cos, half * -sin)
    transfer[1, 3:5], transfer[1, 6:] = (sin, cos), (half * sin, half * cos)
    transfer[2, 5] = transfer[3, 6] = transfer[4, 7] = dt
    moved = transfer.dot(state)
    # Turning the robot turns the step that it makes.
    transfer[0, _YAW], transfer[1, _YAW] = state[1] - moved[1], moved[0] - state[0]
    moved[_YAW] = math.remainder(moved[_YAW], math.tau)
    return moved, transfer


class ExtendedKalmanFilter:
    """The filter.

    `process_noise` replaces some of PROCESS_NOISE: {'x': 0.002, 'y': 0.002}. The first message sets
    the part of the state that it measures; the rest is zero, with a variance of 1e-9, or with those
    of `initial_covariance`: {'x': 1.0, 'y': 1.0}.

    `state` (8) in the order of STATE and `covariance` (8, 8) are the estimate at the time `t` in
    seconds (None before the first message).
    """

    def __init__(
        self,
        process_noise: Mapping[str, float] | None = None,
        initial_covariance: Mapping[str, float] | None = None,
    ) -> None:
        noise = settings.variances('process_noise', process_noise, PROCESS_NOISE, or_zero=True)
        sure = dict.fromkeys(STATE, INITIAL_VARIANCE)
        initial = settings.variances('initial_covariance', initial_covariance, sure)
        self.process_noise = np.diag([noise[name] for name in STATE])
        self.state = np.zeros(len(STATE))
        self.covariance = np.diag([initial[name] for name in STATE])
        self.t: float | None = None

    def process(
        self,
        t: float,
        measured: Sequence[str],
        values: Sequence[float],
        covariance: Sequence | np.ndarray,
        gate: float | None = None,
    ) -> Innovation | None:
        """Take a message of the time `t` (seconds): predict the state of `t`, and update it.

        `measured` names k parts of the state, `values` (k) are in the same order. `covariance` is
        (k, k), or k variances. With a `gate` this message is kept out if its Mahalanobis distance
        is `gate` or more. A message that is older than the estimate updates it as if it were of
        now, as robot_localization does without its history (`smooth_lagged_data`).

        Returns the innovation, or None for the first message: it sets what it measures.

        Raises ValueError for what is not a measurement.
        """
        settings.some_of('measured', measured, STATE)
        values = np.array(values, float)
        if values.shape != (len(measured),) or not np.isfinite(values).all():
            raise ValueError(
                f'values must be {len(measured)} finite numbers, not {shown(values.tolist())}: '
                'leave out what was not measured.'
            )
        covariance = _covariance(covariance, len(measured))
        return self.process_unchecked(t, part_of_state(measured), values, covariance, gate)

    def process_unchecked(
        self, t: float, part: Part, values: np.ndarray, covariance: np.ndarray, gate: float | None
    ) -> Innovation | None:
        """Do what `process` does, without its checks: a caller can make them once for many."""
        if self.t is None:
            self.t = t
            self.state[part.places] = values
            self.state[_YAW] = math.remainder(self.state[_YAW], math.tau)
            block = np.arange(len(STATE))[part.places]
            self.covariance[np.ix_(block, block)] = covariance
            return None
        self.predict(t)
        return self._update(part, values, covariance, gate)

    def predict(self, t: float) -> None:
        """Move the estimate on to `t` (s), after a message. An earlier time changes nothing."""
        if t > self.t:
            self.state, jacobian = motion(self.state, t - self.t)
            self.covariance = jacobian.dot(self.covariance).dot(jacobian.T)
            self.covariance += (t - self.t) * self.process_noise
            self.t = t

    def _update(self, part, values, covariance, gate) -> Innovation:
        # `dot` takes half the time of `@` for arrays as small as these.
        shared = self.covariance[:, part.places]
        expected = shared[part.places] + covariance
        inverse = 1 / expected if len(expected) == 1 else np.linalg.inv(expected)
        innovation = values - self.state[part.places]
        if part.yaw is not None:
            innovation[part.yaw] = math.remainder(innovation[part.yaw], math.tau)
        nis = float(innovation.dot(inverse).dot(innovation))
        accepted = gate is None or nis < gate * gate
        if accepted:
            gain = shared.dot(inverse)
            self.state = self.state + gain.dot(innovation)
            self.state[_YAW] = math.remainder(self.state[_YAW], math.tau)
            # Joseph's form: a sum of squares, which rounding cannot make negative.
            kept = _IDENTITY.copy()
            kept[:, part.places] -= gain
            self.covariance = kept.dot(self.covariance).dot(kept.T)
            self.covariance += gain.dot(covariance).dot(gain.T)
        return Innovation(innovation, expected, nis, accepted)


def _covariance(given, size: int) -> np.ndarray:
    matrix = np.array(given, float)
    if matrix.shape == (size,):
        matrix = np.diag(matrix)
    if matrix.shape != (size, size):
        raise ValueError(
            f'covariance must be {size} by {size}, or {size} variances, not {shown(given)}.'
        )
    # A NaN compares as False.
    symmetric = np.abs(matrix - matrix.T).max() <= 1e-9 * np.abs(matrix).max()
    if not (symmetric and np.linalg.eigvalsh(matrix)[0] > 0):
        raise ValueError(
            f'covariance must be symmetric, and its variances more than zero, not {shown(given)}: '
            'where a message has only zeros, its covariance is not known, and you must choose one.'
        )
    return matrix
