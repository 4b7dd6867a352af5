"""Whatever a student's code does, a check says one sentence, the process lives, nothing is left."""

import os
import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest
from support.waits import wait_for

from helpers.checks import sandbox
from helpers.checks.tasks import Tasks

LIMIT_S = 3.0


def interrupted_for_ever():
    while True:
        try:
            while True:
                pass
        except KeyboardInterrupt:
            pass


def sleeps_for_ever():
    while True:
        try:  # noqa: SIM105
            time.sleep(1)
        except KeyboardInterrupt:
            pass


def catches_everything():
    while True:
        try:
            while True:
                pass
        except BaseException:
            pass


def holds_the_lock():
    return 9**9**9 > 0


def sleeps_in_c():
    import ctypes

    ctypes.PyDLL(None).sleep(1000)  # it keeps the interpreter's lock


def leaves_a_thread():
    threading.Thread(target=sleeps_for_ever, name='worker').start()
    return True


def leaves_a_program():
    import subprocess

    subprocess.Popen(['sleep', '1000'], start_new_session=True)
    return True


def leaves_a_daemon():
    """Its parent has ended, so that nobody in the worker knows it."""
    import subprocess

    subprocess.run(['sh', '-c', 'setsid sleep 1000 & exit 0'], check=True)
    return True


def ends_at_once():
    os._exit(0)


def exits():
    raise SystemExit(0)


def crashes():
    import ctypes

    ctypes.string_at(0)


def prints_for_ever():
    while True:
        print('hello' * 20)


def calls_itself():
    return calls_itself()


def takes_all_memory():
    kept = []
    while True:
        kept.append(bytearray(50_000_000))


def kills_its_group():
    os.killpg(0, 9)


ENDLESS = 'TimeoutError: it did not end. Is there an endless loop, or a spin() that never returns?'
HOSTILE = {
    interrupted_for_ever: f'{ENDLESS} Line ',
    sleeps_for_ever: f'{ENDLESS} Line ',
    catches_everything: f'{ENDLESS} Line ',
    holds_the_lock: f'{ENDLESS} Line ',
    sleeps_in_c: f'{ENDLESS} Line ',
    leaves_a_thread: 'the thread worker that your code has started does not end. Line ',
    leaves_a_program: 'a program that your code has started still runs: sleep',
    leaves_a_daemon: 'a program that your code has started still runs: ',
    ends_at_once: 'your code has ended the whole program, with os._exit or from C',
    exits: 'SystemExit: your code ends the program. Line ',
    crashes: 'your code has ended the whole program: signal 11',
    prints_for_ever: f'{ENDLESS} Line ',
    calls_itself: 'RecursionError: a function calls itself without end. Line ',
    takes_all_memory: 'MemoryError',
    kills_its_group: 'your code has ended the whole program: signal 9',
}


def points_of(function, capsys):
    """Judge a function as the last point of a task, and return what the verdict found."""
    tasks = Tasks()

    @tasks.add(limit_s=LIMIT_S, cpu_s=1.0)
    def task(answer):
        return [('before', lambda: True, ''), ('it ends', answer, '')]

    tasks.check('task', function)
    return capsys.readouterr().out


@pytest.mark.parametrize('function', HOSTILE, ids=lambda function: function.__name__)
def test_each_hostile_answer_gets_a_sentence_and_leaves_nothing(function, capsys, monkeypatch):
    monkeypatch.setattr(sandbox, 'MEMORY_BYTES', 200 << 20)  # to fill it takes time
    threads, started = threading.active_count(), time.monotonic()
    said = ' '.join(points_of(function, capsys).split())
    assert '[ok] before [not yet] it ends' in said
    assert f'Found: {HOSTILE[function]}' in said
    assert time.monotonic() - started < 20
    assert threading.active_count() <= threads
    assert psutil.Process().children(recursive=True) == []
    assert not [
        p for p in psutil.process_iter(['cmdline']) if p.info['cmdline'] == ['sleep', '1000']
    ]


def test_a_thread_that_failed_gets_a_sentence_of_its_own(capsys):
    def starts_a_thread():
        thread = threading.Thread(target=lambda: 1 / 0)
        thread.start()
        thread.join()
        return 'nothing came'

    said = ' '.join(points_of(starts_a_thread, capsys).split())
    assert 'nothing came. A thread of yours ended with ZeroDivisionError: division by zero' in said


def test_an_interrupt_ends_the_check_and_all_it_started(capsys):
    threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        points_of(sleeps_for_ever, capsys)
    assert psutil.Process().children(recursive=True) == []


def test_an_interrupt_while_the_guard_begins(capsys, monkeypatch):
    fork = sandbox.fork

    def interrupted():
        process = fork()
        signal.raise_signal(signal.SIGINT)  # in this process, and in the guard
        return process

    monkeypatch.setattr(sandbox, 'fork', interrupted)
    with pytest.raises(KeyboardInterrupt):
        points_of(sleeps_for_ever, capsys)
    assert psutil.Process().children(recursive=True) == []


KILLED = """
import subprocess, time
from helpers.checks.tasks import Tasks

def starts_and_waits():
    subprocess.Popen(['sleep', '1001'])
    time.sleep(1000)

tasks = Tasks()
tasks.add(lambda answer: [('it ends', answer, '')], name='it', limit_s=100)
tasks.check('it', starts_and_waits)
"""


def sleepers():
    commands = [process.info['cmdline'] for process in psutil.process_iter(['cmdline'])]
    return commands.count(['sleep', '1001'])


def test_a_killed_kernel_leaves_nothing_of_its_check():
    with subprocess.Popen([sys.executable, '-c', KILLED]) as kernel:
        wait_for(sleepers)
        kernel.kill()
    wait_for(lambda: not sleepers())
