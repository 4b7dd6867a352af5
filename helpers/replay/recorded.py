"""What the replays of recorded callbacks share: the setup of model.js, and its moves in order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from helpers.replay import KINDS, Run
from helpers.replay.events import ARRIVE, END, TAKE

DEPTH = 10  # of services and clients, by default; a timer's tick is taken when it is recorded
GO = 'go'
SAME_TIME = [ARRIVE, TAKE, GO, END]


class Callback(NamedTuple):
    """A callback as model.js needs it: `word` names what waits for it, `does` are its steps.

    `group` is the same for all callbacks of one group, None for one that is in no group.
    """

    name: str
    word: str
    group: object
    exclusive: bool
    does: list[dict]


class Move(NamedTuple):
    """A move of model.js at a time in seconds: of a callback.

    `number` is that of a message that arrives, else the place of the thread.
    """

    at_s: float
    do: str
    callback: int
    number: int


def run_of(
    threads: list[str], callbacks: Sequence[Callback], moves: Iterable[Move], time_label: str
) -> Run:
    """Return recorded callbacks as a run, which has no summary yet."""
    members: dict[object, list[Callback]] = {}
    for one in callbacks:
        members.setdefault(one.group, []).append(one)
    groups = list(members)
    setup = {
        'threads': threads,
        'groups': [
            {
                'name': 'no group'
                if group is None
                else f'the group of {" and ".join(one.name for one in own)}',
                'exclusive': own[0].exclusive,
            }
            for group, own in members.items()
        ],
        'callbacks': [
            one._asdict() | {'group': groups.index(one.group), 'depth': DEPTH} for one in callbacks
        ],
    }
    ordered = sorted(moves, key=lambda move: (move.at_s, SAME_TIME.index(move.do)))
    in_short = [
        [round(1e6 * at_s), KINDS.index(do), callback, number]
        for at_s, do, callback, number in ordered
    ]
    return Run('', '', False, setup, in_short, time_label)


def count_of(threads: int) -> str:
    """Return the number of threads as a summary begins."""
    return 'One thread.' if threads == 1 else f'{threads} threads.'
