"""Records of what callbacks did, and the model of a queue that explains them."""

from helpers.recording.queue_model import explain, predict, take_bounds
from helpers.recording.recording import Call, CallbackRecording, CallbackRun, Recording

__all__ = [
    'Call',
    'CallbackRecording',
    'CallbackRun',
    'Recording',
    'explain',
    'predict',
    'take_bounds',
]
