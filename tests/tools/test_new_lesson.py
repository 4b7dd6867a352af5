"""A lesson or a task is added, or a lesson taken out, in a copy of this checkout: rules hold."""

import os
import re
import subprocess
import sys

import pytest
import yaml
from support.checkouts import copy_checkout, git

from helpers.lesson import ROOT, bare_mentions, lessons, links_to_tasks, read
from tools.lessons import new, run, tables, task

KNOWN = lessons()[12]
MIDDLE = new.EXAMPLE  # which CONTRIBUTING.md and `make help` name
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
    assert 'Look at' not in printed  # a person has nothing to do
    assert printed.endswith('Now run `make notebooks LESSON=05`.\n')
    assert run.main(['05', lessons(copy / 'notebooks')[-2].number], copy) == 0
    the_rules_hold(copy)

    after = lessons(copy / 'notebooks')
    assert (titles(copy)[5], titles(copy)[-2]) == ('Measure the delay', 'Lose your keys')
    kept = [*after[:5], *after[6:-2], after[-1]]
    for old, lesson in zip(before, kept, strict=True):
        assert (old.name, old.title) == (lesson.name, lesson.title)
        # `make update` finds what a student has written by the ids.
        assert [c.id for c in old.notebook.cells] == [c.id for c in lesson.notebook.cells]
        if old.number != lesson.number:
            assert int(lesson.number) == int(old.number) + 1
    readme = (copy / 'README.md').read_text(encoding='utf-8')
    assert f'| [05 Measure the delay](notebooks/05_{MIDDLE}.ipynb) |' in readme

    commit(copy)
    assert (copy / f'tests/answers/{MIDDLE}.yaml').exists()
    for lesson in ('05', 'lose_your_keys'):
        assert new.main([lesson, '--remove'], copy) == 0
        commit(copy)
    # Of all files, only the table of exercises in notebook 00 is still that of its last run.
    changed = git(copy, 'diff', '--name-only', 'HEAD~5').split()
    assert changed == ['notebooks/00_start_here.ipynb']


@pytest.mark.parametrize('path', sorted(tables.documents()), ids=lambda path: path.name)
def test_documents_mention_lessons_by_links(path):
    text = tables.BLOCK.sub('', path.read_text(encoding='utf-8'))
    assert [*bare_mentions(text)] == []
    bare = re.sub(r'```.*?```|`[^`\n]*`|\[[^\]\n]*\]\([^)]*\)', '', text, flags=re.DOTALL)
    assert re.findall(r'.*(?<![\w:.,-])0[1-9](?![\w:.]).*', bare) == []


def test_later_tasks_follow_a_new_one():
    """Numbers are places: names, ids, judges and answers of all other tasks stay as they are."""
    texts, notebook, number = task.plan(KNOWN.name, '2', 'count_them', ROOT)
    new = read(texts[notebook], KNOWN.file)
    assert number == 3
    assert [one.number for one in new.tasks] == [*range(1, len(KNOWN.tasks) + 2)]
    names = [one.name for one in new.tasks]
    assert names.pop(2) == 'count_them'
    assert names == [one.name for one in KNOWN.tasks]
    judges = texts[f'helpers/checks/lessons/{KNOWN.name}.py']
    assert judges.index(f'def {names[1]}(') < judges.index('def count_them(')
    assert judges.index('def count_them(') < judges.index(f'def {names[2]}(')
    file = f'tests/answers/{KNOWN.name}.yaml'
    before = yaml.load((ROOT / file).read_text(encoding='utf-8'), yaml.BaseLoader)
    answers = yaml.load(texts[file], yaml.BaseLoader)
    assert {*answers} == {*before, 'count_them wrong', 'count_them right'}
    # `make update` finds what a student has written by the ids.
    kept = [cell.id for cell in KNOWN.cells]
    assert [cell.id for cell in new.cells if cell.id in kept] == kept
    # What says "task 3" of an old task 3 says "task 4" now, and leads there.
    for cell in new.cells:
        assert {*links_to_tasks(cell.source)} <= {one.anchor for one in new.tasks}


@pytest.mark.parametrize(
    'points',
    ['', 'from helpers.checks.points import all_of, needs\n',
     'from helpers.checks.points import all_of, expect, needs\n'],
)  # fmt: skip
def test_a_new_judge_has_the_import_that_it_needs(points):
    source = f'{points}from helpers.checks.tasks import Tasks\n\n\ndef it_was_here():\n    pass\n'
    lines = task.with_judge(source, 'count_them', 'it_was_here').splitlines()
    assert lines[1] == 'from helpers.checks.tasks import Tasks'
    names = lines[0].removeprefix('from helpers.checks.points import ').split(', ')
    assert names == (['all_of', 'expect', 'needs'] if points else ['expect'])


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        ([''], 'Name the lesson: make task LESSON=01 AFTER=3'),
        (['77'], "There is no single lesson '77'."),
        (['99'], 'has no task yet'),
        ([KNOWN.number, '--after', '77'], f"{KNOWN.file} has no task '77'. It has: 1 "),
        ([KNOWN.number, '--name', 'Find'], 'Name the task in small letters'),
        ([KNOWN.number, '--name', KNOWN.tasks[0].name], 'already: choose another NAME'),
        (['find_the_fault'], 'is no function of its own: write the new task by hand'),
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
        ([KNOWN.tasks[0].name], f'{KNOWN.file} has a task {KNOWN.tasks[0].name}: choose another'),
        (['count_losses', '--after', '77'], "There is no single lesson '77'. Give a number or a"),
        (['count_losses', '--after', '99'], 'The glossary stays at the end'),
        (['count_losses', '--after', '04'], 'Commit your changes first'),
        (['count_losses', '--remove'], "There is no single lesson 'count_losses'."),
        (['start_here', '--remove'], '00_start_here is no lesson'),
        ([KNOWN.name, '--remove'], f'these files name {KNOWN.name}'),
    ],
)
def test_bad_input_changes_nothing(changed, capsys, arguments, sentence):
    before = git(changed, 'status', '--porcelain'), git(changed, 'diff')
    assert new.main(arguments, changed) == 1
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count('\n') == 1
    assert (git(changed, 'status', '--porcelain'), git(changed, 'diff')) == before
