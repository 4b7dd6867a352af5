"""Step through calls of services: who waits for whom, from what was recorded."""

from __future__ import annotations

import pandas as pd

from helpers.queue_model import check_count
from helpers.recording import CallbackRecording
from helpers.replay import KINDS, Replay, Run, fill_up
from helpers.replay.events import ARRIVE, END, TAKE
from helpers.replay.model import stories
from helpers.replay.picture import MAX_ROWS

DEPTH = 10  # of services and clients, by default; a tick that is seen is taken
WORDS = {'Timer': 'tick', 'Service': 'request', 'Client': 'answer'}
TIME_LABEL = 'time since the first callback (s)'
HANGS_S = 0.1  # so much is shown of a wait that never ends
SAME_TIME = [ARRIVE, TAKE, 'go', 'resume', END]


def replay_calls(recording: CallbackRecording, threads: int = 1) -> Replay:
    """Return what a recording has seen until now, to step through.

    `threads` is how many the executor of all its callbacks has. The recording must watch timers,
    services, clients: each with its own callback group. Call it while a callback hangs, or when
    all have ended.

    Raises ValueError, with one sentence, where nothing ran, where a call gave up without an answer,
    and where the runs of one callback called differently.
    """
    check_count('threads', threads)
    tables, calls, groups = recording.tables(), recording.calls(), recording.groups()
    names = list(groups.index)
    found = {thread for table in tables.values() for thread in table['thread']}
    found |= set(calls['resumed_by'].dropna())
    if not found:
        raise ValueError('No callback has run yet: there is nothing to step through.')
    thread_names = fill_up(found, threads)
    group_names = list(dict.fromkeys(groups['group']))
    setup = {
        'threads': thread_names,
        'groups': [
            {
                'name': f'the group of {" and ".join(groups.index[groups["group"] == one])}',
                'exclusive': bool(groups.loc[one, 'exclusive']),
            }
            for one in group_names
        ],
        'callbacks': [
            {
                'name': one,
                'word': WORDS.get(groups.loc[one, 'kind'], 'message'),
                'group': group_names.index(groups.loc[one, 'group']),
                'depth': DEPTH,
                'does': _steps(one, calls, tables, groups),
            }
            for one in names
        ],
    }
    moves = _moves(tables, calls, names, thread_names)
    stuck = stories({'setup': setup, 'moves': moves}, MAX_ROWS)['stuck']
    summary = ' '.join(
        ['One thread.' if threads == 1 else f'{threads} threads.']
        + (stuck or ['Nobody waits for ever.'])
    )
    after_s = HANGS_S if stuck else 0.0
    return Replay((Run('', summary, False, setup, moves, TIME_LABEL, after_s),))


def _steps(name: str, calls: pd.DataFrame, tables: dict, groups: pd.DataFrame) -> list[dict] | None:
    """Return what each run of a callback does, besides its work, as model.js reads it."""
    if groups.loc[name, 'kind'] == 'Client':
        return []
    index = list(groups.index).index
    own = calls[calls['caller'] == name]
    if own['service'].isna().any():
        raise ValueError(f'{name} asks a service that is not recorded: watch it, too.')
    seen = [
        [
            {call.style: index(call.service), 'client': index(call.client)}
            for call in own[own['run'] == run].itertuples()
        ]
        for run in tables[name]['seq']
    ]
    if any(steps != seen[0] for steps in seen):
        raise ValueError(f'The runs of {name} called differently: record one run of it.')
    for call in own[own['answered_s'].isna() & (own['style'] != 'send')].itertuples():
        if tables[name]['finished_s'].notna()[call.run]:
            raise ValueError(
                f'{name} ended without its answer: a replay shows calls that wait until it comes.'
            )
    return seen[0] if seen else []


def _moves(tables: dict, calls: pd.DataFrame, names: list[str], threads: list[str]) -> list:
    """Return the moves of model.js that make the recorded run, in their order."""
    known = calls[calls['caller'].notna()]
    # Requests and answers of which it is known who asked: they come by themselves, in the model.
    asked = {(call.client, call.answer) for call in known.itertuples()}
    for call in known.itertuples():
        runs = enumerate(tables[call.service]['started_s'])
        later = ((call.service, run) for run, at in runs if at >= call.sent_s)
        asked.add(next((run for run in later if run not in asked), None))
    awaits = {
        (call.caller, call.run): call.resumed_by
        for call in known[known['style'] == 'await'].itertuples()
    }

    found = []
    for name, table in tables.items():
        callback = names.index(name)
        for run in table.itertuples():
            thread = threads.index(run.thread)
            key = name, run.seq
            if key not in asked:
                found.append((run.started_s, ARRIVE, callback, run.seq, key))
            found.append((run.started_s, TAKE, callback, thread, key))
            if run.finished_s == run.finished_s:
                if key in awaits:
                    thread = threads.index(awaits[key])
                    found.append((run.finished_s, 'resume', key, thread, key))
                found.append((run.finished_s, END, callback, thread, key))
    for call in known.itertuples():
        thread = threads.index(tables[call.caller]['thread'][call.run])
        found.append((call.sent_s, 'go', 0, thread, (call.caller, call.run)))
    found.sort(key=lambda move: (move[0], SAME_TIME.index(move[1])))
    order = [key for _, do, *_, key in found if do == TAKE]
    return [
        [round(1e6 * at_s), KINDS.index(do), order.index(key) if do == 'resume' else one, other]
        for at_s, do, one, other, key in found
    ]
