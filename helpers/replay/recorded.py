"""What the replays of recorded callbacks share: the setup of model.js, and its moves in order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup

from helpers.recording import CallbackRecording, CallbackRun
from helpers.replay.events import ARRIVE, END, TAKE
from helpers.replay.replays import KINDS, Run, fill_up

DEPTH = 10  # of services and clients, by default; a timer's tick is taken when it is recorded
GO = 'go'
SAME_TIME = [ARRIVE, TAKE, GO, END]


class Callback(NamedTuple):
    """A callback as model.js needs it: `word` names what waits for it, `does` are its steps."""

    name: str
    word: str
    group: CallbackGroup | None
    does: list[dict]


class Move(NamedTuple):
    """A move of model.js: when (`time.monotonic`), which, and of which callback, by its place.

    `number` is that of a message that arrives, else the thread's ident.
    """

    at_s: float
    do: str
    callback: int
    number: int


def moves_of(
    run: CallbackRun, callback: int, seq: int, arrived_s: float | None = None
) -> Iterator[Move]:
    """Yield the moves that make a run. Without `arrived_s` its message comes by itself."""
    if arrived_s is not None:
        yield Move(arrived_s, ARRIVE, callback, seq)
    yield Move(run.started_s, TAKE, callback, run.thread)
    if not run.running:
        yield Move(run.finished_s, END, callback, run.thread)


def run_of(
    recording: CallbackRecording,
    threads: int,
    callbacks: Sequence[Callback],
    moves: Iterable[Move],
    time_label: str,
) -> Run:
    """Return recorded callbacks as a run, which has no summary yet."""
    zero, names_of_threads = recording.zero_and_threads()
    members: dict[CallbackGroup | None, list[str]] = {}
    for callback in callbacks:
        members.setdefault(callback.group, []).append(callback.name)
    groups = list(members)
    setup = {
        'threads': fill_up(set(names_of_threads.values()), threads),
        'groups': [
            {
                'name': f'the group of {" and ".join(names)}' if group else 'no group',
                'exclusive': isinstance(group, MutuallyExclusiveCallbackGroup),
            }
            for group, names in members.items()
        ],
        'callbacks': [
            callback._asdict() | {'group': groups.index(callback.group), 'depth': DEPTH}
            for callback in callbacks
        ],
    }
    place = {ident: setup['threads'].index(name) for ident, name in names_of_threads.items()}
    in_short = [
        [
            round(1e6 * (at_s - zero)),
            KINDS.index(do),
            callback,
            number if do == ARRIVE else place[number],
        ]
        for at_s, do, callback, number in sorted(
            moves, key=lambda move: (move.at_s, SAME_TIME.index(move.do))
        )
    ]
    return Run('', '', False, setup, in_short, time_label)


def count_of(threads: int) -> str:
    """Return the number of threads as a summary begins."""
    return 'One thread.' if threads == 1 else f'{threads} threads.'
