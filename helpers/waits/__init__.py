"""What waits, for what, who could end that, and why that one cannot: of any rclpy program.

It reads what is there (frames of threads, coroutines, executors, callback groups, the graph), when
it is asked. Nothing is prepared, and no code of the learner runs. It needs only rclpy: a copy of
this folder works beside any program, `python3 -m waits node.py`.
"""

from __future__ import annotations

import threading
from types import FrameType

from .findings import Finding, find
from .snapshot import Snapshot

__all__ = ['Finding', 'explain', 'find_waits', 'what_waits']


def find_waits(main_frame: FrameType | None = None) -> list[Finding]:
    """Return what waits in this process, what is stuck first, but for the thread that asks.

    With `main_frame` it is the main thread that asks, in a signal handler, and this is the frame in
    which the signal found it.
    """
    own = threading.get_ident()
    return find(Snapshot(main_frame, () if main_frame is not None else (own,)))


def explain(main_frame: FrameType | None = None, most: int = 3) -> str:
    """Return what waits as text, '' if nothing does. `main_frame` as in `find_waits`."""
    from .sentences import sentences

    found = find_waits(main_frame)
    shown = [finding for finding in found if finding.stuck]
    main = [one for one in found if one.activity.thread is threading.main_thread()]
    shown += [one for one in main if one not in shown]
    shown += [one for one in found if one.activity.task is not None and one not in shown]
    lines = [line for finding in shown[:most] for line in sentences(finding)]
    if len(shown) > most:
        lines.append(f'{len(shown) - most} more wait.')
    return '\n'.join(lines)


def what_waits() -> None:
    """Print what waits in this process, for what, and what would help."""
    print(explain() or 'Nothing waits for anything that is known.')
