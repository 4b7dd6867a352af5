"""Boxes and arrows: nodes and topics, who waits for whom, the tree of an interface."""

from __future__ import annotations

from itertools import cycle

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.text import Text

from helpers.alt_text import describe
from helpers.plots.style import (
    GREY,
    GROUP_COLOURS,
    INK,
    LARGE,
    NORMAL,
    PALE,
    PUBLISHED,
    SMALL,
    WIDTH,
    in_words,
    new_axes,
)

# The shapes of the packages. They are four and the colours five: the pairs repeat after twenty.
TREE_MARKERS = 'osD^'
CHARACTER = 0.1 / WIDTH  # the width of one in SMALL, a part of the figure's


def topic_graph(endpoints: pd.DataFrame, title: str) -> Axes:
    """Draw which nodes publish and subscribe to which topics, and with which quality of service.

    `endpoints` has one row a publisher or subscription, with the columns `node`, `role`
    ('publisher' or 'subscription'), `topic`, `type` and `qos` (all text).
    """
    publishers = endpoints[endpoints['role'] == 'publisher']
    subscriptions = endpoints[endpoints['role'] == 'subscription']
    topics = endpoints.drop_duplicates('topic')
    rows = max(len(publishers), len(subscriptions), len(topics))
    ax = new_axes(height=0.9 + 1.25 * rows)
    ax.set_axis_off()
    ax.set_title(title, fontsize=LARGE, loc='left')
    ax.set(xlim=(0, 10), ylim=(-0.5 * rows, 0.5 * rows))

    def spread(count: int) -> np.ndarray:
        return (np.arange(count)[::-1] - (count - 1) / 2) * rows / max(count, 1)

    heights = dict(zip(topics['topic'], spread(len(topics)), strict=True))
    for topic in topics.itertuples():
        text = f'{topic.topic}\n{topic.type}'
        _box(ax, 5, heights[topic.topic], text, 'round,pad=0.7,rounding_size=1.2')
    sides = ((publishers, 1.4, GROUP_COLOURS[1]), (subscriptions, 8.6, GROUP_COLOURS[0]))
    words = ['Boxes for nodes and topics, joined by arrows.']
    for side, x, colour in sides:
        for end, y in zip(side.itertuples(), spread(len(side)), strict=True):
            _box(ax, x, y, f'{end.node}\n{end.qos}', 'square,pad=0.7', colour)
            if end.role == 'publisher':
                tail, head, does = (2.6, y), (3.7, heights[end.topic]), 'publishes on'
            else:
                tail, head, does = (6.3, heights[end.topic]), (7.2, y), 'subscribes to'
            look = {'arrowstyle': '-|>', 'lw': 2, 'color': INK, 'mutation_scale': 18}
            ax.annotate('', xy=head, xytext=tail, arrowprops=look)
            words.append(f'{end.node} {does} {end.topic} ({end.type}), {end.qos}.')
    describe(ax, ' '.join(words))
    return ax


def _box(ax: Axes, x: float, y: float, text: str, style: str, colour: str = '#FFFFFF') -> Text:
    """Write a text in a box, centred at (x, y). `style` is one of matplotlib's box styles."""
    look = {'boxstyle': style, 'facecolor': colour, 'edgecolor': INK, 'linewidth': 1.4}
    centred = {'ha': 'center', 'va': 'center', 'linespacing': 1.5}
    return ax.text(x, y, text, fontsize=NORMAL, bbox=look, **centred)


def interface_tree(tree: pd.DataFrame) -> Axes:
    """Draw the tree of an interface's fields: one line a field, its type, one mark a package.

    `tree` is what `interfaces.dependencies` returns: columns `depth`, `field`, `type`, `package`
    and `array`, one row a field, each followed by the fields of its type. The first row is the
    interface itself. The figure is as high as the tree needs.
    """
    # Inches: a line of text with some space for each row, and room for the title and the legend.
    ax = new_axes(height=0.27 * len(tree) + 1.0)
    packages = [package for package in dict.fromkeys(tree.package) if package]
    looks = zip(packages, cycle(GROUP_COLOURS), cycle(TREE_MARKERS), strict=False)
    marks = {package: {'color': colour, 'marker': marker} for package, colour, marker in looks}
    marks[''] = {'color': PUBLISHED, 'marker': '.'}
    edge = {'ls': 'none', 'ms': 9, 'markeredgecolor': GREY}
    # The width in steps of the depth: each name must end before the column of the types.
    types = (tree.type + tree.array).str.len().max() * CHARACTER
    names = tree.field.str.len() * CHARACTER
    width = max(8, ((tree.depth + 1) / (1 - types - names).clip(lower=0.2)).max())
    column = (tree.depth + 1 + names * width).max()
    parents = []  # the row number of the open branch at each depth
    for number, row in enumerate(tree.itertuples()):
        parents[row.depth :] = [number]
        if row.depth:
            parent = row.depth - 1
            x, y = (parent, parent, row.depth), (parents[parent], number, number)
            ax.plot(x, y, color=PALE, lw=1.2, zorder=1)
        ax.plot(row.depth, number, **edge, **marks[row.package])
        ax.text(row.depth + 0.3, number, row.field, fontsize=SMALL, va='center')
        colour = 'black' if row.package else GREY
        ax.text(column, number, row.type + row.array, fontsize=SMALL, va='center', color=colour)
    ax.set_xlim(-0.4, width)
    ax.set_ylim(len(tree) - 0.4, -0.6)
    ax.set_axis_off()
    ax.set_title(f'{tree.type[0]}: fields and their types', fontsize=LARGE, loc='left')
    handles = [
        Line2D([], [], label=package or 'primitive', **edge, **mark)
        for package, mark in marks.items()
        if package in set(tree.package)
    ]
    place = {'loc': 'upper left', 'bbox_to_anchor': (0, 0), 'frameon': False}
    ax.legend(handles=handles, fontsize=SMALL, ncols=3, **place)
    describe(
        ax,
        f'A tree, one line a field, with its type: {len(tree) - 1} fields in {tree.depth.max()} '
        f'levels below {tree.field[0]}. The shape and the colour of a mark tell from which '
        f'package the type comes: {in_words(packages)}. Where a branch ends is a primitive type.',
    )
    return ax
