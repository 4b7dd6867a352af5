"""The rules whose logic is not plain from their code; each example is one that got through once."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_output

from tools.lessons import rules
from tools.lessons.lesson import FOLDER, Lesson
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
    (rules.names_stay, code('my_guess = 0')),
    (rules.names_stay, code('%time 1\nfor my_guess in [0]:\n    run()')),
    (rules.solutions_import_what_they_use, code('%%solution 2\nwait = deque()', 'solution')),
]
KEPT = [
    (rules.prints_what_stays, printed('/dev/shm is empty; the topic /worker, 1/tmp, and/or\n')),
    (rules.prints_what_stays, shown(text_html=PICTURE)),
    (rules.prints_what_stays, shown(text_plain='<t>', text_html='t')),
    (rules.compared, code('# Not compared: times.\nrun()', 'nbval-ignore-output')),
    (rules.names_stay, code('def run(my_guess):\n    other = [my_guess for my_guess in other]')),
    (
        rules.solutions_import_what_they_use,
        code('%%solution 2\nwait = [Node(str(i)) for i in ()]', 'solution'),
    ),
]


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
