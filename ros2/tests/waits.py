"""How long tests wait."""

import time

LIMIT_S = 20.0  # for every wait; never reached unless something is broken
START_LIMIT_S = 60.0  # for a Python that starts meanwhile


def wait_for(read, right=bool, timeout_s: float = LIMIT_S):
    """Read again and again, until `right` is true of the value that was read. Return that."""
    end = time.monotonic() + timeout_s
    while not right(value := read()):
        assert time.monotonic() < end, value
        time.sleep(0.01)
    return value
