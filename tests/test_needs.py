"""What a cell of a lesson needs, and what it says as long as that is missing."""

import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell
from support.kernel import Kernel
from support.lessons import lesson, task

from helpers.checks.needs import needs_of
from helpers.lesson import keep_solution, kept_solution, lessons


def test_a_cell_needs_the_tasks_whose_names_it_uses():
    found = needs_of(
        lesson(
            *task('two_is_two'),
            new_code_cell('y = x + 1', id='y'),
            new_code_cell('print(y)', id='print'),
            new_code_cell('y = 0', id='anew'),
            new_code_cell('print(y, y)', id='again'),
        )
    )
    assert {source: cell.tasks for source, cell in found.cells.items()} == {
        'y = x + 1': ['two_is_two'],
        'print(y)': ['two_is_two'],
        'y = 0': [],
        'print(y, y)': [],
    }


def test_a_task_needs_those_whose_names_its_own_cells_use():
    cells = task('other', number=2)
    cells[1].source, cells[2].source = 'class Other(x): pass', "check('other', Other)"
    found = needs_of(lesson(*task('two_is_two'), *cells))
    assert found.of_tasks == {'two_is_two': set(), 'other': {'two_is_two'}}


def test_a_cell_between_a_task_and_its_check_is_its_own():
    cells = task('two_is_two')
    cells.insert(2, new_code_cell('print(x)', id='try'))
    assert needs_of(lesson(*cells)).cells == {}


def test_files_with_a_star_are_needed_nowhere():
    for star, files in (('', ['a_file']), (' ★', [])):
        cells = task('a_file', star=star)
        cells[1].source, cells[2].source = '%%write a.py\n1', "check('a_file', workspace)"
        found = needs_of(lesson(*cells, new_code_cell('workspace.build()', id='build')))
        assert found.cells['workspace.build()'].files == files


def test_a_star_reaches_to_the_next_heading_of_its_level():
    starred = lesson(
        new_markdown_cell('## 1. One ★', id='one'),
        new_markdown_cell('### ? Guess', id='guess'),
        new_markdown_cell('## 2. Two', id='two'),
        new_markdown_cell('Some words.\n\n### ? Guess ★', id='inside'),
        new_code_cell('1', id='cell'),
        new_markdown_cell('### Look', id='look'),
    ).starred
    assert [cell.id for cell in starred] == ['one', 'guess', 'inside', 'cell']


@pytest.mark.parametrize('one', lessons(), ids=lambda one: one.name)
def test_no_cell_of_the_core_needs_a_task_with_a_star(one):
    """Names are looked at here; files are for `make left-out`, which runs the lessons."""
    stars, free = {task.name for task in one.tasks if task.star}, {c.id for c in one.starred}
    found = needs_of(one)
    core = [cell for cell in one.code_cells() if cell.id not in free]
    needed = {
        cell.id: stars & {*found.cells[cell.source.strip()].tasks}
        for cell in core
        if cell.source.strip() in found.cells
    }
    needed |= {
        task.name: stars & found.of_tasks.get(task.name, set())
        for task in one.tasks
        if not task.star
    }
    assert {name: tasks for name, tasks in needed.items() if tasks} == {}


def test_a_check_keeps_a_solution_that_nobody_reads_by_chance():
    cell = new_code_cell("check('it', x)")
    assert kept_solution(cell) == ''
    keep_solution(cell, 'secret = 41')
    assert kept_solution(cell) == 'secret = 41'
    assert 'secret' not in str(cell)


# --- In a kernel ----------------------------------------------------------------------------------

BEGIN = """
import os
os.environ['JPY_SESSION_NAME'] = {name!r}
from helpers.checks import tasks as module, progress
from helpers.checks.tasks import Tasks
from helpers.lesson import Lesson, Node, read
tasks = Tasks()
check = tasks.check

def one(x):
    return [('it is 2', lambda: x == 2 or f'it is {{x}}', '')]

for name in ('first', 'second'):
    tasks.add(one, name=name)
tasks.lesson_name = 'keep_it'
tasks.lesson = read(open({path!r}).read(), '05_keep_it.ipynb')
"""
CELL = 'y = x + 1\nprint(y)'


@pytest.fixture
def kernel(tmp_path):
    """Return a function that opens a lesson of two tasks, of which a cell needs the first one."""
    opened = []

    def open_it(solutions=True, lends=True):
        first, second = task('first'), task('second', number=2)
        second[1].source = 'z = x'
        second[2].source = "check('second', z)"
        second[3].source = '%%solution second\nz = 2'
        if not solutions:
            for cells in (first, second):
                if lends:
                    keep_solution(cells[2], cells.pop().source.partition('\n')[2])
                else:
                    cells.pop()
        path = tmp_path / '05_keep_it.ipynb'
        import nbformat

        made = lesson(*first, new_code_cell(CELL, id='cell'), *second)
        path.write_text(nbformat.writes(made.notebook))
        kernel = Kernel()
        opened.append(kernel)
        kernel.__enter__()
        kernel.run(f'import os; os.environ["ROS2_NOTEBOOKS_PROGRESS"] = "{tmp_path}/progress.txt"')
        assert kernel.run(BEGIN.format(name=str(path), path=str(path))) == ''
        return kernel

    yield open_it
    for kernel in opened:
        kernel.__exit__(None, None, None)


FIRST = 'x = 1'
CHECK = "check('first', x)"


def words(said):
    return ' '.join(said.split())


def test_a_cell_that_needs_a_task_says_which_one_and_does_not_run(kernel):
    run = kernel().run
    run(FIRST)
    assert 'go on with the solution below' in run(CHECK)
    assert words(run(CELL)) == (
        'This cell needs task 1, "Try", which is not solved: solve it, or run its solution, then '
        'run this cell again.'
    )
    assert "name 'y' is not defined" in run('print(y)')
    assert run('x + 1') == '2\n'  # a cell of one's own always runs
    run('z = x')
    said = words(run("check('second', z)"))
    assert said.startswith('This task needs task 1, "Try", which is not solved')
    assert said.endswith('Task 2: not judged.')
    run('%%solution first\nx = 2')
    assert run(CELL) == '3\n'


def test_a_student_who_is_stuck_borrows_and_has_not_solved(kernel, tmp_path):
    run = kernel(solutions=False).run
    run(FIRST)
    assert 'Try task 1 first: you can borrow it after 3 more tries.' in run('%borrow first')
    said = [run(CHECK) for _ in range(3)]
    assert 'solution' not in ''.join(said)
    assert ['%borrow first' in words(one) for one in said] == [False, False, True]
    assert '%borrow first' in words(run(CELL))
    assert 'Task 1 is borrowed, not solved' in words(run('%borrow first'))
    assert run(CELL) == '3\n'
    assert 'This is the code of the solution.' in run(CHECK)
    assert (tmp_path / 'progress.txt').read_text() == 'borrowed keep_it first\n'
    run('x = 2')
    assert 'All done.' in run(CHECK)
    assert 'keep_it first\n' in (tmp_path / 'progress.txt').read_text()


def test_a_teacher_can_leave_it_out_and_a_grader_does(kernel):
    run = kernel(solutions=False, lends=False).run
    run(FIRST)
    assert 'borrow' not in ''.join(run(CHECK) for _ in range(4))
    assert 'lends nothing' in run('%borrow first')


def test_a_grader_lends_nothing(kernel):
    run = kernel(solutions=False).run
    run(f"os.environ['ROS2_NOTEBOOKS_GRADED'] = 'yes'\n{FIRST}")
    assert 'borrow' not in ''.join(run(CHECK) for _ in range(4))
    assert 'lends nothing' in run('%borrow first')


def test_after_a_cell_that_failed_a_later_one_says_which_to_run(kernel):
    run = kernel().run
    run('x = 2')
    assert 'All done.' in run(CHECK)
    run('x = 1 / 0')
    assert words(run(CELL)) == (
        'x comes from the cell that begins with "x = 1 / 0", which ended with an error: run it '
        'first.'
    )
    run('x = 2\nraise KeyboardInterrupt')
    assert 'which was interrupted: run it first.' in words(run(CELL))
    run('x = 2')
    assert run(CELL) == '3\n'


def test_an_interrupt_is_one_line():
    with Kernel() as kernel:
        kernel.run('%load_ext helpers.kernel')
        source = 'def wait():\n    raise KeyboardInterrupt\nwait()'
        kernel.run(source)
        [error] = kernel.nb.cells[-1].outputs
        assert error['traceback'] == ['Interrupted. Line 2: raise KeyboardInterrupt']
