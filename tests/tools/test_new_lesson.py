"""A lesson is added and taken out in a copy of this checkout, where all rules still hold."""

import os
import subprocess
import sys

import nbformat
import pytest
from support.checkouts import copy_checkout, git

from tools.lessons import new, run
from tools.lessons.lesson import ROOT, lessons

KNOWN = lessons()[2]
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
    return [one.title for one in lessons(folder / 'notebooks')]


def test_a_number_at_the_end_of_a_sentence_is_renumbered():
    stems = {'05_run_a_long_job': '06_run_a_long_job'}
    text = 'As in lesson 05. Lesson 05 says more, and lessons 04 and 05.'
    assert new.renumbered(text, stems) == text.replace('05', '06')


def test_added_and_taken_out(tmp_path, capsys):
    copy = copied(tmp_path / 'copy')
    before = lessons(copy / 'notebooks')
    assert new.main(['lose_your_keys'], copy) == 0
    commit(copy)
    assert new.main(['find_your_keys', '--after', '04'], copy) == 0
    assert run.main(['00'], copy) == 0
    assert '05_find_your_keys.ipynb: its summary is not yet in French' in capsys.readouterr().out
    the_rules_hold(copy)

    after = lessons(copy / 'notebooks')
    assert (titles(copy)[5], titles(copy)[-2]) == ('Find your keys', 'Lose your keys')
    kept = [*after[:5], *after[6:-2], after[-1]]
    for old, one in zip(before, kept, strict=True):
        assert (old.name, old.title) == (one.name, one.title)
        if old.number != one.number:
            assert int(one.number) == int(old.number) + 1
            text = nbformat.writes(one.notebook)
            for word in ('of lesson ', 'lesson_', '"lesson-', '"note-', '"quiz-'):
                assert text.count(f'{word}{one.number}') == nbformat.writes(old.notebook).count(
                    f'{word}{old.number}'
                )
    readme = (copy / 'README.md').read_text(encoding='utf-8')
    assert '| 05 | [Find your keys](notebooks/05_find_your_keys.ipynb) |' in readme

    commit(copy)
    assert new.main(['find_your_keys', '--remove'], copy) == 0
    commit(copy)
    assert new.main(['lose_your_keys', '--remove'], copy) == 0
    git(copy, 'add', '-A')
    # Of all files, only the table of exercises in notebook 00 is still that of its last run.
    assert git(copy, 'diff', '--cached', '--name-only', 'HEAD~3').split() == [
        'notebooks/00_start_here.ipynb'
    ]


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
        (['count'], 'Name the lesson in small letters'),
        (['Count_losses'], 'Name the lesson in small letters'),
        (['count losses'], 'Name the lesson in small letters'),
        (['10_count_losses'], 'Name the lesson in small letters'),
        ([KNOWN.name], f'There is {KNOWN.file} already'),
        (['count_losses', '--after', '77'], "There is no lesson '77'. Give AFTER one of 00, 01"),
        (['count_losses', '--after', '99'], "There is no lesson '99'."),
        (['count_losses', '--after', '04'], 'Commit your changes first'),
        (['count_losses', '--remove'], "There is no lesson 'count_losses' to remove."),
        (['look_up_a_term', '--remove'], "There is no lesson 'look_up_a_term' to remove."),
        ([KNOWN.name, '--remove'], f'Lesson {KNOWN.number} is named in '),
        ([KNOWN.name, '--remove', '--after', '03'], 'Give AFTER or REMOVE, not both.'),
    ],
)
def test_bad_input_changes_nothing(changed, capsys, arguments, sentence):
    before = git(changed, 'status', '--porcelain'), git(changed, 'diff')
    assert new.main(arguments, changed) == 1
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count('\n') == 1
    assert (git(changed, 'status', '--porcelain'), git(changed, 'diff')) == before


def test_the_template_is_run_by_nbval(pytestconfig):
    assert str(new.TEMPLATE.relative_to(ROOT)) in pytestconfig.getini('testpaths')
    notebook = nbformat.read(new.TEMPLATE, as_version=4)
    assert not run.pictures(notebook)
