"""Every check judges the answers that students give: wrong ones of many kinds, and right ones.

A file `<lesson>.py` beside this one holds the answers of a lesson's tasks:

    ANSWERS = {2: {'wrong': ['source of a cell', ...], 'right': [...]}}

One kernel runs the lesson from the top. Before the check of each task, it runs each answer in place
of the starter, and then the check.
"""

import runpy
from pathlib import Path

import nbformat
import pytest
from support.kernel import NOTEBOOKS, Kernel

HERE = Path(__file__).parent
WRONG, RIGHT = 5, 3  # how many a task has at least

LESSONS = sorted(path.stem for path in HERE.glob('*.py') if path.stem != 'test_answers')


def tags(cell) -> list[str]:
    return cell.metadata.get('tags', [])


@pytest.mark.parametrize('lesson', LESSONS)
def test_checks_judge_right_and_wrong_answers(lesson):
    [path] = NOTEBOOKS.glob(f'[0-9][0-9]_{lesson}.ipynb')
    answers = runpy.run_path(str(HERE / f'{lesson}.py'))['ANSWERS']
    cells = [cell for cell in nbformat.read(path, 4).cells if cell.cell_type == 'code']
    task, judged, starter = 0, set(), False
    with Kernel() as kernel:
        for place, cell in enumerate(cells):
            if 'exercise' in tags(cell) and not starter:
                task, starter = task + 1, True
                rest = cells[place:]
                checks = [one for one in rest if 'check' in tags(one)]
                end = next(one for one in rest if 'solution' in tags(one))
                checks = [one.source for one in checks if rest.index(one) < rest.index(end)]
                for kind, sources in answers[task].items():
                    for source in sources:
                        said = ''.join(map(kernel.run, [source, *checks]))
                        assert ('All done.' in said) == (kind == 'right'), (
                            f'Task {task}, a {kind} answer:\n{source}\nThe check said:\n{said}'
                        )
                judged.add(task)
            starter = starter and 'solution' not in tags(cell)
            kernel.run(cell.source)
    assert judged == set(answers)
    for task, kinds in answers.items():
        assert len(kinds['wrong']) >= WRONG, f'Task {task} needs {WRONG} wrong answers.'
        assert len(kinds['right']) >= RIGHT, f'Task {task} needs {RIGHT} right answers.'
