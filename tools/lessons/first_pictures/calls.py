"""Calls: a brake that drives to a wall, and asks a camera whether it is one."""

from helpers.lesson import Lesson
from tools.lessons.first_pictures import lanes
from tools.lessons.first_pictures.lanes import Lane, way_of, x_at
from tools.lessons.first_pictures.look import LATER, PLAYS_S, WIDTH, output_of, runs_of, svg

LIMIT_M = 1.0  # where the brake asks
LOOK_S = 0.1  # so long a camera looks: no answer can come before
ASKS_S = 2.8  # when the brake asks, in the picture: what follows is seen slowly
LANE = Lane(from_m=2.2, height=84, middle=42)
BOX_W, BRAKE_X, CAMERA_X = 130, 16, 574  # pixels
INSIDE = 10  # pixels: so far into the box of the camera the request goes
FAR = CAMERA_X + INSIDE - BRAKE_X - BOX_W
STYLE = f"""
.box{{fill:COLOUR(way);stroke:COLOUR(wall)}}
.name{{text-anchor:middle}}
.arrow,.back{{fill:none;stroke:COLOUR(heard);stroke-width:2.5}}
.back{{stroke:COLOUR(wall);stroke-dasharray:5 5}}
.head{{stroke-dasharray:none}}
.far{{stroke:COLOUR(ink)}}
.request{{animation:sent {PLAYS_S - ASKS_S - 0.4:.2g}s {ASKS_S}s linear both}}
@keyframes sent{{from{{transform:translateX({-FAR}px);opacity:0}}1%{{opacity:1}}}}
"""


def call_picture(lesson: Lesson, cell_id: str) -> str:
    """Return a drive until a moment after the brake has asked: whether it stops is a guess."""
    run, *_ = runs_of(output_of(lesson, cell_id))
    asks_s = next(t_s for t_s, x in way_of(run) if x >= lanes.WALL_M - LIMIT_M)
    way = [(t_s * ASKS_S / asks_s, x) for t_s, x in way_of(run, asks_s)]
    robot, css = LANE.robot('r', [*way, (PLAYS_S, x_at(run, asks_s + LOOK_S))])
    boxes = ''.join(
        f'<rect class="box" x="{x}" y="14" width="{BOX_W}" height="70" rx="8"/>'
        f'<text class="ink name" x="{x + BOX_W / 2:g}" y="56">{name}</text>'
        for x, name in ((BRAKE_X, 'brake'), (CAMERA_X, 'camera'))
    )
    left, right, middle = BRAKE_X + BOX_W + 6, CAMERA_X - 6, WIDTH / 2
    when = f'style="animation-delay:{ASKS_S}s"'
    line, wall = LANE.x(lanes.WALL_M - LIMIT_M), LANE.wall_x
    lane = (
        f'{LANE.floor(LIMIT_M)}<text class="ink name" x="{(line + wall) / 2:.0f}" y="58">'
        f'{LIMIT_M:g} m</text><path class="far" d="M{line:.0f} 67H{wall:.0f}m0-5v10"/>{robot}'
    )
    body = (
        f'{boxes}<g class="later" {when}><text class="heard name" x="{middle:g}" y="32">'
        'Is that a wall?</text>'
        f'<path class="arrow" d="M{left} 44H{right}m-9 -6l9 6l-9 6"/></g>'
        f'<circle class="heard request" cx="{CAMERA_X + INSIDE}" cy="44" r="8"/>'
        f'<path class="back" d="M{right} 70H{middle + 14:g}m-28 0H{left}"/>'
        f'<path class="back head" d="M{left + 9} 64l-9 6l9 6"/>'
        f'<text class="asks ink name" x="{middle:g}" y="77">?</text>'
        f'{LANE.at(100, lane)}'
        f'<text class="asks ink" x="{LANE.left}" y="212">Does the answer come?</text>'
    )
    about = f'A real drive of {lesson.name}, until its brake has asked'
    return svg(228, about, lanes.STYLE + LATER + STYLE + css, body)
