"""Runs of a patroller, an action server, and of its operator, as they are recorded."""

from __future__ import annotations

import time
from types import SimpleNamespace

from rclpy.node import Node

from helpers.replay import ActionRecording, Replay, replay_action


def note_feedback(operator: Node, times: list[float]) -> None:
    """Note when an operator hears feedback (`time.monotonic`, in seconds)."""
    callback = operator.feedback_callback

    def noted(message):
        times.append(time.monotonic())
        callback(message)

    operator.feedback_callback = noted


def record(patroller: Node) -> ActionRecording:
    """Return a recording of the action of a patroller, and of its service."""
    services = {'charge_callback': patroller.service} if hasattr(patroller, 'service') else {}
    return ActionRecording(patroller.server, patroller.execute_callback, **services)


def step_through(run: SimpleNamespace, threads: int) -> Replay:
    """Return the replay of a run: its `recording`, and when it was cancelled, `cancelled_s`."""
    return replay_action(run.recording, threads, run.cancelled_s)
