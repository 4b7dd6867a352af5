"""Which of somebody else's robots comes next, after those that a learner has mended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from helpers.checks import progress

if TYPE_CHECKING:
    from helpers.faults import Case
    from helpers.workspace import Workspace

LAST = 'mend_the_next'  # the task that mends one of the others


def next_robot(workspace: Workspace, seed: int) -> Case:
    """Return the next robot: the number `seed` decides in which order they come.

    First those come that have not been mended yet, then all of them, again and again. Until it is
    mended, a robot stays as it was left.
    """
    from helpers.faults import take_next  # slow to load, and one lesson needs it

    return take_next(workspace, seed, progress.about(LAST))
