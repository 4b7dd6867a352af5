"""Step through calls of services: which recorded callbacks wait for which."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pandas as pd

from helpers._plumbing.values import check_count
from helpers.recording import CallbackRecording
from helpers.replay import Replay, fill_up
from helpers.replay.events import ARRIVE, END, TAKE
from helpers.replay.recorded import GO, Callback, Move, count_of, run_of
from helpers.replay.script import javascript

WORDS = {'Timer': 'tick', 'Service': 'request', 'Client': 'answer'}
TIME_LABEL = 'time since the first callback (s)'
HANGS_S = 0.1  # so much is shown of a wait that never ends


def replay_calls(recording: CallbackRecording, threads: int = 1) -> Replay:
    """Return what a recording has seen until now, to step through.

    `threads` is how many the executor of all its callbacks has. The recording must watch timers,
    subscriptions, services, clients: each with its own callback group. Call it while a callback
    hangs, or when all have ended. It shows what waits in `Client.call`.

    Raises ValueError, with one sentence, if nothing ran, if a callback is a coroutine, if a call
    gave up without an answer, or if the runs of one callback called differently.
    """
    check_count('threads', threads)
    tables, calls, groups = recording.tables(), recording.calls(), recording.groups()
    found = {thread for table in tables.values() for thread in table['thread']}
    if not found:
        raise ValueError('No callback has run yet: there is nothing to step through.')
    thread_names = fill_up(found, threads)
    callbacks = [
        Callback(
            name,
            WORDS.get(row.kind, 'message'),
            row.group,
            row.exclusive,
            _steps(name, calls, tables, groups),
        )
        for name, row in groups.iterrows()
    ]
    moves = _moves(tables, calls, list(groups.index), thread_names)
    run = run_of(thread_names, callbacks, moves, TIME_LABEL)
    stuck = javascript('stuck', run.record())
    summary = ' '.join([count_of(threads), *(stuck or ['Nobody waits for ever.'])])
    return Replay((replace(run, summary=summary, after_s=HANGS_S if stuck else 0.0),))


def _steps(name: str, calls: pd.DataFrame, tables: dict, groups: pd.DataFrame) -> list[dict]:
    """Return what each run of a callback does, besides its work, as model.js reads it."""
    if groups.loc[name, 'coroutine']:
        raise ValueError(f'{name} is a coroutine: a replay shows callbacks that wait in call().')
    index = list(groups.index).index
    own = calls[calls['caller'] == name]
    if own['service'].isna().any():
        raise ValueError(f'{name} asks a service that is not recorded: watch it, too.')
    seen = [
        [
            {'call': index(call.service), 'client': index(call.client)}
            for call in own[own['run'] == run].itertuples()
        ]
        for run in tables[name]['seq']
    ]
    if any(steps != seen[0] for steps in seen):
        raise ValueError(f'The runs of {name} called differently: record one run of it.')
    for call in own[own['answered_s'].isna()].itertuples():
        if tables[name]['finished_s'].notna()[call.run]:
            raise ValueError(
                f'{name} ended without its answer: a replay shows calls that wait until it comes.'
            )
    return seen[0] if seen else []


def _moves(
    tables: dict, calls: pd.DataFrame, names: list[str], threads: list[str]
) -> Iterator[Move]:
    """Yield the moves of model.js that make the recorded run."""
    known = calls[calls['caller'].notna()]
    # In the model, requests and answers of known callers come by themselves.
    asked = {(call.client, call.answer) for call in known.itertuples()}
    for call in known.itertuples():
        runs = enumerate(tables[call.service]['started_s'])
        later = ((call.service, run) for run, at in runs if at >= call.sent_s)
        asked.add(next((run for run in later if run not in asked), None))
        thread = threads.index(tables[call.caller]['thread'][call.run])
        yield Move(call.sent_s, GO, names.index(call.caller), thread)
    for name, table in tables.items():
        callback = names.index(name)
        for run in table.itertuples():
            thread = threads.index(run.thread)
            if (name, run.seq) not in asked:
                yield Move(run.started_s, ARRIVE, callback, run.seq)
            yield Move(run.started_s, TAKE, callback, thread)
            if pd.notna(run.finished_s):
                yield Move(run.finished_s, END, callback, thread)
