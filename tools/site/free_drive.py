"""Free drive, for the site's first page: the robot on its floor, and a script that moves it."""

from pathlib import Path

from helpers import robot
from helpers.replay import attribute, script, style
from helpers.robot import ROOMS
from helpers.robot_view import DRIVE_CSS, floor_in_words, floor_picture

SCRIPT = Path(__file__).with_suffix('.js')


def record() -> dict:
    """Return walls, places, where the robot starts, and its limits: metres, radians, seconds."""
    limits = (
        robot.RADIUS_M,
        robot.MAX_ACCELERATION,
        robot.MAX_TURN_ACCELERATION,
        1 / robot.RATE_HZ,
    )
    walls = [wall[:4] for wall in ROOMS.walls]
    start, places = list(ROOMS.start), dict(ROOMS.places)
    return {'walls': walls, 'start': start, 'limits': limits, 'places': places}


def html() -> str:
    words = floor_in_words(ROOMS)
    svg = floor_picture(ROOMS, [ROOMS.start[:2]], ROOMS.start)
    return (
        f'<div class="replay free-drive" data-drive={attribute(record())}>{style(DRIVE_CSS)}'
        '<p class="drive-hello">Come to A, B and C without a bump.</p>'
        f'<div class="replay-floor" role="img" aria-label="{words}">{svg}</div>'
        f'<script>{script(SCRIPT)}</script></div>'
    )
