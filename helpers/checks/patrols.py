"""What judges of the robot program look at, in the lesson that builds it and in the next one."""

import math

DRIVES = 'drives on the floor '
NOT_BUILT = 'not judged: it does not build'


def commands_of(robot):
    """Return what a robot was told: the speed (m/s) and turning rate (rad/s) of each command."""
    return [(command.v, command.w) for command in robot.record.commands]


def is_driven_at_most(robot, limit_mps, why):
    """Return whether no command was faster, or else how fast it was told to drive."""
    fastest = max((v for v, _ in commands_of(robot)), default=0.0)
    return fastest < limit_mps + 1e-4 or f'it is told to drive {fastest:.2g} m/s, and {why}'


def one_command_a_scan(robot):
    """Return whether as many commands came as scans, or else their numbers."""
    scans, commands = len(robot.record.scans), len(robot.record.commands)
    return scans - 2 <= commands <= scans or f'{commands} commands for {scans} scans'


def has_a_timer(periods_s, period_s):
    """Return whether one of the timers has this period (s), or else which they have."""
    return period_s in periods_s or (
        f'the periods of its timers are {periods_s} s, and none is {period_s}'
    )


def comes_to_each_place(robot):
    """Return whether a robot has come to each place of its floor, or else which ones it missed."""
    x0, y0, _ = robot.floor.start
    missed = [
        f'{name} ({place[0] - x0:g}, {place[1] - y0:g} from the start)'
        for name, place in sorted(robot.floor.places.items())
        if min(math.dist((pose.x, pose.y), place) for pose in robot.record.poses) > 0.5
    ]
    return not missed or f'it does not come to {", ".join(missed)}'
