"""A lesson that goes on with the program of an earlier one: whose files it gets."""

import shutil
import sys
from types import ModuleType

import nbformat
import pytest
from IPython.core.error import UsageError
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook
from support.packages import SETUP_PY, package_xml

from helpers.checks import carry_on, progress
from helpers.checks.tasks import Tasks
from helpers.lesson import code_of_solution, keep_solution
from helpers.workspace import Workspace

EARLIER, LATER = 'build_it_in_a_test', 'carry_it_on_in_a_test'
SPEED, NAME = 'src/small_pkg/small_pkg/speed.py', 'src/small_pkg/small_pkg/name.py'
TASKS = {  # the file that each writes, its part of it, the starter, the solution
    'the_speed': (f'{SPEED} part 1', 'SPEED = 0', 'SPEED = 1'),
    'the_limit': (f'{SPEED} part 2', 'LIMIT = 0', 'LIMIT = 9'),
    'the_name': (NAME, "NAME = ''", "NAME = 'solution'"),
}
OWN = {SPEED: 'SPEED = 3\nLIMIT = 30\n', NAME: "NAME = 'own'\n"}


def lesson():
    """Return a lesson whose cells and tasks write a package."""
    files = {
        'package.xml': package_xml('small_pkg', 'ament_python'),
        'setup.py': SETUP_PY.replace('talker_pkg', 'small_pkg'),
        'resource/small_pkg': '',
        'small_pkg/__init__.py': '',
    }
    cells = [
        new_markdown_cell('# 92 Build it'),
        new_code_cell(f"workspace = Workspace('{EARLIER}')"),
    ]
    cells += [
        new_code_cell(f'%%write src/small_pkg/{file}\n{text}') for file, text in files.items()
    ]
    cells.append(new_code_cell('%%terminal\ntouch src/small_pkg/made_in_a_terminal'))
    for number, (name, (file, starter, solution)) in enumerate(TASKS.items(), 1):
        cells.append(new_markdown_cell(f'### ✎ Task {number}: {name}\n\nDo it.'))
        for tag, source in (
            ('exercise', f'%%write {file}\n{starter}\n'),
            ('check', f"check('{name}', workspace)"),
            ('solution', f'%%solution {name}\n%%write {file}\n{solution}\n'),
        ):
            cells.append(new_code_cell(source, metadata={'tags': [tag]}))
    return new_notebook(cells=cells)


def without_solutions():
    """Return the lesson as a student has it whose teacher keeps the solutions."""
    notebook, checks = lesson(), []
    for cell in notebook.cells:
        if 'check' in cell.metadata.get('tags', ()):
            checks.append(cell)
        elif 'solution' in cell.metadata.get('tags', ()):
            keep_solution(checks[-1], code_of_solution(cell.source))
    notebook.cells = [c for c in notebook.cells if 'solution' not in c.metadata.get('tags', ())]
    return notebook


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return the folder of the notebooks, in which a kernel works."""
    folder = tmp_path / 'notebooks'
    folder.mkdir()
    nbformat.write(new_notebook(), folder / '00_start_here.ipynb')
    nbformat.write(lesson(), folder / f'92_{EARLIER}.ipynb')
    monkeypatch.chdir(folder)
    monkeypatch.setenv(progress.FILE_VARIABLE, str(tmp_path / 'progress.txt'))
    return folder


@pytest.fixture(autouse=True)
def judges(monkeypatch):
    """Put the judge of the last task where those of a lesson are."""
    tasks = Tasks()

    @tasks.add(name='the_name')
    def the_name(workspace):
        def is_fast():
            text = workspace.file(SPEED).read_text()
            return 'SPEED = 0' not in text or 'its speed is 0'

        return [('it is fast', is_fast, 'SPEED')]

    module = ModuleType(f'helpers.checks.lessons.{EARLIER}')
    module.tasks = tasks
    monkeypatch.setitem(sys.modules, module.__name__, module)


@pytest.fixture
def workspaces():
    """Return the workspace of the earlier lesson, with a student's own files, and a new one."""
    earlier, later = Workspace(EARLIER), Workspace(LATER)
    for cell in lesson().cells:
        if cell.source.startswith('%%write src/small_pkg/') and 'tags' not in cell.metadata:
            first, _, text = cell.source.partition('\n')
            earlier.write(first.split()[1], text)
    for file, text in OWN.items():
        earlier.write(file, text)
    earlier.write('src/small_pkg/notes.txt', 'my notes')
    yield earlier, later
    for workspace in (earlier, later):
        workspace.close()
        shutil.rmtree(workspace.path, ignore_errors=True)


def solved(*names, begin=''):
    for name in names:
        progress.add(f'{begin}{EARLIER} {name}')


def carried(later, capsys):
    """Carry on. Return what is printed, and the two files."""
    carry_on(later, EARLIER)
    files = (later.file(file).read_text() for file in (SPEED, NAME))
    return ' '.join(capsys.readouterr().out.split()), *files


def test_nothing_is_solved(folder, workspaces, capsys):
    _, later = workspaces
    said, speed, name = carried(later, capsys)
    assert said == 'The program of "Build it": that of its solutions.'
    assert speed.split() == ['SPEED', '=', '1', 'LIMIT', '=', '9']
    assert name == "NAME = 'solution'\n"
    assert later.file('src/small_pkg/made_in_a_terminal').exists()
    assert not later.file('src/small_pkg/notes.txt').exists()
    later.write(NAME, "NAME = 'changed since'\n")
    said, _, name = carried(later, capsys)  # the cell is run again
    assert (said, name) == ('', "NAME = 'changed since'\n")


def test_all_is_solved(folder, workspaces, capsys):
    _, later = workspaces
    solved(*TASKS)
    said, *files = carried(later, capsys)
    assert said == 'The program of "Build it": yours.'
    assert files == [*OWN.values()]
    assert later.file('src/small_pkg/notes.txt').read_text() == 'my notes'


def test_a_file_of_which_one_part_is_solved_is_that_of_the_solutions(folder, workspaces, capsys):
    _, later = workspaces
    solved('the_limit', 'the_name')
    said, speed, name = carried(later, capsys)
    assert said == 'The program of "Build it": yours. Of its solutions: speed.py.'
    assert 'SPEED = 1' in speed
    assert name == OWN[NAME]


@pytest.mark.parametrize(
    ('file', 'text', 'why'),
    [
        (SPEED, 'SPEED = 0\n', 'the_name: its speed is 0'),
        ('src/small_pkg/setup.py', 'setup(', 'small_pkg: '),
    ],
)
def test_what_is_not_whole_any_more_is_not_taken(folder, workspaces, capsys, file, text, why):
    earlier, later = workspaces
    solved(*TASKS)
    earlier.write(file, text)
    said, speed, name = carried(later, capsys)
    assert said.startswith(f'Yours is not whole: {why}')
    assert said.endswith('It stays where it is. The program of "Build it": that of its solutions.')
    assert 'SPEED = 1' in speed
    assert name == "NAME = 'solution'\n"
    assert earlier.file(file).read_text() == text


def test_an_edition_without_solutions_shows_none(folder, workspaces, capsys):
    earlier, later = workspaces
    nbformat.write(without_solutions(), folder / f'92_{EARLIER}.ipynb')
    solved('the_speed', 'the_limit')
    with pytest.raises(UsageError, match='task 3, "the_name", is neither solved nor borrowed'):
        carry_on(later, EARLIER)
    assert not later.file('src/small_pkg').exists()
    solved('the_name', begin=f'{progress.BORROWED} ')
    said, speed, name = carried(later, capsys)
    assert said == 'The program of "Build it": yours. Of its solutions: name.py.'
    assert (speed, name) == (OWN[SPEED], "NAME = 'solution'\n")
    later.begin_anew()
    earlier.write(SPEED, 'SPEED = 0\n')
    with pytest.raises(UsageError, match='is not whole: the_name: its speed is 0. Mend it there'):
        carry_on(later, EARLIER)
