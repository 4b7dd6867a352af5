"""Drives: the floor of a saved drive, on which its robot drives once, and draws its way."""

import math
import re
from itertools import pairwise

from helpers.lesson import Lesson
from tools.lessons.first_pictures.look import (
    PLAYS_S,
    WIDTH,
    colour,
    output_of,
    percent,
    runs_of,
    styled,
    svg_of,
)

TRAIL = 2.6  # pixels
BAND = 44  # pixels, below the floor, for a line of text


def drive_picture(
    lesson: Lesson,
    cell_id: str,
    share: float = 1,
    around_m: tuple[float, float] | None = None,
    asks: str = '',
) -> str:
    """Return a saved drive, a share of its way. Its end is not told before it happens.

    With `around_m` it shows only the floor so far (x, y in m) beside the way, and below it `asks`.
    """
    page = output_of(lesson, cell_id)
    svg, run = svg_of(page), runs_of(page)[0]
    last = int(share * (len(run['poses']) - 1))
    poses = run['poses'][: last + 1]
    if share < 1:
        svg = re.sub(r"<path[^>]* class='(all|driven|seconds|bumps)'[^>]*/>", '', svg)
        x, y, *_ = poses[-1]
        at = f"class='robot' transform='translate({x:.3f} {y:.3f})'"
        svg = re.sub(r"class='robot' transform='[^']*'", at, svg)
    far = [0.0]
    for (x0, y0, *_), (x1, y1, *_) in pairwise(poses):
        far.append(far[-1] + math.hypot(x1 - x0, y1 - y0))
    every = max(1, last // 60)
    moves = turns = trail = ''
    for i, (x, y, yaw, *_) in enumerate(poses):
        if i % every == 0 or i == last:
            when = percent(PLAYS_S * i / last)
            moves += f'{when}{{transform:translate({x:.3g}px,{y:.3g}px)}}'
            turns += f'{when}{{transform:rotate({math.degrees(yaw):.0f}deg)}}'
            trail += f'{when}{{stroke-dashoffset:{1 - far[i] / far[-1]:.3f}}}'
    bump_s = PLAYS_S * min(1, run['bumps'][0] / 1000 / run['step'] / last) if run['bumps'] else 0
    scale = float(re.search(r'scale\(([\d.]+) ', svg)[1])
    if around_m:
        svg, zoom = _cropped(svg, poses, around_m, asks)
        scale *= zoom
    svg = re.sub(r"<path[^>]* class='driven'[^>]*/>", '', svg)
    svg = svg.replace(" class='all'", " class='all' pathLength='1'")
    style = (
        f'svg{{color-scheme:light dark;color:{colour("ink")}}}.fan,.old{{display:none}}'
        f'.robot,.robot>g,.all{{animation:move {PLAYS_S}s linear both}}'
        '.robot>g{animation-name:turn}'
        # A dash has the length of the way only where the line is scaled with its floor.
        f'.all{{animation-name:trail;vector-effect:none;stroke-width:{TRAIL / scale:.4f};'
        'stroke-opacity:1;stroke-dasharray:1}'
        f'.seconds{{animation:comes .3s {PLAYS_S}s both}}'
        f'.bumps{{animation:comes .1s {bump_s:.2f}s both}}@keyframes comes{{from{{opacity:0}}}}'
        f'@keyframes move{{{moves}}}@keyframes turn{{{turns}}}@keyframes trail{{{trail}}}'
        '@media(prefers-reduced-motion:reduce){svg *{animation:none!important}}'
    )
    return styled(svg, style)


def _cropped(svg: str, poses: list, around_m: tuple[float, float], asks: str) -> tuple[str, float]:
    """Return the part of a floor around a way, with a line of text, and how much larger it is."""
    wide, high = map(float, re.search(r"viewBox='0 0 ([\d.]+) ([\d.]+)'", svg).groups())
    dx, dy, scale = map(
        float, re.search(r'translate\(([-\d.]+) ([-\d.]+)\) scale\(([\d.]+) ', svg).groups()
    )
    (x_m, y_m), xs, ys = around_m, [pose[0] for pose in poses], [pose[1] for pose in poses]
    left, right = max(0, dx + scale * (min(xs) - x_m)), min(wide, dx + scale * (max(xs) + x_m))
    top, low = max(0, dy - scale * (max(ys) + y_m)), min(high, dy - scale * (min(ys) - y_m))
    zoom = WIDTH / (right - left)
    band = BAND / zoom
    frame = (
        f"viewBox='{left:.1f} {top:.1f} {right - left:.1f} {low - top + band:.1f}' "
        f"width='{WIDTH}' height='{zoom * (low - top) + BAND:.0f}'"
    )
    svg = re.sub(r"viewBox='[^']*' width='[^']*' height='[^']*'", frame, svg)
    # What lies below the part must not be seen behind the text.
    inside = (
        f"<clipPath id='part'><path d='M{left:.1f} {top:.1f}H{right:.1f}V{low:.1f}H{left:.1f}z'/>"
        f'</clipPath><style>.asks{{font-size:{19 / zoom:.2f}px;fill:currentColor;font-weight:bold}}'
        f'@media(max-width:560px){{.asks{{font-size:{30 / zoom:.2f}px}}}}</style>'
        "<g clip-path='url(#part)'>"
    )
    line = (
        f"</g><text class='asks' x='{left + 6 / zoom:.2f}' y='{low + 0.7 * band:.2f}'>{asks}</text>"
    )
    start = svg.index('>') + 1
    return f'{svg[:start]}{inside}{svg[start:].replace("</svg>", f"{line}</svg>")}', zoom
