"""Free play: change the numbers of a run, and see its prediction at once, without a kernel."""

from __future__ import annotations

from dataclasses import dataclass

from helpers.replay.script import played

SAYS = (
    'Free play: the period, the callback, the depth, the threads and the group on sliders. The '
    'prediction for 41 messages is drawn again at each change.'
)


@dataclass(frozen=True)
class FreePlay:
    """Sliders that begin with these numbers: seconds, messages, threads."""

    period: float = 0.05
    callback: float = 0.2
    depth: int = 10
    threads: int = 1

    def __str__(self) -> str:
        return SAYS

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        html = played('free', vars(self), SAYS)
        return {'text/plain': SAYS, 'text/html': html}
