"""Step through a run, recorded or predicted: what waits, what runs, what is lost, and why.

A replay is an output of a cell: a sentence and a picture, and a script that makes them something to
step through. The script needs neither a kernel nor the network. If a page does not run it, as in
a notebook that JupyterLab does not trust yet, the picture stays.

model.js decides what may happen, view.js shows it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from urllib.parse import quote

import pandas as pd

from helpers.notebook.values import check_count, check_table, natural, shown
from helpers.replay.events import ARRIVE, END, TAKE, events
from helpers.replay.script import attribute, javascript, script, style

KINDS = ARRIVE, TAKE, END, 'go'  # as walk.js numbers them
EXCLUSIVE, REENTRANT = 'mutually exclusive', 'reentrant'
MAX_MESSAGES = 10_000
SAFE = "!$'()*+,-./:;=?@_~ "  # may stand in the address of an image, in double quotes
ROWS_IN_WORDS = (
    ' One row for each message: a line while it waits, with dashes for the reason, and a bar '
    'while its callback runs.'
)
CROSSES_IN_WORDS = (
    ' A cross is where it was pushed out, and a dotted line leads to the message that did it.'
)


@dataclass(frozen=True)
class Run:
    """A run as it is replayed.

    `summary` is what is true of the run each time that it is made. A move is [microseconds, its
    kind, two numbers], as walk.js reads it.
    """

    name: str
    summary: str
    lost: bool
    setup: dict
    moves: list[list[int]]
    time_label: str = 'time since the first publish (s)'
    after_s: float = 0.0

    @property
    def span_s(self) -> tuple[float, float]:
        """From when to when it is shown: to a little after its last event, at least `after_s`."""
        end = self.moves[-1][0] / 1e6
        return 0.0, end + (max(0.02 * end, self.after_s) or 1.0)

    @property
    def words(self) -> str:
        """What its picture shows, for everybody who does not see it."""
        return self.summary + ROWS_IN_WORDS + (CROSSES_IN_WORDS if self.lost else '')

    def record(self) -> dict:
        """Return what the script needs."""
        return {name: getattr(self, name) for name in ('name', 'setup', 'moves')}


@dataclass(frozen=True)
class Replay:
    """One run, or several beside each other, stepped together. The last line of a cell shows it."""

    runs: tuple[Run, ...]

    def __str__(self) -> str:
        """Return what is true each time: nbval compares it."""
        if any(run.name for run in self.runs):
            return ' '.join(f'{run.name}: {run.summary}' for run in self.runs)
        return f'Replay: {" ".join(run.summary for run in self.runs)}'

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        starts, ends = zip(*(run.span_s for run in self.runs), strict=True)
        span_s = min(starts), max(ends)  # pictures beside each other share their time
        of_queues = [run for run in self.runs if run.setup]  # the others are drives of a robot
        asked = [{**run.record(), 'time': run.time_label} for run in of_queues]
        drawn = iter(javascript('pictures', asked, span_s))
        figures = ''.join(
            figure(run, next(drawn) if run.setup else run.picture()) for run in self.runs
        )
        drives = len(of_queues) < len(self.runs)
        callbacks = [one for run in of_queues for one in run.setup['callbacks']]
        names = ('model.js', 'walk.js', 'board.js') if of_queues else ()
        names += ('circle.js',) if any('does' in one for one in callbacks) else ()
        names += ('drive.js',) if drives else ()
        record = {'span': span_s, 'runs': [run.record() for run in self.runs]}
        html = (
            f'<div class="replay" data-record={attribute(record)}>'
            f'{style("drive.css") if drives else style()}<p>{escape(str(self))}</p>{figures}'
            f'<script>{script(*names, "element.js", "view.js")}</script></div>'
        )
        return {'text/plain': str(self), 'text/html': html}


def figure(run: Run, svg: str) -> str:
    """Return the picture of a run with words for it, below the name of one of several runs."""
    caption = f'<figcaption>{escape(run.name)}</figcaption>' if run.name else ''
    words = escape(f'{run.name}: {run.words}' if run.name else run.words)
    # As an address, percent signs are shorter than base64.
    address = f'data:image/svg+xml,{quote(svg.replace(chr(34), chr(39)), safe=SAFE)}'
    return f'<figure>{caption}<img alt="{words}" src="{address}"></figure>'


def replay(
    table: pd.DataFrame,
    depth: int,
    threads: int = 1,
    group: str = EXCLUSIVE,
) -> Replay:
    """Return a run to step through. `table` is one of `Recording.table` or of `predict`.

    `depth` is that of the subscription's KEEP_LAST queue, `threads` how many the executor has, and
    `group` is 'mutually exclusive' or 'reentrant'. If no callback ran at all, the replay shows
    that no executor took a message.

    Raises TypeError or ValueError, with one sentence: for a table that is none, or that no such
    queue can have made, and for more than 10,000 messages.
    """
    table = check_table(table)
    check_count('depth', depth)
    check_count('threads', threads)
    if group not in (EXCLUSIVE, REENTRANT):
        raise ValueError(f'group must be {EXCLUSIVE!r} or {REENTRANT!r}, not {shown(group)}.')
    heard = table[table['started_s'].notna()]
    found = set(heard['thread'].dropna())
    names = fill_up(found, threads) if len(heard) else []
    if len(table) > MAX_MESSAGES:
        raise ValueError(
            f'{len(table):,} messages are too many to step through: at most {MAX_MESSAGES:,}.'
        )
    made = events(table, depth, threads if group == REENTRANT else 1)
    setup = {
        'threads': names,
        'groups': [{'name': 'the group', 'exclusive': group == EXCLUSIVE}],
        'callbacks': [{'name': 'subscription', 'group': 0, 'depth': depth}],
    }
    moves = [
        [round(1e6 * at_s), KINDS.index(do), 0, seq if do == ARRIVE else names.index(thread)]
        for at_s, do, seq, thread in made
    ]
    unheard = table['started_s'].isna()
    # Those behind the last one that was heard may still wait in the queue.
    waiting = min(depth, int(unheard[::-1].cummin().sum()))
    lost = int(unheard.sum()) > waiting
    said = f'{len(names)} threads' if len(names) > 1 else 'one thread' if names else 'no executor'
    if len(names) > 1:
        said += f', a {group} group'
    end = 'Some were lost' if lost else 'None was lost'
    if not any(event.do == TAKE for event in made):
        end = 'None was heard'
    summary = f'{len(table)} messages, depth {depth}, {said}. {end}.'
    return Replay((Run('', summary, lost, setup, moves),))


def side_by_side(runs: Mapping[str, Replay]) -> Replay:
    """Return several replays as one, stepped together in the order of time: `{'before': ...}`."""
    return Replay(tuple(replace(run, name=name) for name, one in runs.items() for run in one.runs))


def fill_up(found: set[str], threads: int) -> list[str]:
    """Return the names of threads in their order, with more names until there are `threads`.

    Raises ValueError if there are more.
    """
    if len(found) > threads:
        raise ValueError(f'Callbacks ran in {len(found)} threads, more than threads={threads}.')
    more = (f'thread {number}' for number in range(1, 2 * threads + 1))
    free = [name for name in more if name not in found]
    return sorted([*found, *free[: threads - len(found)]], key=natural)
