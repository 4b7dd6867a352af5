"""The first pictures: of README and site, and of lessons whose own picture comes late on the page.

    python -m tools.site.first_pictures

It reads the saved replays and writes `notebooks/images/`: poses, queues and ages are those of the
records. A picture plays once, in 4.5 s. Without motion it is its own end.
"""

import json
import math
import re
from html import unescape
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

from helpers.notebook import LOOK
from helpers.robot import CORRIDOR, RADIUS_M
from tools.lessons.lesson import FOLDER, PICTURES, Lesson, lessons

IMAGES = FOLDER / PICTURES
FILE = IMAGES / 'depth_10_hits_depth_1_stops.svg'
# The cell whose drive a lesson shows first, and how much of it: a guess is not told.
DRIVES = {
    '01': ('drive-the-square', 1),
    '05': ('drive-depth-10', 0.55),
    '06': ('drive-deadlock', 0.4),
    '07': ('lesson-07-19', 0.5),
    '08': ('run-15-obey', 1),
    '10': ('l09-careful', 1),
    '14': ('l11-replay', 1),
    '15': ('cpp-12-drive', 1),
    '18': ('bag0716d970', 1),
    '19': ('take-dan', 1),
    '20': ('project-082', 1),
}
# The cell whose queue a lesson shows, until it is full: which message is lost is a guess.
QUEUE = 'lose_messages', 'step-through-run'
CELLS = {10: 'drive-depth-10', 1: 'drive-depth-1'}
ARRIVE, TAKE, END = range(3)  # moves of a replay

FAST, PLAYS_S = 1.6, 4.5  # times as fast as the drive was, and how long it takes
SCALE, START_X = 190, 57  # pixels a metre, and of the robot's start
WALL_X = START_X + SCALE * (4.5 - CORRIDOR.start.x)
BRAKE_M = 0.6
PLACE, FIRST_X, BRAKE_X = 26, 186, 132  # of the queue: the width of a place, the first one
LABEL_W = 330  # pixels: at most so long is what the ghost says

# Letters have a contrast of 4.5 and more on their ground, marks of 3, in light and in dark.
PAIRS = {
    'ground': ('#ffffff', '#15191e'),
    'ink': ('#4a5460', '#b4bec9'),
    'way': ('#eff1f3', '#242a31'),
    'wall': ('#6b7681', '#7f8b97'),
    'heard': (LOOK['heard'], '#3ea0df'),
    'lost': ('#b34a00', '#ff9350'),
    'waiting': ('#855d00', '#e3b040'),
    'good': ('#00734f', '#2fbd8d'),
}
STYLE = """
svg{color-scheme:light dark;font:16px system-ui,'Segoe UI',Roboto,'Noto Sans',sans-serif}
.scan{fill:COLOUR(waiting);animation:in .12s both,gone .16s forwards}
.out{animation-name:in,out}
.look{fill:COLOUR(heard);opacity:0;animation:look .126s linear}
.age{opacity:0}
.age:last-of-type{opacity:1}
.says{font-weight:bold;animation:in .3s both}
.depth{font-weight:bold}
.robot,.behind,.ghost,.told,.tape,.age{animation:PLAYS linear both}
.ghost,.told,.age{animation-timing-function:step-end}
@keyframes in{from{opacity:0;transform:translateY(-14px)}to{opacity:1}}
@keyframes gone{to{opacity:0}}
@keyframes out{from{fill:COLOUR(lost)}to{fill:COLOUR(lost);opacity:0;transform:translateY(24px)}}
@keyframes look{from{opacity:1;transform:translateX(26px)}40%,to{opacity:1;transform:none}}
@media(max-width:560px){svg{font-size:24px}.wide{display:none}}
@media(prefers-reduced-motion:reduce){svg *{animation:none!important}}
"""


class Drive(NamedTuple):
    """A drive as lesson 05 has recorded it: seconds and metres."""

    depth: int
    poses: list[tuple[float, float]]  # when, x
    acts: list[tuple[float, float, float]]  # a command: when, the age of its scan, where that was
    moves: list[tuple[float, int, int]]  # when, ARRIVE or TAKE or END, the scan
    ends_s: float
    hit: bool


def output_of(lesson: Lesson, cell_id: str) -> str:
    """Return the saved replay of a cell, as HTML."""
    cell = next(cell for cell in lesson.notebook.cells if cell.id == cell_id)
    pages = (output.get('data', {}).get('text/html', '') for output in cell.outputs)
    return next(page for page in pages if 'data-record=' in page)


def runs_of(page: str) -> list[dict]:
    return json.loads(unescape(re.search(r"data-record='([^']*)'", page)[1]))['runs']


def recorded(lesson: Lesson, depth: int) -> Drive:
    """Return the drive of a brake with this depth, from the saved replay of lesson 05."""
    drive, queue = runs_of(output_of(lesson, CELLS[depth]))
    step = drive['step']
    poses = [(i * step, pose[0]) for i, pose in enumerate(drive['poses'])]

    def place(t_s: float) -> float:
        before = min(int(t_s / step), len(poses) - 2)
        (t0, x0), (t1, x1) = poses[before : before + 2]
        return x0 + (x1 - x0) * (t_s - t0) / (t1 - t0)

    acts = [
        (at / 1000, age / 1000, place((at - age) / 1000)) for at, _, _, _, age in drive['commands']
    ]
    ends_s = drive['bumps'][0] / 1000 if drive['bumps'] else poses[-1][0]
    moves = [(at / 1e6, kind, what) for at, kind, _, what in queue['moves'] if at / 1e6 < ends_s]
    return Drive(depth, poses, acts, moves, ends_s, bool(drive['bumps']))


def percent(t_s: float) -> str:
    """Return when something of the drive happens, in the 4.5 s of the picture."""
    return f'{100 * t_s / FAST / PLAYS_S:.2f}%'


def x_of(metres: float) -> float:
    return START_X + SCALE * (metres - CORRIDOR.start.x)


def moving(name: str, stops: list[tuple[float, float]]) -> str:
    """Return keyframes that move something along x, through (seconds, pixels)."""
    kept = [
        stop
        for before, stop, after in zip([None, *stops], stops, [*stops[1:], None], strict=False)
        if before is None or after is None or not before[1] == stop[1] == after[1]
    ]
    frames = ''.join(f'{percent(t_s)}{{transform:translateX({x:.4g}px)}}' for t_s, x in kept)
    return f'@keyframes {name}{{{frames}to{{transform:translateX({kept[-1][1]:.4g}px)}}}}'


def queue(drive: Drive) -> tuple[str, str]:
    """Return the scans that wait and are looked at, and the keyframes of their tape.

    Scan by scan the tape has a place for each one, and moves one place to the left when its first
    one leaves: it is taken, or a new one pushes it out.
    """
    number, parts, tape, waiting, popped = 0, [], [(0.0, 0)], [], 0
    left: dict[int, tuple[float, str]] = {}
    came = []
    for at, kind, _ in drive.moves:
        if kind == ARRIVE:
            waiting.append(number)
            came.append(at)
            number += 1
        leaves = kind == TAKE or len(waiting) > drive.depth
        if leaves:
            left[waiting.pop(0)] = at, 'scan' if kind == TAKE else 'scan out'
            tape += [(at, -popped * PLACE), (at + 0.08, -(popped + 1) * PLACE)]
            popped += 1
        if kind == TAKE:
            parts.append(f'<rect class="look" style="animation-delay:{at / FAST:.3f}s"/>')
    for scan, at in enumerate(came):
        gone, kind = left.get(scan, (None, 'scan'))
        delay = f'{at / FAST:.3f}s' + (f',{gone / FAST:.3f}s' if gone is not None else ',99s')
        opacity = ' opacity="0"' if gone is not None else ''
        x = FIRST_X + scan * PLACE
        parts.append(f'<rect x="{x}" class="{kind}"{opacity} style="animation-delay:{delay}"/>')
    looked = ''.join(part for part in parts if 'look' in part)
    waited = ''.join(part for part in parts if 'look' not in part)
    name = f't{drive.depth}'
    shift = -popped * PLACE
    svg = looked.replace('<rect', f'<rect x="{BRAKE_X}"')
    # The last scan is still looked at when a drive ends.
    last_s = max(at for at, kind, _ in drive.moves if kind == TAKE) / FAST + 0.126
    svg += f'<rect x="{BRAKE_X}" class="last" style="animation-delay:{last_s:.3f}s"/>'
    svg += f'<g class="tape" style="animation-name:{name}" transform="translate({shift} 0)">'
    return f'{svg}{waited}</g>', moving(name, _rising(tape))


def _rising(stops: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return stops whose times rise: what begins before the last has ended waits for it."""
    kept = stops[:1]
    for at, x in stops[1:]:
        kept.append((max(at, kept[-1][0] + 1e-3), x))
    return kept


def ghost(drive: Drive) -> tuple[str, str]:
    """Return where the robot was in the scan that the brake has acted on, and its age in words."""
    acts = [act for act in drive.acts if act[0] <= drive.ends_s]
    first = acts[0][0]
    places = [(0.0, x_of(acts[0][2])), *((at, x_of(x)) for at, _, x in acts)]
    part = LABEL_W / (WALL_X - START_X)
    label = [(at, x - RADIUS_M * SCALE - part * (x - START_X)) for at, x in places]
    ages: list[tuple[float, str]] = []
    for at, age, _ in acts:
        text = f'{age:.1f}'
        if not ages or ages[-1][1] != text:
            ages.append((at, text))
    css = moving(f'g{drive.depth}', places) + moving(f'l{drive.depth}', label)
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
        f'cy="33" transform="translate({places[-1][1]:.1f} 0)"/>'
        f'<g class="ghost" style="animation-name:l{drive.depth}" '
        f'transform="translate({label[-1][1]:.1f} 0)">'
        f'<g transform="translate({LABEL_W / 2:.0f} 78)">{texts}</g></g></g>',
        css,
    )


def lane(drive: Drive, y: int) -> tuple[str, str]:
    """Return a lane, its queue above it, and their keyframes."""
    scans, tape = queue(drive)
    seen, seen_css = ghost(drive)
    poses = [(t_s, x_of(x)) for t_s, x in drive.poses if t_s <= drive.ends_s]
    poses.append((drive.ends_s, x_of(drive.poses[-1][1])))
    places = ''.join(f'<rect x="{FIRST_X + i * PLACE}" class="place"/>' for i in range(drive.depth))
    end_x, r = poses[-1][1], RADIUS_M * SCALE
    says, colour = ('It hits the wall.', 'lost') if drive.hit else ('It stops in time.', 'good')
    delay = f'style="animation-delay:{drive.ends_s / FAST:.2f}s"'
    cross = (
        f'<path class="says" {delay} d="M{WALL_X - 10:.1f} 24l18 18m0-18l-18 18" '
        'stroke="COLOUR(lost)" stroke-width="5" fill="none"/>'
        if drive.hit
        else ''
    )
    body = (
        f'<g transform="translate(16 {y})">'
        f'<text class="depth ink" y="19">Depth {drive.depth}</text>'
        f'<rect x="{BRAKE_X}" class="place"/>{places}{scans}'
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
    return body, tape + seen_css + moving(f'r{drive.depth}', poses)


def filling(lesson: Lesson) -> Drive:
    """Return how the queue of a slow subscriber fills up, as slow as a picture plays."""
    (run,) = runs_of(output_of(lesson, QUEUE[1]))
    (callback,) = run['setup']['callbacks']
    waiting, moves = 0, []
    for at, kind, _, what in run['moves']:
        waiting += {ARRIVE: 1, TAKE: -1, END: 0}[kind]
        if waiting > callback['depth']:
            break
        moves.append((at, kind, what))
    slower = FAST * PLAYS_S / moves[-1][0]
    stretched = [(at * slower, kind, what) for at, kind, what in moves]
    return Drive(callback['depth'], [], [], stretched, FAST * PLAYS_S, hit=False)


def queue_picture(lesson: Lesson) -> str:
    """Return the queue of a slow subscriber, until it is full."""
    drive = filling(lesson)
    messages, tape = queue(drive)
    places = ''.join(f'<rect x="{FIRST_X + i * PLACE}" class="place"/>' for i in range(drive.depth))
    words = (
        f'<text class="ink" x="{BRAKE_X + 22}" y="20" text-anchor="end">callback</text>'
        f'<text class="ink" x="{FIRST_X}" y="20">queue of {drive.depth} messages</text>'
        f'<text class="says ink" style="animation-delay:{PLAYS_S}s" x="{FIRST_X}" y="84">'
        'It is full. What will happen to the next message?</text>'
    )
    body = (
        f'<g transform="translate(0 32)"><rect x="{BRAKE_X}" class="busy"/>{messages}{places}</g>'
    )
    return _svg('0 0 720 104', 'The real queue of lesson 02', _style([tape]), f'{words}{body}')


def _style(moves: list[str]) -> str:
    """Return the style of a picture with queues, and the keyframes that move them."""
    return (
        STYLE.replace('PLAYS', f'{PLAYS_S}s')
        + ''.join(moves)
        + ''.join(f'.{name}{{fill:COLOUR({name})}}' for name in ('ink', *PAIRS) if name != 'ground')
        + 'rect{y:1px;width:22px;height:22px;rx:4px}.place{fill:none;stroke:COLOUR(wall)}'
        '.busy{fill:COLOUR(heard)}'
        '.last{fill:COLOUR(heard);animation:gone .01s reverse both}'
        '.line{stroke:COLOUR(ink);stroke-dasharray:3 5}.behind{stroke:COLOUR(good);'
        'stroke-width:3;stroke-opacity:.4}text.age{text-anchor:middle}circle.ghost{fill:none;stroke:COLOUR(waiting);'
        'stroke-width:2.5;stroke-dasharray:5 4}.robot path{fill:COLOUR(ground)}'
        '.ground{fill:COLOUR(ground)}'
    )


def _svg(box: str, about: str, style: str, body: str) -> str:
    width, height = box.split()[2:]
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" width="{width}" '
        f'height="{height}">\n'
        f'<!-- {about}. Made by tools/site/first_pictures.py. -->\n<style>{style}</style>\n'
        f'<path class="ground" d="M0 0H{width}V{height}H0z"/>{body}\n</svg>\n'
    )
    return re.sub(r'COLOUR\((\w+)\)', lambda found: _colour(found[1]), text)


def picture() -> str:
    """Return the picture, from the saved outputs of lesson 05."""
    lesson = next(lesson for lesson in lessons() if lesson.name == 'keep_what_is_fresh')
    lanes = [lane(recorded(lesson, depth), y) for depth, y in zip(CELLS, (34, 178), strict=True)]
    head = 'y="24" text-anchor="end" class="ink'
    body = (
        f'<clipPath id="driven"><path d="M{START_X} 0H720V90H{START_X}z"/></clipPath>'
        f'<text {head}" x="{16 + BRAKE_X + 24}">brake</text>'
        f'<text class="ink" x="{16 + FIRST_X}" y="24">queue<tspan class="wide"> of scans</tspan>'
        f'</text><text {head} wide" x="704">0.6 m before the wall: brake</text>'
        '\n' + '\n'.join(body for body, _ in lanes)
    )
    about = f'Two real drives of lesson 05, {FAST} times as fast'
    return _svg('0 0 720 314', about, _style([css for _, css in lanes]), body)


def _colour(name: str) -> str:
    return 'light-dark({},{})'.format(*PAIRS[name])


def drive_picture(page: str, share: float) -> str:
    """Return the floor of a saved drive, on which its robot drives once, a share of its way."""
    svg = unquote(re.search(r'src="data:image/svg\+xml,([^"]*)"', page)[1])
    poses = runs_of(page)[0]['poses']
    last = int(share * (len(poses) - 1))
    poses = poses[: last + 1]
    if share < 1:
        svg = re.sub(r"<path[^>]* class='(all|driven|seconds|bumps)'[^>]*/>", '', svg)
        x, y, *_ = poses[-1]
        at = f"class='robot' transform='translate({x:.3f} {y:.3f})'"
        svg = re.sub(r"class='robot' transform='[^']*'", at, svg)
    every = max(1, last // 60)
    moves = turns = ''
    for i, (x, y, yaw, *_) in enumerate(poses):
        if i % every == 0 or i == last:
            when = f'{100 * i / last:.1f}%'
            moves += f'{when}{{transform:translate({x:.3g}px,{y:.3g}px)}}'
            turns += f'{when}{{transform:rotate({math.degrees(yaw):.0f}deg)}}'
    style = (
        f'<style>svg{{color-scheme:light dark;color:{_colour("ink")}}}.fan,.old{{display:none}}'
        f'.robot,.robot>g{{animation:move {PLAYS_S}s linear both}}.robot>g{{animation-name:turn}}'
        f'@keyframes move{{{moves}}}@keyframes turn{{{turns}}}'
        '@media(prefers-reduced-motion:reduce){.robot,.robot>g{animation:none}}</style>'
    )
    return re.sub(r'(<svg[^>]*>)', rf'\1{style}', svg, count=1) + '\n'


def write(file: Path, text: str) -> None:
    file.write_text(text, encoding='utf-8')
    print(f'{file.relative_to(FOLDER.parent)} is written.')


if __name__ == '__main__':
    write(FILE, picture())
    for known in lessons():
        if known.name == QUEUE[0]:
            write(IMAGES / f'queue_of_{known.name}.svg', queue_picture(known))
        if known.number in DRIVES:
            cell, share = DRIVES[known.number]
            shown = drive_picture(output_of(known, cell), share)
            write(IMAGES / f'drive_of_{known.name}.svg', shown)
