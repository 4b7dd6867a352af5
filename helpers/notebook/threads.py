"""Where the threads of this process are."""

from __future__ import annotations

import gc
import sys
import threading
from types import FrameType


def frames(threads: list[threading.Thread]) -> list[tuple[threading.Thread, FrameType]]:
    """Return the innermost frame of each thread. A thread that has ended has none."""
    collects = gc.isenabled()
    try:
        # Before Python 3.11.9, a collection that frees a threading.local hangs in the next call:
        # https://github.com/python/cpython/issues/106883
        gc.disable()
        # private: sys, Python 3.11.7
        current = sys._current_frames()  # noqa: SLF001 - documented, in spite of its name
    finally:
        if collects:
            gc.enable()
    return [(thread, current[thread.ident]) for thread in threads if thread.ident in current]
