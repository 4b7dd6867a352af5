"""What a command does to its own threads, while it makes a participant."""

import os
import threading

from ros2_command.guards import new_threads_wait


def scheduling(thread):
    return os.sched_getscheduler(thread), os.sched_getaffinity(thread)


def test_new_threads_share_a_processor_only_within_the_block():
    before = scheduling(0)
    end = threading.Event()
    thread = threading.Thread(target=end.wait)
    with new_threads_wait():
        thread.start()
        inside = scheduling(thread.native_id)
        assert scheduling(0) == inside
    after = scheduling(thread.native_id), scheduling(0)
    end.set()
    thread.join()
    assert (inside[0], len(inside[1])) == (os.SCHED_BATCH, 1)
    assert after == (before, before)
