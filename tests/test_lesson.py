"""What a lesson is: its tasks by name, its guesses, and how texts mention lessons and tasks."""

import ast
import re

import pytest
from nbformat.v4 import new_code_cell, new_raw_cell
from support.lessons import lesson, task

from helpers.lesson import (
    ROOT,
    bare_mentions,
    check_call,
    earlier_name,
    lessons,
    magic_of,
    outlines,
    path_and_part,
    with_mentions,
    with_slugs,
    without_links,
    write_numbers,
)
from helpers.lesson.earlier import NAMES

# What a cell begins with, or has in it, because it is part of a lesson.
GRAMMAR = re.compile(
    r'✎|%%solution|check\\?\(|## \\d|## From memory|### Question|For the instructor|Part: '
    r'|compare_prediction\\?\(|remember\\?\(|Workspace\\?\('
)
READS = {'compile', 'match', 'search', 'fullmatch', 'findall', 'finditer', 'sub', 'split'}
READS |= {'startswith', 'removeprefix', 'partition', 'index', 'find'}


def test_a_task_has_a_name_for_ever_and_the_number_of_its_place():
    one = lesson(*task('a', 1), *task('b', 2, 'Turn', ' ★'))
    assert [(t.number, t.name, t.title, t.star) for t in one.tasks] == [
        (1, 'a', 'Try', False),
        (2, 'b', 'Turn', True),
    ]
    moved = lesson(*task('b', 2, 'Turn', ' ★'), *task('a', 1), file='07_keep_it.ipynb')
    write_numbers(moved)
    assert [(t.number, t.name) for t in moved.tasks] == [(1, 'b'), (2, 'a')]
    assert moved.cells[0].source == '# 07 Keep it'
    assert moved.cells[1].source.startswith('### ✎ Task 1 ★: Turn\n')


@pytest.mark.parametrize(
    ('source', 'call'),
    [
        ("check('a_driver', Driver)", ('a_driver', ['Driver'])),
        ("check('it', workspace, 'src/a.py')  # mine", ('it', ['workspace', "'src/a.py'"])),
        ("print(1)\ncheck('it')", ('it', [])),
        ('check(3, Driver)', None),  # of version 0.3
        ('checked = 1', None),
        ("check('it', ", None),
    ],
)
def test_a_check_says_its_task_and_what_it_hands_over(source, call):
    assert check_call(source) == call


@pytest.mark.parametrize(
    ('source', 'magic'),
    [
        ('%%write src/a b.py part 2\nx = 1\n', ('write', 'src/a b.py part 2', 'x = 1\n')),
        ('\n%%terminal\nls', ('terminal', '', 'ls')),
        ('%%terminal robot ', ('terminal', 'robot', '')),
        ('x = 1\n%%terminal', ('', '', 'x = 1\n%%terminal')),
    ],
)
def test_a_magic_is_read_with_its_line_and_what_is_below(source, magic):
    assert magic_of(source) == magic
    assert magic_of(source).file == ('src/a b.py' if magic[0] == 'write' else '')


@pytest.mark.parametrize(
    ('line', 'found'),
    [('a.py', ('a.py', None)), ('"a b.py" part 12 ', ('a b.py', 12)), ('part 2', ('part 2', None))],
)
def test_a_line_of_write_names_a_file_and_perhaps_a_part(line, found):
    assert path_and_part(line) == found


def test_links_get_the_numbers_of_today():
    here = lesson(*task('new', 1, 'New'), *task('a', 2, 'Try it'), file='09_here.ipynb')
    other = lesson(*task('b', 4, 'Turn', ' ★'), file='06_keep_it.ipynb')
    text = (
        '[Lesson 05](05_keep_it.ipynb), lessons [05](../notebooks/05_keep_it.ipynb) and 1; '
        '[task 1](#✎-Task-1:-Try-it), [task 3 ★](05_keep_it.ipynb#✎-Task-3-★:-Turn), '
        '[its picture](05_keep_it.ipynb), [05](05_gone.ipynb), [05](https://a.org/05_x.html)'
    )
    written = with_mentions(text, [here, other], here)
    assert written == (
        '[Lesson 06](06_keep_it.ipynb), lessons [06](../notebooks/06_keep_it.ipynb) and 1; '
        '[task 2](#✎-Task-2:-Try-it), [task 4 ★](06_keep_it.ipynb#✎-Task-4-★:-Turn), '
        '[its picture](06_keep_it.ipynb), [05](05_gone.ipynb), [05](https://a.org/05_x.html)'
    )
    assert with_mentions(written, [here, other], here) == written
    assert without_links('In [task 2](#✎-Task-2:-Try-it): [x](y.md)') == 'In task 2: [x](y.md)'
    assert with_slugs('[task 6 ★](#✎-Task-6-★:-A-mirror)') == '[task 6 ★](#-task-6--a-mirror)'


def test_a_number_outside_a_link_is_found():
    text = 'As in lesson 05 and Lessons 02, 03 and 04; tasks 5 and 6, [task 7](#x), step 3'
    assert [*bare_mentions(text)] == ['lesson 05', 'Lessons 02, 03 and 04', 'tasks 5 and 6']
    assert [*bare_mentions('### ✎ Task 3: Try')] == []


def test_a_guess_is_found_with_its_comparison():
    asked = new_code_cell("%time 1\nmy_x = guess('How many?', ...)", metadata={'tags': ['predict']})
    other = new_code_cell("compare_prediction('How far?', my_x, 1)")
    compared = new_code_cell("found = 3\ncompare_prediction(\n    'How many?', my_x, found)")
    early = new_code_cell(compared.source)
    one = lesson(early, asked, new_raw_cell('For the instructor: 4 minutes'), other, compared)
    [guess] = one.guesses
    assert (guess.variable, guess.question, guess.value) == ('my_x', 'How many?', ...)
    assert one.comparison_of(guess) is compared
    assert lesson(asked, other).comparison_of(guess) is None


def test_the_quick_reading_finds_what_the_other_one_does():
    for quick, whole in zip(outlines(), lessons(), strict=True):
        assert [(t.name, t.title, t.star) for t in quick.tasks] == [
            (t.name, t.title, t.star) for t in whole.tasks
        ]
        assert quick.workspace == whole.workspace


def test_nothing_else_reads_the_cells_of_a_lesson():
    """A pattern of the grammar outside of helpers/lesson would be a second owner."""
    found = []
    for folder in ('helpers', 'tools', 'classroom'):
        for file in sorted((ROOT / folder).rglob('*.py')):
            if ROOT / 'helpers/lesson' in file.parents or 'tests' in file.parts:
                continue
            for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
                if isinstance(node, ast.Call) and getattr(node.func, 'attr', '') in READS:
                    texts = [arg.value for arg in ast.walk(node) if isinstance(arg, ast.Constant)]
                    found += [
                        f'{file.relative_to(ROOT)}:{node.lineno}: {text!r}'
                        for text in texts
                        if isinstance(text, str) and GRAMMAR.search(text)
                    ]
    assert found == []


# Tasks of version 0.3 that no lesson has any more. Each other one keeps what was done for it.
GONE = {
    *('fill_it', 'listen_for_two_events', 'answer_at_the_end', 'catch_it'),
    *('make_the_library', 'give_it_to_others', 'name_what_it_needs', 'make_the_module'),
}


def test_what_was_done_for_a_task_of_0_3_counts_for_one_of_today():
    today = {task.name for lesson in outlines() for task in lesson.tasks}
    assert {name for names in NAMES.values() for name in names} - today == GONE
    assert earlier_name('test_a_node', 6) == 'run_them'
    assert earlier_name('test_a_node', 99) == earlier_name('gone', 1) == ''
