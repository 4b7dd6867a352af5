"""Every lesson keeps the rules, and what is said of it elsewhere is right. nbval runs it."""

import pytest

from helpers.checks import progress
from tools.lessons import rules, tables
from tools.lessons.lesson import lessons

LESSONS = lessons()


@pytest.mark.parametrize('lesson', LESSONS, ids=[lesson.file for lesson in LESSONS])
def test_lesson(lesson):
    problems = rules.problems(lesson)
    assert not problems, '\n'.join(problems)


def test_lessons_together():
    problems = rules.problems_of_all(LESSONS)
    assert not problems, '\n'.join(problems)


def test_what_follows_from_the_notebooks():
    differ = list(tables.made(tables.texts_of()))
    assert not differ, f'They differ from what follows from the notebooks: run `{tables.COMMAND}`.'


def test_lesson_00_shows_the_tasks_that_there_are():
    assert not tables.needs_run(LESSONS), f'Run `{tables.COMMAND}`.'


def test_kernels_and_rules_read_the_same_tasks():
    assert progress.with_tasks() == tables.with_tasks(LESSONS)
    for one in LESSONS:
        assert one.tasks == list(rules.tasks(one))
