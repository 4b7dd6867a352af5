"""Step through a run, recorded or predicted: what waits, what runs, what is lost, and why.

A replay is an output of a cell: a sentence and a picture, and a script that makes them something to
step through. The script asks for nothing, neither a kernel nor the network. Where a page does not
run it, as in a notebook that JupyterLab does not trust yet, the picture stays.

model.js decides what may happen, view.js shows it.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from itertools import chain

import pandas as pd

from helpers.queue_model import check_count
from helpers.recording import check_table
from helpers.replay.events import ARRIVE, END, TAKE, Event, events
from helpers.replay.picture import LEFT, NARROW, RIGHT, WIDTH, address, picture
from helpers.replay.script import attribute, script, source
from helpers.values import shown

SCRIPT = 'model.js', 'walk.js', 'element.js', 'view.js'
EXCLUSIVE, REENTRANT = 'mutually exclusive', 'reentrant'
MOST_MESSAGES = 10_000
ROWS_IN_WORDS = (
    'One row for each message: a line while it waits, with a colour for the reason, and a bar '
    'while its callback runs.'
)
CROSSES_IN_WORDS = (
    ' A cross is where it was pushed out, and a dotted line leads to the message that did it.'
)


@dataclass(frozen=True)
class Run:
    """A run as it is replayed. `first` is how many events come before the part that is shown."""

    name: str
    messages: int
    lost: bool
    setup: dict
    events: list[Event]
    first: int = 0

    @property
    def summary(self) -> str:
        """What is true of the run each time that it is made."""
        callbacks, groups, threads = (self.setup[k] for k in ('callbacks', 'groups', 'threads'))
        count = len(threads)
        said = f'{count} threads' if count > 1 else 'one thread' if count else 'no executor'
        if count > 1:
            said += f', a {groups[0]["name"]} group'
        lost = 'Some were lost' if self.lost else 'None was lost'
        if not any(event.do == TAKE for event in self.events):
            lost = 'None was heard'
        return f'{self.messages} messages, depth {callbacks[0]["depth"]}, {said}. {lost}.'

    @property
    def span_s(self) -> tuple[float, float]:
        """From when to when it is shown: to a little after its last event."""
        start = self.events[self.first].at_s if self.first else 0.0
        end = self.events[-1].at_s
        return start, end + (0.02 * (end - start) or 1.0)

    def picture(self, span_s: tuple[float, float], width: int = WIDTH) -> str:
        """Return the run as an SVG, in a span of seconds and `width` pixels wide."""
        group, threads = self.setup['groups'][0], self.setup['threads']
        depth = self.setup['callbacks'][0]['depth']
        return picture(self.events, depth, len(threads), group['exclusive'], span_s, width)

    def record(self) -> dict:
        """Return what the script needs: the setup, and the moves of model.js in short."""
        place = {name: index for index, name in enumerate(self.setup['threads'])}
        kinds = (ARRIVE, TAKE, END)
        moves = [
            [
                round(1e6 * e.at_s),
                kinds.index(e.do),
                0,
                e.seq if e.do == ARRIVE else place[e.thread],
            ]
            for e in self.events
        ]
        return {
            'name': self.name,
            'setup': self.setup,
            'moves': moves,
            'first': self.first,
        }


@dataclass(frozen=True)
class Replay:
    """One run, or several beside each other, stepped together. The last line of a cell shows it."""

    runs: tuple[Run, ...]

    def __str__(self) -> str:
        """Return what is true each time: nbval compares it."""
        return ' '.join(
            f'{run.name}: {run.summary}' if run.name else f'Replay: {run.summary}'
            for run in self.runs
        )

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        width = WIDTH if len(self.runs) == 1 else NARROW
        starts, ends = zip(*(run.span_s for run in self.runs), strict=True)
        span_s = min(starts), max(ends)  # pictures beside each other share their time
        figures = ''.join(
            f'<figure><img alt="{escape(_alternative(run))}" '
            f'src="{address(run.picture(span_s, width))}"></figure>'
            for run in self.runs
        )
        record = {
            'span': span_s,
            'plot': [round(LEFT / width, 4), round(1 - RIGHT / width, 4)],
            'runs': [run.record() for run in self.runs],
        }
        html = (
            f'<div class="replay" data-record={attribute(record)}>'
            f'<style>{source("style.css")}</style><p>{escape(str(self))}</p>{figures}'
            f'<script>{script(*SCRIPT)}</script></div>'
        )
        return {'text/plain': str(self), 'text/html': html}


def replay(
    table: pd.DataFrame,
    depth: int,
    threads: int = 1,
    group: str = EXCLUSIVE,
    *,
    name: str = '',
    part: tuple[int, int] | None = None,
) -> Replay:
    """Return a run to step through. `table` is one of `Recording.table` or of `predict`.

    `depth` is that of the subscription's KEEP_LAST queue, `threads` how many the executor has, and
    `group` is 'mutually exclusive' or 'reentrant'. Where no callback ran at all, it is shown that
    no executor took a message. `part` shows only the messages with numbers from `part[0]` to
    `part[1]`, and those that are still there when they come.

    Raises TypeError or ValueError, with one sentence: for a table that is none, or that no such
    queue can have made, and for more than 10,000 messages at once.
    """
    table = check_table(table)
    check_count('depth', depth)
    check_count('threads', threads)
    if group not in (EXCLUSIVE, REENTRANT):
        raise ValueError(f'group must be {EXCLUSIVE!r} or {REENTRANT!r}, not {shown(group)}.')
    heard = table[table['started_s'].notna()]
    names = sorted(heard['thread'].dropna().unique(), key=_natural)
    if len(names) > threads:
        raise ValueError(f'Callbacks ran in {len(names)} threads, more than threads={threads}.')
    more = (f'thread {number}' for number in range(1, 2 * threads + 1))
    while len(names) < threads and len(heard):
        names += [found] if (found := next(more)) not in names else []
    made = events(table, depth, threads if group == REENTRANT else 1)
    first = 0
    if part is not None:
        made, first = _part_of(made, depth, part)
    shown_here = table['seq'].between(*part) if part else table['seq'].notna()
    if not shown_here.any():
        raise ValueError(f'There is no message from {part[0]} to {part[1]}.')
    if shown_here.sum() > MOST_MESSAGES:
        raise ValueError(
            f'{shown_here.sum():,} messages are too many to step through. Ask for a part of '
            f'{MOST_MESSAGES:,} at most: part=(0, {MOST_MESSAGES - 1}).'
        )
    setup = {
        'threads': sorted(names, key=_natural),
        'groups': [{'name': group, 'exclusive': group == EXCLUSIVE}],
        'callbacks': [{'name': 'subscription', 'group': 0, 'depth': depth}],
    }
    lost = bool(table.loc[shown_here, 'started_s'].isna().any())
    return Replay((Run(name, int(shown_here.sum()), lost, setup, made, first),))


def side_by_side(runs: Mapping[str, Replay]) -> Replay:
    """Return several replays as one, stepped together in the order of time: `{'before': ...}`."""
    return Replay(tuple(replace(run, name=name) for name, one in runs.items() for run in one.runs))


def _part_of(made: list[Event], depth: int, bounds: tuple[int, int]) -> tuple[list[Event], int]:
    """Return the events of a part, after those that lead to its start, and how many those are."""
    least, most = bounds
    waiting, running = deque(), {}
    before: list[Event] = []
    begun = False
    found = []
    for event in made:
        if not begun and event.do == ARRIVE and least <= event.seq <= most:
            begun = True
            before = sorted([*chain(*running.values()), *waiting])
        if begun:
            found.append(event)
        if event.do == ARRIVE:
            waiting.append(event)
            if len(waiting) > depth:
                waiting.popleft()
        elif event.do == TAKE:
            running[event.seq] = waiting.popleft(), event
        else:
            del running[event.seq]
        left = not any(e.seq <= most for e in waiting) and not any(s <= most for s in running)
        if begun and event.seq >= most and left:
            break
    return before + found, len(before)


def _alternative(run: Run) -> str:
    name = f'{run.name}: ' if run.name else ''
    return f'{name}{run.summary} {ROWS_IN_WORDS}{CROSSES_IN_WORDS if run.lost else ""}'


def _natural(name: str) -> list:
    """Sort key that puts 'thread 2' before 'thread 10'."""
    return [int(part) if part.isdecimal() else part for part in re.split(r'(\d+)', name)]
