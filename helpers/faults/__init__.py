"""Somebody else's robots, each with a fault that one finds and mends.

    ada = take(workspace, FAULTS['...'], 'ada')     its package is in src/ada, and built
    drive(ada, name='ada')                          in the page, as it is launched

The folder `healthy` is a package that works: a route that wants to go straight on, a brake between
it and the robot, and a manager. Each other folder here is a fault: the files that it changes, and
`fault.yaml`, which says what is broken, how it is found, which mends are right, and which are
tempting and wrong. Another fault is another folder: CONTRIBUTING.md says what is in its file.

    cases    read the folders, put a robot into a workspace, mend it
    drives   drive it, in the page or to judge it
    robots   the robots of the lesson: which comes next, what it did, by what its fault is seen
"""

from helpers.faults.cases import (
    FAULTS,
    FILE,
    KINDS,
    NAME,
    Case,
    Fault,
    Mend,
    mend_in_words,
    read,
    take,
)
from helpers.faults.drives import FRESH_S, OTHER, drive
from helpers.faults.robots import (
    CORE,
    OTHERS,
    TURNED,
    give_up,
    mend,
    order_of,
    proves,
    robot,
    seen,
    show_drive,
    take_next,
    wait_until_up,
    words,
)

__all__ = [
    'words',
    'wait_until_up',
    'take_next',
    'show_drive',
    'seen',
    'robot',
    'read',
    'proves',
    'order_of',
    'mend',
    'give_up',
    'TURNED',
    'OTHERS',
    'CORE',
    'FAULTS',
    'FRESH_S',
    'KINDS',
    'NAME',
    'FILE',
    'OTHER',
    'Case',
    'Fault',
    'Mend',
    'drive',
    'mend_in_words',
    'take',
]
