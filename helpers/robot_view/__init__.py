"""The robot, seen and driven by hand: while a cell runs, afterwards step by step, and on paper.

    with ros_session() as session:
        robot = Robot(ROOMS)
        watch(robot)
        drive_by_hand(robot, seconds=60)

`picture` draws a floor and the robot on it, `scans` records which scan a callback works on,
`replay` makes a drive that one steps through, `live` shows it while a cell runs, and `by_hand` lets
a person drive. `place` is the guess of where it ends, or of a point. A robot that runs as a program
has nobody who looks, and loads none of this.
"""

from helpers.robot_view.by_hand import drive_by_hand
from helpers.robot_view.live import watch
from helpers.robot_view.picture import DRIVE_CSS, floor_in_words, floor_picture
from helpers.robot_view.place import Place, Point
from helpers.robot_view.replay import replay_drive

__all__ = [
    'DRIVE_CSS',
    'Place',
    'Point',
    'drive_by_hand',
    'floor_in_words',
    'floor_picture',
    'replay_drive',
    'watch',
]
