"""A wait that was found: what waits for what, and who could end that."""

from __future__ import annotations

from dataclasses import dataclass, field

from .blockers import Ender
from .snapshot import Activity


@dataclass(eq=False)
class Finding:
    """A wait. `kind` is one word for tests and cures; `what` completes 'waits for'."""

    activity: Activity
    kind: str
    what: str
    enders: list[Ender] = field(default_factory=list)
    needs_all: bool = False  # an answer needs the server and the client; a lock one of its holders
    limited: bool = False  # a time-out ends the wait
    loops: bool = False  # it asks again and again
    spins: bool = False  # it spins an executor meanwhile
    short: str = ''  # `what`, where a picture has less room

    @property
    def stuck(self) -> bool:
        """Return whether something that was read keeps this wait from ending."""
        if self.limited or not self.enders:
            return False
        blocked = [bool(ender.blockers) for ender in self.enders]
        return any(blocked) if self.needs_all else all(blocked)

    @property
    def causes(self) -> set[str]:
        """Return the causes of it: those of its blockers, and 'spin in callback'."""
        found = {blocker.cause for ender in self.enders for blocker in ender.blockers}
        return found | ({'spin in callback'} if self.spins and self.activity.task else set())
