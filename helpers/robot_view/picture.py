"""A floor from above, with the robot on it: one SVG for the live picture, the replay and paper.

All is drawn in metres, x to the right and y up, inside one group: a script that moves a part of the
picture, as drive.js does, computes no pixels. Ink is `currentColor`, right in light and in dark.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

import numpy as np

from helpers.notebook import LOOK
from helpers.robot import RADIUS_M, RANGE_MAX, Floor, Pose, Scan

WIDTH, HEIGHT, MARGIN = 720, 400, 2  # pixels, at most
SMALLEST = 9  # pixels: the robot's radius on a large floor
BEAMS = 40  # of a scan, in a picture
WALL_M = 0.15  # of an outer wall
PLACE_M = 0.45  # so near, the robot is at a place
LANE_M, WORDS_M = 0.5, 0.26  # of a lane: to each side of the robot, and beyond for words
DRIVE_CSS = Path(__file__).with_name('drive.css')
ROBOT, WAITING, LOST = LOOK['robot'], LOOK['waiting'], LOOK['lost']


def floor_picture(
    floor: Floor,
    points: Iterable[tuple[float, float]],
    pose: Pose,
    scan: Scan | None = None,
    bumps: Sequence[Pose] = (),
    seconds: Sequence[Pose] = (),
    *,
    scan_pose: Pose | None = None,
    whole: Sequence[tuple[float, float]] = (),
    as_lane: bool = False,
) -> str:
    """Return the SVG: the floor, the path through `points`, the robot at `pose` with its laser.

    `scan` was made at `scan_pose`, which is mostly a little behind `pose`. `seconds` are the places
    that get a dot, `bumps` those where it hit something. `whole` is the path also after `pose`:
    drive.js draws the rest when its time has come. `as_lane` draws only the strip of a corridor,
    with room above and below it for words.
    """
    x, y, right, above = lane_edges(floor) if as_lane else edges(floor)
    scale = min((WIDTH - 2 * MARGIN) / (right - x), (HEIGHT - 2 * MARGIN) / (above - y))
    width, height = (scale * size + 2 * MARGIN for size in (right - x, above - y))
    r = max(RADIUS_M, SMALLEST / scale)  # on a large floor the robot is drawn larger than it is
    way = line(points)
    drawn = way if whole else ''
    pale = ' stroke-opacity=".3"' if whole else ''
    start = floor.start
    strip = LANE_M if as_lane else math.inf
    ring = f'M{start.x - r:.3f} {start.y:.3f}a{r:.3f} {r:.3f} 0 1 0 {2 * r:.3f} 0'
    ring += f'a{r:.3f} {r:.3f} 0 1 0 {-2 * r:.3f} 0'
    parts = [
        _lane(floor) if as_lane else _floor(floor, scale),
        f'<path class="fan" d="{fan(scan_pose or pose, scan, strip)}" fill="{ROBOT}" '
        f'fill-opacity=".16" stroke="{ROBOT}" stroke-opacity=".6"/>',
        f'<path class="old" d="" fill="none" stroke="{WAITING}" '
        'stroke-width="2" stroke-dasharray="5 4"/>',
        f'<path class="all" d="{line(whole) if whole else way}" fill="none" stroke="{ROBOT}" '
        f'stroke-width="2.6"{pale}/>',
        f'<path class="driven" d="{drawn}" fill="none" stroke="{ROBOT}" stroke-width="2.6"/>',
        f'<path class="seconds" d="{dots(seconds)}" stroke="{ROBOT}" stroke-width="6.5" '
        'stroke-linecap="round"/>',
        f'<path class="start" d="{ring}" fill="none" stroke="currentColor" stroke-opacity=".6" '
        'stroke-dasharray="3 3"/>',
        # A disc with an arrow that shows its heading.
        f'<g class="robot" transform="translate({pose.x:.3f} {pose.y:.3f})">'
        f'<g transform="rotate({math.degrees(pose.yaw):.1f})">'
        f'<circle r="{r:.3f}" fill="{ROBOT}"/><path d="M{0.68 * r:.3f} 0L{-0.42 * r:.3f} '
        f'{0.52 * r:.3f}L{-0.18 * r:.3f} 0L{-0.42 * r:.3f} {-0.52 * r:.3f}z" fill="#fff"/></g></g>',
        f'<path class="bumps" d="{crosses(bumps, r, 7 / scale)}" stroke="{LOST}" '
        'stroke-width="3.2"/>',
    ]
    left, below = 14 + scale * WALL_M, height - 14 - scale * (WORDS_M if as_lane else WALL_M)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}" color="{LOOK["ink"]}" '
        'preserveAspectRatio="xMinYMid" '
        f'font-family="system-ui, sans-serif" font-size="16"><g transform="translate('
        f'{MARGIN - scale * x:.1f} {height - MARGIN + scale * y:.1f}) '
        f'scale({scale:.2f} -{scale:.2f})" stroke-linejoin="round">{"".join(parts)}</g>'
        f'<path d="M{left:.0f} {below:.0f}v-6m0 3h{scale:.0f}m0-3v6" fill="none" '
        f'stroke="currentColor"/><text x="{left + scale / 2:.0f}" y="{below - 7:.0f}" '
        f'text-anchor="middle" fill="currentColor">1 m</text></svg>'
    ).replace('<path ', '<path vector-effect="non-scaling-stroke" ')


def is_lane(floor: Floor, poses: Iterable[Sequence[float]] = ()) -> bool:
    """Return whether a floor is a corridor along x, and a robot (x, y, ...) stays in its strip."""
    width, height = floor.size_m
    boxes = any(wall.kind != 'wall' for wall in floor.walls)
    if boxes or floor.places or not floor.walls or height > width / 2 or floor.start.yaw:
        return False
    return all(abs(y - floor.start.y) < LANE_M / 2 for _, y, *_ in poses)


def lane_edges(floor: Floor) -> tuple[float, float, float, float]:
    """Return from where to where a lane is drawn (x, y, x, y in m), with room for words."""
    x, y, *_ = floor.start
    (ahead, behind), _ = floor.ranges(x, y, np.array([0.0, math.pi]))
    return (
        x - float(behind) - WALL_M,
        y - LANE_M - WORDS_M,
        x + float(ahead) + WALL_M,
        y + LANE_M + WORDS_M,
    )


def _lane(floor: Floor) -> str:
    x, low, right, high = lane_edges(floor)
    left, right, low, high = x + WALL_M, right - WALL_M, low + WORDS_M, high - WORDS_M
    grid = ''.join(f'M{n} {low:.2f}V{high:.2f}' for n in range(math.ceil(left), math.ceil(right)))
    walls = ''.join(
        f'M{one:.2f} {low - WALL_M / 2:.2f}h{WALL_M}V{high + WALL_M / 2:.2f}h-{WALL_M}z'
        for one in (left - WALL_M, right)
    )
    return (
        f'<path d="M{left:.2f} {low:.2f}H{right:.2f}V{high:.2f}H{left:.2f}z" fill="currentColor" '
        f'fill-opacity=".1"/><path d="{grid}" stroke="currentColor" stroke-opacity=".13"/>'
        f'<path d="{walls}" fill="{LOOK["ink"]}"/>'
    )


def edges(floor: Floor) -> tuple[float, float, float, float]:
    """Return from where to where a floor is drawn (x, y, x, y in m): little of the outer walls."""
    width, height = floor.size_m
    x = min((wall.x1 for wall in floor.walls if wall.x0 <= 0), default=WALL_M)
    y = min((wall.y1 for wall in floor.walls if wall.y0 <= 0), default=WALL_M)
    right = max((wall.x0 for wall in floor.walls if wall.x1 >= width), default=width - WALL_M)
    above = max((wall.y0 for wall in floor.walls if wall.y1 >= height), default=height - WALL_M)
    return x - WALL_M, y - WALL_M, right + WALL_M, above + WALL_M


def _floor(floor: Floor, scale: float) -> str:
    width, height = floor.size_m
    grid = ''.join(f'M{x} 0V{height:g}' for x in range(1, math.ceil(width)))
    grid += ''.join(f'M0 {y}H{width:g}' for y in range(1, math.ceil(height)))

    def boxes(kind: str) -> str:
        return ''.join(
            f'M{x0:g} {y0:g}H{x1:g}V{y1:g}H{x0:g}z'
            for x0, y0, x1, y1, kind_of_block in floor.walls
            if kind_of_block == kind
        )

    names = ''.join(
        f'<text transform="translate({x:g} {y:g}) scale({1 / scale:.5f} '
        f'-{1 / scale:.5f})" text-anchor="middle" dy=".35em" fill="currentColor" '
        f'font-size="16">{escape(name)}</text><circle class="place" cx="{x:g}" cy="{y:g}" '
        f'r="{PLACE_M}" fill="{ROBOT}" fill-opacity="0" stroke="{ROBOT}" stroke-width="2" '
        'stroke-dasharray="4 4" vector-effect="non-scaling-stroke"/>'
        for name, (x, y) in floor.places.items()
    )
    return (
        f'<path d="M0 0H{width:g}V{height:g}H0z" fill="none" stroke="currentColor" '
        f'stroke-opacity=".4"/><path d="{grid}" stroke="currentColor" stroke-opacity=".13"/>'
        f'<path d="{boxes("wall")}" fill="{LOOK["ink"]}" fill-opacity=".5"/>'
        f'<path d="{boxes("box")}" fill="{LOOK["ink"]}" fill-opacity=".35" stroke="{LOOK["ink"]}" '
        f'stroke-width="1.5"/>{names}'
    )


def line(points: Iterable[tuple[float, float]]) -> str:
    return 'M' + 'L'.join(f'{x:.2f} {y:.2f}' for x, y in points)


def dots(poses: Sequence[Pose]) -> str:
    return ''.join(f'M{x:.2f} {y:.2f}h0' for x, y, *_ in poses)


def crosses(poses: Sequence[Pose], r: float, a: float) -> str:
    """Return a path of crosses with arms `a`, at the front of a robot with radius `r` (m)."""
    return ''.join(
        f'M{x + r * math.cos(yaw) - a:.3f} {y + r * math.sin(yaw) - a:.3f}l{2 * a:.3f} {2 * a:.3f}'
        f'm0-{2 * a:.3f}l-{2 * a:.3f} {2 * a:.3f}'
        for x, y, yaw, *_ in poses
    )


def fan(pose: Pose, scan: Scan | None, strip: float = math.inf) -> str:
    """Return a path around what the laser sees from a pose, `strip` (m) to each side of it."""
    if scan is None:
        return ''
    angles, few = scan.drawn(BEAMS, RANGE_MAX)
    angles = pose.yaw + angles
    few = np.minimum(few, strip / np.maximum(np.abs(np.sin(angles)), 1e-6))
    xs, ys = pose.x + few * np.cos(angles), pose.y + few * np.sin(angles)
    hits = 'L'.join(f'{x:.2f} {y:.2f}' for x, y in zip(xs.tolist(), ys.tolist(), strict=True))
    return f'M{pose.x:.2f} {pose.y:.2f}L{hits}z'


def floor_in_words(floor: Floor) -> str:
    """Return what a picture shows, for everybody who does not see it."""
    width, height = floor.size_m
    return (
        f'The floor {floor.name}, {width:g} m by {height:g} m, from above: walls, the robot with '
        'its laser, and its path, with a dot for each second.'
    )
