"""One pose from several imperfect sensors: an extended Kalman filter for a robot on a floor.

`filter` has the filter, message by message, as a node uses it. `tables` lets it run over a table
of what the sensors said. `drives` simulates such tables, together with the truth, and `recorded`
has those of a robot that drives. `evaluation` compares an estimate with the truth, and with what
the filter says of its own errors. `messages` reads the messages of a drive, and `nodes` has two
nodes of robot_localization, which packages of that name start as programs.

A name loads only what it needs: the programs make no tables, so they do without pandas.
"""

from helpers.notebook import load_on_demand

MODULES = {
    'drives': ('simulate',),
    'evaluation': ('errors', 'rmse'),
    'filter': ('STATE', 'ExtendedKalmanFilter'),
    'messages': ('from_odometry',),
    'nodes': ('EkfNode',),
    'recorded': ('SensorLog', 'localize'),
    'tables': ('SENSORS', 'VARIANCES', 'fuse', 'fuse_with_innovations'),
}

__all__ = [name for names in MODULES.values() for name in names]
__getattr__ = load_on_demand(__name__, MODULES)
