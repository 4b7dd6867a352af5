"""Step through a run, recorded or predicted: what waits, what runs, what is lost, and why.

A replay is an output of a cell: a sentence and a picture, and a script that makes them something to
step through. The script needs neither a kernel nor the network. If a page does not run it, as in
a notebook that JupyterLab does not trust yet, the picture stays. It opens where it tells most: at
the bump of a drive or its end, else at the last loss, else at the end. In a level the learner is
the executor, and free play draws the prediction of any numbers.

model.js decides what may happen, view.js shows it.
"""

from helpers.replay.actions import ActionRecording, replay_action
from helpers.replay.calls import replay_calls
from helpers.replay.free import FreePlay
from helpers.replay.levels import level
from helpers.replay.replays import Replay, picture_of, replay, side_by_side
from helpers.replay.script import attribute, javascript, script, source, style

__all__ = [
    'ActionRecording',
    'FreePlay',
    'Replay',
    'attribute',
    'javascript',
    'level',
    'picture_of',
    'replay',
    'replay_action',
    'replay_calls',
    'script',
    'side_by_side',
    'source',
    'style',
]
