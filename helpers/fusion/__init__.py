"""One pose from several imperfect sensors: an extended Kalman filter for a robot on a floor.

`filter` has the filter, message by message, as a node uses it. `tables` lets it run over a table
of what the sensors said. `drives` simulates such tables, together with the truth. `evaluation`
compares an estimate with the truth, and with what the filter says of its own errors. `messages`
reads the messages of a drive, and `nodes` has two nodes of robot_localization,
which packages of that name start as programs.
"""

from helpers.fusion.drives import simulate
from helpers.fusion.evaluation import errors, rmse
from helpers.fusion.filter import STATE, ExtendedKalmanFilter
from helpers.fusion.messages import from_odometry
from helpers.fusion.nodes import EkfNode, SensorLog, localize
from helpers.fusion.tables import SENSORS, VARIANCES, fuse, fuse_with_innovations

__all__ = [
    'SENSORS',
    'STATE',
    'VARIANCES',
    'EkfNode',
    'ExtendedKalmanFilter',
    'SensorLog',
    'errors',
    'from_odometry',
    'fuse',
    'fuse_with_innovations',
    'localize',
    'rmse',
    'simulate',
]
