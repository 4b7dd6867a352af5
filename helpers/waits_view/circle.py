"""What waits in this process, in words and as a picture: the circle, if the waits close to one."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

from IPython.display import display

from helpers.replay import attribute, script, style
from helpers.waits import NOTHING, tell

SCRIPT = Path(__file__).with_name('waits.js')


@dataclass(frozen=True)
class Circle:
    """A circle of waits that has closed. The last line of a cell shows it.

    `turns` is what `helpers.waits.circle` returns. Without scripts a page has its sentence.
    """

    turns: dict

    def __str__(self) -> str:
        return self.turns['says']

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        html = (
            f'<div class="replay" data-circle={attribute(self.turns)}>'
            f'{style("ring.css")}<p>{escape(str(self))}</p>'
            f'<script>{script(SCRIPT)}</script></div>'
        )
        return {'text/plain': str(self), 'text/html': html}


def what_waits() -> None:
    """Print what waits in this process, for what, why it does not come, and what would help.

    If callbacks wait for each other, it also draws the circle in which they do. While a cell hangs,
    ask from a console of a subshell: in JupyterLab a right click on the notebook, *New Subshell
    Console for Notebook*.
    """
    told = tell()
    print(told.text or NOTHING)
    if told.circle:
        display(Circle(told.circle))
