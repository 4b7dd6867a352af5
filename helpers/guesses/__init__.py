"""A guess as an object in the picture that answers it: a place, a level, ticks, or options.

    guess = Guess('How many are received?', Level(0, 41, 'messages'))
    show(guess)                     a cell shows it; the student sets it there
    guess.value                     None, until it is set

A kind of guess says what may be answered, reads what is typed in place of it, and draws it. On a
page all have guess.js, which needs neither a kernel nor the network. In JupyterLab the kernel is
told at once, elsewhere the browser keeps it. The kind of a place on a floor is in
`helpers.robot_view`, which has the floors.
"""

from helpers.guesses.guess import CSS, MEMORY, Gap, Guess, Kind, show
from helpers.guesses.kinds import Level, Options, Rows, Ticks, kind_of, number_of

__all__ = [
    'CSS',
    'MEMORY',
    'Gap',
    'Guess',
    'Kind',
    'Level',
    'Options',
    'Rows',
    'Ticks',
    'kind_of',
    'number_of',
    'show',
]
