"""What the replays of recorded callbacks share: the setup of model.js, and its moves in order."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field

from helpers.replay import KINDS, Run
from helpers.replay.events import ARRIVE, END, TAKE

DEPTH = 10  # of services and clients, by default; a timer's tick is taken when it is recorded
GO, RESUME = 'go', 'resume'
SAME_TIME = [ARRIVE, TAKE, GO, RESUME, END]


@dataclass(frozen=True)
class Callback:
    """A callback as model.js needs it: `word` names what waits for it, `does` are its steps.

    `group` is the same for all callbacks of one group, None for one that is in no group.
    """

    name: str
    word: str
    group: Hashable | None
    exclusive: bool
    does: list[dict] = field(default_factory=list)


@dataclass(frozen=True)
class Move:
    """A move of model.js at a time in seconds: of a callback, on a thread.

    `number` is that of a message that arrives, else the place of the thread. `run` names the run
    of the callback, if a later move may resume it.
    """

    at_s: float
    do: str
    callback: int
    number: int
    run: tuple[str, int] | None = None


def run_of(
    threads: list[str],
    callbacks: Sequence[Callback],
    moves: Iterable[Move],
    time_label: str,
) -> Run:
    """Return recorded callbacks as a run, which has no summary yet."""
    members: dict[Hashable | None, list[Callback]] = {}
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
            {
                'name': one.name,
                'word': one.word,
                'group': groups.index(one.group),
                'depth': DEPTH,
                'does': one.does,
            }
            for one in callbacks
        ],
    }
    return Run('', '', False, setup, _in_order(moves), time_label)


def _in_order(moves: Iterable[Move]) -> list[list[int]]:
    """Return the moves as walk.js reads them. It names a run that is resumed by its number."""
    moves = sorted(moves, key=lambda move: (move.at_s, SAME_TIME.index(move.do)))
    runs = [move.run for move in moves if move.do == TAKE]
    return [
        [
            round(1e6 * move.at_s),
            KINDS.index(move.do),
            runs.index(move.run) if move.do == RESUME else move.callback,
            move.number,
        ]
        for move in moves
    ]


def count_of(threads: int) -> str:
    """Return the number of threads as a summary begins."""
    return 'One thread.' if threads == 1 else f'{threads} threads.'
