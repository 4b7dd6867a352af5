"""The verdict on a task: its text, its data, its card, and what becomes of the student's code."""

import threading
import time
from html.parser import HTMLParser

import numpy as np
import psutil
import pytest
from support.kernel import Kernel

from helpers.checks import showing
from helpers.checks import tasks as module
from helpers.checks.errors import Failed, sentence
from helpers.checks.points import needs
from helpers.checks.tasks import NO_TIME, NOT_TRIED, Tasks
from helpers.checks.verdict import AGAIN, Point, Verdict, bundle
from helpers.ros import graph_environment


@pytest.fixture
def lesson():
    """A lesson of one task, which `judged` judges."""
    return Tasks()


def judged(capsys, lesson, *points, answer=None, **limits):
    """Return the lines that a check of these points prints."""
    lesson.judges.clear()
    lesson.add(lambda answer: list(points), name='it', **limits)
    lesson.check('it', answer)
    return capsys.readouterr().out.splitlines()


def tried(capsys, lesson, second=True):
    return judged(
        capsys,
        lesson,
        ('the group is Reentrant', lambda: True, 'Look at the second argument.'),
        ('no message is lost', lambda: second or 'one is lost', 'Count the threads.'),
    )


def test_hints_appear_at_the_second_wrong_try(capsys, lesson):
    first = ['[ok] the group is Reentrant', '[not yet] no message is lost']
    first += ['    Found: one is lost']
    assert tried(capsys, lesson, second=False) == [*first, f'Task 1: 1 of 2. {AGAIN}']
    assert 'Hint' not in str(tried(capsys, Tasks(), second=False))
    hint = '    Hint: Count the threads.'
    assert tried(capsys, lesson, second=False) == [*first, hint, f'Task 1: 1 of 2. {AGAIN}']


def test_a_hint_that_does_not_fit_is_not_shown(capsys, lesson):
    def built():
        raise Failed('a comma is missing', hint='Look at line 3.')

    def installed():
        needs(built, 'it is not built')

    points = ('it builds', built, 'Is src there?'), ('it is there', installed, 'Name the file.')
    for _ in range(2):
        lines = judged(capsys, lesson, *points)
    assert [line for line in lines if 'Hint' in line] == ['    Hint: Look at line 3.']


def test_a_check_may_have_a_domain_of_its_own(capsys, lesson):
    def is_own():
        return graph_environment()['ROS_DOMAIN_ID'] != kernels or 'it is that of the kernel'

    kernels = graph_environment()['ROS_DOMAIN_ID']
    point = 'the domain is another one', is_own, ''
    assert 'that of the kernel' in str(judged(capsys, lesson, point))
    assert '[ok]' in judged(capsys, lesson, point, own_domain=True)[0]
    assert graph_environment()['ROS_DOMAIN_ID'] == kernels


def test_a_second_run_prints_the_same(capsys, lesson):
    # Starter, then solution, as in a notebook that is run from top to bottom.
    runs = [(tried(capsys, lesson, second=False), tried(capsys, lesson)) for _ in range(3)]
    assert runs[0] == runs[1] == runs[2]
    assert runs[0][1][-1] == 'Task 1: 2 of 2. All done.'


class Group:
    def add(self, timer): ...


def test_what_the_code_did_is_said_with_its_line(capsys, lesson):
    def broken():
        raise RuntimeError(f'no {object()!r}\nmore')

    def hidden():  # as publish() does for a float in an Int32
        raise SystemError('returned a result with an exception set') from TypeError('a float')

    def in_a_thread():
        thread = threading.Thread(target=broken)
        thread.start()
        thread.join()
        return 'nothing came'

    lines = judged(
        capsys,
        lesson,
        ('2, 4', lambda: 'your node published [1, 2]', ''),
        ('the node exists', broken, ''),
        ('it is in a group', lambda: Group.add('a timer'), ''),
        ('it publishes', hidden, ''),
        ('it is called', lambda: broken('an argument'), ''),
        ('it is heard', in_a_thread, ''),
        ('equal', lambda: np.bool_(True), ''),
    )
    text = ' '.join(' '.join(lines).split())
    assert 'Found: your node published [1, 2] [not yet] the node exists' in text
    line = "of test_tasks.py: raise RuntimeError(f'no {object()!r}\\nmore')"
    number_of_line = broken.__code__.co_firstlineno + 1
    assert f'RuntimeError: no <object object> more. Line {number_of_line} {line}' in text
    assert "Group.add() missing 1 required positional argument: 'timer'. Did you forget ()" in text
    assert 'Found: TypeError: a float [not yet] it is called' in text
    assert 'TypeError: broken() takes 0 positional arguments but 1 was given' in text
    assert 'Found: nothing came. A thread of yours ended with RuntimeError: no' in text
    assert '[ok] equal' in text
    assert lines[-1] == f'Task 1: 1 of 7. {AGAIN}'


def test_an_error_is_said_once_and_its_line_takes_the_place_of_a_hint(capsys, lesson):
    def broken():
        raise RuntimeError('the wheel is stuck')

    hint = 'Turn it.'
    for _ in range(2):
        lines = judged(capsys, lesson, ('one', broken, hint), ('two', broken, hint))
    text = ' '.join(' '.join(lines).split())
    assert 'RuntimeError: the wheel is stuck. Line' in text
    assert text.endswith(f'[not yet] two Found: the same Task 1: 0 of 2. {AGAIN}')
    assert hint not in text


def test_after_an_endless_point_the_others_wait(capsys, lesson):
    waits = ('it waits', threading.Event().wait, '')
    lines = judged(capsys, lesson, waits, ('and again', lambda: True, ''), limit_s=0.3)
    text = ' '.join(' '.join(lines).split())
    assert 'TimeoutError: it did not end. Is there an endless loop' in text
    assert f'[not yet] and again Found: {NOT_TRIED}' in text


@pytest.mark.parametrize(('load', 'says'), [(0, NO_TIME), (1e4, 'it took 1 s')])
def test_after_a_wrong_point_the_others_have_little_time(capsys, lesson, monkeypatch, load, says):
    """They have more of it while other programs use the machine."""
    monkeypatch.setattr('os.getloadavg', lambda: (load, 0.0, 0.0))
    monkeypatch.setattr('helpers.checks.sandbox.MOST_PATIENCE', 1e3)
    monkeypatch.setattr('helpers.checks.tasks.TOGETHER_S', 0.1)

    def slow():
        time.sleep(1)
        return 'it took 1 s'

    lines = judged(capsys, lesson, ('one', lambda: 'no', ''), ('two', slow, ''))
    assert f'    Found: {says}' in lines


def test_what_it_prints_is_shown_and_bounded(capsys, lesson):
    def talk():
        print('my own line')
        print('x' * 100_000)
        return True

    lines = judged(capsys, lesson, ('it talks', talk, ''))
    assert lines[0] == 'my own line'
    assert lines[-1].endswith('All done.')
    assert sum(map(len, lines)) < 25_000


@pytest.mark.parametrize(
    ('points', 'sentence'),
    [
        (lambda answer: None, 'This task cannot be judged: its check returns no points'),
        (lambda answer: [('it is 7', lambda: True)], "the point 'it is 7' of its check must be"),
        (lambda answer: [('it is 7', True, '')], "the point 'it is 7' of its check must be"),
        (lambda answer: answer.points, 'its check ended with AttributeError: '),
    ],
)
def test_a_mistake_of_the_check_is_not_the_students(capsys, lesson, points, sentence):
    lesson.add(points, name='it')
    lesson.check('it', 'an answer')
    said = ' '.join(capsys.readouterr().out.split())
    assert sentence in said
    assert said.endswith('Task 1: not judged.')
    assert 'your code' not in said


def test_interrupt_is_no_try(capsys, lesson, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(module.Sandbox, '__iter__', interrupted)
        with pytest.raises(KeyboardInterrupt):
            tried(capsys, lesson)
    assert 'Hint' not in str(tried(capsys, lesson, second=False))


def test_an_interrupt_takes_the_message_of_a_running_check_away(capsys, lesson, monkeypatch):
    shown = []

    class Shown:
        def __init__(self, data, **_):
            shown.append(data['text/html'])

        def update(self, data, **_):
            shown.append(data['text/html'])
            if shown[-1]:
                raise KeyboardInterrupt

    monkeypatch.setattr(showing, 'somebody_watches', lambda: True)
    monkeypatch.setattr(showing, 'SHOW_AFTER_S', 0)
    monkeypatch.setattr(showing, 'display', Shown)
    with pytest.raises(KeyboardInterrupt):
        tried(capsys, lesson)
    assert shown == ['Checking: 0 of 2 …', 'Checking: 1 of 2 …', '']
    assert psutil.Process().children() == []


def test_long_lines_are_broken_at_blanks(capsys, lesson):
    words = ' '.join(f'word{count}' for count in range(40))
    for _ in range(2):
        lines = judged(capsys, lesson, (words, lambda: words, words))
        assert max(map(len, lines)) <= 94
    assert ' '.join(' '.join(lines).split()).count(words) == 3


def test_an_unknown_task_is_a_sentence(monkeypatch):
    tasks = Tasks()
    tasks.add(list, name='a_list')
    with pytest.raises(
        ValueError, match="^This lesson has no task 'a_lisp'. Its tasks are called: a_"
    ):
        tasks.check('a_lisp')
    monkeypatch.setenv('JPY_SESSION_NAME', '02_lose_messages.ipynb')
    tasks.add(list, name='be_the_queue')
    said = "^This lesson has no task 4. Tasks have names now, and this one is 'be_the_queue'[.]$"
    with pytest.raises(ValueError, match=said):
        tasks.check(4)  # as a student's cell of version 0.3 has it
    with pytest.raises(ValueError, match='^This lesson has two tasks that are called a_list[.]$'):
        tasks.add(list, name='a_list')


# --- Data and card


class Tags(HTMLParser):
    """Keeps the tags that are open, and the text."""

    def __init__(self, source):
        super().__init__()
        self.open, self.text = [], ''
        self.feed(source)

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += f' {data}'


def test_data_text_and_card_say_the_same():
    points = [Point('x < 3', True), Point('it turns', False, 'nothing & more', 'Look.')]
    data, metadata = bundle(Verdict('turn', 3, points))
    card = Tags(data['text/html'])
    assert card.open == []
    for part in ('x < 3', 'it turns', 'Found  nothing & more', 'Hint  Look.', 'Task 3: 1 of 2.'):
        assert part in card.text
    assert metadata['ros2_notebooks'] == {
        'task': 'turn',
        'of': 'answer',
        'solved': False,
        'points': [
            {'what': 'x < 3', 'ok': True},
            {'what': 'it turns', 'ok': False, 'found': 'nothing & more', 'hint': 'Look.'},
        ],
    }
    assert bundle(Verdict('turn', 3, points[:1]))[1]['ros2_notebooks']['solved']


# --- In a notebook

LESSON = """
from helpers.checks.tasks import Tasks
tasks = Tasks()
check = tasks.check

@tasks.add
def two_is_two(two):
    return [('it is 2', lambda: two == 2 or f'it is {two}', 'One and one.')]
"""


CHECK = "check('two_is_two', two)"


def test_a_lesson_goes_on_with_the_code_that_passes():
    solution = '%%solution two_is_two\ntwo = 1 + 1'
    with Kernel() as kernel:
        kernel.run(LESSON)
        assert 'its check has not' in kernel.run('%%solution two_is_two\nthree = 3')
        assert '[not yet]' in kernel.run(f'two = 3\n{CHECK}')
        assert kernel.run(solution) == '[ok] it is 2\nSolution of task 1: 1 of 1.\n'
        assert [verdict['of'] for verdict in kernel.verdicts] == ['solution']
        # What the solution gave is not the student's, and stays for the later cells. An equal value
        # that a cell gives is.
        assert 'This is the code of the solution.' in kernel.run(CHECK)
        assert kernel.run('print(two)') == '2\n'
        kernel.run('two = 2')
        assert 'All done.' in kernel.run(CHECK)
        assert 'goes on with your code' in kernel.run(solution)
        assert kernel.run('print(two)') == '2\n'


def test_a_cell_that_failed_is_not_judged_by_what_it_was_before():
    with Kernel() as kernel:
        kernel.run(LESSON)
        kernel.run('two = 2')
        assert 'All done.' in kernel.run(CHECK)
        kernel.run('two = 1 + three')
        said = kernel.run(CHECK)
        assert 'The last cell that defines two ended with an error.' in said
        assert said.endswith('Task 1: not judged.\n')
        kernel.run('two = 3')
        assert 'Found: it is 3' in kernel.run(CHECK)


@pytest.mark.parametrize(
    'cell',
    [
        'two = 3\n!true\n%config\n',
        '%%time\ntwo = 3',
        'with open("/dev/null"):\n    two = 3',
        'if True:\n    for two in [3]:\n        pass',
        'import os; two: int = 3; os.sep',
    ],
)
def test_a_name_is_found_wherever_a_cell_assigns_it(cell):
    with Kernel() as kernel:
        kernel.run(f'{LESSON}\ntwo = 2')
        kernel.run(f'{cell}\n1 / 0')
        assert 'The last cell that defines two' in kernel.run(CHECK)
        kernel.run(cell)
        assert 'Found: it is 3' in kernel.run(CHECK)


@pytest.mark.parametrize('cell', ['two = (3', 'def two(:\n    pass', 'class two\n    pass'])
def test_a_name_is_found_in_a_cell_that_python_cannot_read(cell):
    with Kernel() as kernel:
        kernel.run(f'{LESSON}\ntwo = 2')
        kernel.run(cell)
        assert 'The last cell that defines two' in kernel.run(CHECK)


@pytest.mark.parametrize(
    'cell',
    [
        'def one():\n    two = 3\n1 / 0',
        '1 / 0\ndel two',
        '1 / 0\nimport two',
        'print(two == 2',
        '%%write two.py\ntwo = (',
    ],
)
def test_a_failed_cell_that_assigns_another_name_is_nothing_to_the_check(cell):
    with Kernel() as kernel:
        kernel.run(f'{LESSON}\ntwo = 2')
        kernel.run(cell)
        assert 'All done.' in kernel.run(CHECK)


def test_the_solution_mends_a_cell_that_failed_if_it_runs():
    lesson = f'{LESSON}\ntasks.add(lambda two: [("it is 4", lambda: two == 4, "")], name="four")'
    with Kernel() as kernel:
        kernel.run(lesson)
        kernel.run('two = 1 / 0')
        kernel.run('%%solution two_is_two\ntwo = 4')
        assert 'All done.' in kernel.run("check('four', two)")
        kernel.run(f'two = 2\n{CHECK}')
        kernel.run('two = 1 / 0')
        assert 'goes on with your code' in kernel.run('%%solution two_is_two\ntwo = 4')
        assert 'The last cell that defines two' in kernel.run(CHECK)


def test_an_interrupt_outside_of_a_cell_prints_nothing_more():
    with Kernel() as kernel:
        kernel.run(LESSON)
        assert kernel.run("get_ipython().events.trigger('post_run_cell', None)") == ''


def test_a_check_before_its_task_says_what_to_run():
    with Kernel() as kernel:
        kernel.run(f'%load_ext helpers.kernel\nimport helpers.ros.session{LESSON}')
        assert 'two is not there yet: run the cell of the task above' in kernel.run(CHECK)
        assert 'not there yet' not in kernel.run('print(two)')


def test_a_check_leaves_the_kernel_as_it_was():
    with Kernel() as kernel:
        kernel.run(LESSON.replace('two == 2', 'two.append(4)'))
        assert 'it is [3, 4]' in kernel.run(f'two = [3]\n{CHECK}')
        assert kernel.run('print(two)') == '[3]\n'
        assert 'Line 2: return 1 / 0' in kernel.run(
            'def two():\n    return 1 / 0\ntasks.add(lambda two: [("a", two, "")], name="a"); '
            'check("a", two)'
        )


def test_an_int_in_a_float_field_is_an_error():
    with Kernel() as kernel:
        early = 'from geometry_msgs.msg import Vector3\nimport helpers.ros.session\n'
        assert "The 'x' field must be of type 'float'" in kernel.run(f'{early}Vector3(x=1)')
        late = 'from sensor_msgs.msg import Range'
        assert "The 'range' field must" in kernel.run(f'{late}\nRange(range=1)')


def test_a_name_that_the_students_code_does_not_know_is_one_sentence():
    try:
        exec('distance < 1.0')  # what a callback raises has no text of its own
    except NameError as error:
        said = sentence(error)
    assert said.startswith("NameError: name 'distance' is not defined. Is it defined in the cell")


class Listener:
    def on_text(self, message):
        pass


# As in create_subscription(String, 'topic', self.on_text(), 10): it hands over None.
HANDED_OVER = Listener().on_text('a')


@pytest.mark.parametrize(
    ('call', 'said'),
    [
        (
            lambda: HANDED_OVER('a'),
            "TypeError: 'NoneType' object is not callable. Are there () after the name of a "
            'callback that is only handed over? ',
        ),
        (
            lambda: Listener.on_text('a'),
            "TypeError: Listener.on_text() missing 1 required positional argument: 'message'. Did "
            'you forget () after a class, or write () after a callback? ',
        ),
    ],
)
def test_parentheses_too_many_or_too_few_are_a_hint(call, said):
    with pytest.raises(TypeError) as error:
        call()
    assert sentence(error.value).startswith(said)
