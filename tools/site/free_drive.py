"""Free drive, for the site's first page: the robot on its floor, and a script that moves it."""

from pathlib import Path

from helpers.replay.script import attribute, source, style
from helpers.robot import body
from helpers.robot.floor import ROOMS
from helpers.robot.view.picture import described, picture

SCRIPT = Path(__file__).with_suffix('.js')


def record() -> dict:
    """Return the floor, where the robot starts, and its limits: metres, radians, seconds."""
    limits = body.RADIUS_M, body.MAX_ACCELERATION, body.MAX_TURN_ACCELERATION, 1 / body.RATE_HZ
    walls = [wall[:4] for wall in ROOMS.walls]
    return {'walls': walls, 'start': list(ROOMS.start), 'limits': limits}


def html() -> str:
    svg = picture(ROOMS, [ROOMS.start[:2]], ROOMS.start)
    return (
        f'<div class="replay" data-drive={attribute(record())}>{style("drive.css")}'
        '<p>Click the floor, and drive with the arrow keys; or hold a button. Come to A, B and C '
        'without a bump.</p>'
        f'<div class="replay-floor" role="img" aria-label="{described(ROOMS)}">{svg}</div>'
        f'<script>(() => {{\n{source("element.js")}{SCRIPT.read_text("utf-8")}'
        "show(document.currentScript.closest('.replay'));})();</script></div>"
    )
