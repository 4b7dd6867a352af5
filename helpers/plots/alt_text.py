"""The alternative text of a figure, for readers who do not see it.

A notebook shows a figure as an `<img>` with this text as its `alt`. To a plain image/png output
JupyterLab gives none, whatever its metadata say (github.com/jupyter/enhancement-proposals #120).

nbval compares the text, and no pixels: it may say what cannot move from run to run, and no more.
"""

from __future__ import annotations

from html import escape
from weakref import WeakKeyDictionary

from IPython import get_ipython
from IPython.core.pylabtools import print_figure
from IPython.display import display
from matplotlib.axes import Axes
from matplotlib.figure import Figure

_described: WeakKeyDictionary[Axes, tuple[str, str | None]] = WeakKeyDictionary()


def describe(ax: Axes, text: str, title: str | None = None) -> None:
    """Say in one or more sentences what is drawn into `ax`; the last call counts.

    The title and the labels of `ax` are read out with it. Give `title` if the visible one
    has a number that moves.
    """
    _described[ax] = text, title


def alt_text(figure: Figure) -> str:
    """Return the alternative text of a figure: what is drawn into each of its axes."""
    panels = [ax for ax in figure.axes if ax.get_visible()]
    parts = [figure.get_suptitle()]
    for number, ax in enumerate(panels, 1):
        if len(panels) > 1:
            parts.append(f'Picture {number} of {len(panels)}')
        parts += _of_axes(ax)
    text = ' '.join(_sentence(part) for part in parts if part.strip())
    return text or 'A figure without a title.'


def show(figure: Figure) -> None:
    """Display a figure in the notebook, with its alternative text."""
    text = alt_text(figure)
    data = {'text/plain': text}
    if png := print_figure(figure, base64=True):  # None if nothing is drawn
        data['text/html'] = f'<img alt="{escape(text)}" src="data:image/png;base64,{png}">'
    display(data, raw=True)


def _of_axes(ax: Axes) -> list[str]:
    text, title = _described.get(ax, ('', None))
    if title is None:
        title = ' '.join(ax.get_title(loc=place) for place in ('left', 'center', 'right'))
    labels = [('Horizontal', ax.get_xlabel()), ('Vertical', ax.get_ylabel())]
    return [title, text, *(f'{name} axis: {label}' for name, label in labels if label)]


def _sentence(text: str) -> str:
    text = ' '.join(text.split())
    return text if text.endswith(('.', '?', '!')) else f'{text}.'


# matplotlib's inline backend takes back every other formatter of figures when it starts.
if shell := get_ipython():
    shell.display_formatter.ipython_display_formatter.for_type(Figure, show)
