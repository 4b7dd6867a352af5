"""What all first pictures share: their colours, how long they play, and how they are written."""

import json
import re
from html import unescape
from urllib.parse import unquote

from helpers.lesson import Lesson
from helpers.notebook import LOOK

PLAYS_S = 4.5
WIDTH = 720  # pixels

# Letters have a contrast of 4.5 and more on their ground, marks of 3, in light and in dark.
PAIRS = {
    'ground': ('#ffffff', '#15191e'),
    'ink': ('#4a5460', '#b4bec9'),
    'way': ('#eff1f3', '#242a31'),
    'wall': ('#6b7681', '#7f8b97'),
    'heard': (LOOK['heard'], LOOK['heard-night']),
    'lost': ('#b34a00', '#ff9350'),
    'waiting': ('#855d00', '#e3b040'),
    'good': (LOOK['robot-letters'], '#2fbd8d'),
}
STYLE = """
svg{color-scheme:light dark;font:16px system-ui,'Segoe UI',Roboto,'Noto Sans',sans-serif}
.says{font-weight:bold}
.says,.comes{animation:comes .3s both}
@keyframes comes{from{opacity:0}}
@media(max-width:560px){svg{font-size:24px}.wide{display:none}}
@media(prefers-reduced-motion:reduce){svg *{animation:none!important}}
"""
# What is there from the first moment on, pale until its turn comes.
LATER = '.later{animation:later .3s both}@keyframes later{from{opacity:.4}}'


def output_of(lesson: Lesson, cell_id: str) -> str:
    """Return the saved page of a cell, as HTML."""
    pages = (
        output.get('data', {}).get('text/html', '') for output in cell(lesson, cell_id).outputs
    )
    return next(page for page in pages if page)


def text_of(lesson: Lesson, cell_id: str) -> str:
    """Return the text that a cell has printed."""
    return ''.join(output.get('text', '') for output in cell(lesson, cell_id).outputs)


def cell(lesson: Lesson, cell_id: str):
    return next(cell for cell in lesson.notebook.cells if cell.id == cell_id)


def runs_of(page: str) -> list[dict]:
    """Return the runs of a saved replay."""
    return json.loads(unescape(re.search(r"data-record='([^']*)'", page)[1]))['runs']


def svg_of(page: str) -> str:
    """Return the picture of a saved replay."""
    return unquote(re.search(r'src="data:image/svg\+xml,([^"]*)"', page)[1])


def styled(picture: str, style: str) -> str:
    """Return a saved picture with a style of its own."""
    return re.sub(r'(<svg[^>]*>)', rf'\1<style>{style}</style>', picture, count=1) + '\n'


def colour(name: str) -> str:
    return 'light-dark({},{})'.format(*PAIRS[name])


def percent(t_s: float) -> str:
    """Return a time of the picture as a part of it, for keyframes."""
    return f'{100 * t_s / PLAYS_S:.2f}%'


def moving(name: str, stops: list[tuple[float, float]]) -> str:
    """Return keyframes that move something along x, through (seconds, pixels)."""
    kept = [
        stop
        for before, stop, after in zip([None, *stops], stops, [*stops[1:], None], strict=False)
        if before is None or after is None or not before[1] == stop[1] == after[1]
    ]
    frames = ''.join(f'{percent(t_s)}{{transform:translateX({x:.4g}px)}}' for t_s, x in kept)
    return f'@keyframes {name}{{{frames}to{{transform:translateX({kept[-1][1]:.4g}px)}}}}'


def svg(height: float, about: str, style: str, body: str) -> str:
    """Return a picture; COLOUR(name) in style and body is a colour of light and of dark."""
    fills = ''.join(f'.{name}{{fill:COLOUR({name})}}' for name in PAIRS if name != 'ground')
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:g}" '
        f'width="{WIDTH}" height="{height:g}">\n'
        f'<!-- {about}. Made by tools/lessons/first_pictures. -->\n<style>{STYLE}{fills}'
        f'.ground{{fill:COLOUR(ground)}}{style}</style>\n'
        f'<path class="ground" d="M0 0H{WIDTH}V{height:g}H0z"/>{body}\n</svg>\n'
    )
    return re.sub(r'COLOUR\((\w+)\)', lambda found: colour(found[1]), text)
