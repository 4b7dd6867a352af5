"""What all pictures share: colours, sizes, axes, marks.

A figure has no ground of its own, and its ink is clear on white and on black: so it is right in
light and in dark. All sizes are set here, because the axes may be the caller's own.
"""

from __future__ import annotations

from collections.abc import Iterable

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection

from helpers.notebook import LOOK

HEARD, LOST, WAITING, ROBOT, INK, PALE = (
    LOOK[name] for name in ('heard', 'lost', 'waiting', 'robot', 'ink', 'line')
)
# One look for each of several lines: all differ in colour, and in how they are dashed.
LINE_LOOKS = (
    {'color': ROBOT, 'ls': '-'},
    {'color': LOOK['second'], 'ls': (0, (5, 2))},
    {'color': INK, 'ls': (0, (1, 1.2))},
    {'color': LOOK['third'], 'ls': (0, (5, 2, 1, 2))},
)
plt.rcParams.update(
    dict.fromkeys(('figure.facecolor', 'axes.facecolor', 'savefig.facecolor'), 'none')
    | dict.fromkeys(('text.color', 'axes.labelcolor', 'axes.edgecolor'), INK)
    | dict.fromkeys(('xtick.color', 'ytick.color'), INK)
)

SMALL, NORMAL, LARGE = 12, 13, 15  # font sizes in points, readable from the last row of a room
WIDTH, HEIGHT = 9, 4  # inches
WIDE = (11, 4.4)
DPI = 110


def new_axes(height: float = HEIGHT, width: float = WIDTH) -> Axes:
    """Return the axes of a new figure. The sizes are in inches."""
    return plt.figure(figsize=(width, height), dpi=DPI, layout='constrained').add_subplot()


def label_axes(
    ax: Axes, title: str, xlabel: str, ylabel: str, handles: list | None = None, grid: str = 'both'
) -> None:
    """Give the axes their texts, a grid, and a legend above them, which hides no data."""
    ax.set_title(title, fontsize=LARGE, loc='left', pad=34 if handles else 10)
    ax.set_xlabel(xlabel, fontsize=NORMAL)
    ax.set_ylabel(ylabel, fontsize=NORMAL)
    ax.tick_params(labelsize=SMALL)
    ax.spines[['top', 'right']].set_visible(False)
    ax.grid(True, axis=grid, color=PALE, linewidth=0.6)
    ax.set_axisbelow(True)
    if handles:
        ax.legend(
            handles=handles,
            loc='lower left',
            bbox_to_anchor=(0, 1),
            ncols=len(handles),
            fontsize=SMALL,
            frameon=False,
            borderaxespad=0.3,
            borderpad=0.2,
            handletextpad=0.5,
            handlelength=1.6,
            columnspacing=1.6,
        )


def crosses(ax: Axes, x, y, label: str, scale: float = 1.0) -> PathCollection:
    """Mark what was lost: the same cross in every picture. `scale` is the area of a mark."""
    look = {'marker': 'x', 's': 40 * scale, 'linewidths': 2 * scale**0.5, 'color': LOST}
    return ax.scatter(x, y, label=label, zorder=4, clip_on=False, **look)


def say(ax: Axes, text: str) -> None:
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha='center', va='center', fontsize=LARGE)


def in_words(names: Iterable) -> str:
    return '; '.join(map(str, names))


def check_looks(what: str, items, most: int) -> None:
    """Raise ValueError unless there are 1 to `most` items: each needs a look of its own."""
    if not 1 <= len(items) <= most:
        raise ValueError(f'One picture can show 1 to {most} {what}, not {len(items)}.')
