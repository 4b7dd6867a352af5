"""A copy of this process, of a kernel too."""

from __future__ import annotations

import os
import sys
import warnings


def fork() -> int:
    """Return what `os.fork` returns: 0 in the copy. Call `leave_ros` before.

    rclpy has no threads while no session is open. The copy must use nothing of ipykernel's threads,
    and end with `os._exit`.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        # Python warns of locks that another thread may hold: those of ipykernel's threads.
        warnings.simplefilter('ignore', DeprecationWarning)
        return os.fork()
