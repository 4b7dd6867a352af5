"""Brakes: their queues, their lanes, and what they see, from the saved drives of lesson 05.

Two of them are the first picture of README and site, and one is that of the lesson.
"""

from itertools import pairwise
from typing import NamedTuple

from helpers.lesson import Lesson
from helpers.robot import RADIUS_M
from tools.lessons.first_pictures import lanes
from tools.lessons.first_pictures.lanes import Lane, way_of, x_at
from tools.lessons.first_pictures.look import PLAYS_S, moving, output_of, percent, runs_of, svg
from tools.lessons.first_pictures.queues import (
    CALLBACK_X,
    FIRST_X,
    STYLE,
    TAKE,
    Move,
    looks,
    places,
    tape,
)

CELLS = {10: 'drive-depth-10', 1: 'drive-depth-1'}
FAST = 1.6  # times as fast as the drives were
LANE = Lane(from_m=0.95)
BRAKE_M = 0.6
LABEL_W = 330  # pixels: at most so long is what the ghost says

SEES = (
    f'.age{{opacity:0}}.age:last-of-type{{opacity:1}}'
    f'.ghost,.told,.age{{animation:{PLAYS_S}s linear both}}'
    '.ghost,.told,.age{animation-timing-function:step-end}'
    '.depth{font-weight:bold}'
    'text.age{text-anchor:middle}'
    'circle.ghost{fill:none;stroke:COLOUR(waiting);stroke-width:2.5;stroke-dasharray:5 4}'
)


class Drive(NamedTuple):
    """A drive as lesson 05 has recorded it: metres, and seconds of the picture."""

    depth: int
    way: list[tuple[float, float]]  # when, x
    acts: list[tuple[float, float, float]]  # a command: when, the age of its scan (real s), its x
    moves: list[Move]
    ends_s: float
    hit: bool


def recorded(lesson: Lesson, depth: int, until_m: float = lanes.WALL_M) -> Drive:
    """Return the drive of a brake with this depth, until its robot is at `until_m`."""
    drive, queue = runs_of(output_of(lesson, CELLS[depth]))
    way = way_of(drive)
    ends_s = drive['bumps'][0] / 1000 if drive['bumps'] else way[-1][0]
    ends_s = next((t_s for t_s, x in way if x > until_m), ends_s)
    acts = [
        (at / 1000 / FAST, age / 1000, x_at(drive, (at - age) / 1000))
        for at, _, _, _, age in drive['commands']
    ]
    moves = [Move(at / 1e6 / FAST, kind) for at, kind, *_ in queue['moves']]
    moves = [move for move in moves if move.at_s < ends_s / FAST]
    way = [(t_s / FAST, x) for t_s, x in way_of(drive, ends_s)]
    return Drive(depth, way, acts, moves, ends_s / FAST, bool(drive['bumps']))


def ghost(drive: Drive) -> tuple[str, str]:
    """Return where the robot was in the scan that the brake has acted on, and its age in words."""
    acts = [act for act in drive.acts if act[0] <= drive.ends_s]
    first, r = acts[0][0], RADIUS_M * LANE.scale
    seen = [(0.0, LANE.x(acts[0][2])), *((at, LANE.x(x)) for at, _, x in acts)]
    start = LANE.x(drive.way[0][1])
    part = LABEL_W / (LANE.wall_x - start)
    label = [(at, x - r - part * (x - start)) for at, x in seen]
    ages: list[tuple[float, str]] = []
    for at, age, _ in acts:
        text = f'{age:.1f}'
        if not ages or ages[-1][1] != text:
            ages.append((at, text))
    css = moving(f'g{drive.depth}', seen) + moving(f'l{drive.depth}', label)
    texts = ''
    for i, ((at, age), after) in enumerate(pairwise([*ages, (drive.ends_s + 9, '')])):
        name = f'a{drive.depth}-{i}'
        shown = f'0%{{opacity:0}}{percent(at)}{{opacity:1}}'
        last = after[0] > drive.ends_s
        css += f'@keyframes {name}{{{shown}' + (
            'to{opacity:1}}' if last else f'{percent(after[0])},to{{opacity:0}}}}'
        )
        texts += (
            f'<text class="age waiting" style="animation-name:{name}">'
            f'the brake sees this, {age} s ago</text>'
        )
    css += f'@keyframes s{drive.depth}{{0%{{opacity:0}}{percent(first)},to{{opacity:1}}}}'
    return (
        f'<g class="told" style="animation-name:s{drive.depth}">'
        f'<circle class="ghost" style="animation-name:g{drive.depth}" r="{r:.1f}" '
        f'cy="{LANE.middle}" transform="translate({seen[-1][1]:.1f} 0)"/>'
        f'<g class="ghost" style="animation-name:l{drive.depth}" '
        f'transform="translate({label[-1][1]:.1f} 0)">'
        f'<g transform="translate({LABEL_W / 2:.0f} 78)">{texts}</g></g></g>',
        css,
    )


def queue_of(drive: Drive) -> tuple[str, str]:
    """Return the brake and its queue, and their keyframes."""
    scans, css = tape(drive.depth, drive.moves)
    # The last scan is still looked at when a drive ends.
    last_s = max(move.at_s for move in drive.moves if move.kind == TAKE) + 0.126
    body = (
        f'<rect x="{CALLBACK_X}" class="place"/>{places(drive.depth)}{looks(drive.moves)}{scans}'
        f'<rect x="{CALLBACK_X}" class="last" style="animation-delay:{last_s:.3f}s"/>'
    )
    return body, css


def with_end(drive: Drive, y: int) -> tuple[str, str]:
    """Return a lane, its queue above it, what its brake sees, how it ends, and their keyframes."""
    parts = queue_of(drive), ghost(drive), LANE.robot(f'r{drive.depth}', drive.way)
    (queue, _), (seen, _), (robot, _) = parts
    says, colour = ('It hits the wall.', 'lost') if drive.hit else ('It stops in time.', 'good')
    body = (
        f'<g transform="translate({LANE.left} {y})">'
        f'<text class="depth ink" y="19">Depth {drive.depth}</text>{queue}'
        f'<text class="says {colour}" style="animation-delay:{drive.ends_s:.2f}s" x="688" y="19" '
        f'text-anchor="end">{says}</text></g>'
    ) + LANE.at(
        y + 34,
        LANE.floor(BRAKE_M) + seen + robot + (LANE.hit(drive.ends_s) if drive.hit else ''),
    )
    return body, ''.join(css for _, css in parts)


def _picture(about: str, height: int, parts: list[tuple[str, str]]) -> str:
    head = 'y="24" text-anchor="end" class="ink'
    body = (
        f'<text {head}" x="{LANE.left + CALLBACK_X + 24}">brake</text>'
        f'<text class="ink" x="{LANE.left + FIRST_X}" y="24">queue<tspan class="wide"> of scans'
        f'</tspan></text><text {head}" x="704">{BRAKE_M} m before the wall: brake</text>'
        '\n' + '\n'.join(body for body, _ in parts)
    )
    return svg(height, about, STYLE + lanes.STYLE + ''.join(css for _, css in parts), body)


def two_brakes_picture(lesson: Lesson) -> str:
    """Return two drives to their ends, from the saved outputs of lesson 05."""
    ends = [with_end(recorded(lesson, depth), y) for depth, y in zip(CELLS, (34, 178), strict=True)]
    about = f'Two real drives of {lesson.name}, {FAST} times as fast'
    return _picture(about, 314, [('', SEES), *ends])


def one_brake_picture(lesson: Lesson) -> str:
    """Return the first of them until its robot is at the line: whether it stops is a guess."""
    drive = recorded(lesson, 10, until_m=lanes.WALL_M - BRAKE_M - RADIUS_M)
    lane = LANE._replace(height=2 * LANE.middle)
    queue, robot = queue_of(drive), lane.robot('r', drive.way)
    body = (
        lane.at(34, queue[0])
        + lane.at(68, lane.floor(BRAKE_M) + robot[0])
        + f'<text class="asks ink" x="{lane.left}" y="162">Does it stop in time?</text>'
    )
    about = f'A real drive of {lesson.name}, {FAST} times as fast'
    return _picture(about, 178, [(body, queue[1] + robot[1])])
