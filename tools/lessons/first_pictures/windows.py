"""Windows with text: a terminal and what it has printed, or a program or command above a drive."""

from html import escape

from helpers.lesson import Lesson, magic_of
from tools.lessons.first_pictures import lanes
from tools.lessons.first_pictures.lanes import Lane, way_of
from tools.lessons.first_pictures.look import (
    LATER,
    PLAYS_S,
    WIDTH,
    cell,
    output_of,
    runs_of,
    svg,
    text_of,
)

LINE, PAD = 32, 18  # pixels
LANE = Lane(from_m=0.95, height=66)
HALL_LANE = LANE._replace(wall_m=7.5)  # of the floor that set_parameters draws
STOPS_M = 0.4  # where the robot of the program stands
STYLE = """
.window{fill:COLOUR(way);stroke:COLOUR(wall);stroke-opacity:.5}
.typed,.printed{font:21px ui-monospace,'SF Mono','DejaVu Sans Mono',Consolas,monospace;
white-space:pre}
.typed{font-weight:bold}
"""


def terminal_picture(lesson: Lesson, lines: list[str | tuple[str, str]]) -> str:
    """Return a terminal in which one line after the other gets its full colour.

    A line is what somebody types, or (cell, beginning): the sentences that this cell has printed
    and that begin so. What is not there any more raises ValueError.
    """
    shown = []
    for line in lines:
        if isinstance(line, str):
            shown.append(('typed ink', line))
            continue
        cell_id, beginning = line
        # A line of two sentences would be too long, and the second one may tell too much.
        printed = text_of(lesson, cell_id).replace('. ', '.\n').splitlines()
        found = [('printed ink', text) for text in printed if text.startswith(beginning)]
        if not found:
            raise ValueError(f'{cell_id} of {lesson.name} prints no {beginning!r} any more.')
        shown += found
    every_s = PLAYS_S / len(shown)
    shown = [
        (f'{kind} later" style="animation-delay:{i * every_s:.2f}s', text)
        for i, (kind, text) in enumerate(shown)
    ]
    height, body = window(shown)
    return svg(height, f'What {lesson.name} has printed', LATER + STYLE, body)


def window(lines: list[tuple[str, str]]) -> tuple[float, str]:
    """Return the height of a window with these lines, (class, text), and the window."""
    texts = ''.join(
        f'<text class="{kind}" x="{2 * PAD}" y="{2 * PAD + i * LINE + 14}">{escape(text)}</text>'
        for i, (kind, text) in enumerate(lines)
    )
    height = len(lines) * LINE + 3.4 * PAD
    frame = (
        f'<rect class="window" x="{PAD / 2}" y="{PAD / 2}" width="{WIDTH - PAD}" '
        f'height="{height - PAD}" rx="8"/>'
    )
    return height, frame + texts


def program_picture(lesson: Lesson, cell_id: str, lines: list[str], drive: str) -> str:
    """Return lines of a program that a learner completes, and the drive of what it becomes.

    Each of `lines` is how a line of the cell begins. What is not there raises ValueError.
    """
    magic = magic_of(cell(lesson, cell_id).source)
    code, shown = magic.body.splitlines(), [('typed ink', magic.line)]
    for line in lines:
        if not any(one.startswith(line) for one in code):
            raise ValueError(f'{cell_id} of {lesson.name} has no line {line!r} any more.')
        shown.append(('typed good' if 'Your code' in line else 'printed ink', line))
    (run,) = runs_of(output_of(lesson, drive))
    return _above_a_drive(lesson, shown, run, LANE, STOPS_M, 'Which C++ stops it before the wall?')


def command_picture(lesson: Lesson, cell_id: str, command: str, drive: str) -> str:
    """Return a command of a cell, which comes when its robot is told to stop, and the drive."""
    if f'!{command}' not in cell(lesson, cell_id).source:
        raise ValueError(f'{cell_id} of {lesson.name} has no command {command!r} any more.')
    (run,) = runs_of(output_of(lesson, drive))
    stops_ms = next(at for at, v, *_ in run['commands'] if not v)
    delay = PLAYS_S * stops_ms / 1000 / way_of(run)[-1][0]
    shown = [(f'typed ink later" style="animation-delay:{delay:.2f}s', f'$ {command}')]
    return _above_a_drive(lesson, shown, run, HALL_LANE, 0, 'Why does the driver listen to it?')


def _above_a_drive(
    lesson: Lesson, shown: list[tuple[str, str]], run: dict, lane: Lane, stops_m: float, asks: str
) -> str:
    """Return a window above a saved drive, and a question below it."""
    height, lines = window(shown)
    way = way_of(run)
    robot, css = lane.robot('r', [(t_s * PLAYS_S / way[-1][0], x) for t_s, x in way])
    body = (
        f'{lines}{lane.at(height + 6, lane.floor(stops_m) + robot)}'
        f'<text class="asks ink" x="{lane.left}" y="{height + lane.height + 34:.0f}">{asks}</text>'
    )
    about = f'A window of {lesson.name}, and its real drive'
    return svg(height + lane.height + 50, about, LATER + STYLE + lanes.STYLE + css, body)
