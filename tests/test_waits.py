"""What waits, and why: programs that hang for different reasons, and such as only take long.

They are in tests/data/waits. A comment `# Says:` is a line that is explained, `# Arrow:` one of the
circle in which callbacks wait for each other, in their order; without them there is none. `# From:`
names the public thread with a program of this form. Those whose name begins with `slow` must not be
accused.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from support.kernel import Kernel
from support.waits import wait_for

from helpers.lesson import outlines
from helpers.ros.domain import reserve_domain_id
from helpers.waits import NOTHING, find_waits
from helpers.waits.blockers import nearly
from helpers.waits.sentences import CURES

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = sorted((ROOT / 'tests/data/waits').glob('*.py'))
HANGS = [file for file in PROGRAMS if not file.stem.startswith('slow')]
SLOW = [file for file in PROGRAMS if file.stem.startswith('slow')]
TIMEOUT_S = 40
ACCUSES = re.compile('(It|They) cannot:')


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        ('/Scan', ' (nearly the same name: /scan)'),
        ('/scans', ' (nearly the same name: /scan)'),
        ('/scan', ''),  # that one is no other
        ('/scan_raw', ''),  # another topic of the same sensor
    ],
)
def test_only_a_name_that_is_nearly_the_same_is_called_so(name, said):
    assert nearly(name, ['/scan', '/cmd_vel']) == said


class Asked:
    """A program that runs below `helpers.waits`, and is asked what waits: `pid`, its output."""

    def __init__(self, pid, output):
        self.pid, self.output = pid, output

    @property
    def said(self):
        return self.output.read_text() if self.output.exists() else ''

    def wait(self, condition, timeout_s=TIMEOUT_S):
        end = time.monotonic() + timeout_s
        while not condition(self.said) and time.monotonic() < end:
            time.sleep(0.05)
        return condition(self.said)

    def ask(self):
        """Return what is said after a signal. Perhaps not all of it: then ask again."""
        before = self.said
        os.kill(self.pid, signal.SIGQUIT)
        self.wait(lambda said: said != before, 2.0)
        return self.said[len(before) :]

    def ask_until(self, condition):
        """Ask again and again, until an answer fits: a busy machine comes late to where it hangs.

        Returns the last answer.
        """
        assert self.wait(lambda said: 'kill -QUIT' in said)  # from then on it bears the signal
        end, answer = time.monotonic() + TIMEOUT_S, self.ask()
        while not condition(answer) and time.monotonic() < end:
            answer = self.ask()
        return answer


@pytest.fixture(scope='module')
def forks():
    command = [sys.executable, str(ROOT / 'tests/support/forks.py')]
    variables = dict(
        os.environ,
        PYTHONPATH=str(ROOT),
        PYTHONUNBUFFERED='1',
        ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
    )
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=variables
    ) as process:
        yield process
        process.stdin.close()


@pytest.fixture
def asked(forks, file, tmp_path):
    output = tmp_path / 'said'
    print(file, reserve_domain_id(), output, file=forks.stdin, flush=True)
    pid = int(forks.stdout.readline())
    yield Asked(pid, output)
    os.kill(pid, signal.SIGKILL)


def arrows(file):
    return re.findall(r'^# Arrow: (.*)$', file.read_text(), re.MULTILINE)


def circles_in(answer):
    """Return each circle that was said: its arrows, as in the comments of a program."""
    found = []
    for line in re.findall(r'^Circle: (.*)$', answer, re.MULTILINE):
        said = json.loads(line) or {'boxes': [], 'arrows': []}
        name = {box['id']: box['name'] for box in said['boxes']}
        found.append(
            [f'{name[a["from"]]} > {a["label"]} > {name[a["to"]]}' for a in said['arrows']]
        )
    return found


def wanted(file):
    return re.findall(r'^# Says: (.*)$', file.read_text(), re.MULTILINE)


@pytest.mark.parametrize('file', HANGS, ids=lambda file: file.stem)
def test_a_program_that_hangs_is_explained(asked, file):
    def is_told(answer):
        return (
            all(line in answer for line in wanted(file))
            and ACCUSES.search(answer)
            and circles_in(answer)[-1:] == [arrows(file)]
        )

    answer = asked.ask_until(is_told)
    assert [line for line in wanted(file) if line not in answer] == [], answer
    assert ACCUSES.search(answer)
    assert circles_in(answer)[-1:] == [arrows(file)], answer


@pytest.mark.parametrize('file', SLOW, ids=lambda file: file.stem)
def test_a_program_that_only_takes_long_is_not_accused(asked, file):
    assert asked.wait(lambda said: 'now\n' in said), asked.said
    answers = [asked.ask_until(len) for _ in range(3)]
    assert [answer for answer in answers if ACCUSES.search(answer)] == []
    assert [circle for answer in answers for circle in circles_in(answer) if circle] == []
    assert [line for line in wanted(file) if line not in answers[-1]] == [], answers


CELL = """
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from helpers.ros import ros_session

HERE = 'now' + ' it hangs'
with ros_session() as session:
    node = Node('brake')
    node.create_service(Trigger, 'look', lambda request, response: response)
    client = node.create_client(Trigger, 'look')
    answers = []

    def ask():
        print(HERE, flush=True)
        answers.append(client.call(Trigger.Request()))

    node.create_timer(0.1, ask)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    session.spin(executor)
    session.wait_until(lambda: answers)
"""


class Interrupting(Kernel):
    """A kernel that is interrupted a moment after its cell has said that it hangs."""

    wait_s = 1.0

    def process_message(self, msg, cell, cell_index):
        if 'now it hangs' in str(msg['content'].get('text', '')):
            send = self.km.provisioner.process.send_signal
            threading.Timer(self.wait_s, send, [signal.SIGINT]).start()
        return super().process_message(msg, cell, cell_index)


def error_of(kernel):
    return next(
        '\n'.join(output.traceback)
        for output in kernel.nb.cells[-1].outputs
        if output.output_type == 'error'
    )


CIRCLE = (
    'Nobody can go on: ask() waits for the answer of the service look; '
    'a lambda would answer, but needs the only thread; ask() holds the only thread.'
)


def circles_of(outputs):
    """Return the circles that a cell has drawn, in words."""
    return [
        output['data']['text/plain']
        for output in outputs
        if 'data-circle=' in output.get('data', {}).get('text/html', '')
    ]


def test_an_interrupted_cell_says_what_waited():
    with Interrupting() as kernel:
        kernel.run(CELL)
        said = error_of(kernel)
        assert circles_of(kernel.nb.cells[-1].outputs) == [CIRCLE]
        assert said.startswith('Interrupted. Line 22: session.wait_until(lambda: answers)')
        assert 'ask() waits for the answer of the service look.' in said
        assert 'They cannot: ask() holds the only thread of its executor' in said
        assert 'It cannot: it waits for the answer of the service look' in said


def test_a_kernel_is_asked_while_its_cell_hangs():
    class Asking(Interrupting):
        said, wait_s = '', 15.0

        def process_message(self, msg, cell, cell_index):
            if 'now it hangs' in str(msg['content'].get('text', '')):
                threading.Thread(target=self._ask).start()
            return super().process_message(msg, cell, cell_index)

        def _ask(self):
            file = self.km.connection_file
            command = [sys.executable, '-m', 'helpers.waits', '--kernel', file]
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
            self.said = done.stdout + done.stderr

    with Asking() as kernel:
        kernel.run(CELL.replace('it hangs', 'it hangs, and is asked'))
        end = time.monotonic() + TIMEOUT_S
        while not kernel.said and time.monotonic() < end:
            time.sleep(0.1)
        assert 'ask() waits for the answer of the service look.' in kernel.said
        assert 'They cannot: ask() holds the only thread of its executor' in kernel.said


def test_an_interrupted_cell_that_computes_says_nothing_more():
    with Interrupting() as kernel:
        kernel.run('import rclpy\nprint("now it " + "hangs", flush=True)\nwhile True:\n    pass')
        assert error_of(kernel).startswith('Interrupted. Line ')
        assert '\n' not in error_of(kernel)
        assert circles_of(kernel.nb.cells[-1].outputs) == []


def test_a_cell_draws_the_circle_of_an_executor_behind_it():
    cell = CELL.replace('wait_until(lambda: answers)', 'wait_until(client._pending_requests.copy)')
    asks = '    from helpers.waits_view import what_waits\n    what_waits()\n'
    with Kernel() as kernel:
        said = kernel.run(f'{cell}{asks}')
        assert 'ask() waits for the answer of the service look.' in said
        assert circles_of(kernel.nb.cells[-1].outputs) == [CIRCLE]
        # All that hung has ended with its cell.
        assert kernel.run('what_waits()').strip() == NOTHING


def test_a_thread_that_an_open_barrier_lets_go_does_not_wait():
    barrier = threading.Barrier(2)
    thread = threading.Thread(target=lambda: barrier.wait(), daemon=True)
    thread.start()

    def finding():
        return next((one for one in find_waits() if one.activity.thread is thread), None)

    wait_for(finding)
    assert finding().what.startswith('a Barrier: 1 of 2 threads')
    with barrier._cond:  # private: of threading, Python 3.11 to 3.14
        barrier._release()  # as the second thread does; the first has not woken yet
        assert finding() is None
    thread.join()


def test_what_helps_names_lessons_of_today():
    assert {lesson for *_, lesson in CURES} <= {lesson.title for lesson in outlines()}


def test_a_folder_that_was_copied_works_beside_any_program(tmp_path):
    """On a robot there are no helpers: only rclpy, and this folder."""
    folder = shutil.copytree(ROOT / 'helpers/waits', tmp_path / 'waits')
    file, output = ROOT / 'tests/data/waits/call_in_a_callback.py', tmp_path / 'said'
    variables = dict(os.environ, PYTHONPATH='', ROS_DOMAIN_ID=str(reserve_domain_id()))
    with output.open('w') as out:
        command = [sys.executable, str(folder), str(file)]
        process = subprocess.Popen(command, stdout=out, stderr=out, env=variables, cwd='/')
    asked = Asked(process.pid, output)
    answer = asked.ask_until(lambda said: all(line in said for line in wanted(file)))
    process.kill()
    process.wait()
    assert [line for line in wanted(file) if line not in answer] == [], asked.said


def test_there_are_thirty_and_ten_and_ten_are_of_public_threads():
    public = {
        address
        for file in HANGS
        for address in re.findall(r'^# From: (https://\S+)$', file.read_text(), re.MULTILINE)
    }
    assert len(HANGS) >= 30
    assert len(SLOW) >= 10
    assert len(public) >= 10
