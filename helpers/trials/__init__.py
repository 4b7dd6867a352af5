"""What code of a learner does where a lesson puts it: a gate holds a thread, a step fails.

A lesson shows what came out of a trial, and tasks are judged by some of them.

    executors  how many callbacks run at once, and what waiting costs
    brakes     a stop, while a brake looks for long or asks a camera
    patrols    the recorded run of an action
    robots     robots beside a learner's nodes
    packages   what becomes of packages when one edits, builds, runs and deletes
    planted    a learner's tests, with right and with wrong versions of what they test
    busy       a brake on a busy computer, and its flaky test
    lifecycle  a camera whose steps fail
    copies     runs that are compared, each in a copy of the kernel
"""

from helpers.trials.brakes import Camera, scan, show_a_wall, stop_while_looking
from helpers.trials.busy import BRAKE, BUSY, run_busy
from helpers.trials.copies import in_copies
from helpers.trials.executors import callbacks_at_once, cpu_of_spin
from helpers.trials.lifecycle import Device, state_after
from helpers.trials.packages import (
    as_table,
    build_anew,
    imports,
    make_three_changes,
    play,
    times_printed,
)
from helpers.trials.patrols import note_feedback, record, step_through
from helpers.trials.planted import planted, run_tests
from helpers.trials.robots import ways, with_camera

__all__ = [
    'BRAKE',
    'BUSY',
    'Camera',
    'Device',
    'as_table',
    'build_anew',
    'callbacks_at_once',
    'cpu_of_spin',
    'imports',
    'in_copies',
    'make_three_changes',
    'note_feedback',
    'planted',
    'play',
    'record',
    'run_busy',
    'run_tests',
    'scan',
    'show_a_wall',
    'state_after',
    'step_through',
    'stop_while_looking',
    'times_printed',
    'ways',
    'with_camera',
]
