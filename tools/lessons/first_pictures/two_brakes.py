"""The first picture of README and site: two brakes, their queues, and what they see.

Poses, queues and ages are those of the saved drives of lesson 05. Without motion it is its own end.
"""

from itertools import pairwise
from typing import NamedTuple

from helpers.lesson import Lesson
from helpers.robot import CORRIDOR, RADIUS_M
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
SCALE, START_X = 190, 57  # pixels a metre, and of the robot's start
WALL_X = START_X + SCALE * (4.5 - CORRIDOR.start.x)
BRAKE_M = 0.6
LABEL_W = 330  # pixels: at most so long is what the ghost says

LANES = (
    f'.age{{opacity:0}}.age:last-of-type{{opacity:1}}'
    f'.robot,.behind,.ghost,.told,.age{{animation:{PLAYS_S}s linear both}}'
    '.ghost,.told,.age{animation-timing-function:step-end}'
    '.depth{font-weight:bold}'
    '.line{stroke:COLOUR(ink);stroke-dasharray:3 5}'
    '.behind{stroke:COLOUR(good);stroke-width:3;stroke-opacity:.4}'
    'text.age{text-anchor:middle}'
    'circle.ghost{fill:none;stroke:COLOUR(waiting);stroke-width:2.5;stroke-dasharray:5 4}'
    '.robot path{fill:COLOUR(ground)}'
)


class Drive(NamedTuple):
    """A drive as lesson 05 has recorded it: metres, and seconds of the picture."""

    depth: int
    poses: list[tuple[float, float]]  # when, x
    acts: list[tuple[float, float, float]]  # a command: when, the age of its scan (real s), its x
    moves: list[Move]
    ends_s: float
    hit: bool


def recorded(lesson: Lesson, depth: int) -> Drive:
    """Return the drive of a brake with this depth, from the saved replay of lesson 05."""
    drive, queue = runs_of(output_of(lesson, CELLS[depth]))
    step_s = drive['step']
    xs = [pose[0] for pose in drive['poses']]

    def place(t_s: float) -> float:
        before = min(int(t_s / step_s), len(xs) - 2)
        return xs[before] + (xs[before + 1] - xs[before]) * (t_s / step_s - before)

    acts = [
        (at / 1000 / FAST, age / 1000, place((at - age) / 1000))
        for at, _, _, _, age in drive['commands']
    ]
    ended_s = drive['bumps'][0] / 1000 if drive['bumps'] else step_s * (len(xs) - 1)
    moves = [Move(at / 1e6 / FAST, kind) for at, kind, *_ in queue['moves']]
    moves = [move for move in moves if move.at_s < ended_s / FAST]
    poses = [(i * step_s / FAST, x) for i, x in enumerate(xs)]
    return Drive(depth, poses, acts, moves, ended_s / FAST, bool(drive['bumps']))


def x_of(metres: float) -> float:
    return START_X + SCALE * (metres - CORRIDOR.start.x)


def ghost(drive: Drive) -> tuple[str, str]:
    """Return where the robot was in the scan that the brake has acted on, and its age in words."""
    acts = [act for act in drive.acts if act[0] <= drive.ends_s]
    first = acts[0][0]
    seen = [(0.0, x_of(acts[0][2])), *((at, x_of(x)) for at, _, x in acts)]
    part = LABEL_W / (WALL_X - START_X)
    label = [(at, x - RADIUS_M * SCALE - part * (x - START_X)) for at, x in seen]
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
        f'<circle class="ghost" style="animation-name:g{drive.depth}" r="{RADIUS_M * SCALE:.1f}" '
        f'cy="33" transform="translate({seen[-1][1]:.1f} 0)"/>'
        f'<g class="ghost" style="animation-name:l{drive.depth}" '
        f'transform="translate({label[-1][1]:.1f} 0)">'
        f'<g transform="translate({LABEL_W / 2:.0f} 78)">{texts}</g></g></g>',
        css,
    )


def lane(drive: Drive, y: int) -> tuple[str, str]:
    """Return a lane, its queue above it, and their keyframes."""
    scans, css = tape(drive.depth, drive.moves)
    # The last scan is still looked at when a drive ends.
    last_s = max(move.at_s for move in drive.moves if move.kind == TAKE) + 0.126
    seen, seen_css = ghost(drive)
    poses = [(t_s, x_of(x)) for t_s, x in drive.poses if t_s <= drive.ends_s]
    poses.append((drive.ends_s, x_of(drive.poses[-1][1])))
    end_x, r = poses[-1][1], RADIUS_M * SCALE
    says, colour = ('It hits the wall.', 'lost') if drive.hit else ('It stops in time.', 'good')
    delay = f'style="animation-delay:{drive.ends_s:.2f}s"'
    cross = (
        f'<path class="says" {delay} d="M{WALL_X - 10:.1f} 24l18 18m0-18l-18 18" '
        'stroke="COLOUR(lost)" stroke-width="5" fill="none"/>'
        if drive.hit
        else ''
    )
    body = (
        f'<g transform="translate(16 {y})">'
        f'<text class="depth ink" y="19">Depth {drive.depth}</text>'
        f'<rect x="{CALLBACK_X}" class="place"/>{places(drive.depth)}{looks(drive.moves)}'
        f'{scans}'
        f'<rect x="{CALLBACK_X}" class="last" style="animation-delay:{last_s:.3f}s"/>'
        f'<text class="says {colour}" {delay} x="688" y="19" text-anchor="end">{says}</text>'
        '<g transform="translate(0 34)">'
        f'<path class="way" d="M0 0H{WALL_X:.1f}V90H0z"/>'
        f'<path class="line" d="M{x_of(4.5 - BRAKE_M):.1f} 0V90"/>'
        f'<path class="wall" d="M{WALL_X:.1f} -2h14v94h-14z"/>'
        f'<g clip-path="url(#driven)"><path class="behind" style="animation-name:r{drive.depth}" '
        f'transform="translate({end_x:.1f} 0)" d="M-640 33H0"/></g>{seen}'
        f'<g class="robot good" style="animation-name:r{drive.depth}" '
        f'transform="translate({end_x:.1f} 0)"><circle cy="33" r="{r:.1f}"/>'
        f'<path d="M14 33L-9 44L-4 33L-9 22z"/></g>{cross}</g></g>'
    )
    return body, css + seen_css + moving(f'r{drive.depth}', poses)


def two_brakes_picture(lesson: Lesson) -> str:
    """Return the picture, from the saved outputs of lesson 05."""
    lanes = [lane(recorded(lesson, depth), y) for depth, y in zip(CELLS, (34, 178), strict=True)]
    head = 'y="24" text-anchor="end" class="ink'
    body = (
        f'<clipPath id="driven"><path d="M{START_X} 0H720V90H{START_X}z"/></clipPath>'
        f'<text {head}" x="{16 + CALLBACK_X + 24}">brake</text>'
        f'<text class="ink" x="{16 + FIRST_X}" y="24">queue<tspan class="wide"> of scans</tspan>'
        f'</text><text {head} wide" x="704">0.6 m before the wall: brake</text>'
        '\n' + '\n'.join(body for body, _ in lanes)
    )
    about = f'Two real drives of {lesson.name}, {FAST} times as fast'
    return svg(314, about, STYLE + LANES + ''.join(css for _, css in lanes), body)
