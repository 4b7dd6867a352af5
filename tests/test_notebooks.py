"""Every lesson keeps the rules, and what is said of it elsewhere is right. nbval runs it."""

from importlib import import_module
from pathlib import Path

import pytest
from mutants.made import is_program
from support.answers import EQUAL, LEAST, answers_of, source_of

from helpers.lesson import code_of_solution, lessons
from tools.lessons import rules, tables
from tools.lessons.first_pictures.__main__ import IMAGES, is_same, pictures

LESSONS = lessons()
ANSWERS = Path(__file__).parent / 'answers'


@pytest.mark.parametrize('lesson', LESSONS, ids=[lesson.file for lesson in LESSONS])
def test_lesson(lesson):
    problems = rules.problems(lesson)
    assert not problems, '\n'.join(problems)


def test_lessons_together():
    problems = rules.problems_of_all(LESSONS)
    assert not problems, '\n'.join(problems)


def test_what_follows_from_the_notebooks():
    differ = list(tables.updated(tables.texts_of()))
    assert not differ, f'They differ from what follows from the notebooks: run `{tables.COMMAND}`.'


def test_the_first_pictures_follow_from_the_notebooks():
    made = pictures()
    differ = [
        name for name in made if not is_same(made[name], (IMAGES / f'{name}.svg').read_text())
    ]
    assert not differ, f'They differ from what follows from the notebooks: run `{tables.COMMAND}`.'


def test_lesson_00_shows_the_tasks_that_there_are():
    assert not tables.needs_run(LESSONS), f'Run `{tables.COMMAND}`.'


@pytest.mark.parametrize('lesson', LESSONS, ids=[lesson.file for lesson in LESSONS])
def test_each_task_has_answers_that_try_its_check(lesson):
    file = ANSWERS / f'{lesson.name}.yaml'
    answers = answers_of(file) if file.exists() else {}
    wanted = {f'{task.name} right' for task in lesson.tasks}
    may_be = {f'{task.name} {kind}' for task in lesson.tasks for kind in ('wrong', EQUAL)}
    differ = ', '.join(sorted((answers.keys() - may_be) ^ wanted))
    assert not differ, (
        f'tests/answers/{file.name} lacks these, or has too many: {differ}. The top of '
        'tests/answers/test_answers.py says how answers are written.'
    )
    few = [key for key in sorted(wanted) if len(answers[key]) < LEAST['right']]
    assert not few, f'{file.name} has fewer than {LEAST["right"]} answers below {", ".join(few)}.'


@pytest.mark.parametrize('lesson', LESSONS, ids=[lesson.file for lesson in LESSONS])
def test_each_answer_can_still_be_made_from_its_task(lesson):
    file = ANSWERS / f'{lesson.name}.yaml'
    answers = answers_of(file) if file.exists() else {}
    problems = []
    for task in lesson.tasks:
        sources = [code_of_solution(cell.source) for cell in task.solutions]
        sources += [cell.source for cell in task.exercises]
        for kind in ('wrong', 'right'):
            for answer in answers.get(f'{task.name} {kind}', []):
                where = f'Below `{task.name} {kind}:` of {file.name}.'
                try:
                    source = source_of(answer, *sources)
                except ValueError as error:
                    problems.append(f'{where} {error}')
                else:  # a wrong one whose cell fails tells nothing about its check
                    if kind == 'wrong' and not is_program(source):
                        problems.append(f'{where} This answer has a syntax error:\n{source}')
    assert not problems, '\n'.join(problems)


@pytest.mark.parametrize('lesson', LESSONS, ids=[lesson.file for lesson in LESSONS])
def test_the_judges_are_those_of_the_tasks_in_their_order(lesson):
    if lesson.tasks:
        judges = import_module(f'helpers.checks.lessons.{lesson.name}').tasks.judges
        assert [*judges] == [task.name for task in lesson.tasks]
