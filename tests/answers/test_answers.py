"""Every check judges the answers that students give: wrong ones of many kinds, and right ones.

A file `<lesson>.yaml` beside this one has the answers of a lesson's tasks:

    a_driver wrong:
    - self.publisher.publish(message): ''  # publishes nothing
    - x = self.speed: x = 0.5  # two edits are one answer
      z = self.turn: z = 1.0
    a_driver right:
    - message = ... (message): |-
        from geometry_msgs.msg import Vector3
        self.publisher.publish(Twist(linear=Vector3(x=self.speed), angular=Vector3(z=self.turn)))

An answer is the notebook's solution, edited: `old text: new text`. ` ... ` in the old text is
whatever lies between, and a space is any white space. The solution must have each old text exactly
once. If it has not, the starter is edited, which must. New lines are indented as the line in which
the old text begins. An answer that has little in common with both is given as a whole, as text.

A wrong answer that a rule of tests/mutants makes is not written here: `make mutants` judges all of
them, and with a seed a few of each lesson are judged here. One that differs from the solution, but
not in what the task asks for, stands in the file as well:

    a_driver equal:
    - self.speed = 0.5: self.speed = 1 / 2
      because: it is the same number

A task in which the learner writes tests is judged by what they find. There `mutant: each that
survives` says, with a reason, that what the check takes is right.

YAML wants quotes around text that begins with a quote, a bracket or another sign of its own, or
that has a colon with a space behind it, or a # with a space before it.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from mutants.lessons import drawn_of_lesson
from support.answers import answers_of, source_of
from support.judged import Cells, Lesson, read_tasks, run_all
from support.kernel import Kernel

HERE = Path(__file__).parent
FILES = sorted(HERE.glob('*.yaml'))
MUTANTS = 8  # of a lesson
WHY = {
    'wrong': 'This answer stands below `{}:`, and its check says something else.',
    'mutant': 'A rule of tests/mutants has made this wrong answer, `{}`, and its check takes it: '
    'CONTRIBUTING.md says what follows.',
}


def made(answers: list, key: str, cells: Cells) -> list[str]:
    """Return the sources of the answers below a key of the file."""
    try:
        return [source_of(answer, *cells['solution'], *cells['exercise']) for answer in answers]
    except ValueError as error:
        text = f'An answer below `{key}:` cannot be made. {error}'
        raise pytest.fail.Exception(text, pytrace=False) from None


def judge(kernel: Kernel, sources: list[str], key: str, cells: Cells) -> None:
    """Run each answer, and its check twice: each time it must find of which kind the answer is."""
    kind = key.split()[1]
    starters = cells['exercise']
    files = starters if len(starters) > 1 else []  # the answer changes what they have written
    for source in sources:
        said = run_all(kernel, files, [source])
        for _ in range(2):
            said += run_all(kernel, cells['check'])
            if kernel.judged != ('right' if kind == 'right' else 'wrong'):
                pytest.fail(
                    f'{WHY.get(kind, WHY["wrong"]).format(key)}\n{source}\n\n'
                    f'The check said:\n{said}',
                    pytrace=False,
                )


@pytest.fixture(scope='module')
def open_lesson():
    """Return a function that returns a lesson in a kernel in which a task was not reached yet.

    The tasks of a lesson come in their order, so the next one goes on in the kernel of the last.
    """
    opened: list[Lesson] = []  # at most one

    def close() -> None:
        while opened:
            opened.pop().kernel.__exit__(None, None, None)

    @contextmanager
    def open_at(name: str, task: str) -> Iterator[Lesson]:
        if not opened or opened[0].name != name or opened[0].is_behind(task):
            close()
            lesson = Lesson(name)
            lesson.kernel.__enter__()
            opened.append(lesson)
        lesson = opened[0]
        try:
            lesson.go_to(task)
            with lesson.undone():
                yield lesson
        except BaseException:
            close()  # what a wrong verdict has left is not what the next task begins with
            raise

    yield open_at
    close()


@pytest.mark.parametrize(
    ('lesson', 'task'), [(path.stem, task) for path in FILES for task in read_tasks(path.stem)]
)
def test_check_judges_right_and_wrong_answers(lesson, task, open_lesson, request):
    answers, tasks = answers_of(HERE / f'{lesson}.yaml'), read_tasks(lesson)
    # Before the cells above the task have run: that takes a while.
    wrong, right = (
        made(answers.get(f'{task} {kind}', []), f'{task} {kind}', tasks[task][1])
        for kind in ('wrong', 'right')
    )
    seed = request.config.option.seed
    drawn = drawn_of_lesson(lesson, MUTANTS, seed) if seed else {}
    mutants = [one.source for one in drawn.get(task, [])]
    with open_lesson(lesson, task) as opened:
        kernel, cells = opened.kernel, opened.cells
        run_all(kernel, cells['exercise'])
        started = time.monotonic()
        said = run_all(kernel, cells['check'])
        times = f'A verdict took {time.monotonic() - started:.1f} s for the starter'
        assert [verdict['solved'] for verdict in kernel.verdicts] == [False], (
            f'The starter must be wrong. Its check said:\n{said}'
        )
        judge(kernel, wrong, f'{task} wrong', cells)
        if mutants:
            print(f'Mutants are drawn with SEED={seed}.')
            judge(kernel, mutants, f'{task} mutant', cells)
        # What a right answer builds stays, so the solution comes after the wrong ones.
        run_all(kernel, cells['exercise'])
        started = time.monotonic()
        said = kernel.run(f'%%solution {task}\n{cells["solution"][0]}')
        print(f'{times}, and {time.monotonic() - started:.1f} s for the solution.')  # with -rP
        assert [(verdict['of'], verdict['solved']) for verdict in kernel.verdicts] == [
            ('solution', True)
        ], said
        judge(kernel, right, f'{task} right', cells)


IN_TERMINALS = """
from helpers.ros import ros_session

for program in ('listener', 'talker'):
    run = f'source install/setup.bash\\nros2 run hello_pkg {program}'
    workspace.start(run, f'one more {program}')
with ros_session() as session:
    session.wait_until(lambda: session.node.count_subscribers('/topic'))
    session.wait_until(lambda: session.node.count_publishers('/topic'))
"""


@pytest.mark.parametrize('lesson', ['make_a_package'])
def test_what_runs_in_a_terminal_changes_no_verdict(lesson, open_lesson):
    tasks = read_tasks(lesson)
    with open_lesson(lesson, 'other_arguments') as opened:
        said = opened.kernel.run(IN_TERMINALS)
        for task in ('a_slow_listener', 'callbacks_in_parallel', 'other_arguments'):
            _, cells = tasks[task]
            said += run_all(opened.kernel, cells['solution'], cells['check'])
            assert [verdict['solved'] for verdict in opened.kernel.verdicts] == [True], said
