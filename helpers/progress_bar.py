"""A progress bar for a cell that waits. It leaves nothing in the saved output."""

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
        self._progress = progress if _somebody_watches() else None
        self._display = None
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

    def __exit__(self, *exception) -> None:
        if self._display is not None:
            from IPython.display import clear_output

            clear_output()


def _somebody_watches() -> bool:
    """Whether a person runs this cell, and not nbval or nbclient."""
    try:
        from IPython import get_ipython
    except ImportError:
        return False
    return can_ask(getattr(get_ipython(), 'kernel', None))
