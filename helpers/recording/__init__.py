"""Records of what callbacks did, and the model of a queue that explains them."""

from helpers.recording.queue_model import explain, predict
from helpers.recording.recording import CallbackRecording, Recording

__all__ = ['CallbackRecording', 'Recording', 'explain', 'predict']
