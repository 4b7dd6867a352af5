"""What a cell shows while it waits. Nothing of it is left in the saved output."""

from __future__ import annotations

from collections.abc import Callable

from helpers.rclpy_private import can_ask

SHOW_AFTER_S = 2.0
REFRESH_S = 0.2


class ProgressBar:
    """Shows what `progress` returns (0 to 1), once the wait has taken `SHOW_AFTER_S`.

    Without a `progress`, or where nobody watches, it shows nothing. To leave no trace it clears the
    output of the cell: print after the wait, not before.
    """

    def __init__(self, progress: Callable[[], float] | None) -> None:
        self._watched = _somebody_watches()
        self._progress = progress if self._watched else None
        self._display = None
        self._text: str | None = None
        self._next_s = SHOW_AFTER_S

    def __enter__(self) -> ProgressBar:
        return self

    def update(self, waited_s: float) -> None:
        """Draw the bar if it is time to. `waited_s` is the time since the wait began."""
        if self._progress is None or waited_s < self._next_s:
            return
        from IPython.display import HTML, display

        self._next_s = waited_s + REFRESH_S
        percent = round(100 * min(1.0, self._progress()))
        bar = HTML(f'<progress value="{percent}" max="100"></progress> {percent} %')
        if self._display is None:
            self._display = display(bar, display_id=True)
        else:
            self._display.update(bar)

    def say(self, text: str) -> None:
        """Print a text where somebody watches. It stays where the wait does not end well."""
        if self._watched:
            print(text)
            self._text = text

    def __exit__(self, exception_type, *exception) -> None:
        if self._display is None and self._text is None:
            return
        from IPython.display import clear_output

        clear_output()
        if exception_type is KeyboardInterrupt and self._text is not None:
            print(self._text)


def _somebody_watches() -> bool:
    """Whether a person runs this cell, and not nbval or nbclient."""
    try:
        from IPython import get_ipython
    except ImportError:
        return False
    return can_ask(getattr(get_ipython(), 'kernel', None))
