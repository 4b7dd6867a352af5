"""How good is an estimate, and does the filter know it?"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from helpers.fusion.tables import POSE, columns_of


def errors(estimate: pd.DataFrame, truth: pd.DataFrame) -> pd.DataFrame:
    """Return how far off the estimate is: `t`, `x`, `y`, `distance` (m), `yaw` (rad, -pi to pi).

    `truth` has the columns `t`, `x`, `y`, `yaw`. Between its rows it is interpolated; it must
    cover the times of the estimate.
    """
    estimate, truth = (columns_of(table, ('t', *POSE)) for table in (estimate, truth))
    t, known = estimate['t'], truth['t']
    if not np.all((known[0] <= t) & (t <= known[-1])):
        raise ValueError('The truth must cover all times of the estimate.')
    x, y = (estimate[name] - np.interp(t, known, truth[name]) for name in ('x', 'y'))
    yaw = estimate['yaw'] - np.interp(t, known, np.unwrap(truth['yaw']))
    yaw -= math.tau * np.round(yaw / math.tau)
    return pd.DataFrame({'t': t, 'x': x, 'y': y, 'yaw': yaw, 'distance': np.hypot(x, y)})


def rmse(estimate: pd.DataFrame, truth: pd.DataFrame) -> float:
    """Return the root mean square of the distances (m) that `errors` finds.

    It is the error in the plane: noise with sigma along each of two axes has sigma times root 2.
    Rows of the estimate that are NaN do not count.
    """
    return float(np.sqrt((errors(estimate, truth)['distance'] ** 2).mean()))
