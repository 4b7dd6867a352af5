"""The soak: it notices what is left, whoever left it, and runs cells as each mode says."""

import fcntl
import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import nbformat
import psutil
import pytest
from support.nodes import LIMIT_S

from helpers.doctor import SHARED_MEMORY
from tools.soak import __main__ as soak
from tools.soak import leftovers
from tools.soak.conditions import CONDITIONS, CannotRunError, Condition, busy_loops, python_of
from tools.soak.leftovers import MARK, Watch
from tools.soak.plugin import HINTS, IN_IMPORT

CONDITION = {condition.name: condition for condition in CONDITIONS}


# What is left in a kernel


def test_what_is_left_in_a_kernel_is_named():
    script = """
        import json, socket, subprocess, threading
        from domain_coordinator import domain_id
        from domain_coordinator.impl import PORT_BASE
        from helpers.domain import reserve_domain_id
        from helpers.session import ros_session
        from tools.soak.leftovers import left_in_process, state_of_process

        before, gate = state_of_process(), threading.Event()
        with ros_session():
            pass
        reserve_domain_id()
        # A port of the coordinator's range that serves something else.
        for port in range(PORT_BASE + 101, PORT_BASE, -1):
            try:
                server = socket.create_server(('127.0.0.1', port))
                break
            except OSError:
                continue
        client = socket.create_connection(server.getsockname())
        nothing = left_in_process(before, state_of_process())
        threading.Thread(target=gate.wait, name='mine').start()
        child = subprocess.Popen(['sleep', '9'])
        another = domain_id()
        another.__enter__()
        ros_session().__enter__()
        while 'dds.ev.0' not in state_of_process()['threads'].values():
            pass  # a thread gives itself its name
        print(json.dumps([nothing, left_in_process(before, state_of_process()), child.pid]))
        gate.set()
        child.kill()
    """
    answer = subprocess.run(
        [sys.executable, '-c', textwrap.dedent(script)], capture_output=True, text=True, timeout=30
    )
    nothing, left, child = json.loads(answer.stdout)
    assert nothing == []
    assert 'The thread mine (Thread) still runs.' in left
    assert 'The thread dds.ev.0 still runs.' in left
    assert f'The process {child} still runs: sleep 9.' in left
    assert 'The kernel holds 2 domain ids instead of one.' in left
    assert any(sentence.startswith('The kernel still uses /dev/shm/fastrtps_') for sentence in left)


def test_a_child_that_ends_in_a_moment_is_not_left(monkeypatch):
    with subprocess.Popen(['sleep', '0.1']) as ends, subprocess.Popen(['sleep', '60']) as stays:
        children = [psutil.Process(child.pid) for child in (ends, stays)]
        threading.Thread(target=ends.wait).start()
        monkeypatch.setattr(leftovers, 'MOMENT_S', LIMIT_S)
        assert leftovers._that_stay(children[:1]) == []
        monkeypatch.setattr(leftovers, 'MOMENT_S', 0.1)
        assert leftovers._that_stay(children) == children[1:]
        stays.kill()


# What is left when the kernel is gone


@pytest.fixture
def folders(tmp_path):
    for name in ('home', 'checkout', 'checkout/scratch', 'checkout/.git'):
        (tmp_path / name).mkdir()
    (tmp_path / 'checkout/lesson').write_text('old')
    return tmp_path


LEAVES_ALL = """
    import json, os, signal, subprocess, sys, time
    from helpers.domain import reserve_domain_id
    from helpers.session import ros_session
    from tools.soak.leftovers import held_by, state_of_process
    import psutil

    session = ros_session().__enter__()
    child = os.fork()
    if child == 0:
        while True:
            signal.pause()
    print(json.dumps([child, state_of_process()]), flush=True)
    for name in ('home/new', 'checkout/new', 'checkout/scratch/allowed', 'checkout/.git/allowed'):
        open(name, 'w').close()
    open('checkout/lesson', 'a').write('new')
    sys.stdin.read()
"""


def test_what_a_killed_process_leaves_is_named(folders, monkeypatch):
    """A process that dies hard while its child lives on: every kind of leftover."""
    monkeypatch.setattr(leftovers, 'END_TIMEOUT_S', 0.2)
    mark = f'test-{os.getpid()}'
    with Watch(mark, [folders / 'home'], [folders / 'checkout']) as watch:
        process = subprocess.Popen(
            [sys.executable, '-c', textwrap.dedent(LEAVES_ALL)],
            env=os.environ | {MARK: mark},
            cwd=folders,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        child, state = json.loads(process.stdout.readline())
        while not (watch._held and (folders / 'checkout/lesson').read_text() == 'oldnew'):
            assert process.poll() is None
        process.kill()
        process.wait()  # not for the end of its output, which the child holds
    (domain_id,) = state['domain_ids']
    with_child = watch.left(state['domain_ids'], killed=set())
    os.kill(child, signal.SIGKILL)
    process.communicate()
    monkeypatch.undo()  # it may take a moment
    assert sum(f'The process {child} still runs: ' in sentence for sentence in with_child) == 1
    assert f'The process {child} still reserves domain id {domain_id}.' in with_child
    files = [sentence for sentence in with_child if sentence.startswith('The file')]
    assert files == [
        f'The file {folders}/{name} is new or has changed.'
        for name in ('checkout/lesson', 'checkout/new', 'home/new')
    ]
    (segment,) = [name for name in state['shared_memory'] if 'port' not in name]
    assert Path(segment).exists()
    then = watch.left(state['domain_ids'], killed=set())
    assert f'Shared memory is left: {segment}.' in then
    assert not Path(segment).exists()
    assert 'still' not in ' '.join(then)


def test_shared_memory_of_a_killed_process_is_removed_and_not_counted(folders):
    mark = f'test-{os.getpid()}'
    segment, older = (f'{SHARED_MEMORY}/fastrtps_{name}_of_{mark}' for name in ('new', 'old'))
    Path(older).touch()
    with Watch(mark, [folders / 'home'], [folders / 'checkout']) as watch:
        for end in ('', '_el'):
            Path(segment + end).touch()
        watch._held |= leftovers._files([segment, f'{segment}_el', older])
    assert watch.left({}, killed={segment}) == []
    assert not Path(f'{segment}_el').exists()
    Path(older).unlink()  # somebody else's: it was there before


def test_shared_memory_of_the_same_name_is_not_the_same(folders):
    """A port that this run had is free again, and then another run's."""
    port = Path(f'{SHARED_MEMORY}/fastrtps_port_of_test-{os.getpid()}')
    with Watch('mine', [folders / 'home'], [folders / 'checkout']) as watch:
        port.touch()
        watch._held |= leftovers._files([str(port)])
    other = port.with_name(f'{port.name}_new')
    other.touch()
    other.replace(port)
    assert watch.left({}, killed=set()) == []
    port.unlink()


def test_a_lock_counts_for_the_process_that_holds_it():
    """A participant opens the locks of other ports too, to see whether they are free."""
    segment = f'{SHARED_MEMORY}/fastrtps_lock_of_test-{os.getpid()}'
    lock = Path(f'{segment}_el')
    try:
        with lock.open('w') as holder:
            assert leftovers._segments(os.getpid()) == set()
            fcntl.flock(holder, fcntl.LOCK_EX)
            assert leftovers._segments(os.getpid()) == {segment}
            lock.unlink()  # another file of this name, in /dev/shm or in another name space
            lock.touch()
            assert leftovers._segments(os.getpid()) == set()
    finally:
        lock.unlink()


def test_a_zombie_is_named_and_a_process_that_has_ended_is_not():
    ended = subprocess.Popen(['true'])
    process = psutil.Process(ended.pid)
    while process.status() != psutil.STATUS_ZOMBIE:
        pass
    assert [name for _, name in leftovers._named([process])] == [
        'true (a zombie: nobody has waited for its end)'
    ]
    ended.wait()
    assert not list(leftovers._named([process]))


def test_other_processes_are_left_alone(folders):
    with (
        subprocess.Popen(['sleep', '9'], env=os.environ | {MARK: 'somebody else'}) as other,
        Watch('mine', [folders / 'home'], [folders / 'checkout']) as watch,
    ):
        assert watch.left({}, set()) == []
        assert other.poll() is None
        other.kill()


# The modes


def notebook(folder: Path, *cells: tuple[str, str]) -> Path:
    """Write a notebook of cells, each a source and what it prints."""
    node = nbformat.v4.new_notebook()
    for source, prints in cells:
        cell = nbformat.v4.new_code_cell(source, execution_count=len(node.cells) + 1)
        cell.outputs = [nbformat.v4.new_output('stream', text=prints)] if prints else []
        node.cells.append(cell)
    path = folder / 'lesson.ipynb'
    nbformat.write(node, path)
    return path


COUNT = ("count = globals().get('count', 0) + 1\nprint(count)", '1\n')
WAIT = ('import threading\nthreading.Event().wait(3)\nprint("waited")', 'waited\n')
LEAVE = ('threading.Thread(target=threading.Event().wait, args=[60], name="left").start()', '')


def test_twice_compares_the_second_pass_too(tmp_path):
    record = soak.run(notebook(tmp_path, COUNT), CONDITION['twice'], seed=1)
    assert record['failed'][0] == 'code cell 1 again'
    assert list(record['cells']) == ['code cell 1', 'code cell 1 again']


def test_an_interrupted_cell_is_looked_at_and_run_again(tmp_path):
    path = notebook(tmp_path, ('import threading', ''), WAIT, LEAVE)
    record = soak.run(path, CONDITION['interrupt'], seed=3)
    interrupted, left = record['report'][1:3]
    assert interrupted['interrupted_after_s'] < 3
    assert interrupted['failed'] is None
    assert 'The thread left (Thread) still runs.' in left['failed']
    assert record['failed'][0] == 'code cell 3'


@pytest.mark.parametrize('times', [1, 2])
def test_a_kernel_that_an_interrupt_ends_is_given_a_second_try(tmp_path, times):
    cell = f"""
import os, time
from pathlib import Path
run = len(list(Path('{tmp_path}').glob('run*')))
Path(f'{tmp_path}/run{{run}}').touch()
try:
    time.sleep(20 if run < 2 else 0)
except KeyboardInterrupt:
    if run < {times}:
        os._exit(1)
    raise
"""
    record = soak.run(notebook(tmp_path, (cell, '')), CONDITION['interrupt'], seed=3)
    assert record['interrupts']['with a lost kernel'] == 1
    if times == 1:
        assert record['failed'] is None
    else:
        assert 'The kernel is lost' in record['failed'][1]


def test_after_a_killed_kernel_all_cells_run_in_a_fresh_one(tmp_path):
    record = soak.run(notebook(tmp_path, COUNT), CONDITION['kill'], seed=1)
    assert record['failed'] is None
    assert list(record['cells']) == ['code cell 1']


def test_the_hints_of_a_second_try_are_not_compared():
    first = '[missing] the depth is 10\n    (NameError: it\n[ok] all\nExercise 1: 1 of 2.\n'
    hint = '    Hint: count the messages\n          that wait.\n'
    head, rest = first.split('[ok]')
    assert HINTS.sub('', f'{head}{hint}[ok]{rest}') == first


@pytest.mark.parametrize(
    ('frame', 'import_'),
    [
        ('File ~/my env/site-packages/numpy/_core/numeric.py:12\n     10 import x', True),
        ('File <frozen importlib._bootstrap>:1176, in _find_and_load(name, import_)', True),
        ('File ~/env/numpy/_core/numeric.py:580, in ones(shape)\n    579 result', False),
        ('Cell In[1], line 1\n----> 1 import numpy', False),
    ],
)
def test_an_interrupted_import_is_seen_in_the_traceback(frame, import_):
    assert bool(IN_IMPORT.search(f'KeyboardInterrupt\n{frame}\n')) is import_


# The tool


def test_conditions_that_this_machine_lacks_say_so(monkeypatch, tmp_path):
    with pytest.raises(CannotRunError, match=r'Python 3\.9'):
        python_of('3.9')
    monkeypatch.setattr(os, 'getuid', lambda: 1000)
    with pytest.raises(CannotRunError, match='as root'):
        CONDITION['shm-full'].before(tmp_path)


def test_a_full_shared_memory_is_named_by_the_doctor(tmp_path):
    condition = CONDITION['shm-full-before']
    try:
        before = condition.before(tmp_path)
    except CannotRunError as error:
        pytest.skip(str(error))
    answer = subprocess.run(
        [*before, sys.executable, '-m', 'helpers.doctor'], capture_output=True, text=True
    )
    assert answer.returncode == 1
    assert f'- rclpy: {condition.sentence}: run `' in answer.stdout


def test_busy_loops_end():
    before = set(psutil.Process().children())
    with busy_loops():
        assert len(set(psutil.Process().children()) - before) == 4
    assert set(psutil.Process().children()) <= before


def record(notebook: str, condition: str, failed=None) -> dict:
    cells = {'code cell 1': 0.1, 'code cell 2': 2.0}
    return {
        'notebook': notebook,
        'condition': condition,
        'seed': 7,
        'seconds': 3.0,
        'cells': cells,
        'interrupts': {'interrupted': 2, 'in an import': 0, 'without a reply': 1},
        'failed': failed,
    }


def test_a_run_counts_until_what_it_used_has_changed(tmp_path, monkeypatch):
    monkeypatch.setattr(soak, 'ROOT', tmp_path)
    monkeypatch.setattr(soak, 'RUNS', tmp_path / 'runs.jsonl')
    monkeypatch.setattr(
        soak, 'run', lambda path, condition, seed: record(path.stem, condition.name)
    )
    (tmp_path / 'helpers').mkdir()
    one, other, helper = (tmp_path / name for name in ('1.ipynb', '2.ipynb', 'helpers/one.py'))
    for path in (one, other, helper):
        path.write_text('old')
    assert soak.recorded([one]) == []
    records = soak.soak([one, other], [CONDITION['idle']], rounds=2, minutes=1, seed=0)
    assert len(records) == 4
    assert soak.recorded([one, other]) == records
    other.write_text('new')
    assert {record['notebook'] for record in soak.recorded([one, other])} == {'1'}
    helper.write_text('new')
    assert soak.recorded([one, other]) == []


def test_the_table():
    records = [
        record('01_a', 'idle'),
        record('01_a', 'busy', ['code cell 2', 'It differs.\nHere.']),
        record('02_b', 'idle'),
    ]
    lines = [' '.join(line.split()) for line in soak.table(records).splitlines()]
    assert lines[1] == '01_a 2 1 2.0 s, code cell 2 busy, code cell 2'
    assert lines[2] == '02_b 1 0 2.0 s, code cell 2'
    assert 'Failures by condition: idle 0 of 2, busy 1 of 1.' in lines
    assert 'Cells: 6 interrupted, 3 without a reply.' in lines
    assert lines[-2:] == ['It differs.', 'Here.']


def test_sittings_add_up_and_an_interrupt_ends_one(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(soak, 'RUNS', tmp_path / 'new/runs.jsonl')
    done = []

    def run(path: Path, condition: Condition, seed: int) -> dict:
        done.append((path.stem[:2], condition.name))
        if len(done) == 5:
            raise KeyboardInterrupt
        if condition.name == 'python3.14':
            raise CannotRunError('There is none.')
        return record(path.stem, condition.name)

    monkeypatch.setattr(soak, 'run', run)
    assert soak.main(['--lesson', '01', '--conditions', 'idle']) == 0
    soak.main(['--lesson', '00 01', '--conditions', 'idle,python3.14'])
    assert done[1:] == [('00', 'idle'), ('00', 'python3.14'), ('01', 'idle')]
    soak.main(['--rounds', '3', '--lesson', '01', '--conditions', 'busy'])
    assert 'do not count' in capsys.readouterr().out
    assert soak.main(['--report', '--lesson', '01']) == 0
    assert '01_publish_and_subscribe  2     0' in capsys.readouterr().out


@pytest.mark.parametrize('wrong', [['--conditions', 'idel'], ['--lesson', '77']])
def test_what_there_is_none_of_is_said(wrong, capsys):
    with pytest.raises(SystemExit):
        soak.main(wrong)
    assert 'There is no' in capsys.readouterr().err
