"""Pictures of a run: what was heard and lost, which thread worked, how long messages waited.

The tables are those of `recording` and `queue_model`: one row a message, columns `seq`,
`published_s`, `started_s`, `finished_s`, `thread`. A table describes a finished run: a message that
was never heard counts as lost.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator

from helpers.plots.alt_text import describe
from helpers.plots.style import (
    DPI,
    HEARD,
    INK,
    LOST,
    NORMAL,
    SMALL,
    WAITING,
    WIDE,
    crosses,
    label_axes,
    new_axes,
    say,
)
from helpers.recording import check_table, thread_order

MAX_SEQ_LABELS, MAX_GAP_LABELS = 25, 15
TIME_LABEL = 'time since the first publish (s)'

# The descriptions in words: nbval compares them, so no number that moves may be in them.


def sequence_gaps(
    table: pd.DataFrame,
    title: str | None = None,
    depth: int = 10,
    ax: Axes | None = None,
) -> Axes:
    """Draw what was published and what was heard: sequence number over time.

    A small dot is a message at the time it was published, a large dot the start of its callback.
    The line from the small dot to the large one is the time that the message waited.

    A cross is a message that was lost, at the time when it was pushed out. A dotted line joins it
    with the message that did it, the `depth`-th newer one; `depth` is that of the subscription's
    KEEP_LAST queue. One that was not pushed out has its cross where it was published.

    Draws into `ax`, or into a new figure. Raises TypeError or ValueError for a bad table.
    """
    table = check_table(table)
    ax = ax or new_axes()
    _draw_gaps(ax, table, title or f'Messages: {_loss(table)}', depth)
    describe(ax, _gaps_in_words(table, depth), title or '')
    _label_gaps(ax, table)
    return ax


def before_and_after(
    before: pd.DataFrame, after: pd.DataFrame, labels: tuple[str, str], depth: int = 10
) -> Figure:
    """Draw the sequence gaps of two runs beside each other, on the same axes.

    Each title has its label, and says how many messages the run lost. `depth` is that of
    `sequence_gaps`. Returns the Figure, since it has two Axes.

    Raises TypeError or ValueError for a bad table.
    """
    tables = [check_table(before), check_table(after)]
    figure = plt.figure(figsize=WIDE, dpi=DPI, layout='constrained')
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for ax, table, label in zip(panels, tables, labels, strict=True):
        _draw_gaps(ax, table, f'{label}: {_loss(table)}', depth, scale=0.5)
        describe(ax, _gaps_in_words(table, depth), label)
    panels[1].set_ylabel('')
    return figure


def _draw_gaps(ax: Axes, table: pd.DataFrame, title: str, depth: int, scale: float = 1.0) -> None:
    """Draw the marks and what surrounds them. `scale` is the area of a mark."""
    heard, lost = table[table.started_s.notna()], table[table.started_s.isna()]
    scale *= min(1.0, max(0.2, 60 / len(table)))  # many marks must be smaller to stay apart
    # Lines of many messages fill the ground: they are pale there, and the crosses stand out.
    part = min(1.0, 15 / len(table))
    waits = {'color': WAITING, 'alpha': 0.5 * part, 'lw': 1.2, 'zorder': 1}
    ax.hlines(heard.seq, heard.published_s, heard.started_s, **waits)
    ax.margins(x=0.04, y=0.09)
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    lost_at = _pushed_out(table, depth)[lost.index].fillna(lost.published_s)
    ax.hlines(lost.seq, lost.published_s, lost_at, **waits)
    dotted = {'color': LOST, 'alpha': part, 'lw': 0.9, 'ls': ':', 'zorder': 1}
    ax.vlines(lost_at, lost.seq, table.seq.shift(-depth)[lost.index], **dotted)
    small = {'s': 14 * scale, 'color': WAITING, 'zorder': 2, 'label': f'published {len(table)}'}
    large = {'s': 52 * scale, 'color': HEARD, 'zorder': 3, 'label': f'received {len(heard)}'}
    handles = [
        ax.scatter(table.published_s, table.seq, **small),
        ax.scatter(heard.started_s, heard.seq, **large),
        crosses(
            ax, lost_at, lost.seq, f'{_unheard(table)} {len(lost)}', max(scale, 0.8 * part**0.5)
        ),
    ]
    label_axes(ax, title, TIME_LABEL, 'sequence number', handles)


def _pushed_out(table: pd.DataFrame, depth: int) -> pd.Series:
    """Return for each message when the `depth`-th newer one came, which would push it out.

    NaN if there is none: such a message still waits at the end.
    """
    return table.published_s.shift(-depth)


def _label_gaps(ax: Axes, table: pd.DataFrame) -> None:
    """Write the sequence number at each heard message, and at each gap how many were lost."""
    heard, lost = table[table.started_s.notna()], table[table.started_s.isna()]
    texts = []
    if len(heard) <= MAX_SEQ_LABELS:
        # Below and to the right of a heard message nothing else can be: no message with a
        # smaller number comes later, unless several threads overlap.
        look = {'xytext': (3, -4), 'ha': 'left', 'va': 'top', 'color': INK}
        for message in heard.itertuples():
            texts.append(_label(ax, str(message.seq), message.started_s, message.seq, look))
    # Consecutive rows share a gap: within one, row number minus rank among the lost is constant.
    gaps = [gap for _, gap in lost.groupby(lost.index - np.arange(len(lost)))]
    if len(gaps) <= MAX_GAP_LABELS:
        look = {'xytext': (-4, 1), 'ha': 'right', 'va': 'bottom', 'color': LOST}
        for gap in gaps:
            x, y = gap.published_s.mean(), gap.seq.mean()
            texts.append(_label(ax, f'{len(gap)} lost', x, y, look))
    _remove_overlaps(ax, texts, heard[['started_s', 'seq']].to_numpy(float))


def _label(ax: Axes, text: str, x: float, y: float, look: dict) -> Text:
    return ax.annotate(text, (x, y), textcoords='offset points', fontsize=SMALL, zorder=5, **look)


def _remove_overlaps(ax: Axes, texts: list[Text], marks: np.ndarray) -> None:
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


def timeline(
    table: pd.DataFrame | Mapping[str, pd.DataFrame],
    title: str = 'One bar for each callback, with its sequence number',
    ax: Axes | None = None,
    depth: int | None = None,
) -> Axes:
    """Draw one lane a thread and one bar a callback, with its sequence number if it fits.

    `table` is a table, or a table with the name of its callback group: `{'reentrant': table}`. With
    `depth`, that of the subscription's KEEP_LAST queue, thin bars below show the messages while
    they wait, and a cross ends those that were pushed out. Draws into `ax`, or into a new figure.

    Raises TypeError or ValueError for a bad table.
    """
    [(group, table)] = table.items() if isinstance(table, Mapping) else [('', table)]
    table = check_table(table)
    bars = table[table.started_s.notna()].copy()
    # A callback that had not finished when the recording ended runs to the end of the picture.
    bars['finished_s'] = bars.finished_s.fillna(bars[['started_s', 'finished_s']].max().max())
    threads = sorted(bars.thread.unique(), key=thread_order)
    bars['lane'] = bars.thread.map({thread: lane for lane, thread in enumerate(threads)})

    ax = ax or new_axes()
    look = {'facecolor': HEARD, 'edgecolor': '#ffffffa0', 'lw': 0.8, 'label': group}
    ax.barh(bars.lane, bars.finished_s - bars.started_s, left=bars.started_s, height=0.72, **look)
    ax.set_yticks(range(len(threads)), threads)
    bottom = max(len(threads), 1) - 0.5
    waiting = ''
    if depth:
        bottom, waiting = _draw_waiting(ax, table, depth, bottom)
    ax.set_ylim(bottom, -0.5)  # the first thread on top
    # Axes that share their time show the longest run of all.
    last_s = max(one.dataLim.x1 for one in ax.get_shared_x_axes().get_siblings(ax))
    ax.set_xlim(0, 1.02 * last_s if math.isfinite(last_s) else 1)
    handles = [Patch(**look)] if group else None
    label_axes(ax, title, TIME_LABEL, 'thread', handles, grid='x')
    named = f' The hatching stands for: {group}.' if group else ''
    describe(
        ax,
        'One lane for each thread that ran a callback, one bar for each callback, with its '
        f'sequence number where it fits.{named} {_overlap_in_words(bars)}{waiting}',
    )
    if bars.empty:
        say(ax, 'no callback was called')
    _label_bars(ax, bars)
    return ax


def _draw_waiting(ax: Axes, table: pd.DataFrame, depth: int, top: float) -> tuple[float, str]:
    """Draw the messages while they wait, below `top`: one thin lane a place in the queue.

    Returns the lower end of the lanes, and a description of them.
    """
    lost = table.started_s.isna()
    left_s = table.started_s.where(~lost, _pushed_out(table, depth)).fillna(table.published_s)
    lanes = top + 0.3 + 0.3 * np.arange(depth)
    free_s = np.full(depth, -np.inf)  # when the message before has left each place
    places = []
    for left in left_s:
        places.append(int(free_s.argmin()))
        free_s[places[-1]] = left
    look = {'facecolor': WAITING, 'edgecolor': 'none', 'height': 0.24}
    ax.barh(lanes[places], left_s - table.published_s, left=table.published_s, **look)
    if lost.any():
        crosses(ax, left_s[lost], lanes[places][lost], '', 0.4)
    names = [label.get_text() for label in ax.get_yticklabels()]
    ax.set_yticks([*ax.get_yticks(), lanes.mean()], [*names, 'waiting'])
    crossed = 'a cross ends those that were pushed out' if lost.any() else 'none is pushed out'
    return lanes[-1] + 0.3, f' Thin bars below: messages while they wait; {crossed}.'


def _label_bars(ax: Axes, bars: pd.DataFrame) -> None:
    """Write the sequence number on each bar that is wide enough for it."""
    ax.figure.draw_without_rendering()
    glow = [withStroke(linewidth=3, foreground=HEARD)]
    look = {'fontsize': SMALL, 'color': 'white', 'path_effects': glow}
    look |= {'ha': 'center', 'va': 'center'}
    for bar in bars.itertuples():
        left, right = bar.started_s, bar.finished_s
        text = ax.text((left + right) / 2, bar.lane, str(bar.seq), **look)
        (left, _), (right, _) = ax.transData.transform([(left, 0), (right, 0)])
        if text.get_window_extent().width > 0.95 * (right - left):
            text.remove()


def queue_length(table: pd.DataFrame, depth: int, ax: Axes | None = None) -> Axes:
    """Draw how many messages wait in the subscription's queue, KEEP_LAST with history `depth`.

    A message enters when it is published. It leaves when its callback starts, or when the
    `depth`-th newer message arrives: that one pushes it out, and a cross marks the loss. Therefore
    the length never exceeds `depth`. Draws into `ax`, or into a new figure.

    Raises TypeError or ValueError for a bad table.
    """
    table = check_table(table)
    entered, started = table.published_s.to_numpy(), table.started_s.to_numpy()
    pushed_out = _pushed_out(table, depth).to_numpy()
    # A message is taken a little before its callback starts, so a newer one may come in between.
    left = np.fmax(entered, np.fmin(started, pushed_out))
    left = left[~(np.isnan(started) & np.isnan(pushed_out))]  # the others still wait at the end
    lost_at = pushed_out[np.isnan(started) & ~np.isnan(pushed_out)]
    # What enters and leaves in the same nanosecond did not wait: add up before drawing.
    times, place = np.unique(np.round(np.concatenate([entered, left]), 9), return_inverse=True)
    change = np.concatenate([np.ones(len(entered)), -np.ones(len(left))])
    waiting = np.cumsum(np.bincount(place, weights=change))

    ax = ax or new_axes()
    (line,) = ax.step(times, waiting, where='post', color=WAITING, lw=2, label='messages waiting')
    ax.fill_between(times, waiting, step='post', color=WAITING, alpha=0.18, lw=0)
    limit = ax.axhline(depth, color=INK, ls='--', lw=1.8, label=f'depth {depth}')
    handles = [line, limit]
    if len(lost_at):
        label = f'pushed out: {len(lost_at)}'
        handles.append(crosses(ax, lost_at, np.full(len(lost_at), depth), label))
    ax.set_ylim(-0.04 * depth, 1.12 * depth)  # a line at zero must be seen, too
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    label_axes(ax, 'How full is the queue?', TIME_LABEL, 'messages waiting', handles)
    crossed = (
        'Crosses mark when a message was pushed out.' if len(lost_at) else 'None is pushed out.'
    )
    describe(
        ax,
        f'A line in steps: how many messages wait. It never goes above {depth}, the depth, which '
        f'is a dashed line. {crossed}',
    )
    return ax


def latency(table: pd.DataFrame, period_s: float) -> Axes:
    """Draw for each heard message the time from publishing to the start of its callback, in ms.

    A second axis on the right counts in periods of the publisher, `period_s` seconds. Crosses at
    the bottom are lost messages, which have no latency.

    Raises TypeError or ValueError for a bad table.
    """
    table = check_table(table)
    heard, lost = table[table.started_s.notna()], table[table.started_s.isna()]

    ax = new_axes()
    delay_ms = 1000 * (heard.started_s - heard.published_s)
    look = {'color': HEARD, 'ms': 7, 'lw': 1.5, 'label': f'received {len(heard)}'}
    handles = ax.plot(heard.published_s, delay_ms, 'o-', **look)
    highest = max(delay_ms.max(), 1.0) if len(heard) else 1.0
    if len(lost):
        below = np.full(len(lost), -0.05 * highest)
        label = f'{_unheard(table)} {len(lost)}'
        handles.append(crosses(ax, lost.published_s, below, label))
    ax.set_ylim(-0.09 * highest, 1.1 * highest)
    title = 'How long each message waited for its callback'
    below = 'time of publishing, since the first publish (s)'
    label_axes(ax, title, below, 'latency (ms)', handles)
    period_ms = 1000 * period_s
    there_and_back = (lambda ms: ms / period_ms, lambda periods: periods * period_ms)
    right = ax.secondary_yaxis('right', functions=there_and_back)
    right.set_ylabel('latency (periods)', fontsize=NORMAL)
    right.tick_params(labelsize=SMALL)
    right.spines['right'].set_visible(True)
    describe(
        ax,
        'One dot for each message that was received: how long it waited. The axis on the right '
        f'counts it in periods of the publisher. {_loss_in_words(table, "crosses at the bottom")}',
    )
    if heard.empty:
        say(ax, 'no message was received')
    return ax


def _loss(table: pd.DataFrame) -> str:
    lost = int(table.started_s.isna().sum())
    return f'{lost} of {len(table)} lost' if lost else 'none lost'


def _gaps_in_words(table: pd.DataFrame, depth: int) -> str:
    marks = (
        'a cross marks when one was pushed out, and a dotted line leads to the message that did '
        f'it, {depth} numbers later'
    )
    return (
        f'{len(table)} messages. A small dot marks when a message was published, a large dot the '
        f'start of its callback. {_loss_in_words(table, marks)}'
    )


def _loss_in_words(table: pd.DataFrame, marks: str) -> str:
    lost = table.started_s.isna()
    if not lost.any():
        return 'None was lost.'
    return f'{"None was received" if lost.all() else "Some were lost"}: {marks}.'


def _unheard(table: pd.DataFrame) -> str:
    """Name the messages without a callback. If none was heard, they may wait, or never come."""
    return 'lost' if table.started_s.notna().any() else 'not received'


def _overlap_in_words(bars: pd.DataFrame) -> str:
    """Say whether two bars ever overlap: one begins before an earlier one has ended."""
    bars = bars.sort_values('started_s')
    overlap = (bars.started_s.iloc[1:].to_numpy() < bars.finished_s.cummax().iloc[:-1]).any()
    return 'Some callbacks overlap.' if overlap else 'No two callbacks overlap.'
