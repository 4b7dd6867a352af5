"""The rules whose logic is not plain from their code; each example is one that got through once."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_output

from helpers.lesson import FOLDER, Lesson
from tools.lessons import rules
from tools.lessons.new import template


def complaints(rule, *cells):
    """Return the sentences of a rule on the template with some cells before its recap."""
    notebook = template()
    recap = next(i for i, cell in enumerate(notebook.cells) if cell.source.startswith('## Recap'))
    notebook.cells[recap:recap] = cells
    return list(rule(Lesson('90_write_a_lesson.ipynb', notebook)))


def code(source='run()', *tags, outputs=()):
    return new_code_cell(source, metadata={'tags': list(tags)}, outputs=list(outputs))


def printed(text, name='stdout'):
    return code(outputs=[new_output('stream', name=name, text=text)])


def shown(**data):
    bundle = {kind.replace('_', '/'): text for kind, text in data.items()}
    return code(outputs=[new_output('execute_result', data=bundle)])


PICTURE = '<img alt="One dot for each of five messages." src="data:image/png;base64,iV/tmp/AA">'
BROKEN = [
    (rules.prints_what_stays, printed('warning\n', 'stderr')),
    (rules.prints_what_stays, printed('saved in /home/ada/plot.csv\n')),
    (rules.prints_what_stays, printed('lib/python3.11/site-packages/rclpy\n')),
    (rules.prints_what_stays, printed(f'in {FOLDER.parent}\n')),
    (rules.prints_what_stays, shown(text_html='<a href="/root/x">x</a>')),
    (rules.prints_what_stays, shown(text_plain='<Axes: >')),
    (rules.compared, code('# NBVAL_IGNORE_OUTPUT\n# Not compared: times.\nrun()')),
    (rules.compared, code('run()', 'nbval-ignore-output')),
    (rules.pictures_described, shown(image_png='iVBO')),
    (rules.imports_from_apis, code('import helpers.robot.floor')),
    (rules.imports_from_apis, code('from helpers.checks.lessons.try_it import check, drive')),
    (rules.imports_from_apis, code('from helpers.checks.lessons.try_it import (\n    check,\n)')),
    (rules.imports_from_apis, code('import helpers.checks.lessons.try_it as it')),
    (rules.names_stay, code('my_guess = 0')),
    (rules.names_stay, code('%time 1\nfor my_guess in [0]:\n    run()')),
    (rules.solutions_import_what_they_use, code('%%solution 2\nwait = deque()', 'solution')),
]
KEPT = [
    (rules.prints_what_stays, printed('/dev/shm is empty; the topic /worker, 1/tmp, and/or\n')),
    (rules.prints_what_stays, shown(text_html=PICTURE)),
    (rules.prints_what_stays, shown(text_plain='<t>', text_html='t')),
    (rules.compared, code('# Not compared: times.\nrun()', 'nbval-ignore-output')),
    (
        rules.imports_from_apis,
        code('from helpers.checks.lessons.try_it import check\nfrom helpers.robot import Robot'),
    ),
    (rules.names_stay, code('def run(my_guess):\n    other = [my_guess for my_guess in other]')),
    (
        rules.solutions_import_what_they_use,
        code('%%solution 2\nwait = [Node(str(i)) for i in ()]', 'solution'),
    ),
]

GUESS = code("my_first = guess('How many?', ..., on=range(50))", 'predict')
ANSWER = new_output('stream', name='stdout', text='How many?\n  The answer is 14.\n')
COMPARED = code("compare_prediction('How many?', my_first, len(heard))", outputs=[ANSWER])
MOVES = code("compare_prediction('How many?', my_first, len(heard), 3)")
GIVEN_AWAY = [
    [GUESS, code("compare_prediction('How many?', my_first, 14)")],
    [GUESS, code("right = [1, 4]\ncompare_prediction('How many?', my_first, right)")],
    [GUESS, code("print('They are all:', len(heard) == 14)"), COMPARED],
    [GUESS, code('assert len(heard) == approx(14)'), COMPARED],
    [GUESS, code('print(abs(len(heard) - 20) <= 3)'), MOVES],
    [
        GUESS,
        code(
            "compare_prediction('How many?', my_first, len(heard), because='Most are lost.')",
            outputs=[ANSWER],
        ),
    ],
    [
        GUESS,
        code(
            "why = f'The queue keeps {depth}, and 4 are in flight: 14.'\n"
            "compare_prediction('How many?', my_first, len(heard), because=why)",
            outputs=[ANSWER],
        ),
    ],
]
KEPT_SECRET = [
    [GUESS, COMPARED, code('len(heard) == 14')],
    [code('len(heard) == 14'), GUESS, COMPARED],
    [GUESS, code('%%solution 2\nlen(heard) == 14', 'solution'), COMPARED],
    [GUESS, code('heard[:2] == [0, 1] and depth == 10 and abs(x - 0.5) < 0.1'), COMPARED],
    [GUESS, code('print(abs(len(heard) - expected) <= 3)'), MOVES],
    [
        GUESS,
        code(
            "kind = 'A'\nif heard:\n    kind = 'B'\n"
            "compare_prediction('How many?', my_first, kind, because=f'In flight: {14.5}.')",
            outputs=[ANSWER],
        ),
    ],
]


@pytest.mark.parametrize('cells', GIVEN_AWAY)
def test_an_answer_before_its_question_is_found(cells):
    [sentence] = complaints(rules.answers_come_after_guesses, *cells)
    assert "gives the answer of 'How many?' away before it is guessed: " in sentence


@pytest.mark.parametrize('cells', KEPT_SECRET)
def test_code_that_gives_no_answer_away_is_left_alone(cells):
    assert complaints(rules.answers_come_after_guesses, *cells) == []


def test_a_guess_shows_what_may_be_answered():
    typed = code("my_first = guess('How many?', ...)", 'predict')
    [sentence] = complaints(rules.guesses_are_compared, typed, COMPARED)
    assert 'does not show what may be answered' in sentence
    assert complaints(rules.guesses_are_compared, GUESS, COMPARED) == []


def test_a_heading_with_the_answer_is_found():
    answer = new_output('stream', name='stdout', text='  The answer is SIGKILL.\n')
    compared = code("compare_prediction('How many?', my_first, hits)", outputs=[answer])
    heading = new_markdown_cell('### Run until SIGKILL')
    [sentence] = complaints(rules.answers_come_after_guesses, GUESS, heading, compared)
    assert sentence == "The heading 'Run until SIGKILL' has the answer of 'How many?'."


@pytest.mark.parametrize(
    ('old', 'new', 'said'),
    [
        ('=..., what', '=..., what', []),
        ('## From memory', '## Before', ['needs a cell that begins with `## From memory`']),
        ('=..., what', "='A', what", ['`remember(one_name=..., other_name=...)`']),
        (', what_reliable_does_for_a_queue=...', '', ['with two questions']),
        ('what_reliable', 'what_else', ['The question what_else_does_for_a_queue is not in ']),
    ],
)
def test_a_lesson_opens_with_two_questions_from_memory(old, new, said):
    notebook = template()
    for cell in notebook.cells[:6]:
        cell.source = cell.source.replace(old, new)
    found = list(rules.asks_from_memory(Lesson('90_write_a_lesson.ipynb', notebook)))
    assert len(found) == len(said)
    assert all(words in sentence for words, sentence in zip(said, found, strict=True))


def test_the_first_lessons_ask_nothing_from_memory():
    notebook = template()
    notebook.cells = [cell for cell in notebook.cells if 'remember(' not in cell.source]
    notebook.cells = [cell for cell in notebook.cells if '## From' not in cell.source]
    assert not list(rules.asks_from_memory(Lesson('02_write_a_lesson.ipynb', notebook)))
    assert list(rules.asks_from_memory(Lesson('03_write_a_lesson.ipynb', notebook)))


@pytest.mark.parametrize(('rule', 'cell'), BROKEN)
def test_a_cell_that_breaks_a_rule_is_named(rule, cell):
    [sentence] = complaints(rule, cell)
    assert cell.id in sentence or 'my_guess' in sentence


@pytest.mark.parametrize(('rule', 'cell'), KEPT)
def test_a_cell_that_keeps_a_rule_is_left_alone(rule, cell):
    assert complaints(rule, cell) == []


def test_what_is_wrong_with_a_solution_is_said():
    points = [{'what': 'it is 7', 'ok': True}, {'what': 'it is 8', 'ok': False, 'found': '9'}]
    assert rules.said([{'points': points}]) == ' "it is 8": 9'
    assert rules.said([{'note': 'It cannot be judged.', 'points': []}]) == ' It cannot be judged.'


def test_the_template_is_a_notebook_of_its_own():
    nbformat.validate(template())
