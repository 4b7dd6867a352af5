"""Step through the run of an action: its requests, its job, and for what a cancel waits."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from helpers.notebook import check_count
from helpers.recording import CallbackRecording
from helpers.replay.recorded import GO, Callback, Move, count_of, moves_of, run_of
from helpers.replay.replays import Replay

REQUESTS = {'goal': 'send_goal', 'cancel': 'cancel_goal'}  # in `Waitable.execute`, and the service
SAYS = 'publish_feedback', 'succeed', 'canceled', 'abort'  # methods of a goal handle
TIME_LABEL = 'time since the goal was taken (s)'


class ActionRecording(CallbackRecording):
    """Records an action server, and services of its node, from now on.

    `execute_callback` is the server's, and a plain function. The names of the runs are
    'execute_callback', the names of the services, and 'send_goal' and 'cancel_goal' for the
    requests of these two services of the action: while one runs, the server holds its group.
    """

    def __init__(self, server, execute_callback: Callable, **services) -> None:
        super().__init__(**services)
        self.said: list[tuple[float, str]] = []  # what the job called, of SAYS, and when (seconds)
        # An execute callback is a task: in no group.
        self.group_of = {'send_goal': server.callback_group, 'execute_callback': None}
        self.group_of |= {'cancel_goal': server.callback_group}
        self.group_of |= {name: service.callback_group for name, service in services.items()}
        job, execute = self.watch('execute_callback', execute_callback), server.execute
        requests = {kind: self.watch(name, execute) for kind, name in REQUESTS.items()}

        def recorded_job(goal_handle):
            for name in SAYS:
                setattr(goal_handle, name, self._noted(getattr(goal_handle, name)))
            return job(goal_handle)

        @functools.wraps(execute)
        async def recorded_execute(taken: dict) -> None:
            kind = next(filter(requests.get, taken), None)
            await requests.get(kind, execute)(taken)

        server.register_execute_callback(recorded_job)
        server.execute = recorded_execute

    def _noted(self, method: Callable) -> Callable:
        @functools.wraps(method)
        def noted(*arguments):
            self.said.append((time.monotonic(), method.__name__))
            return method(*arguments)

        return noted


def replay_action(recording: ActionRecording, threads: int, cancelled_s: float) -> Replay:
    """Return the run of one goal that was cancelled, to step through. Call it when all has ended.

    `threads` is how many the executor of the server's node has, `cancelled_s` when the cancel was
    sent, on the clock of `time.monotonic`.

    Raises ValueError, with one sentence, unless one job and one cancel have run.
    """
    check_count('threads', threads)
    runs = recording.runs
    if any(len(runs[name]) != 1 for name in ('execute_callback', 'cancel_goal')):
        raise ValueError('A replay shows one job and its cancel: record the run of one goal.')
    late = runs['cancel_goal'][0].started_s > runs['execute_callback'][0].finished_s
    taken = 'is taken when the job has ended' if late else 'is taken while the job runs'
    does = {
        'execute_callback': [{'says': f'calls {said}'} for _, said in recording.said],
        'cancel_goal': [{'says': taken}],
    }
    callbacks = [
        Callback(
            name, 'job' if name == 'execute_callback' else 'request', group, does.get(name, [])
        )
        for name, group in recording.group_of.items()
    ]
    run = run_of(recording, threads, callbacks, _moves(recording, cancelled_s), TIME_LABEL)
    return Replay((replace(run, summary=f'{count_of(threads)} The cancel {taken}.'),))


def _moves(recording: ActionRecording, cancelled_s: float) -> Iterator[Move]:
    """Yield the moves of model.js that make the recorded run."""
    goal_s = recording.runs['send_goal'][0].finished_s
    for callback, name in enumerate(recording.group_of):
        for seq, run in enumerate(recording.runs[name]):
            arrived_s, steps_s = run.started_s, []
            if name == 'execute_callback':  # the request for the goal has made it
                arrived_s = min(arrived_s, goal_s)
                steps_s = [at_s for at_s, _ in recording.said]
            elif name == 'cancel_goal':
                arrived_s, steps_s = cancelled_s, [run.started_s]
            yield from moves_of(run, callback, seq, arrived_s)
            for at_s in steps_s:
                yield Move(at_s, GO, callback, run.thread)
