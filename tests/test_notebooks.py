"""Every lesson keeps the rules, and what is said of it elsewhere is right. nbval runs it."""

import pytest

from helpers import progress
from tools.lessons import rules, tables
from tools.lessons.lesson import lessons

LESSONS = lessons()
TEXTS = tables.texts_of()


@pytest.mark.parametrize('lesson', LESSONS, ids=[lesson.file for lesson in LESSONS])
def test_lesson(lesson):
    problems = rules.problems(lesson)
    assert not problems, '\n'.join(problems)


def test_lessons_together():
    problems = rules.problems_of_all(LESSONS)
    assert not problems, '\n'.join(problems)


@pytest.fixture(scope='module')
def made():
    return tables.made(TEXTS)


@pytest.mark.parametrize('path', TEXTS)
def test_what_follows_from_the_notebooks(path, made):
    assert path not in made, (
        f'{path} differs from what follows from the notebooks: run `{tables.COMMAND}`.'
    )


def test_lesson_00_shows_the_tasks_that_there_are():
    assert not tables.needs_run(LESSONS), (
        f'The table in notebook 00 is of other lessons: run `{tables.COMMAND}`.'
    )


def test_kernels_and_rules_read_the_same_tasks():
    assert progress.with_tasks() == tables.with_tasks(LESSONS)
    for one in LESSONS:
        assert one.tasks == list(rules.tasks(one))
