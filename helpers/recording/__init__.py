"""Records of what callbacks did, and the model of a queue that explains them."""

from helpers.recording.queue_model import explain, predict, take_bounds
from helpers.recording.recording import (
    Call,
    CallbackRecording,
    CallbackRun,
    Recording,
    most_at_once,
)

__all__ = [
    'Call',
    'CallbackRecording',
    'CallbackRun',
    'Recording',
    'explain',
    'most_at_once',
    'predict',
    'take_bounds',
]
