"""How a verdict, and a check that takes a while, come into the notebook."""

from __future__ import annotations

from IPython import get_ipython
from IPython.display import display

from helpers.checks.verdict import Verdict, bundle
from helpers.notebook import somebody_watches

SHOW_AFTER_S = 1.0


class Running:
    """Says how far a check is, if a person watches and it takes a while. Nothing of it stays."""

    def __init__(self, verdict: Verdict) -> None:
        self._verdict = verdict
        self._watched = somebody_watches()
        self._display = None

    def __enter__(self) -> Running:
        return self

    def update(self, waited_s: float) -> None:
        """Show how many points were tried, once the check has taken `SHOW_AFTER_S`."""
        if not self._watched or waited_s < SHOW_AFTER_S:
            return
        count = sum(bool(point.ok or point.found) for point in self._verdict.points)
        data = {'text/html': f'Checking: {count} of {len(self._verdict.points)} …'}
        if self._display is None:
            self._display = display(data, raw=True, display_id=True)
        else:
            self._display.update(data, raw=True)

    def __exit__(self, *exception) -> None:
        if self._display is not None:
            self._display.update({'text/html': ''}, raw=True)


def show(verdict: Verdict) -> None:
    """Show a verdict: as a card, as data and as text, or outside of a notebook as text only."""
    if get_ipython() is None:
        print(verdict.text())
        return
    data, metadata = bundle(verdict)
    display(data, metadata=metadata, raw=True)
