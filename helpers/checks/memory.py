"""From memory: two short questions about earlier lessons, with which a lesson opens.

    remember(who_receives=..., which_one_is_lost=...)         prints both questions
    remember(who_receives='B', which_one_is_lost=...)         judges the first answer

questions.yaml has the questions. A wrong answer is kept in the file of the student's progress, and
the question comes back in later lessons until it is answered right there: an answer that was just
read does not count. Without a wrong answer the text is the same for everybody.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import yaml

from helpers.checks import progress
from helpers.notebook import wrap

FILE = Path(__file__).with_name('questions.yaml')
HOW = "Write 'A', 'B' or 'C' in place of the three dots, and run the cell again."


class Question(NamedTuple):
    """A question, its options by their letters, the right letter, and where it is answered."""

    lesson: str  # the name without its number, such as lose_messages
    step: int
    question: str
    options: dict[str, str]
    right: str
    why: str

    def asked(self) -> list[str]:
        """Return the lines of the question and its options."""
        lines = wrap(self.question)
        for letter, option in self.options.items():
            lines += wrap(f'{letter}. {option}', '  ')
        return lines

    def judged(self, answer: object) -> list[str]:
        """Return the lines of a verdict."""
        letter = letter_of(answer)
        if letter not in self.options:
            return wrap(f"Please change {answer!r}: the answer is 'A', 'B' or 'C'.", '  ')
        verdict = 'Right.' if letter == self.right else f'No, it is {self.right}.'
        return wrap(f'Your answer: {letter}. {verdict} {self.reason}', '  ')

    @property
    def reason(self) -> str:
        """Why the right answer is right, and where it is shown."""
        return f'{self.why} {place(self.lesson, self.step)}'


def remember(**answers: object) -> None:
    """Print each question, by its name in questions.yaml, or judge its answer: A, B or C.

    `...` is no answer yet. Nothing is raised: what is no answer gets a sentence.
    """
    known, again, blocks = questions(), missed(), []
    for name, answer in answers.items():
        if name not in known:
            blocks.append(wrap(f'There is no question called {name}: copy its name again.'))
            continue
        question = known[name]
        if answer is None or answer is ...:
            blocks.append(question.asked())
            continue
        blocks.append(wrap(question.question) + question.judged(answer))
        if (letter := letter_of(answer)) in question.options:
            _keep(name, letter == question.right, again)
    if any(answer is None or answer is ... for answer in answers.values()):
        blocks.append([HOW])
    for name in due(again, answers):
        lines = ['From before, a question that you have missed:', *known[name].asked()]
        blocks.append([*lines, f"To answer it, write it into the parentheses: {name}='A'"])
    print(*('\n'.join(block) for block in blocks), sep='\n\n')


def letter_of(answer: object) -> str:
    """Return the letter of an answer, empty if it is none."""
    return answer.strip().upper() if isinstance(answer, str) else ''


@cache
def questions() -> dict[str, Question]:
    """Return all questions by their names."""
    found = yaml.safe_load(FILE.read_text(encoding='utf-8'))
    return {
        name: Question(
            lesson=entry['about'].split()[0],
            step=int(entry['about'].split()[1]),
            question=entry['question'],
            options={letter: entry[letter] for letter in 'ABC'},
            right=entry['right'],
            why=entry['why'],
        )
        for name, entry in found.items()
    }


def place(lesson: str, step: int) -> str:
    """Say where a question is answered. The number of a lesson is that of its notebook today."""
    if number := progress.number_of(lesson):
        return f'Lesson {number}, step {step}, shows it.'
    return f'The lesson "{lesson.replace("_", " ")}", step {step}, shows it.'


def missed() -> dict[str, str]:
    """Return the questions that are still to be answered, and in which lesson each was missed."""
    found: dict[str, str] = {}
    for name, lesson in progress.memories():
        found.pop(name, None)
        if lesson and name in questions():
            found[name] = lesson
    return found


def due(again: dict[str, str], asked: dict[str, object]) -> list[str]:
    """Return the question that comes back in this lesson, if there is one: the oldest miss.

    It is about an earlier lesson, and was missed in another one.
    """
    here = progress.this_lesson()
    number = progress.number_of(here)
    return [
        name
        for name, lesson in again.items()
        if here != lesson
        and name not in asked
        and progress.number_of(questions()[name].lesson) < number
    ][:1]


def _keep(name: str, right: bool, again: dict[str, str]) -> None:
    """Keep a miss, and forget it after a right answer in another lesson."""
    here = progress.this_lesson()
    if here and not right and again.get(name) != here:
        progress.keep_memory(name, here)
    elif here and right and again.get(name, here) != here:
        progress.keep_memory(name)
