"""Step through calls of services: which recorded callbacks wait for which."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import replace

from helpers.notebook import check_count
from helpers.recording import Call, CallbackRecording
from helpers.replay.recorded import GO, Callback, Move, count_of, moves_of, run_of
from helpers.replay.replays import Replay
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
    if not any(recording.runs.values()):
        raise ValueError('No callback has run yet: there is nothing to step through.')
    callbacks = [
        Callback(
            name,
            WORDS.get(type(thing).__name__, 'message'),
            thing.callback_group,
            _steps(recording, name),
        )
        for name, thing in recording.watched.items()
    ]
    run = run_of(recording, threads, callbacks, _moves(recording), TIME_LABEL)
    stuck = javascript('circleAtEnd', run.record())
    summary = f'{count_of(threads)} {stuck or "Nobody waits for ever."}'
    return Replay((replace(run, summary=summary, after_s=HANGS_S if stuck else 0.0),))


def _steps(recording: CallbackRecording, name: str) -> list[dict]:
    """Return what each run of a callback does, besides its work, as model.js reads it."""
    if inspect.iscoroutinefunction(getattr(recording.watched[name], 'callback', None)):
        raise ValueError(f'{name} is a coroutine: a replay shows callbacks that wait in call().')
    index = list(recording.watched).index
    seen = []
    for run in recording.runs[name]:
        own = [call for call in recording.calls if call.caller is run]
        if not all(call.service for call in own):
            raise ValueError(f'{name} asks a service that is not recorded: watch it, too.')
        if not run.running and not all(map(recording.answer, own)):
            raise ValueError(
                f'{name} ended without its answer: a replay shows calls that wait until it comes.'
            )
        seen.append([{'call': index(call.service), 'client': index(call.client)} for call in own])
    if any(steps != seen[0] for steps in seen):
        raise ValueError(f'The runs of {name} called differently: record one run of it.')
    return seen[0] if seen else []


def _moves(recording: CallbackRecording) -> Iterator[Move]:
    """Yield the moves of model.js that make the recorded run."""
    runs = recording.runs
    calls: list[Call] = [call for call in recording.calls if call.caller]
    # In the model, requests and answers of known callers come by themselves.
    asked = {recording.answer(call) for call in calls}
    for call in calls:
        later = (run for run in runs[call.service] if run.started_s >= call.sent_s)
        asked.add(next((run for run in later if run not in asked), None))
        callback = next(i for i, own in enumerate(runs.values()) if call.caller in own)
        yield Move(call.sent_s, GO, callback, call.caller.thread)
    for callback, own in enumerate(runs.values()):
        for seq, run in enumerate(own):
            yield from moves_of(run, callback, seq, None if run in asked else run.started_s)
