"""What a cell shows while it waits. Afterwards only the reason of an interrupted wait stays."""

from __future__ import annotations

import html
from collections.abc import Callable

from helpers.notebook.kernel import can_ask

SHOW_AFTER_S = 2.0
REFRESH_S = 0.2
# Set by a program that shows lessons from their start, such as slides: begin each workspace empty.
BEGIN_EMPTY = 'ROS2_NOTEBOOKS_BEGIN_EMPTY'


class ProgressBar:
    """Shows what `progress` returns (0 to 1), once the wait has taken `SHOW_AFTER_S`.

    Without a `progress`, or if no person watches, it shows nothing. At its end it becomes empty:
    what the cell has printed before stays.
    """

    def __init__(self, progress: Callable[[], float] | None) -> None:
        self._watched = somebody_watches()
        self._progress = progress if self._watched else None
        self._display = None
        self._bar = self._text = ''
        self._next_s = SHOW_AFTER_S

    def __enter__(self) -> ProgressBar:
        return self

    def update(self, waited_s: float) -> None:
        """Draw the bar if it is time to. `waited_s` is the time since the wait began."""
        if self._progress is None or waited_s < self._next_s:
            return
        self._next_s = waited_s + REFRESH_S
        percent = round(100 * min(1.0, self._progress()))
        self._bar = f'<progress value="{percent}" max="100"></progress> {percent} %'
        self._show()

    def say(self, text: str) -> None:
        """Show a text if a person watches. It stays if the cell is interrupted."""
        if self._watched:
            self._text = f'<pre>{html.escape(text)}</pre>'
            self._show()

    def _show(self) -> None:
        from IPython.display import display

        data = {'text/html': self._bar + self._text}
        if self._display is None:
            self._display = display(data, raw=True, display_id=True)
        else:
            self._display.update(data, raw=True)

    def __exit__(self, exception_type, *exception) -> None:
        if self._display is None:
            return
        self._bar = ''
        if exception_type is not KeyboardInterrupt:
            self._text = ''
        self._show()


def somebody_watches() -> bool:
    """Return whether a person runs this cell, and not nbval or nbclient."""
    try:
        from IPython import get_ipython
    except ImportError:
        return False
    return can_ask(getattr(get_ipython(), 'kernel', None))
