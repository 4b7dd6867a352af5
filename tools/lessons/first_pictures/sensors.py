"""What sensors say: wheels that lose their way, a lidar mounted askew, a camera that turns."""

import base64
import io
import math
import re

import numpy as np
from PIL import Image

from helpers.fusion import fuse, simulate
from helpers.lesson import Lesson
from helpers.robot import ROOMS, Robot
from helpers.robot_view import replay_drive
from helpers.ros import ros_session
from tools.lessons.first_pictures.look import (
    PLAYS_S,
    WIDTH,
    colour,
    output_of,
    percent,
    styled,
    svg,
    svg_of,
)

ASKEW = math.radians(-30)  # as MOUNTING of the lesson says
LIDAR_SAYS = 436, 270  # pixels: in a room that its points do not reach
RAYS = 45  # so many groups of points come one after the other
VIEW_W = 170  # pixels
LABEL = 34
WAY_PAD = 44  # pixels around two ways
WAYS = (
    '.length,.start{stroke:COLOUR(ink);fill:none}.start{stroke-dasharray:3 3}'
    'use{fill:none;stroke-width:3;stroke-linejoin:round;stroke:COLOUR(good)}'
    'use.believed{stroke:COLOUR(waiting)}use.all{stroke-opacity:.25}'
    f'circle,use.now{{animation:{PLAYS_S}s linear both}}use.now{{stroke-dasharray:1 1}}'
    'circle.driven{fill:COLOUR(good)}circle.believed{fill:COLOUR(waiting)}'
)


def wheels_picture(lesson: Lesson) -> str:
    """Return the way of a robot, and the way that its wheels believe: the lesson's drive."""
    measurements, truth = simulate(1, 60)
    believed = fuse(measurements, ('odom',))
    ways = [table[['x', 'y']].to_numpy()[::25] for table in (truth, believed)]
    low, high = (bound(np.concatenate(ways), axis=0) for bound in (np.min, np.max))
    scale = (WIDTH - 2 * WAY_PAD) / (high[0] - low[0])
    height = round(scale * (high[1] - low[1]) + 2 * WAY_PAD)
    pale = bright = css = ''
    for name, way in zip(('driven', 'believed'), ways, strict=True):
        xs, ys = WAY_PAD + scale * (way[:, 0] - low[0]), WAY_PAD + scale * (high[1] - way[:, 1])
        line = 'M' + 'L'.join(f'{x:.0f} {y:.0f}' for x, y in zip(xs, ys, strict=True))
        far = np.r_[0, np.cumsum(np.hypot(np.diff(xs), np.diff(ys)))]
        moves = draws = ''
        for i in range(0, len(xs), 2):
            when = percent(PLAYS_S * i / (len(xs) - 1))
            moves += f'{when}{{transform:translate({xs[i]:.0f}px,{ys[i]:.0f}px)}}'
            draws += f'{when}{{stroke-dashoffset:{1 - far[i] / far[-1]:.3f}}}'
        css += f'@keyframes {name}{{{moves}}}@keyframes {name}-way{{{draws}}}'
        pale += (
            f'<defs><path id="{name}" d="{line}" pathLength="1"/></defs>'
            f'<use href="#{name}" class="all {name}"/>'
        )
        bright += (
            f'<use href="#{name}" class="now {name}" style="animation-name:{name}-way"/>'
            f'<circle class="{name}" r="9" transform="translate({xs[-1]:.0f} {ys[-1]:.0f})" '
            f'style="animation-name:{name}"/>'
        )
    off_m = math.dist(ways[0][-1], ways[1][-1])
    right = WIDTH - WAY_PAD
    start = f'M{xs[0] - 13:.0f} {ys[0]:.0f}a13 13 0 1 0 26 0a13 13 0 1 0-26 0'
    body = (
        f'{pale}<path class="start" d="{start}"/>{bright}'
        f'<text class="good" x="{WAY_PAD}" y="24">where the robot is</text>'
        f'<text class="waiting" x="{right}" y="24" text-anchor="end">'
        'where its wheels say that it is</text>'
        f'<path class="length" d="M{right - scale:.0f} {height - 10}v-6m0 3H{right}m0-3v6"/>'
        f'<text class="ink" x="{right - scale / 2:.0f}" y="{height - 20}" text-anchor="middle">1 m'
        f'</text><text class="says ink" x="{WAY_PAD}" y="{height - 10}" '
        f'style="animation-delay:{PLAYS_S}s">After 60 s the two are {off_m:.1f} m apart.</text>'
    )
    return svg(height, f'The drive of {lesson.name}, as its wheels report it', WAYS + css, body)


def lidar_picture(_lesson: Lesson) -> str:
    """Return a floor, and the points of a lidar as if it looked ahead, as the robot believes.

    The scan is that of the course's robot, whose lidar is mounted as in the lesson.
    """
    with ros_session():
        robot = Robot(ROOMS, noise=False, sim_time=True, mounting={'base_scan': ASKEW})
        robot.run(1.0)
    scan, pose = robot.record.scans[-1], robot.pose
    angles = pose.yaw + scan.first + scan.step * np.arange(len(scan.ranges))
    known = np.isfinite(scan.ranges)
    xs = pose.x + scan.ranges[known] * np.cos(angles[known])
    ys = pose.y + scan.ranges[known] * np.sin(angles[known])
    points = ''
    for i, part in enumerate(np.array_split(np.arange(len(xs)), RAYS)):
        dots = ''.join(f'M{xs[k]:.2f} {ys[k]:.2f}h0' for k in part)
        points += (
            f"<path class='seen' vector-effect='non-scaling-stroke' d='{dots}' "
            f"style='animation-delay:{i * PLAYS_S / RAYS:.1f}s'/>"
        )
    picture = svg_of(html_of(replay_drive(robot.record)))
    picture = picture.replace("<g class='robot'", f"{points}<g class='robot'")
    x, y = LIDAR_SAYS
    says = f"<text class='says' x='{x}' y='{y}' text-anchor='middle'>points of its lidar</text>"
    picture = picture.replace('</svg>', f'{says}</svg>')
    style = (
        f'svg{{color-scheme:light dark;color:{colour("ink")}}}.fan,.start{{display:none}}'
        f'.seen{{stroke:{colour("lost")};stroke-width:5;stroke-linecap:round;'
        'animation:in .3s both}@keyframes in{from{stroke-opacity:.3}}'
        f'.says{{fill:{colour("lost")}}}@media(max-width:560px){{text{{font-size:24px}}}}'
        '@media(prefers-reduced-motion:reduce){.seen{animation:none}}'
    )
    return styled(picture, style)


def html_of(shown) -> str:
    """Return the page that a cell shows."""
    return shown._repr_mimebundle_()['text/html']


def camera_picture(lesson: Lesson, cell_id: str, degrees: list[int]) -> str:
    """Return the views of a camera that turns, from the figure that a cell has shown."""
    page = output_of(lesson, cell_id)
    data = re.search(r'src="data:image/png;base64,([^"]*)"', page)[1]
    figure = Image.open(io.BytesIO(base64.b64decode(data))).convert('RGB')
    views = ''
    gap = (WIDTH - len(degrees) * VIEW_W) / (len(degrees) + 1)
    for i, (view, turned) in enumerate(zip(_views(figure), degrees, strict=True)):
        height = VIEW_W * view.height / view.width
        png = io.BytesIO()
        view.quantize(32).save(png, 'PNG', optimize=True)
        x = gap + i * (VIEW_W + gap)
        views += (
            f'<g class="comes" style="animation-delay:{i * PLAYS_S / len(degrees):.1f}s">'
            f'<text class="ink" x="{x + VIEW_W / 2:.0f}" y="24" text-anchor="middle">{turned}°'
            f'</text><image x="{x:.0f}" y="{LABEL}" width="{VIEW_W}" height="{height:.0f}" '
            f'href="data:image/png;base64,{base64.b64encode(png.getvalue()).decode()}"/></g>'
        )
    about = f'What the camera of {lesson.name} sees'
    return svg(LABEL + height + 16, about, '', views)


def _views(figure: Image.Image) -> list[Image.Image]:
    """Return the views of a figure: what is not white, without the titles above."""
    ink = (np.asarray(figure) < 250).any(axis=2)
    rows = np.flatnonzero(ink.mean(axis=1) > 0.5)
    columns = ink[rows].mean(axis=0) > 0.9
    edges = np.flatnonzero(np.diff(np.r_[False, columns, False].astype(int)))
    return [
        figure.crop((left, rows[0], right, rows[-1] + 1))
        for left, right in edges.reshape(-1, 2).tolist()
    ]
