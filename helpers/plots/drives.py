"""Pictures of a drive: the path, the error of an estimate, the tree of frames."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse

from helpers.plots.alt_text import describe
from helpers.plots.style import (
    HEARD,
    INK,
    LARGE,
    LINE_LOOKS,
    NORMAL,
    PALE,
    WIDTH,
    check_looks,
    crosses,
    in_words,
    label_axes,
    new_axes,
)

NO_TREE = 'These transforms make no tree: it has one root, and each frame one parent.'


def path(
    truth: pd.DataFrame | None,
    estimates: Mapping[str, pd.DataFrame],
    fixes: pd.DataFrame | None = None,
    ellipses_s: float | None = None,
    title: str = 'The path, seen from above',
) -> Axes:
    """Draw where the robot was, and where each of up to four estimates says that it was.

    `truth` (None: not known) and each estimate have the columns `x` and `y` in metres. `fixes`
    adds what GPS said (columns `gps_x`, `gps_y`). With `ellipses_s` each estimate needs `t` (s),
    `var_x`, `cov_x_y` and `var_y` (m^2), too: every so many seconds an ellipse shows 3 sigma: the
    robot should be inside 99 times of 100.

    Raises ValueError for no or too many estimates.
    """
    check_looks('estimates', estimates, len(LINE_LOOKS))
    ax = new_axes(height=5.6)
    handles, known = [], truth is not None
    if known:
        look = {'color': PALE, 'lw': 6, 'label': 'truth', 'solid_capstyle': 'round'}
        handles += ax.plot(truth.x, truth.y, **look)
    if fixes is not None:
        look = {'marker': '+', 'color': INK, 'ls': 'none', 'ms': 6}
        handles += ax.plot(fixes.gps_x, fixes.gps_y, label='GPS', **look)
    for look, (name, table) in zip(LINE_LOOKS, estimates.items(), strict=False):
        handles += ax.plot(table.x, table.y, lw=1.8, label=name, **look)
        if ellipses_s:
            for row in table[(table.t // ellipses_s).diff() > 0].dropna().itertuples():
                ax.add_patch(_ellipse(row, look))
    start = (truth if known else next(iter(estimates.values()))).iloc[0]
    handles.append(ax.scatter(start.x, start.y, s=70, color=INK, zorder=5, label='start'))
    ax.set_aspect('equal', 'datalim')
    label_axes(ax, title, 'x (m)', 'y (m)', handles)
    describe(
        ax,
        f'Seen from above: {"a wide line for the truth, and " if known else ""}'
        f'a line for each of: {in_words(estimates)}.'
        + (' Plus signs are the positions that GPS gave.' if fixes is not None else '')
        + (f' Ellipses show 3 sigma every {ellipses_s:g} seconds.' if ellipses_s else ''),
    )
    return ax


def _ellipse(row, look: dict, sigmas: float = 3.0) -> Ellipse:
    """Return the ellipse of so many sigmas, from the eigenvalues of the covariance."""
    covariance = np.array([[row.var_x, row.cov_x_y], [row.cov_x_y, row.var_y]])
    variances, axes = np.linalg.eigh(covariance)
    width, height = 2 * sigmas * np.sqrt(variances.clip(min=0))
    angle = math.degrees(math.atan2(axes[1, 0], axes[0, 0]))
    return Ellipse((row.x, row.y), width, height, angle=angle, fill=False, lw=1.2, **look)


def error(
    errors: Mapping[str, pd.DataFrame],
    spans_s: Mapping[str, tuple[float, float]] | None = None,
    title: str = 'How far off each estimate is',
) -> Axes:
    """Draw the error of up to four estimates over time.

    Each table has the columns `t` (s) and `distance` (m). `spans_s` shades times in which
    something happened: `{'no GPS': (40, 80)}`, in seconds.

    Raises ValueError for no or too many tables.
    """
    check_looks('errors', errors, len(LINE_LOOKS))
    spans = spans_s or {}
    ax = new_axes()
    handles = []
    for look, (name, table) in zip(LINE_LOOKS, errors.items(), strict=False):
        handles += ax.plot(table.t, table.distance, lw=2, label=name, **look)
    for name, span in spans.items():
        look = {'facecolor': 'none', 'edgecolor': PALE, 'hatch': '//', 'label': name}
        handles.append(ax.axvspan(*span, zorder=0, lw=0, **look))
    ax.set_ylim(bottom=0)
    label_axes(ax, title, 'time (s)', 'distance from the truth (m)', handles)
    shaded = (f' Shaded: {name}, {first:g} to {last:g} s.' for name, (first, last) in spans.items())
    describe(ax, f'One line for each of: {in_words(errors)}.{"".join(shaded)}')
    return ax


def gate(
    innovations: Mapping[str, tuple[float, float]],
    covariance: np.ndarray,
    sigmas: float,
    taken: Sequence[str],
) -> Axes:
    """Draw innovations of fixes by name (x, y in m), and the ellipse of a gate of so many sigmas.

    `covariance` (2, 2) is that of the innovations. Those in `taken` are dots, the others crosses.
    """
    ax = new_axes()
    row = pd.Series({'x': 0.0, 'y': 0.0, 'var_x': covariance[0, 0], 'cov_x_y': covariance[0, 1]})
    row['var_y'] = covariance[1, 1]
    ax.add_patch(_ellipse(row, {'color': HEARD}, sigmas))
    for name, (x, y) in innovations.items():
        if name in taken:
            ax.plot(x, y, 'o', color=INK, ms=8)
        else:
            crosses(ax, [x], [y], '')
        ax.annotate(name, (x, y), (8, 6), textcoords='offset points', fontsize=LARGE)
    ax.set_aspect('equal', 'datalim')
    label_axes(ax, 'What the gate takes', 'innovation in x (m)', 'innovation in y (m)')
    left = [name for name in innovations if name not in taken]
    describe(
        ax,
        f'An ellipse of {sigmas:g} sigma around zero. Taken: {in_words(taken)}. '
        f'Kept out, as crosses: {in_words(left)}.',
    )
    return ax


def scans(
    walls: Sequence[Sequence[float]],
    pose: tuple[float, float, float],
    points: Mapping[str, tuple[np.ndarray, np.ndarray]],
) -> Axes:
    """Draw walls (x0, y0, x1, y1 and more, in m), and what a robot sees from a pose among them.

    `points` are up to four sets of points (x, y in m), seen from the pose (x, y in m, yaw in rad).
    """
    check_looks('points', points, len(LINE_LOOKS))
    ax = new_axes(height=5.0)
    for x0, y0, x1, y1, *_ in walls:
        ax.add_patch(plt.Rectangle((x0, y0), x1 - x0, y1 - y0, facecolor=PALE, lw=0))
    x, y, yaw = pose
    handles = [ax.scatter(x, y, s=70, color=INK, zorder=5, label='robot')]
    for line, marker, (name, ends) in zip(LINE_LOOKS, 'o+xs', points.items(), strict=False):
        ahead, left = np.array(ends)[:, np.isfinite(ends[0])]
        look = {'color': line['color'], 'marker': marker, 'ls': 'none', 'ms': 5, 'label': name}
        seen_x = x + ahead * math.cos(yaw) - left * math.sin(yaw)
        seen_y = y + ahead * math.sin(yaw) + left * math.cos(yaw)
        handles += ax.plot(seen_x, seen_y, **look)
    ax.set_aspect('equal', 'datalim')
    label_axes(ax, 'What the lidar sees, on the map', 'x (m)', 'y (m)', handles)
    describe(ax, f'Walls from above, and points for each of: {in_words(points)}.')
    return ax


def frame_tree(transforms: pd.DataFrame, title: str = 'The tree of frames') -> Axes:
    """Draw a tree of frames, from the left: one arrow a transform, one look a publisher.

    `transforms` has one row a transform, with the columns `parent`, `child` and `publisher` (all
    text).

    Raises ValueError for more than four publishers, and if the transforms make no tree.
    """
    depths, rows = _tree_layout(transforms)
    publishers = transforms.publisher.unique()
    check_looks('publishers', publishers, len(LINE_LOOKS))
    looks = dict(zip(publishers, LINE_LOOKS, strict=False))
    widths = pd.Series({frame: 0.13 * len(frame) + 0.25 for frame in depths})  # inches
    widest = widths.groupby(pd.Series(depths)).max()
    gap = 0.75
    left = (widest + gap).cumsum().shift(fill_value=0)
    centre = left + widest / 2
    width = left.iloc[-1] + widest.iloc[-1]

    ax = new_axes(0.75 * (max(rows.values()) + 1) + 1.2, max(WIDTH, width + 0.4))
    look = {'boxstyle': 'round,pad=0.5', 'facecolor': 'none', 'edgecolor': INK}
    text = {'fontsize': NORMAL, 'family': 'monospace', 'ha': 'center', 'va': 'center', 'bbox': look}
    for frame, depth in depths.items():
        ax.text(centre[depth], -rows[frame], frame, **text)
    for row in transforms.itertuples():
        depth, look = depths[row.parent], looks[row.publisher]
        tail = centre[depth] + widths[row.parent] / 2 + 0.1, -rows[row.parent]
        head = centre[depth + 1] - widths[row.child] / 2 - 0.1, -rows[row.child]
        ax.plot(*zip(tail, head, strict=True), lw=2.2, **look)
        ax.plot(*head, marker='>', ms=9, color=look['color'])
    handles = [Line2D([], [], lw=2.2, label=name, **look) for name, look in looks.items()]
    ax.set_xlim(-0.2, max(width, WIDTH - 0.4) + 0.2)
    ax.set_ylim(-max(rows.values()) - 0.6, 0.6)
    label_axes(ax, title, '', '', handles)
    ax.set_axis_off()
    edges = (f'{row.parent} to {row.child} by {row.publisher}' for row in transforms.itertuples())
    describe(ax, f'One arrow for each transform, and who publishes it: {in_words(edges)}.')
    return ax


def _tree_layout(transforms: pd.DataFrame) -> tuple[dict[str, int], dict[str, float]]:
    """Return each frame's depth and its row: the leaves have rows 0, 1, 2, ..."""
    roots = [name for name in transforms.parent.unique() if name not in {*transforms.child}]
    if len(roots) != 1 or transforms.child.duplicated().any():
        raise ValueError(NO_TREE)
    children = transforms.groupby('parent', sort=False)['child'].agg(list).to_dict()
    depths: dict[str, int] = {}
    rows: dict[str, float] = {}
    leaves = 0

    def place(frame: str, depth: int) -> None:
        nonlocal leaves
        depths[frame] = depth
        for child in children.get(frame, []):
            place(child, depth + 1)
        if frame in children:
            rows[frame] = float(np.mean([rows[child] for child in children[frame]]))
        else:
            rows[frame] = leaves
            leaves += 1

    place(roots[0], 0)
    if len(depths) != len(transforms) + 1:  # a circle beside the tree
        raise ValueError(NO_TREE)
    return depths, rows
