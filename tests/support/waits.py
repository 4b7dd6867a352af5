"""How long tests wait. Nothing here needs ROS."""

import time

LIMIT_S = 20.0  # for every wait; never reached unless something is broken
START_LIMIT_S = 60.0  # for a Python or a machine that starts meanwhile


def wait_for(read, right=bool, timeout_s: float = LIMIT_S):
    """Read again and again, until `right` is true of what was read. Return that."""
    end = time.monotonic() + timeout_s
    while not right(found := read()):
        assert time.monotonic() < end, found
        time.sleep(0.01)
    return found
