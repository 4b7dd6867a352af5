"""What waits, for what, who could end that, and why that one cannot: of any rclpy program.

It reads what is there (frames of threads, coroutines, executors, callback groups, the graph), when
it is asked. Nothing is prepared, and no code of the learner runs. It needs only rclpy: a copy of
this folder works beside any program, `python3 -m waits node.py`.
"""

from __future__ import annotations

import inspect
import threading
from dataclasses import dataclass
from types import FrameType

from .blockers import nearest
from .circles import circle
from .finding import Finding
from .findings import find
from .sentences import NOTHING, sentences
from .snapshot import Snapshot, action_name

__all__ = [
    'NOTHING',
    'Finding',
    'Told',
    'action_name',
    'circle',
    'explain',
    'explain_callbacks',
    'find_waits',
    'nearest',
    'tell',
    'tell_interrupt',
]

MOST = 3


@dataclass(frozen=True)
class Told:
    """What waited at a moment: `text`, '' if nothing did, and `circle`, as circle() returns it.

    It holds nothing of the program, and may be kept.
    """

    text: str
    circle: dict | None


def find_waits(main_frame: FrameType | None = None) -> list[Finding]:
    """Return what waits in this process, what is stuck first, but for the thread that asks.

    With `main_frame` it is the main thread that asks, and its code from this frame outwards is
    looked at too: a signal handler gives the frame in which the signal found it.
    """
    own = threading.get_ident()
    return find(Snapshot(main_frame, () if main_frame is not None else (own,)))


def tell() -> Told:
    """Return what waits: what is stuck first, three waits at most."""
    found = find_waits()
    stuck = [one for one in found if one.stuck]
    main = [one for one in found if one.activity.thread is threading.main_thread()]
    callbacks = [one for one in found if one.activity.task is not None]
    return _told([*dict.fromkeys([*stuck, *main, *callbacks])])


def explain() -> str:
    """Return what waits as text, '' if nothing does."""
    return tell().text


def explain_callbacks() -> str:
    """Return what callbacks wait, as text; a thread that asks may hold what they wait for."""
    in_main = threading.current_thread() is threading.main_thread()
    frame = inspect.currentframe() if in_main else None
    return _told([one for one in find_waits(frame) if one.activity.task is not None]).text


def tell_interrupt(frame: FrameType | None) -> Told:
    """Return what kept the main thread waiting when a signal came, in this frame.

    A cell that computes is not told about threads that wait for their next work.
    """
    found = find_waits(frame)
    main = [one for one in found if one.activity.thread is threading.main_thread()]
    stuck = [one for one in found if one.stuck and (main or one.activity.task is not None)]
    return _told([*dict.fromkeys([*stuck, *main])])


def _told(findings: list[Finding]) -> Told:
    turns = circle(findings)
    # While a callback is stuck, it is no news that its executor spins, or that others do not run.
    if any(one.stuck and one.activity.task for one in findings):
        findings = [one for one in findings if one.kind != 'spin' or one.activity.task]
    lines = [line for finding in findings[:MOST] for line in sentences(finding)]
    if len(findings) > MOST:
        lines.append(f'{len(findings) - MOST} more wait.')
    return Told('\n'.join(lines), turns)
