"""A lesson or a task is added, or a lesson taken out, in a copy of this checkout: rules hold."""

import os
import re
import shutil
import subprocess
import sys

import nbformat
import pytest
import yaml
from support.checkouts import copy_checkout, git

from helpers.lesson import ROOT, lessons
from tools.lessons import new, run, task

KNOWN = lessons()[12]
MIDDLE = 'find_your_keys'  # no test may name its file: it could not be taken out
CHEAP = ['tests/test_notebooks.py', 'tests/test_progress.py']


def copied(folder):
    """Copy this checkout with its changes, and commit them there; return the folder."""
    copy_checkout(folder)
    git(folder, 'init', '-q')
    commit(folder)
    return folder


def commit(folder):
    git(folder, 'add', '-A')
    git(folder, 'commit', '-qm', 'All')


def titles(folder):
    return [lesson.title for lesson in lessons(folder / 'notebooks')]


def the_rules_hold(folder):
    environment = os.environ | {'PYTHONPATH': str(folder), 'PYTHONDONTWRITEBYTECODE': '1'}
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', *CHEAP],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout


def test_added_in_the_middle_and_at_the_end_with_a_task(tmp_path, capsys):
    copy = copied(tmp_path / 'copy')
    before = lessons(copy / 'notebooks')
    assert new.main(['lose_your_keys'], copy) == 0
    commit(copy)
    assert task.main(['lose_your_keys'], copy) == 0
    assert 'make test-answers LESSON=lose_your_keys TASK=2' in capsys.readouterr().out
    commit(copy)
    assert new.main([MIDDLE, '--after', '04'], copy) == 0
    printed = capsys.readouterr().out
    assert 'Look at these lines' in printed
    assert printed.endswith('Now run `make notebooks LESSON=05`.\n')
    assert run.main(['05', lessons(copy / 'notebooks')[-2].number], copy) == 0
    the_rules_hold(copy)

    after = lessons(copy / 'notebooks')
    assert (titles(copy)[5], titles(copy)[-2]) == ('Find your keys', 'Lose your keys')
    kept = [*after[:5], *after[6:-2], after[-1]]
    for old, lesson in zip(before, kept, strict=True):
        assert (old.name, old.title) == (lesson.name, lesson.title)
        # `make update` finds what a student has written by the ids.
        assert [c.id for c in old.notebook.cells] == [c.id for c in lesson.notebook.cells]
        if old.number != lesson.number:
            assert int(lesson.number) == int(old.number) + 1
    readme = (copy / 'README.md').read_text(encoding='utf-8')
    assert f'| [05 Find your keys](notebooks/05_{MIDDLE}.ipynb) |' in readme

    commit(copy)
    assert (copy / f'tests/answers/{MIDDLE}.yaml').exists()
    for lesson in ('05', 'lose_your_keys'):
        assert new.main([lesson, '--remove'], copy) == 0
        commit(copy)
    # Of all files, only the table of exercises in notebook 00 is still that of its last run.
    changed = git(copy, 'diff', '--name-only', 'HEAD~5').split()
    assert changed == ['notebooks/00_start_here.ipynb']


def test_later_tasks_follow_a_new_one():
    texts, number, last = task.plan(KNOWN.name, '2', ROOT)
    notebook, checks, answers = texts.values()
    cells = nbformat.reads(notebook, as_version=4).cells
    every = [str(count) for count in range(1, last + 1)]
    assert number == 3
    for pattern in (r'^### ✎ Task (\d+)', r'^check\((\d+)', r'^%%solution (\d+)'):
        found = (re.search(pattern, cell.source, re.MULTILINE) for cell in cells)
        assert [one[1] for one in found if one] == every
    assert re.findall(r'^@tasks\.add\((\d+)', checks, re.MULTILINE) == every
    assert [*yaml.safe_load(answers)] == [
        f'{n} {kind}' for n in every for kind in ('wrong', 'right')
    ]
    # `make update` finds what a student has written by the ids.
    kept = [cell.id for cell in KNOWN.notebook.cells]
    assert [cell.id for cell in cells if cell.id in kept] == kept


def test_lines_that_may_name_a_task_by_its_old_number_are_printed(tmp_path, capsys):
    number, name = KNOWN.number, KNOWN.name
    for path in (f'notebooks/{KNOWN.file}', *(path.format(name=name) for path in new.BESIDE)):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, tmp_path / path)
    texts = {
        'exam.md': f'# Lesson {number}\n\nTake a pen.\nIt is tasks 1 to 4.\n# Home\nTask 3\n',
        'made.md': f'<!-- made by `make notebooks`: x -->\n\n| {number} | task 4 |\n<!-- end -->',
        'grade.sh': f'LESSON={name} TASKS="1 4"\nLESSON={number} TASK=2\nTASK=4\n',
    }
    for path, text in texts.items():
        (tmp_path / path).write_text(text, encoding='utf-8')
    git(tmp_path, 'init', '-q')
    commit(tmp_path)
    assert task.main([number, '--after', '2'], tmp_path) == 0
    printed = capsys.readouterr().out.partition('Look at these lines')[2].splitlines()
    assert [line for line in printed if line.startswith(tuple(texts))] == [
        'exam.md: It is tasks 1 to 4.',
        f'grade.sh: LESSON={name} TASKS="1 4"',
    ]


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        ([''], 'Name the lesson: make task LESSON=01 AFTER=3'),
        (['77'], "There is no single lesson '77'."),
        (['99'], 'has no task yet'),
        ([KNOWN.number, '--after', '77'], 'name one of them with AFTER'),
        (['find_the_fault'], 'for each of the tasks 1 to 10: write the new task by hand'),
    ],
)
def test_a_task_of_no_lesson_gets_one_sentence(capsys, arguments, sentence):
    assert task.main(arguments) == 1
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count('\n') == 1


def test_a_lesson_that_git_does_not_know_is_not_taken_out(tmp_path, capsys):
    copy = copied(tmp_path / 'copy')
    assert new.main([MIDDLE], copy) == 0
    git(copy, 'commit', '-qam', 'All but the new files')
    capsys.readouterr()
    assert new.main([MIDDLE, '--remove'], copy) == 1
    error = capsys.readouterr().err
    assert f'tests/answers/{MIDDLE}.yaml' in error
    assert 'git add -A' in error


@pytest.fixture(scope='module')
def changed(tmp_path_factory):
    """A copy of this checkout with a change in the last lesson that is not committed."""
    folder = copied(tmp_path_factory.mktemp('copy'))
    path = folder / 'notebooks' / lessons()[-2].file
    path.write_text(path.read_text(encoding='utf-8').replace('## Recap', '## Recap '), 'utf-8')
    return folder


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (['Count_losses'], 'Name the lesson in small letters'),
        ([KNOWN.name], f'There is notebooks/{KNOWN.file} already'),
        (['count_losses', '--after', '77'], "There is no single lesson '77'. Give a number or a"),
        (['count_losses', '--after', '99'], 'The glossary stays at the end'),
        (['count_losses', '--after', '04'], 'Commit your changes first'),
        (['count_losses', '--remove'], "There is no single lesson 'count_losses'."),
        (['start_here', '--remove'], '00_start_here is no lesson'),
        ([KNOWN.name, '--remove'], f'these files name {KNOWN.number}_{KNOWN.name}'),
    ],
)
def test_bad_input_changes_nothing(changed, capsys, arguments, sentence):
    before = git(changed, 'status', '--porcelain'), git(changed, 'diff')
    assert new.main(arguments, changed) == 1
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count('\n') == 1
    assert (git(changed, 'status', '--porcelain'), git(changed, 'diff')) == before
