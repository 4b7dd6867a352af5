"""A floor from above, with the robot on it: one SVG for the live picture, the replay and paper.

All is drawn in metres, x to the right and y up, inside one group: who moves a part of the picture,
as drive.js does, computes no pixels. Ink is `currentColor`, so it is right in light and in dark.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from html import escape
from typing import NamedTuple

import numpy as np

from helpers.plots.style import HEARD, INK, LOST
from helpers.robot.body import RADIUS_M
from helpers.robot.floor import Block, Floor, Pose
from helpers.robot.sensors import ANGLES, RANGE_MAX

WIDTH, HEIGHT, MARGIN = 720, 400, 10  # pixels, at most
SMALLEST = 9  # pixels: the robot's radius on a large floor
WALL_M, STEP_M = 0.15, 0.05
BEAMS = 61  # of a scan, in a picture
LIGHT, WALL, BOX = '#e69f00', '#737e87', '#a9b3ba'


class Frame(NamedTuple):
    """What is drawn of a floor, in metres, and the pixels of a metre."""

    left: float
    below: float
    right: float
    above: float
    scale: float

    @property
    def radius_m(self) -> float:
        """The robot's radius: on a large floor it is drawn larger than it is."""
        return max(RADIUS_M, SMALLEST / self.scale)


@cache
def frame_of(walls: tuple[Block, ...], size_m: tuple[float, float]) -> Frame:
    """Return how large a floor is drawn."""
    width, height = size_m
    across = [wall[:4] for wall in walls]
    upright = [(y0, x0, y1, x1) for x0, y0, x1, y1 in across]
    left, right = _solid(across, width, height)
    below, above = _solid(upright, height, width)
    scale = min((WIDTH - 2 * MARGIN) / (right - left), (HEIGHT - 2 * MARGIN) / (above - below))
    return Frame(left, below, right, above, scale)


def _solid(walls: list[tuple], length: float, breadth: float) -> tuple[float, float]:
    """Return from where to where a floor is drawn, which begins and ends with a solid wall.

    Of this `WALL_M` are enough. `walls` are (along, across, along, across), from and to.
    """

    def is_solid(at: float) -> bool:
        reached = 0.0
        for begin, low, end, high in sorted(walls, key=lambda wall: wall[1]):
            if begin <= at <= end and low <= reached + 1e-6:
                reached = max(reached, high)
        return reached >= breadth - 1e-6

    steps = np.arange(STEP_M, length / 2, STEP_M)
    first = next((at for at in steps if not is_solid(at)), STEP_M)
    last = next((at for at in steps if not is_solid(length - at)), STEP_M)
    return max(0.0, first - STEP_M - WALL_M), min(length, length - last + STEP_M + WALL_M)


def picture(
    floor: Floor,
    track: Track,
    pose: Pose,
    ranges: np.ndarray | None = None,
    bumps: Sequence[Pose] = (),
    *,
    seconds: Sequence[Pose] = (),
    paper: bool = False,
) -> str:
    """Return the SVG: the floor, the path, the robot at `pose` with its laser.

    `ranges` is a scan around `pose`, in metres. `seconds` are the places that get a dot, `bumps`
    those where it hit something. `paper` has a white ground, for an image of its own.
    """
    frame = frame_of(floor.walls, floor.size_m)
    width = frame.scale * (frame.right - frame.left) + 2 * MARGIN
    height = frame.scale * (frame.above - frame.below) + 2 * MARGIN
    ground = '<rect class="paper" width="100%" height="100%" fill="#fff"/>' if paper else ''
    parts = [
        _floor(floor, frame),
        f'<path class="fan" d="{fan(pose, ranges)}" fill="{LIGHT}" fill-opacity=".25" '
        f'stroke="{LIGHT}" stroke-opacity=".8"/>',
        f'<path class="old" d="" fill="none" stroke="{LOST}" '
        'stroke-width="1.6" stroke-dasharray="5 4"/>',
        f'<path class="all" d="{track.line()}" fill="none" stroke="{HEARD}" stroke-width="2.6"/>',
        f'<path class="driven" d="" fill="none" stroke="{HEARD}" stroke-width="2.6"/>',
        f'<path class="seconds" d="{dots(seconds)}" stroke="{HEARD}" stroke-width="6.5" '
        'stroke-linecap="round"/>',
        _ring(floor.start, frame),
        _robot(pose, frame),
        f'<path class="bumps" d="{crosses(bumps, frame)}" stroke="{LOST}" stroke-width="3.2"/>',
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}" color="{INK if paper else "currentColor"}" '
        f'font-family="sans-serif" font-size="12">{ground}<g transform="translate('
        f'{MARGIN - frame.scale * frame.left:.1f} {height - MARGIN + frame.scale * frame.below:.1f}'
        f') scale({frame.scale:.2f} -{frame.scale:.2f})" '
        f'stroke-linejoin="round">{"".join(parts)}</g>{_scale(frame, height)}</svg>'
    ).replace('<path ', '<path vector-effect="non-scaling-stroke" ')


def _floor(floor: Floor, frame: Frame) -> str:
    left, below, right, above, scale = frame
    columns, rows = (range(1, math.ceil(size)) for size in floor.size_m)
    grid = ''.join(f'M{x} {below:g}V{above:g}' for x in columns)
    grid += ''.join(f'M{left:g} {y}H{right:g}' for y in rows)

    def boxes(kind: str) -> str:
        return ''.join(
            f'M{max(x0, left):g} {max(y0, below):g}H{min(x1, right):g}V{min(y1, above):g}'
            f'H{max(x0, left):g}z'
            for x0, y0, x1, y1, what in floor.walls
            if what == kind
        )

    names = ''.join(
        f'<text transform="translate({x:g} {y:g}) scale({1 / scale:.5f} '
        f'-{1 / scale:.5f})" text-anchor="middle" dy=".35em" fill="currentColor" '
        f'fill-opacity=".7" font-size="14">{escape(name)}</text>'
        for name, (x, y) in floor.places.items()
    )
    return (
        f'<path d="M{left:g} {below:g}H{right:g}V{above:g}H{left:g}z" fill="currentColor" '
        'fill-opacity=".03" stroke="currentColor" stroke-opacity=".3"/>'
        f'<path d="{grid}" stroke="currentColor" stroke-opacity=".13"/>'
        f'<path d="{boxes("wall")}" fill="{WALL}"/><path d="{boxes("box")}" fill="{BOX}" '
        f'stroke="{WALL}" stroke-width="1.5"/>{names}'
    )


def _ring(start: Pose, frame: Frame) -> str:
    r = frame.radius_m
    return (
        f'<path class="start" d="M{start.x - r:.3f} {start.y:.3f}a{r:.3f} {r:.3f} 0 1 0 '
        f'{2 * r:.3f} 0a{r:.3f} {r:.3f} 0 1 0 {-2 * r:.3f} 0" fill="none" stroke="currentColor" '
        'stroke-opacity=".6" stroke-dasharray="3 3"/>'
    )


def _robot(pose: Pose, frame: Frame) -> str:
    """Return the robot, a disc with an arrow that shows its heading."""
    r = frame.radius_m
    return (
        f'<g class="robot" transform="translate({pose.x:.3f} {pose.y:.3f})">'
        f'<g transform="rotate({math.degrees(pose.yaw):.1f})">'
        f'<circle r="{r:.3f}" fill="{HEARD}"/><path d="M{0.68 * r:.3f} 0L{-0.42 * r:.3f} '
        f'{0.52 * r:.3f}L{-0.18 * r:.3f} 0L{-0.42 * r:.3f} {-0.52 * r:.3f}z" fill="#fff"/></g></g>'
    )


def _scale(frame: Frame, height: float) -> str:
    """Return a bar of one metre, in the corner below."""
    inside = MARGIN + WALL_M * frame.scale + 8
    left, y = inside, height - inside
    right = left + frame.scale
    return (
        f'<path d="M{left} {y:.0f}v-6m0 3H{right:.0f}m0-3v6" fill="none" stroke="currentColor"/>'
        f'<text x="{(left + right) / 2:.0f}" y="{y - 8:.0f}" text-anchor="middle" '
        'fill="currentColor">1 m</text>'
    )


class Track:
    """A path through points, without those that it passes within half a centimetre anyway."""

    def __init__(self) -> None:
        self._kept: list[tuple[float, float]] = []
        self._passed: list[tuple[float, float]] = []  # after the last that is kept

    def add(self, x: float, y: float) -> None:
        """Go on to a point."""
        if not self._kept:
            self._kept.append((x, y))
        if self._passed and (len(self._passed) > 40 or not self._passes(x, y)):
            self._kept.append(self._passed[-1])
            self._passed = []
        self._passed.append((x, y))

    def _passes(self, x: float, y: float) -> bool:
        ax, ay = self._kept[-1]
        dx, dy = x - ax, y - ay
        length = dx * dx + dy * dy or 1.0
        for bx, by in self._passed:
            part = min(max(((bx - ax) * dx + (by - ay) * dy) / length, 0.0), 1.0)
            if math.hypot(bx - ax - part * dx, by - ay - part * dy) > 0.005:
                return False
        return True

    def line(self) -> str:
        """Return the path as SVG has it."""
        points = [*self._kept, *self._passed[-1:]]
        return f'M{"L".join(f"{x:.2f} {y:.2f}" for x, y in points)}' if points else ''


def dots(poses: Sequence[Pose]) -> str:
    """Return a path of dots."""
    return ''.join(f'M{x:.2f} {y:.2f}h0' for x, y, *_ in poses)


def crosses(poses: Sequence[Pose], frame: Frame) -> str:
    """Return a path of crosses, at the robot's front."""
    a, r = 7 / frame.scale, frame.radius_m
    return ''.join(
        f'M{x + r * math.cos(yaw) - a:.3f} {y + r * math.sin(yaw) - a:.3f}l{2 * a:.3f} {2 * a:.3f}'
        f'm0-{2 * a:.3f}l-{2 * a:.3f} {2 * a:.3f}'
        for x, y, yaw, *_ in poses
    )


def fan(pose: Pose, ranges: np.ndarray | None) -> str:
    """Return a path around what the laser sees from a pose."""
    if ranges is None or not len(ranges):
        return ''
    beams = np.linspace(0, len(ranges) - 1, BEAMS).round().astype(int)
    few = np.nan_to_num(ranges[beams], nan=0.0, posinf=RANGE_MAX)
    angles = pose.yaw + ANGLES[beams]
    xs, ys = pose.x + few * np.cos(angles), pose.y + few * np.sin(angles)
    hits = 'L'.join(f'{x:.2f} {y:.2f}' for x, y in zip(xs.tolist(), ys.tolist(), strict=True))
    return f'M{pose.x:.2f} {pose.y:.2f}L{hits}z'


def described(floor: Floor) -> str:
    """Return what a picture shows, for everybody who does not see it."""
    width, height = floor.size_m
    return escape(
        f'The floor {floor.name}, {width:g} m by {height:g} m, from above: walls, the robot with '
        'its laser, and its path, with a dot for each second.'
    )
