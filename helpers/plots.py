"""Pictures of recorded and of predicted runs, all in one style.

Every function takes tables as `recording` and `queue_model` make them: one row a message, columns
`seq`, `published_s`, `started_s`, `finished_s`, `thread`. A table describes a finished run: a
message that was never heard counts as lost. `interface_tree` takes the tables of `interfaces`;
`path`, `error`, `innovation` and `frame_tree` take tables of a drive, with one row a time or a
transform. Bad input raises before anything is drawn.

The colours are those of Okabe and Ito ("Color Universal Design", 2008), which people with any kind
of colour vision can tell apart. No meaning hangs on a colour alone: the shape differs too. Each
picture is described in words, too: see `alt_text`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from numbers import Integral

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from helpers.alt_text import describe
from helpers.recording import check_table
from helpers.values import (
    check_columns,
    column_of_numbers,
    column_of_text,
    column_of_whole_numbers,
    is_number,
    shown,
)

PUBLISHED, HEARD, LOST = '#9aa5ae', '#0072B2', '#D55E00'
LOST_TEXT = '#9c4300'  # a darker vermillion: letters need more contrast than marks
LIMIT = '#222222'
# One colour and one hatch a callback group. Light enough for black numbers on top.
GROUP_COLOURS = ('#56B4E9', '#E69F00', '#009E73', '#CC79A7', '#F0E442')
GROUP_HATCHES = ('', '//', '..', '\\\\', 'xx')
# The shapes of the packages. They are four and the colours five: the pairs repeat after twenty.
TREE_MARKERS = 'osD^'

# One look a line, where several are compared: all differ in colour, and in how they are dashed.
LINE_LOOKS = (
    {'color': HEARD, 'ls': '-'},
    {'color': LOST, 'ls': (0, (5, 2))},
    {'color': '#000000', 'ls': (0, (1, 1.2))},
    {'color': '#009E73', 'ls': (0, (5, 2, 1, 2))},
)
TRUTH = '#c3c9ce'

SMALL, NORMAL, LARGE = 12, 13, 15  # font sizes in points, readable from the last row of a room
SIZE, WIDE = (9, 4), (11, 4.4)  # inches
CHARACTER = 0.1 / SIZE[0]  # the width of one in SMALL, a part of the figure's
DPI = 110
HIGHEST = 400  # inches; no picture file can be higher than 2**16 pixels
MOST_SEQ_LABELS, MOST_GAP_LABELS, MOST_BAR_LABELS = 25, 15, 300
TIME_LABEL = 'time since the first publish (s)'


def sequence_gaps(table: pd.DataFrame, title: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw what was published and what was heard: sequence number over time.

    A small dot is a message at the time it was published, a large dot the start of its callback,
    a cross a message that was lost, at the time it was published. The line from a small dot to its
    large one is the time that the message waited. Draws into `ax`, or into a new figure.

    Raises TypeError or ValueError for a bad table.
    """
    table = check_table(table)
    ax = _axes(ax)
    handles = _draw_gaps(ax, table)
    _dress(ax, title or f'Messages: {_loss(table)}', TIME_LABEL, 'sequence number', handles)
    describe(ax, _gaps_in_words(table), title or '')
    _label_gaps(ax, table)
    return ax


def before_and_after(
    before: pd.DataFrame, after: pd.DataFrame, labels: tuple[str, str] = ('before', 'after')
) -> Figure:
    """Draw the sequence gaps of two runs beside each other, on the same axes.

    Each title says how many messages the run lost. Returns the Figure, since it has two Axes.

    Raises TypeError or ValueError for a bad table, and ValueError unless there are two labels.
    """
    tables = [check_table(before), check_table(after)]
    if not (isinstance(labels, Sequence) and len(labels) == 2) or isinstance(labels, str):
        raise ValueError(
            f'labels must be two names, such as ("before", "after"), not {shown(labels)}.'
        )
    figure = plt.figure(figsize=WIDE, dpi=DPI, layout='constrained')
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for ax, table, label in zip(panels, tables, labels, strict=True):
        handles = _draw_gaps(ax, table, scale=0.5)
        _dress(ax, f'{label}: {_loss(table)}', TIME_LABEL, 'sequence number', handles)
        describe(ax, _gaps_in_words(table), label)
    panels[1].set_ylabel('')
    return figure


def timeline(
    table: pd.DataFrame | Mapping[str, pd.DataFrame],
    span_s: tuple[float, float] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
    time_label: str = TIME_LABEL,
) -> Axes:
    """Draw one lane a thread and one bar a callback, with its sequence number where it fits.

    `table` is one table, or one for each callback group: `{'group name': table, ...}`. Then each
    group has a colour and a hatch of its own. `span_s` shows only the time from `span_s[0]` to
    `span_s[1]`, in seconds.

    Raises TypeError or ValueError for a bad table, no or too many groups, or a bad span.
    """
    groups = _checked_groups(table)
    span_s = None if span_s is None else _checked_span(span_s)
    bars = pd.concat([t[t.started_s.notna()].assign(group=name) for name, t in groups.items()])
    unknown = bars.loc[bars.thread.isna(), 'seq']
    if len(unknown):
        raise ValueError(
            f'It is not known which thread ran the callback of message {unknown.iloc[0]}.'
        )
    # A callback that had not finished when the recording ended runs to the end of the picture.
    bars['finished_s'] = bars.finished_s.fillna(bars[['started_s', 'finished_s']].max().max())
    threads = sorted(bars.thread.astype(str).unique(), key=_natural)
    lane = {thread: number for number, thread in enumerate(threads)}

    ax = _axes(ax)
    handles = []
    for number, name in enumerate(groups):
        own = bars[bars.group == name]
        look = {
            'facecolor': GROUP_COLOURS[number],
            'hatch': GROUP_HATCHES[number],
            'edgecolor': '#555555',
            'linewidth': 0.8,
            'label': name,
        }
        ax.barh(
            own.thread.astype(str).map(lane).to_numpy(dtype=float),
            (own.finished_s - own.started_s).to_numpy(),
            left=own.started_s.to_numpy(),
            height=0.72,
            **look,
        )
        handles.append(Patch(**look))
    ax.set_yticks(range(len(lane)), threads)
    ax.set_ylim(max(len(lane), 1) - 0.5, -0.5)  # the first thread on top
    # Axes that share their time show the longest run of all.
    last_s = max(one.dataLim.x1 for one in ax.get_shared_x_axes().get_siblings(ax))
    ax.set_xlim(span_s or (0, 1.02 * last_s if math.isfinite(last_s) else 1))
    default = 'One bar for each callback, with its sequence number'
    legend = handles if isinstance(table, Mapping) else None
    _dress(ax, title or default, time_label, 'thread', legend, grid='x')
    named = f' The groups are: {_list(groups)}.' if legend else ''
    describe(
        ax,
        'One lane for each thread that ran a callback, one bar for each callback, with its '
        f'sequence number where it fits.{named} {_overlap_in_words(bars)}',
    )
    if bars.empty:
        _say(ax, 'no callback was called')
    _label_bars(ax, bars, lane)
    return ax


def queue_length(
    table: pd.DataFrame, depth: int, title: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw how many messages wait in the subscription's queue, KEEP_LAST with history `depth`.

    A message enters when it is published. It leaves when its callback starts, or when the
    `depth`-th newer message arrives: that one pushes it out, and a cross marks the loss. Therefore
    the length never exceeds `depth`.

    Raises TypeError or ValueError for a bad table, and ValueError unless `depth` is a whole number
    of at least 1.
    """
    table = check_table(table)
    if not (is_number(depth) and isinstance(depth, Integral) and depth >= 1):
        raise ValueError(f'depth must be a whole number of at least 1, not {shown(depth)}.')
    entered, started = table.published_s.to_numpy(float), table.started_s.to_numpy(float)
    pushed_out = table.published_s.shift(-min(depth, len(table))).to_numpy(float)
    # A message is taken a little before its callback starts, so a newer one may come in between.
    left = np.fmax(entered, np.fmin(started, pushed_out))
    left = left[~(np.isnan(started) & np.isnan(pushed_out))]  # the others still wait at the end
    lost_at = pushed_out[np.isnan(started) & ~np.isnan(pushed_out)]
    # What enters and leaves in the same nanosecond did not wait: add up before drawing.
    times, place = np.unique(np.round(np.concatenate([entered, left]), 9), return_inverse=True)
    change = np.concatenate([np.ones(len(entered)), -np.ones(len(left))])
    waiting = np.cumsum(np.bincount(place, weights=change))

    ax = _axes(ax)
    (line,) = ax.step(times, waiting, where='post', color=HEARD, lw=2, label='messages waiting')
    ax.fill_between(times, waiting, step='post', color=HEARD, alpha=0.18, lw=0)
    limit = ax.axhline(depth, color=LIMIT, ls='--', lw=1.8, label=f'depth {depth}')
    handles = [line, limit]
    if len(lost_at):
        label = f'pushed out: {len(lost_at)}'
        handles.append(_crosses(ax, lost_at, np.full(len(lost_at), depth), label))
    ax.set_ylim(-0.04 * depth, 1.12 * depth)  # a line at zero must be seen, too
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    _dress(ax, title or 'How full is the queue?', TIME_LABEL, 'messages waiting', handles)
    describe(
        ax,
        f'A line in steps: how many messages wait. It never goes above {depth}, the depth, which '
        'is a dashed line. '
        + (
            'Crosses mark when a message was pushed out.' if len(lost_at) else 'None is pushed out.'
        ),
    )
    return ax


def latency(
    table: pd.DataFrame,
    period_s: float | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw for each heard message the time from publishing to the start of its callback, in ms.

    With `period_s`, the publisher's period in seconds, a second axis on the right counts in
    periods. Crosses at the bottom are lost messages, which have no latency.

    Raises TypeError or ValueError for a bad table, and ValueError unless `period_s` is above 0.
    """
    table = check_table(table)
    if period_s is not None:
        _check_seconds('period_s', period_s)
    heard, lost = table[table.started_s.notna()], table[table.started_s.isna()]

    ax = _axes(ax)
    delay_ms = 1000 * (heard.started_s - heard.published_s)
    handles = ax.plot(
        heard.published_s, delay_ms, 'o-', color=HEARD, ms=7, lw=1.5, label=f'heard {len(heard)}'
    )
    highest = max(delay_ms.max(), 1.0) if len(heard) else 1.0
    if len(lost):
        below = np.full(len(lost), -0.05 * highest)
        handles.append(_crosses(ax, lost.published_s, below, f'lost {len(lost)}'))
    ax.set_ylim(-0.09 * highest, 1.1 * highest)
    _dress(
        ax,
        title or 'How long each message waited for its callback',
        'time of publishing, since the first publish (s)',
        'latency (ms)',
        handles,
    )
    if period_s is not None:
        per_period = 1000 * period_s
        right = ax.secondary_yaxis(
            'right', functions=(lambda ms: ms / per_period, lambda periods: periods * per_period)
        )
        right.set_ylabel('latency (periods)', fontsize=NORMAL)
        right.tick_params(labelsize=SMALL)
        right.spines['right'].set_visible(True)
    periods = ' The axis on the right counts it in periods of the publisher.' if period_s else ''
    describe(
        ax,
        'One dot for each message that was heard: how long it waited.'
        f'{periods} {_loss_in_words(table, "crosses at the bottom")}',
    )
    if heard.empty:
        _say(ax, 'no message was heard')
    return ax


def sweep(
    results: pd.DataFrame, limit: float | None = None, limit_label: str = '', title: str = ''
) -> Figure:
    """Draw one panel a column of `results` over its index, for a quantity that was varied.

    Names are the axis labels: that of the index below, those of the columns (with their unit) above
    each panel. `limit` marks a value of the index with a line, `limit_label` says what it is.

    Raises TypeError or ValueError for bad results: no row, no column, or something but numbers.
    """
    check_columns(results, [], 'The results of a sweep')
    if results.empty:
        raise ValueError('The results of a sweep need at least one row and one column.')
    check_columns(results, results.columns, 'The results of a sweep')
    results = results.assign(**{name: column_of_numbers(results, name) for name in results})
    results.index = pd.Index(_numbers('index', results.index.to_series()), name=results.index.name)
    if limit is not None and not is_number(limit):
        raise TypeError(f'limit must be a number, not {shown(limit)}.')
    figure = plt.figure(figsize=WIDE, dpi=DPI, layout='constrained')
    figure.suptitle(title, fontsize=LARGE, x=0.01, ha='left')
    varied = [f'{value:g}' for value in results.index]
    panels = figure.subplots(1, results.shape[1], squeeze=False)[0]
    for ax, (name, values) in zip(panels, results.items(), strict=True):
        ax.plot(results.index, values, 'o-', color=HEARD, lw=2, ms=8)
        ax.set_ylim(bottom=0, top=1.15 * max(values.max(), 1e-9))
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        _dress(ax, name, results.index.name or '', '', None)
        ax.title.set_fontsize(NORMAL)
        marked = ''
        if limit is not None:
            line = ax.axvline(limit, color=LIMIT, ls='--', lw=1.8, label=limit_label)
            marked = f' A dashed line marks {limit}: {limit_label}.'
        describe(ax, f'One dot for each of {_list(varied)}, joined by a line.{marked}')
    if limit is not None:
        figure.legend(handles=[line], loc='upper right', fontsize=SMALL, frameon=False)
    return figure


def bars(values: pd.Series, xlabel: str, title: str | None = None, exact: bool = False) -> Axes:
    """Draw one horizontal bar a row of `values`, from the top, each with its value.

    `exact` values do not move from run to run: the description in words tells them, too.

    Raises TypeError or ValueError where there is nothing to draw, or something but numbers.
    """
    if not isinstance(values, pd.Series):
        raise TypeError(f'values must be a Series, not {type(values).__name__}.')
    if values.empty:
        raise ValueError('There are no values to draw.')
    values = pd.Series(_numbers('values', values), values.index)
    ax = _axes(None, height=1.3 + 0.6 * len(values))
    names = values.index.astype(str)
    drawn = ax.barh(names, values.to_numpy(), color=HEARD, height=0.6)
    texts = [f'{value:.0f}' if value >= 10 else f'{value:.2g}' for value in values]
    ax.bar_label(drawn, texts, padding=5, fontsize=NORMAL)
    ax.invert_yaxis()
    ax.margins(x=0.12)
    _dress(ax, title or '', xlabel, '', None, grid='x')
    if exact:
        names = [f'{name}: {text}' for name, text in zip(names, texts, strict=True)]
    describe(ax, f'One horizontal bar, with its value, for each of: {_list(names)}.')
    return ax


def topic_graph(endpoints: pd.DataFrame, title: str | None = None) -> Axes:
    """Draw which nodes publish and subscribe to which topics, and with which quality of service.

    `endpoints` has one row a publisher or subscription, with the columns `node`, `role`
    ('publisher' or 'subscription'), `topic`, `type` and `qos` (all text). An arrow is dashed where
    a topic lacks the other side.

    Raises TypeError or ValueError for a bad table or an unknown role.
    """
    endpoints = _checked('endpoints', endpoints, texts=('node', 'role', 'topic', 'type', 'qos'))
    if not endpoints['role'].isin(['publisher', 'subscription']).all():
        raise ValueError("The role of an endpoint is 'publisher' or 'subscription'.")
    publishers = endpoints[endpoints['role'] == 'publisher']
    subscriptions = endpoints[endpoints['role'] == 'subscription']
    topics = list(dict.fromkeys(endpoints['topic']))
    rows = max(len(publishers), len(subscriptions), len(topics))
    ax = _axes(None, height=0.9 + 1.25 * rows)
    ax.set(xlim=(0, 10), ylim=(-0.5 * rows, 0.5 * rows))
    ax.set_axis_off()
    ax.set_title(title or 'Nodes and topics', fontsize=LARGE, loc='left')

    def spread(count: int) -> np.ndarray:
        return (np.arange(count)[::-1] - (count - 1) / 2) * rows / max(count, 1)

    def box(x: float, y: float, first: str, second: str, style: str, colour: str) -> None:
        ax.text(
            x, y, f'{first}\n{second}', ha='center', va='center', fontsize=NORMAL, linespacing=1.5,
            bbox={'boxstyle': style, 'facecolor': colour, 'edgecolor': LIMIT, 'linewidth': 1.4},
        )  # fmt: skip

    heights = dict(zip(topics, spread(len(topics)), strict=True))
    for topic, y in heights.items():
        name = endpoints.loc[endpoints['topic'] == topic, 'type'].iloc[0]
        box(5, y, topic, name, 'round,pad=0.7,rounding_size=1.2', '#FFFFFF')
    for side, x, edges in ((publishers, 1.4, (2.6, 3.7)), (subscriptions, 8.6, (6.3, 7.2))):
        for (_, end), y in zip(side.iterrows(), spread(len(side)), strict=True):
            colour = GROUP_COLOURS[1] if end['role'] == 'publisher' else GROUP_COLOURS[0]
            box(x, y, end['node'], end['qos'], 'square,pad=0.7', colour)
            topic_y = heights[end['topic']]
            tail, head = (y, topic_y) if end['role'] == 'publisher' else (topic_y, y)
            both = {'publisher', 'subscription'} <= set(
                endpoints.loc[endpoints['topic'] == end['topic'], 'role']
            )
            ax.annotate(
                '', xy=(edges[1], head), xytext=(edges[0], tail),
                arrowprops={'arrowstyle': '-|>', 'lw': 2, 'ls': '-' if both else '--',
                            'color': LIMIT, 'mutation_scale': 18},
            )  # fmt: skip
    describe(
        ax,
        'Boxes for nodes and topics, joined by arrows. '
        + ' '.join(
            f'{end.node} {"publishes on" if end.role == "publisher" else "subscribes to"} '
            f'{end.topic} ({end.type}), {end.qos}.'
            for end in pd.concat([publishers, subscriptions]).itertuples()
        ),
    )
    return ax


def who_waits(
    callback: str, answer: str, thread_free: bool, group_free: bool, title: str | None = None
) -> Axes:
    """Draw who waits for whom: a callback for an answer, the answer for a thread and a group.

    What is not free is held by the callback. Then the arrows close a circle, which is drawn thick.
    """
    ax = _axes(None, height=4.2)
    ax.set(xlim=(0, 10), ylim=(-3.2, 3.2))
    ax.set_axis_off()
    closed = not (thread_free and group_free)
    default = 'A circle: nobody can go on' if closed else 'No circle: the answer can come'
    ax.set_title(title or default, fontsize=LARGE, loc='left')

    def box(x: float, y: float, text: str, style: str, colour: str) -> Text:
        return ax.text(
            x, y, text, ha='center', va='center', fontsize=NORMAL, linespacing=1.5,
            bbox={'boxstyle': style, 'facecolor': colour, 'edgecolor': LIMIT, 'linewidth': 1.4},
        )  # fmt: skip

    def arrow(tail: Text, head: Text, text: str, stops: bool) -> None:
        look = {'lw': 3, 'color': LOST} if stops else {'lw': 1.6, 'color': LIMIT, 'ls': '--'}
        look |= {'arrowstyle': '-|>', 'mutation_scale': 20, 'shrinkA': 3, 'shrinkB': 3}
        look |= {'patchA': tail.get_bbox_patch(), 'patchB': head.get_bbox_patch()}
        (x0, y0), (x1, y1) = tail.get_position(), head.get_position()
        ax.annotate('', xy=(x1, y1), xytext=(x0, y0), arrowprops=look)
        ax.text(
            (x0 + x1) / 2, (y0 + y1) / 2, text, ha='center', va='center', fontsize=SMALL,
            bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 2},
        )  # fmt: skip

    waiting = box(1.3, 0, callback, 'square,pad=0.7', GROUP_COLOURS[0])
    awaited = box(8.7, 0, answer, 'square,pad=0.7', GROUP_COLOURS[1])
    arrow(waiting, awaited, 'waits for', closed)
    for y, name, free in ((2.3, 'a thread', thread_free), (-2.3, "the client's group", group_free)):
        state = 'free' if free else 'held'
        needed = box(5, y, f'{name}\n{state}', 'round,pad=0.6,rounding_size=1.0', '#FFFFFF')
        arrow(awaited, needed, 'needs', not free)
        if not free:
            arrow(needed, waiting, 'is held by', True)
    needs = (
        f'{name}, which {"is free" if free else f"{callback} holds"}'
        for name, free in (('a thread', thread_free), ("the client's group", group_free))
    )
    circles = ('no circle', 'one circle', 'two circles')[(not thread_free) + (not group_free)]
    describe(
        ax,
        f'Boxes joined by arrows. {callback} waits for {answer}. Needed are '
        f'{", and ".join(needs)}. The arrows close {circles}.',
    )
    return ax


def interface_tree(table: pd.DataFrame, title: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw the tree of an interface's fields: one line a field, its type, one mark a package.

    `table` is what `interfaces.dependencies` returns: columns `depth`, `field`, `type`, `package`
    and `array`, one row a field, each followed by the fields of its type. The first row is the
    interface itself. A new figure is as high as the tree needs.

    Raises TypeError or ValueError for a bad table.
    """
    table = _checked_tree(table)
    # Inches: a line of text with some space for each row, and room for the title and the legend.
    ax = _axes(ax, height=0.27 * len(table) + 1.0)
    packages = dict.fromkeys(p for p in table.package if p)
    styles = {
        package: {'color': colour, 'marker': marker}
        for package, colour, marker in zip(
            packages, cycle(GROUP_COLOURS), cycle(TREE_MARKERS), strict=False
        )
    }
    styles[''] = {'color': PUBLISHED, 'marker': '.'}
    parents = []  # the row number of the open branch at each depth
    # The width in steps of the depth: each name must end before the column of the types.
    types = (table.type + table.array).str.len().max() * CHARACTER
    names = table.field.str.len() * CHARACTER
    width = max(8, ((table.depth + 1) / (1 - types - names).clip(lower=0.2)).max())
    column = (table.depth + 1 + names * width).max()
    for number, row in enumerate(table.itertuples()):
        parents[row.depth :] = [number]
        if row.depth:
            parent = row.depth - 1
            x, y = (parent, parent, row.depth), (parents[parent], number, number)
            ax.plot(x, y, color='#cfd6db', lw=1.2, zorder=1)
        ax.plot(
            row.depth, number, ls='none', ms=9, markeredgecolor='#555555', **styles[row.package]
        )
        ax.text(row.depth + 0.3, number, row.field, fontsize=SMALL, va='center')
        ax.text(
            column, number, row.type + row.array, fontsize=SMALL, va='center',
            color='black' if row.package else '#555555',
        )  # fmt: skip
    ax.set_xlim(-0.4, width)
    ax.set_ylim(len(table) - 0.4, -0.6)
    ax.set_axis_off()
    ax.set_title(title or f'{table.type[0]}: fields and their types', fontsize=LARGE, loc='left')
    handles = [
        Line2D([], [], ls='none', ms=9, markeredgecolor='#555555', label=package or 'primitive',
               **styles[package])
        for package in [*packages, *({''} & {*table.package})]
    ]  # fmt: skip
    ax.legend(
        handles=handles, fontsize=SMALL, ncols=3, loc='upper left', bbox_to_anchor=(0, 0),
        frameon=False,
    )  # fmt: skip
    describe(
        ax,
        f'A tree, one line a field, with its type: {len(table) - 1} fields in {table.depth.max()} '
        f'levels below {table.field[0]}. The shape and the colour of a mark tell from which '
        f'package the type comes: {_list(packages)}. Where a branch ends is a primitive type.',
    )
    return ax


def path(
    truth: pd.DataFrame,
    estimates: Mapping[str, pd.DataFrame],
    fixes: pd.DataFrame | None = None,
    ellipses_s: float | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw where the robot was, and where each of up to four estimates says that it was.

    `truth` and each estimate have the columns `x` and `y` in metres. `fixes` adds what GPS said
    (columns `gps_x`, `gps_y`). With `ellipses_s` each estimate needs `t` (s), `var_x`, `cov_x_y`
    and `var_y` (m^2), too: every so many seconds an ellipse shows 3 sigma, where the robot should
    be 99 times of 100.

    Raises TypeError or ValueError for a bad table, and for no or too many estimates.
    """
    truth = _checked('truth', truth, 'x', 'y')
    more = () if ellipses_s is None else ('t', 'var_x', 'cov_x_y', 'var_y')
    estimates = _checked_lines('estimate', estimates, 'x', 'y', *more)
    if fixes is not None:
        fixes = _checked('fixes', fixes, 'gps_x', 'gps_y')
    if ellipses_s is not None:
        _check_seconds('ellipses_s', ellipses_s)

    ax = _axes(ax, height=5.6)
    handles = ax.plot(truth.x, truth.y, color=TRUTH, lw=6, label='truth', solid_capstyle='round')
    if fixes is not None:
        look = {'marker': '+', 'color': '#555555', 'ls': 'none', 'ms': 6}
        handles += ax.plot(fixes.gps_x, fixes.gps_y, label='GPS', **look)
    for look, (name, table) in zip(LINE_LOOKS, estimates.items(), strict=False):
        handles += ax.plot(table.x, table.y, lw=1.8, label=name, **look)
        if ellipses_s is not None:
            for row in table[(table.t // ellipses_s).diff() > 0].dropna().itertuples():
                ax.add_patch(_ellipse(row, look))
    handles += [ax.scatter(truth.x.iloc[0], truth.y.iloc[0], s=70, color=LIMIT, zorder=5,
                           label='start')]  # fmt: skip
    ax.set_aspect('equal', 'datalim')
    _dress(ax, title or 'The path, seen from above', 'x (m)', 'y (m)', handles)
    describe(
        ax,
        f'Seen from above: a wide line for the truth, and a line for each of: {_list(estimates)}.'
        + (' Plus signs are the positions that GPS gave.' if fixes is not None else '')
        + (f' Ellipses show 3 sigma every {ellipses_s:g} seconds.' if ellipses_s else ''),
    )
    return ax


def error(
    errors: Mapping[str, pd.DataFrame],
    spans_s: Mapping[str, tuple[float, float]] | None = None,
    ylabel: str = 'distance from the truth (m)',
    log: bool = False,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the error of up to four estimates over time.

    Each table has the columns `t` (s) and `distance` (m). `spans_s` shades times in which
    something happened: `{'no GPS': (40, 80)}`, in seconds. `log` makes the vertical axis
    logarithmic, from 1 cm up.

    Raises TypeError or ValueError for a bad table or span, and for no or too many tables.
    """
    errors = _checked_lines('error', errors, 't', 'distance')
    if not isinstance(spans_s, Mapping | None):
        raise TypeError(f'spans_s must be a dict, not {shown(spans_s)}.')
    spans = {name: _checked_span(span) for name, span in (spans_s or {}).items()}
    ax = _axes(ax)
    handles = []
    for look, (name, table) in zip(LINE_LOOKS, errors.items(), strict=False):
        handles += ax.plot(table.t, table.distance, lw=2, label=name, **look)
    for name, span in spans.items():
        look = {'facecolor': '#f0f0f0', 'edgecolor': '#c9c9c9', 'hatch': '//', 'label': name}
        handles.append(ax.axvspan(*span, zorder=0, lw=0, **look))
    if log:
        ax.set_yscale('log')
        ax.set_ylim(bottom=0.01)
    else:
        ax.set_ylim(bottom=0)
    _dress(ax, title or 'How far off each estimate is', 'time (s)', ylabel, handles)
    shaded = (f' Shaded: {name}, {first:g} to {last:g} s.' for name, (first, last) in spans.items())
    scale = ' The vertical axis is logarithmic.' if log else ''
    describe(ax, f'One line for each of: {_list(errors)}.{scale}{"".join(shaded)}')
    return ax


def innovation(innovations: pd.DataFrame, title: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw the innovations of one variable over time, with the band of 3 sigma.

    `innovations` has one row a measurement, in the order of time: `t` (s), `innovation` and `sigma`
    (m, rad, ...), `accepted` (bool). A dot is a measurement that the filter used, a cross one that
    its gate kept out.

    Raises TypeError or ValueError for a bad table.
    """
    innovations = _checked('innovations', innovations, 't', 'innovation', 'sigma', 'accepted')
    if not innovations.accepted.isin([0, 1]).all():
        raise TypeError('The column accepted must hold True or False.')
    accepted = innovations.accepted.to_numpy(bool)
    used, kept_out = innovations[accepted], innovations[~accepted]
    ax = _axes(ax)
    three = 3 * innovations.sigma
    look = {'facecolor': '#56B4E9', 'alpha': 0.3, 'lw': 0, 'label': '3 sigma'}
    handles = [ax.fill_between(innovations.t, -three, three, **look)]
    for edge in (-three, three):
        ax.plot(innovations.t, edge, color=HEARD, lw=1.2)
    ax.axhline(0, color=LIMIT, lw=1)
    handles += ax.plot(used.t, used.innovation, 'o', color=LIMIT, ms=4.5,
                       label=f'used {len(used)}')  # fmt: skip
    if len(kept_out):
        label = f'kept out {len(kept_out)}'
        handles.append(_crosses(ax, kept_out.t, kept_out.innovation, label))
    _dress(ax, title or 'Measured minus expected', 'time (s)', 'innovation (m)', handles)
    describe(
        ax,
        'One dot for each measurement that was used, and a band of 3 sigma around zero. '
        + ('Crosses were kept out.' if len(kept_out) else 'None was kept out.'),
    )
    return ax


def frame_tree(transforms: pd.DataFrame, title: str | None = None) -> Axes:
    """Draw a tree of frames, from the left: one arrow a transform, its line tells who publishes it.

    `transforms` has one row a transform, with the columns `parent`, `child` and `publisher` (all
    text).

    Raises TypeError or ValueError for a bad table, for more than four publishers, and where the
    transforms make no tree: a frame with two parents, two roots, or a circle.
    """
    transforms = _checked('transforms', transforms, texts=('parent', 'child', 'publisher'))
    depths, rows = _tree_layout(transforms)
    publishers = list(dict.fromkeys(transforms.publisher))
    _check_number('publishers', publishers)
    looks = dict(zip(publishers, LINE_LOOKS, strict=False))
    widths = pd.Series({frame: 0.13 * len(frame) + 0.25 for frame in depths})  # inches
    widest = widths.groupby(pd.Series(depths)).max()
    gap = 0.75
    left = (widest + gap).cumsum().shift(fill_value=0)
    width = left.iloc[-1] + widest.iloc[-1]

    height = 0.75 * (max(rows.values()) + 1) + 1.2
    figure = plt.figure(figsize=(max(SIZE[0], width + 0.4), height), dpi=DPI, layout='constrained')
    ax = figure.add_subplot()
    for frame, depth in depths.items():
        ax.text(
            left[depth] + widest[depth] / 2, -rows[frame], frame, ha='center', va='center',
            fontsize=NORMAL, family='monospace',
            bbox={'boxstyle': 'round,pad=0.5', 'facecolor': 'white', 'edgecolor': LIMIT},
        )  # fmt: skip
    for row in transforms.itertuples():
        depth = depths[row.parent]
        look = looks[row.publisher]
        ends = [
            (left[depth] + (widest[depth] + widths[row.parent]) / 2 + 0.1, -rows[row.parent]),
            (left[depth + 1] + (widest[depth + 1] - widths[row.child]) / 2 - 0.1, -rows[row.child]),
        ]
        ax.plot(*zip(*ends, strict=True), lw=2.2, **look)
        ax.plot(*ends[1], marker='>', ms=9, color=look['color'])
    handles = [Line2D([], [], lw=2.2, label=name, **look) for name, look in looks.items()]
    ax.set_xlim(-0.2, max(width, SIZE[0] - 0.4) + 0.2)
    ax.set_ylim(-max(rows.values()) - 0.6, 0.6)
    _dress(ax, title or 'The tree of frames', '', '', handles)
    ax.set_axis_off()
    edges = (f'{row.parent} to {row.child} by {row.publisher}' for row in transforms.itertuples())
    describe(ax, f'One arrow for each transform, and who publishes it: {_list(edges)}.')
    return ax


def _checked(what: str, table: pd.DataFrame, *numbers: str, texts: Iterable[str] = ()):
    """Return the columns of a table that has rows, with numbers or text in them, or raise."""
    check_columns(table, [*numbers, *texts], what)
    if table.empty:
        raise ValueError(f'{what} is empty: it needs at least one row.')
    columns = {name: column_of_numbers(table, name) for name in numbers}
    return pd.DataFrame(columns | {name: column_of_text(table, name) for name in texts})


def _checked_lines(what: str, tables: Mapping[str, pd.DataFrame], *columns: str):
    if not isinstance(tables, Mapping):
        raise TypeError(f'Give each {what} a name: {{"a name": table}}.')
    _check_number(f'{what}s', tables)
    return {
        name: _checked(f'The {what} {name!r}', table, *columns) for name, table in tables.items()
    }


def _check_seconds(name: str, value: float) -> None:
    if not (is_number(value) and value >= 1e-9):
        raise ValueError(f'{name} must be a number of seconds above 0, not {shown(value)}.')


def _numbers(name: str, values: pd.Series) -> np.ndarray:
    return column_of_numbers(pd.DataFrame({name: values.to_numpy()}), name)


def _check_number(what: str, items) -> None:
    if not 1 <= len(items) <= len(LINE_LOOKS):
        raise ValueError(f'One picture can show 1 to {len(LINE_LOOKS)} {what}, not {len(items)}.')


def _ellipse(row, look: dict) -> Ellipse:
    """The 3-sigma ellipse of a position, from the eigenvalues of its covariance."""
    covariance = np.array([[row.var_x, row.cov_x_y], [row.cov_x_y, row.var_y]])
    variances, axes = np.linalg.eigh(covariance)
    width, height = 2 * 3 * np.sqrt(variances.clip(min=0))
    angle = math.degrees(math.atan2(axes[1, 0], axes[0, 0]))
    return Ellipse((row.x, row.y), width, height, angle=angle, fill=False, lw=1.2, **look)


def _tree_layout(transforms: pd.DataFrame) -> tuple[dict[str, int], dict[str, float]]:
    """Return each frame's depth and its row: the leaves have rows 0, 1, 2, ..."""
    twice = transforms.child[transforms.child.duplicated()]
    if len(twice):
        raise ValueError(f'The frame {twice.iloc[0]} has two parents: a tree allows one.')
    roots = [name for name in dict.fromkeys(transforms.parent) if name not in {*transforms.child}]
    if len(roots) != 1:
        raise ValueError(f'A tree has one root, these transforms have {len(roots)}.')
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
    if len(depths) <= len(transforms):
        raise ValueError('Some of these transforms make a circle.')
    return depths, rows


def _checked_groups(table: pd.DataFrame | Mapping[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
    if not isinstance(table, Mapping):
        return {'callbacks': check_table(table)}
    if not 1 <= len(table) <= len(GROUP_COLOURS):
        raise ValueError(
            f'The timeline can show 1 to {len(GROUP_COLOURS)} callback groups, not {len(table)}.'
        )
    return {str(name): check_table(one) for name, one in table.items()}


def _checked_span(span_s: tuple[float, float]) -> tuple[float, float]:
    try:
        first, last = span_s
    except (TypeError, ValueError):
        first = last = None
    if not (is_number(first) and is_number(last) and first < last):
        raise ValueError(
            f'span_s must be two times in seconds, the earlier one first, not {shown(span_s)}.'
        )
    return first, last


def _natural(name: str) -> list:
    """Sort key that puts 'worker 2' before 'worker 10'."""
    return [(0, int(s), '') if s.isdecimal() else (1, 0, s) for s in re.split(r'(\d+)', name) if s]


def _loss(table: pd.DataFrame) -> str:
    lost = int(table.started_s.isna().sum())
    return f'{lost} of {len(table)} lost' if lost else 'none lost'


def _list(names: Iterable) -> str:
    return '; '.join(map(str, names))


# What a picture shows, in words: nbval compares them, so no number that moves may be in them.


def _gaps_in_words(table: pd.DataFrame) -> str:
    return (
        f'{len(table)} messages. A small dot is a message when it was published, a large dot the '
        f'start of its callback. {_loss_in_words(table, "crosses")}'
    )


def _loss_in_words(table: pd.DataFrame, marks: str) -> str:
    lost = table.started_s.isna()
    if not lost.any():
        return 'None was lost.'
    return f'{"All" if lost.all() else "Some"} were lost: {marks}.'


def _overlap_in_words(bars: pd.DataFrame) -> str:
    """Say whether two bars ever overlap: one begins before an earlier one has ended."""
    bars = bars.sort_values('started_s')
    overlap = (bars.started_s.iloc[1:].to_numpy() < bars.finished_s.cummax().iloc[:-1]).any()
    return 'Some callbacks overlap.' if overlap else 'No two callbacks overlap.'


def _axes(ax: Axes | None, height: float = SIZE[1]) -> Axes:
    if ax is not None:
        return ax
    if height > HIGHEST:
        raise ValueError('This is too much for one picture: draw a part of it.')
    figure = plt.figure(figsize=(SIZE[0], height), dpi=DPI, layout='constrained')
    return figure.add_subplot()


def _dress(
    ax: Axes, title: str, xlabel: str, ylabel: str, handles: list | None, grid: str = 'both'
) -> None:
    """Give the axes the common style.

    All sizes are set here and not through rcParams, because the axes may be the caller's own.
    The legend stands above the axes, where it cannot hide data.
    """
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


def _crosses(ax: Axes, x, y, label: str, scale: float = 1.0):
    """Mark lost messages: the same cross in every picture."""
    return ax.scatter(
        x, y, marker='x', s=40 * scale, linewidths=2 * scale**0.5, color=LOST, label=label,
        zorder=4, clip_on=False,
    )  # fmt: skip


def _draw_gaps(ax: Axes, table: pd.DataFrame, scale: float = 1.0) -> list:
    """Draw the marks and return them for the legend. `scale` is the area of a mark."""
    heard, lost = table[table.started_s.notna()], table[table.started_s.isna()]
    scale *= min(1.0, max(0.2, 60 / len(table)))  # many marks must be smaller to stay apart
    ax.hlines(heard.seq, heard.published_s, heard.started_s, color='#cfd6db', lw=1.2, zorder=1)
    ax.margins(x=0.04, y=0.09)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    return [
        ax.scatter(
            table.published_s, table.seq, s=14 * scale, color=PUBLISHED, zorder=2,
            label=f'published {len(table)}',
        ),
        ax.scatter(
            heard.started_s, heard.seq, s=52 * scale, color=HEARD, zorder=3,
            label=f'heard {len(heard)}',
        ),
        _crosses(ax, lost.published_s, lost.seq, f'lost {len(lost)}', scale=scale),
    ]  # fmt: skip


def _label_gaps(ax: Axes, table: pd.DataFrame) -> None:
    """Write the sequence number at each heard message, and at each gap how many were lost."""
    heard = table[table.started_s.notna()]
    lost = table[table.started_s.isna()]
    texts = []
    if len(heard) <= MOST_SEQ_LABELS:
        # Below and to the right of a heard message nothing else can be: no message with a
        # smaller number comes later, unless several threads overlap.
        for message in heard.itertuples():
            texts.append(_label(ax, message.seq, message.started_s, message.seq, (3, -4), 'left'))
    # Consecutive rows share a gap: within one, row number minus rank among the lost is constant.
    gaps = [gap for _, gap in lost.groupby(lost.index - np.arange(len(lost)))]
    if len(gaps) <= MOST_GAP_LABELS:
        for gap in gaps:
            x, y, text = gap.published_s.mean(), gap.seq.mean(), f'{len(gap)} lost'
            texts.append(_label(ax, text, x, y, (-4, 1), 'right', LOST_TEXT, 'bottom'))
    _settle(ax, texts, heard[['started_s', 'seq']].to_numpy(float))


def _label(
    ax: Axes, text, x: float, y: float, offset: tuple[float, float], ha: str,
    colour: str = 'black', va: str = 'top',
) -> Text:  # fmt: skip
    return ax.annotate(
        str(text), (x, y), xytext=offset, textcoords='offset points', ha=ha, va=va,
        fontsize=SMALL, color=colour, zorder=5,
    )  # fmt: skip


def _settle(ax: Axes, texts: list[Text], marks: np.ndarray) -> None:
    """Remove each text that covers an earlier one, or one of the `marks`, rows of (x, y).

    A text that leaves the axes on the left is first turned to the right side of its point.
    """
    ax.figure.draw_without_rendering()  # the layout must be final before sizes mean anything
    marks = ax.transData.transform(marks)
    kept = []
    for text in texts:
        if text.get_window_extent().x0 < ax.bbox.x0:
            text.set(ha='left', position=(8, 0))
        box = text.get_window_extent()
        if box.count_overlaps(kept) or box.count_contains(marks):
            text.remove()
        else:
            kept.append(box)


def _label_bars(ax: Axes, bars: pd.DataFrame, lane: Mapping[str, int]) -> None:
    """Write the sequence number on each bar that is wide enough for it."""
    first, last = ax.get_xlim()
    shown = bars[(bars.started_s < last) & (bars.finished_s > first)]
    if len(shown) > MOST_BAR_LABELS:
        return
    ax.figure.draw_without_rendering()
    for bar in shown.itertuples():
        left, right = max(bar.started_s, first), min(bar.finished_s, last)
        text = ax.text(
            (left + right) / 2, lane[str(bar.thread)], str(bar.seq), fontsize=SMALL, ha='center',
            va='center', path_effects=[withStroke(linewidth=3, foreground=(1, 1, 1, 0.7))],
        )  # fmt: skip
        (left, _), (right, _) = ax.transData.transform([(left, 0), (right, 0)])
        if text.get_window_extent().width > 0.95 * (right - left):
            text.remove()


def _checked_tree(table: pd.DataFrame) -> pd.DataFrame:
    """Return the tree as it is meant, or raise."""
    texts = ('field', 'type', 'package', 'array')
    table = _checked('The tree', table, 'depth', texts=texts)
    table['depth'] = column_of_whole_numbers(table, 'depth')
    depth = table.depth.to_numpy()
    if depth[0] != 0 or (depth[1:] < 1).any() or (np.diff(depth) > 1).any():
        raise ValueError(
            'The tree must start with the interface at depth 0, and each row may be at most one '
            'deeper than the row above it.'
        )
    return table


def _say(ax: Axes, text: str) -> None:
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha='center', va='center', fontsize=LARGE)
