"""Records of what callbacks did, and the model of a queue that explains them."""

from helpers.recording.queue_model import explain, predict, take_bounds
from helpers.recording.recording import (
    Call,
    CallbackRecording,
    CallbackRun,
    Recording,
    at_once_with,
    most_at_once,
)
from helpers.recording.table import RUN_COLUMNS, check_table, thread_order

__all__ = [
    'RUN_COLUMNS',
    'Call',
    'CallbackRecording',
    'CallbackRun',
    'Recording',
    'at_once_with',
    'check_table',
    'explain',
    'most_at_once',
    'predict',
    'take_bounds',
    'thread_order',
]
