"""A replay of runs: how a cell shows it, and that of one subscription."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING
from urllib.parse import quote

from helpers.notebook import check_count, shown
from helpers.recording import check_table, thread_order
from helpers.replay.events import ARRIVE, END, TAKE, events
from helpers.replay.script import attribute, javascript, script, style

if TYPE_CHECKING:
    import pandas as pd

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
    opens: str = 'last loss'  # else at its end

    @property
    def scripts(self) -> tuple[str, ...]:
        """The files that view.js needs for it."""
        return ('walk.js', 'board.js', *(['ring.js'] if self.asks else []))

    @property
    def styles(self) -> tuple[str, ...]:
        return ('ring.css',) if self.asks else ()

    @property
    def asks(self) -> bool:
        """Whether a callback waits for an answer: only then somebody may wait for ever."""
        does = (step for callback in self.setup['callbacks'] for step in callback.get('does', ()))
        return any('client' in step for step in does)

    @property
    def span_s(self) -> tuple[float, float]:
        """From when to when it is shown: to a little after its last event, at least `after_s`."""
        end = self.moves[-1][0] / 1e6
        return 0.0, end + (max(0.02 * end, self.after_s) or 1.0)

    @property
    def words(self) -> str:
        return self.summary + ROWS_IN_WORDS + (CROSSES_IN_WORDS if self.lost else '')

    def record(self) -> dict:
        return {name: getattr(self, name) for name in ('name', 'setup', 'moves')}


@dataclass(frozen=True)
class Replay:
    """One run, or several beside each other, stepped together. The last line of a cell shows it.

    A run may be of another kind, as the drive of a robot: without a setup, but with a `picture()`.
    """

    runs: tuple[Run, ...]

    def __str__(self) -> str:
        """Return what is true each time: nbval compares it."""
        if any(run.name for run in self.runs):
            return ' '.join(f'{run.name}: {run.summary}' for run in self.runs)
        return f'Replay: {" ".join(run.summary for run in self.runs)}'

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        starts, ends = zip(*(run.span_s for run in self.runs), strict=True)
        span_s = min(starts), max(ends)  # pictures beside each other share their time
        # Below a lane a script draws the time axis: a picture of its queue would say it again.
        in_lane = any(getattr(run, 'as_lane', False) for run in self.runs)
        drawn_runs = [run for run in self.runs if not (in_lane and run.setup)]
        of_queues = [run for run in drawn_runs if run.setup]
        asked = [{**run.record(), 'time': run.time_label} for run in of_queues]
        at_s = max((run.telling_s for run in self.runs if not run.setup), default=None)
        drawn = iter(javascript('pictures', asked, span_s, at_s))
        figures = ''.join(
            figure(run, next(drawn) if run.setup else run.picture()) for run in drawn_runs
        )
        # Each file once, those of the queues first.
        ordered = sorted(self.runs, key=lambda run: not run.setup)
        scripts = [file for run in ordered for file in run.scripts]
        styles = dict.fromkeys(file for run in ordered for file in run.styles)
        opens = {'opens': 'end'} if any(run.opens == 'end' for run in self.runs) else {}
        record = {'span': span_s, **opens, 'runs': [run.record() for run in self.runs]}
        html = (
            f'<div class="replay" data-record={attribute(record)}>'
            f'{style(*styles)}<p>{escape(str(self))}</p>{figures}'
            f'<script>{script(*scripts, "view.js")}</script></div>'
        )
        return {'text/plain': str(self), 'text/html': html}


def figure(run: Run, svg: str) -> str:
    """Return the picture of a run with words for it, below the name of one of several runs."""
    return picture_of(svg, f'{run.name}: {run.words}' if run.name else run.words, run.name)


def picture_of(svg: str, words: str, name: str = '') -> str:
    """Return an SVG as an image of a page, with words for it, below a name."""
    caption = f'<figcaption>{escape(name)}</figcaption>' if name else ''
    # As an address, percent signs are shorter than base64.
    address = f'data:image/svg+xml,{quote(svg.replace(chr(34), chr(39)), safe=SAFE)}'
    return f'<figure>{caption}<img alt="{escape(words)}" src="{address}"></figure>'


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
    names = fill_up(set(heard['thread'].dropna()), threads) if len(heard) else []
    if len(table) > MAX_MESSAGES:
        raise ValueError(
            f'{len(table):,} messages are too many to step through: at most {MAX_MESSAGES:,}.'
        )
    steps = events(table, depth, threads if group == REENTRANT else 1)
    setup = {
        'threads': names,
        'groups': [{'name': 'the group', 'exclusive': group == EXCLUSIVE}],
        'callbacks': [{'name': 'subscription', 'group': 0, 'depth': depth}],
    }
    moves = [
        [round(1e6 * at_s), KINDS.index(do), 0, seq if do == ARRIVE else names.index(thread)]
        for at_s, do, seq, thread in steps
    ]
    unheard = table['started_s'].isna()
    # Those behind the last one that was heard may still wait in the queue.
    waiting = min(depth, int(unheard[::-1].cummin().sum()))
    lost = int(unheard.sum()) > waiting
    workers = 'one thread' if names else 'no executor'
    if len(names) > 1:
        workers = f'{len(names)} threads, a {group} group'
    end = 'Some were lost' if lost else 'None was lost'
    if not any(event.do == TAKE for event in steps):
        end = 'None was received'
    summary = f'{len(table)} messages, depth {depth}, {workers}. {end}.'
    return Replay((Run('', summary, lost, setup, moves),))


def side_by_side(runs: Mapping[str, Replay]) -> Replay:
    """Return several replays as one, stepped together in the order of time: `{'before': ...}`."""
    return Replay(
        tuple(replace(run, name=name) for name, replay in runs.items() for run in replay.runs)
    )


def fill_up(seen: set[str], threads: int) -> list[str]:
    """Return the names of threads in their order, with more names until there are `threads`.

    Raises ValueError if there are more.
    """
    if len(seen) > threads:
        raise ValueError(f'Callbacks ran in {len(seen)} threads, more than threads={threads}.')
    more = (f'thread {number}' for number in range(1, 2 * threads + 1))
    free = [name for name in more if name not in seen]
    return sorted([*seen, *free[: threads - len(seen)]], key=thread_order)
