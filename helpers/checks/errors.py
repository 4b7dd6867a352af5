"""What an error of a student's code says: its type, its text, and the student's own line."""

from __future__ import annotations

import os
import re
import traceback
from pathlib import Path

from helpers.notebook import own_line

LESSONS = str(Path(__file__).with_name('lessons')) + os.sep
# What rclpy's TypeErrors without a text mean, by the function that raises them.
WITHOUT_TEXT = {
    'send_response': 'the callback of a service has returned no response of its type',
    'call': 'a service is called with something that is no request of its type',
    'call_async': 'a service is called with something that is no request of its type',
}


class Failed(Exception):  # noqa: N818 - a verdict, and no error
    """What a check has found: raised by the bench, shown as it is.

    `hint` takes the place of the hint of the point, which may not fit: '' shows none.
    """

    def __init__(self, found: str = '', hint: str | None = None) -> None:
        super().__init__(found)
        self.hint = hint


class NeverEnds(Failed):
    """What a check has found, if each later point of the task would wait as long for the same."""


def place_of(error: BaseException) -> str:
    """Return the line of the student in which an error came up, or nothing."""
    frames = traceback.extract_tb(error.__traceback__)
    return own_line((frame.filename, frame.lineno or 0) for frame in reversed(frames))


def sentence(error: BaseException) -> str:
    """Say in one sentence or two what an error says, and in which line of the student."""
    if isinstance(error, Failed):
        return str(error)
    if isinstance(error, SystemError) and error.__cause__:  # pybind11 hides a wrong field in one
        error = error.__cause__
    place = place_of(error)
    text = ' '.join(str(error).split('\n\n')[0].split())
    text = re.sub(r' at 0x[0-9a-fA-F]+', '', text)
    text = re.sub(r'(?:\w+\.<locals>\.)+', '', text)  # of a function in a function: its name only
    name = type(error).__name__
    frames = traceback.extract_tb(error.__traceback__)
    if isinstance(error, TypeError) and not text:
        text = WITHOUT_TEXT.get(frames[-1].name, '') if frames else ''
    if isinstance(error, SyntaxError):
        place = f'Line {error.lineno}: {(error.text or "").strip()}' if error.lineno else place
    elif isinstance(error, RecursionError):
        text = 'a function calls itself without end'
    elif isinstance(error, SystemExit):
        text = 'your code ends the program'
    elif isinstance(error, NameError) and frames and frames[-1].filename.startswith(LESSONS):
        where = f'line {frames[-1].lineno} of {os.path.basename(frames[-1].filename)}'
        text += f'. It is the check that uses it, in {where}: import it there'
    elif isinstance(error, NameError) and error.name:
        text += '. Is it defined in the cell of the task, or in a cell above that has not run?'
    elif re.match(r'[A-Z]\w*\.\w+\(\) missing 1 required positional argument', text):
        text += '. Did you forget () after a class, or write () after a callback?'
    elif "'NoneType' object is not callable" in text:
        text += '. Are there () after the name of a callback that is only handed over?'
    said = f'{name}: {text}' if text else name
    if not place:
        return said
    return f'{said}{"" if said[-1] in ".!?" else "."} {place}'
