"""Every lesson keeps the rules of notebook_rules.py. nbval runs the lessons."""

import nbformat
import notebook_rules as rules
import pytest

from helpers import progress
from tools.notebooks import FOLDER, PICTURES, pictures

PATHS = sorted(FOLDER.glob('*.ipynb'))
NAMES = [path.name for path in PATHS]


def test_lessons_are_in_teaching_order():
    assert rules.teaching_order(NAMES) == []


@pytest.mark.parametrize('group', rules.GROUPS)
@pytest.mark.parametrize('path', PATHS, ids=NAMES)
def test_lesson(path, group):
    assert rules.problems(nbformat.read(path, as_version=4), group) == []


@pytest.mark.parametrize('path', PATHS, ids=NAMES)
def test_lesson_in_its_folder(path):
    text = path.read_text(encoding='utf-8')
    notebook = nbformat.reads(text, as_version=4)
    assert rules.saved_as_jupyter_does(text, notebook) == []
    assert rules.title_matches(path.name, notebook) == []
    assert rules.links_lead_somewhere(notebook, FOLDER) == []
    assert rules.maps_every_lesson(notebook, NAMES) == []


def test_progress_knows_every_exercise():
    found = {}
    for path in PATHS:
        notebook = nbformat.read(path, as_version=4)
        if exercises := rules.exercises(notebook):
            title = notebook.cells[0].source.splitlines()[0].removeprefix('# ')
            found[title[:2]] = title[3:], len(exercises)
    assert found == progress.LESSONS, f'LESSONS in helpers/progress.py should be {found}'


def test_the_readme_leads_to_every_notebook():
    readme = (FOLDER.parent / 'README.md').read_text(encoding='utf-8')
    assert [name for name in NAMES if f'(notebooks/{name})' not in readme] == []


def test_pictures_are_those_of_the_notebooks():
    found = {}
    for path in PATHS:
        found |= pictures(nbformat.read(path, as_version=4))
    assert sorted(found) == sorted(PICTURES.values())
    for name, picture in found.items():
        assert (FOLDER / name).read_bytes() == picture, f'run `make notebooks` for {name}'
