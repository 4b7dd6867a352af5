"""What all pictures share: colours, sizes, axes, marks.

The colours are those of Okabe and Ito ("Color Universal Design", 2008), which people with any kind
of colour vision can tell apart. All sizes are set here and not through rcParams, because the axes
may be the caller's own.
"""

from __future__ import annotations

from collections.abc import Iterable

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection

PUBLISHED, HEARD, LOST = '#9aa5ae', '#0072B2', '#D55E00'
LOST_TEXT = '#9c4300'  # a darker vermillion: letters need more contrast than marks
INK, GREY, PALE = '#222222', '#555555', '#cfd6db'
# One colour and one hatch a callback group. Light enough for black numbers on top.
GROUP_COLOURS = ('#56B4E9', '#E69F00', '#009E73', '#CC79A7', '#F0E442')
GROUP_HATCHES = ('', '//', '..', '\\\\', 'xx')
# One look for each of several lines: all differ in colour, and in how they are dashed.
LINE_LOOKS = (
    {'color': HEARD, 'ls': '-'},
    {'color': LOST, 'ls': (0, (5, 2))},
    {'color': '#000000', 'ls': (0, (1, 1.2))},
    {'color': '#009E73', 'ls': (0, (5, 2, 1, 2))},
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
    ax.grid(True, axis=grid, color='#e4e7ea', linewidth=0.8)
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
    """Write a text into the middle of empty axes."""
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha='center', va='center', fontsize=LARGE)


def in_words(names: Iterable) -> str:
    """Return a list of names for a sentence."""
    return '; '.join(map(str, names))


def check_looks(what: str, items, most: int) -> None:
    """Raise ValueError unless there are 1 to `most` items: each needs a look of its own."""
    if not 1 <= len(items) <= most:
        raise ValueError(f'One picture can show 1 to {most} {what}, not {len(items)}.')
