"""The template keeps all rules; broken in one place, it breaks the one that it should."""

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_output, new_raw_cell

from tools.lessons import rules
from tools.lessons.clean import clean, text_of
from tools.lessons.lesson import FOLDER, Lesson
from tools.lessons.new import template
from tools.lessons.run import execute

FILE = '90_write_a_lesson.ipynb'
ALT = 'alt="One dot for each of five messages."'


@pytest.fixture(scope='module')
def text():
    """Return the text of the template, which has been run."""
    return text_of(execute(template(), FOLDER))


def lesson(text, *cells, file=FILE):
    """Return the template, or what its text has become, with some cells before its recap."""
    notebook = nbformat.reads(text, as_version=4)
    at = next(i for i, cell in enumerate(notebook.cells) if cell.source.startswith('## Recap'))
    notebook.cells[at:at] = cells
    return Lesson(file, notebook)


def code(source='run()', *tags, outputs=()):
    cell = new_code_cell(source, metadata={'tags': list(tags)}, outputs=list(outputs))
    cell.execution_count = 9
    if {'solution', 'check'} & set(tags):
        cell.metadata.jupyter = {'source_hidden': True}
    return cell


def printed(text, name='stdout'):
    return code(outputs=[new_output('stream', name=name, text=text)])


def shown(**data):
    bundle = {kind.replace('_', '/'): text for kind, text in data.items()}
    return code(outputs=[new_output('execute_result', data=bundle)])


def note(text):
    metadata = {'tags': ['notes'], 'jupyter': {'source_hidden': True}}
    return new_raw_cell(text, metadata=metadata)


def complaints(built):
    """Return the names of the rules that `built` breaks; each says what, in a sentence."""
    names = set()
    for rule in rules.RULES:
        for sentence in rule(built):
            assert sentence.endswith('.')
            names.add(rule.__name__)
    return names


def test_the_template_keeps_all_rules(text):
    built = lesson(text)
    assert rules.problems(built) == []
    nbformat.validate(built.notebook)
    assert clean(built.notebook) == built.notebook


# A rule, a text in the file of the template, and what it becomes.
CHANGED = [
    ('named', '# 90 Write a', '# 90 Read a'),
    ('named', '# 90 Write a', '# 91 Write a'),
    ('named', '**Time** 10 minutes', '**Time** 11 minutes'),
    ('named', 'Part: nodes', 'Part: node'),
    ('guesses_are_compared', 'my_guess = guess(', 'print('),
    ('guesses_are_compared', "heard?', my_guess,", "heard?', 5,"),
    ('guesses_are_compared', "heard?', ...)", "heard?', 5)"),
    ('tasks_are_checked', '### ✎ Task 1', '### ✎ Task 2'),
    ('tasks_are_checked', '"check"', '"exercise"'),
    ('tasks_are_checked', '[ok] it', 'it'),
    ('tasks_are_checked', '"check(1', '"check(2'),
    ('tasks_are_checked', '%%solution 1', '%%solution 2'),
    ('tagged', '"check"', '"chek"'),
    ('tagged', '# ✔ Check', '# Check'),
    ('tagged', '    "jupyter": {\n     "source_hidden": true\n    },\n', ''),
    ('questions_have_one_right_answer', '**Right.** This', '**No.** This'),
    ('questions_have_one_right_answer', '**No.** On a', '**Right.** On a'),
    ('links_lead_somewhere', '99_look_up_a_term.ipynb', '98_look_up_a_term.ipynb'),
    ('executed_in_order', '"execution_count": 3', '"execution_count": 7'),
]

# A rule, and a cell that breaks it.
ADDED = [
    ('prints_what_stays', printed('warning\n', 'stderr')),
    ('prints_what_stays', printed('saved in /home/ada/plot.csv\n')),
    ('prints_what_stays', printed('lib/python3.11/site-packages/rclpy\n')),
    ('prints_what_stays', printed(r'C:\Users\ada' + '\n')),
    ('prints_what_stays', printed(f'in {FOLDER.parent}\n')),
    ('prints_what_stays', shown(text_html='<a href="/root/x">x</a>')),
    ('prints_what_stays', shown(text_plain='<Axes: >')),
    ('compared', code('# NBVAL_IGNORE_OUTPUT\n# Not compared: times.\nrun()')),
    ('compared', code('# Not compared:\nrun()', 'nbval-ignore-output')),
    ('compared', code('run()', 'nbval-ignore-output')),
    ('compared', code('run()  \n  # NBVAL_RAISES_EXCEPTION')),
    ('pictures_described', shown(text_html='<img alt="A figure.">')),
    ('pictures_described', shown(text_html=f'<img {ALT}> <img {ALT}>')),
    ('pictures_described', shown(image_png='iVBO')),
    ('pictures_described', new_markdown_cell('![](images/b.png)')),
    ('imports_what_is_public', code('from helpers.notebook.text import table')),
    ('names_stay', code('my_guess = 0')),
    ('names_stay', code('%time 1\nfor my_guess in [0]:\n    run()')),
    ('steps_begin_cells', new_markdown_cell('So it is.\n\n## 7. Next')),
    ('tasks_are_checked', code('run()', 'check')),
    ('tagged', note('Ask first.')),
    ('tagged', new_raw_cell('For the instructor: ask')),
    ('fits_a_screen', code('\n'.join(['run()'] * (rules.MAX_CODE_LINES + 1)))),
    ('links_lead_somewhere', new_markdown_cell('[there](nowhere.ipynb)')),
]


@pytest.mark.parametrize(('rule', 'old', 'new'), CHANGED)
def test_a_changed_template_breaks_a_rule(text, rule, old, new):
    assert old in text
    assert rule in complaints(lesson(text.replace(old, new, 1)))


@pytest.mark.parametrize(('rule', 'cell'), ADDED)
def test_an_added_cell_breaks_a_rule(text, rule, cell):
    assert rule in complaints(lesson(text, cell))


def test_every_rule_is_broken_once():
    names = {rule.__name__ for rule in rules.RULES}
    assert names == {name for name, *_ in CHANGED + ADDED}


@pytest.mark.parametrize(
    'cell',
    [
        code('# Not compared: times.\nrun()', 'nbval-ignore-output'),
        code('run()\n' * rules.MAX_CODE_LINES),
        code('def run(my_guess):\n    other = [my_guess for my_guess in other]'),
        printed('/dev/shm is empty; the topic /worker, 1/tmp, and/or\n'),
        shown(text_plain='<t>', text_html='t'),
        shown(text_html=f'<img {ALT} src="data:image/png;base64,iVBO+0xabcdef/tmp/AA">'),
        new_markdown_cell('```python\n# a comment, no heading\n```'),
        note('For the instructor: ask first'),
    ],
)
def test_what_is_allowed_breaks_no_rule(text, cell):
    assert complaints(lesson(text, cell)) <= {'executed_in_order'}


def test_the_numbers_of_the_notebooks(text):
    def built(*files):
        return rules.problems_of_all([lesson(text, file=file) for file in files])

    assert built('00_start_here.ipynb', '01_lose.ipynb') != []
    for files in (['00_a', '02_b'], ['01_a', '02_b'], ['00_a', '00_b'], ['00_a', '01-b']):
        assert built(*(f'{file}.ipynb' for file in files))
