"""Of the project: what several of its tasks look at."""

import math

from helpers.checks.tasks import Tasks

tasks = Tasks()


def one_command_a_scan(robot):
    """Return whether as many commands came as scans, or else their numbers."""
    scans, commands = len(robot.record.scans), len(robot.record.commands)
    return scans - 2 <= commands <= scans or f'{commands} commands for {scans} scans'


def comes_to_each_place(robot):
    """Return whether a robot has come to each place of its floor, or else which ones it missed."""
    missed = [
        name
        for name, place in sorted(robot.floor.places.items())
        if min(math.dist((pose.x, pose.y), place) for pose in robot.record.poses) > 0.5
    ]
    return not missed or f'it does not come to {", ".join(missed)}'


DRIVES = 'drives on the floor '
