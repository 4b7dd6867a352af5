"""Faults: robots that have one task, how each of them drives, and how it ends."""

import re

from helpers.lesson import Lesson
from tools.lessons.first_pictures import lanes
from tools.lessons.first_pictures.lanes import Lane, way_of
from tools.lessons.first_pictures.look import PLAYS_S, output_of, runs_of, svg

STOPS_M = 0.5  # where each robot should stop
LANE = Lane(from_m=2.0, left=320, height=50, middle=25)
TOP, ROW = 34, 62  # pixels
# The opacity of a part of a text is not everywhere animated: that of its fill is.
STYLE = '.ends{animation:ends .3s both}@keyframes ends{from{fill-opacity:0}}'


def faults_picture(lesson: Lesson, cells: dict[str, str]) -> str:
    """Return the drives of robots, by name, on one clock, and what their replays say of them."""
    runs = {name: runs_of(output_of(lesson, cell_id))[0] for name, cell_id in cells.items()}
    ways = {name: way_of(run) for name, run in runs.items()}
    slower = PLAYS_S / max(way[-1][0] for way in ways.values())
    body = css = ''
    for i, (name, run) in enumerate(runs.items()):
        way = [(t_s * slower, metres) for t_s, metres in ways[name]]
        # Its end is known when it stands. One that never drives may still begin to.
        ends_s = next((t_s for t_s, x in way if x == way[-1][1] != way[0][1]), PLAYS_S)
        robot, moves = LANE.robot(name, way)
        hit = LANE.hit(ends_s) if run['bumps'] else ''
        css += moves
        body += LANE.at(TOP + i * ROW, LANE.floor(STOPS_M) + robot + hit)
        says = re.split(', | (?=after)', run['outcome'].removeprefix('The robot'))
        lines = ''.join(
            f'<tspan x="{lanes.PAD}" dy="26">{line}</tspan>' if n else line
            for n, line in enumerate(says)
        )
        body += (
            f'<text class="ink" x="{lanes.PAD}" y="{TOP + i * ROW + 18}">'
            f'<tspan class="asks">{name}</tspan><tspan class="ends {"lost" if hit else "ink"}" '
            f'style="animation-delay:{ends_s:.2f}s">{lines}</tspan></text>'
        )
    below = TOP + len(runs) * ROW
    body += (
        f'<text class="ink" x="704" y="24" text-anchor="end">{STOPS_M} m before the wall: stop'
        f'</text><text class="asks ink" x="{lanes.PAD}" y="{below + 18}">'
        'Each should stop at the line. Why do they not?</text>'
    )
    about = f'Real drives of {lesson.name}'
    return svg(below + 34, about, lanes.STYLE + STYLE + css, body)
