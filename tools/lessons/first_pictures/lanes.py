"""Lanes: a corridor from above, as a strip with a wall at its right end, and the robot on it."""

import math
from typing import NamedTuple

from helpers.robot import RADIUS_M
from tools.lessons.first_pictures.look import PLAYS_S, WIDTH, moving

WALL_M = 4.5  # where the wall of the corridor is
PAD, WALL = 16, 14  # pixels: left and right of a lane, and how thick its wall is
STYLE = (
    f'.robot,.behind{{animation:{PLAYS_S}s linear both}}'
    '.line{stroke:COLOUR(ink);stroke-dasharray:3 5}'
    '.behind{stroke:COLOUR(good);stroke-width:3;stroke-opacity:.4}'
    '.robot path{fill:COLOUR(ground)}'
    '.hit{stroke:COLOUR(lost);stroke-width:5;fill:none}'
    '.asks{font-weight:bold}'
)


class Lane(NamedTuple):
    """What a lane shows, from which metre of the corridor on, and where: all else is pixels."""

    from_m: float
    wall_m: float = WALL_M
    left: float = PAD
    height: float = 90
    middle: float = 33  # where the robot drives, below the upper edge

    @property
    def wall_x(self) -> float:
        return WIDTH - PAD - WALL - self.left

    @property
    def scale(self) -> float:
        return self.wall_x / (self.wall_m - self.from_m)

    def x(self, metres: float) -> float:
        return self.scale * (metres - self.from_m)

    def at(self, y: float, body: str) -> str:
        """Return what is on a lane, in its place of the picture."""
        return f'<g transform="translate({self.left:g} {y:g})">{body}</g>'

    def floor(self, before_wall_m: float) -> str:
        """Return the strip, its wall, and a line so far before it."""
        wall, line = self.wall_x, self.x(self.wall_m - before_wall_m)
        return (
            f'<path class="way" d="M0 0H{wall:.1f}V{self.height}H0z"/>'
            f'<path class="line" d="M{line:.1f} 0V{self.height}"/>'
            f'<path class="wall" d="M{wall:.1f} -2h{WALL}v{self.height + 4}h-{WALL}z"/>'
        )

    def robot(self, name: str, way: list[tuple[float, float]]) -> tuple[str, str]:
        """Return a robot that drives its way, (seconds, metres), its track, and their keyframes."""
        begin, end, r = self.x(way[0][1]), self.x(way[-1][1]), self.scale * RADIUS_M
        moves = f'style="animation-name:{name}" transform="translate({end:.1f} 0)"'
        body = (
            f'<clipPath id="c{name}"><path d="M{begin:.1f} 0H{WIDTH}V{self.height}H{begin:.1f}z"/>'
            f'</clipPath><g clip-path="url(#c{name})">'
            f'<path class="behind" {moves} d="M-{WIDTH} {self.middle}H0"/></g>'
            f'<g class="robot good" {moves}><circle cy="{self.middle}" r="{r:.1f}"/>'
            f'<path transform="translate(0 {self.middle}) scale({r / 21:.3g})" '
            'd="M14 0L-9 11L-4 0L-9-11z"/></g>'
        )
        return body, moving(name, [(t_s, self.x(metres)) for t_s, metres in way])

    def hit(self, at_s: float) -> str:
        """Return the mark of a robot that has hit the wall."""
        x, y = self.wall_x - 10, self.middle - 9
        return (
            f'<path class="says hit" style="animation-delay:{at_s:.2f}s" '
            f'd="M{x:.1f} {y:g}l18 18m0-18l-18 18"/>'
        )


def way_of(run: dict, until_s: float = math.inf) -> list[tuple[float, float]]:
    """Return where on its lane a saved robot was, and when, (s, m), to a time or to its end."""
    step_s, poses = run['step'], run['poses']
    until_s = min(until_s, step_s * (len(poses) - 1))
    way = [(i * step_s, x) for i, (x, *_) in enumerate(poses) if i * step_s < until_s]
    return [*way, (until_s, x_at(run, until_s))]


def x_at(run: dict, t_s: float) -> float:
    """Return where on its lane a saved robot was at a time (m)."""
    at = t_s / run['step']
    before = min(int(at), len(run['poses']) - 2)
    (x, *_), (after, *_) = run['poses'][before : before + 2]
    return x + (after - x) * (at - before)
