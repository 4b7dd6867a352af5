"""The soak: it notices what is left, whoever left it, and runs cells as each mode says."""

import json
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import nbformat
import psutil
import pytest

from tools.soak import __main__ as soak
from tools.soak.conditions import CONDITIONS, CannotRunError, busy_loops, python_of, sandbox
from tools.soak.leftovers import files_of, processes_that_stay
from tools.soak.plugin import HINTS, IN_IMPORT

CONDITION = {condition.name: condition for condition in CONDITIONS}


@pytest.fixture
def lesson(tmp_path):
    """Return a function that runs a notebook of cells, each a source and what it prints."""

    def run(condition: str, *cells: tuple[str, str], seed: int = 1) -> dict:
        node = nbformat.v4.new_notebook()
        for source, prints in cells:
            cell = nbformat.v4.new_code_cell(
                textwrap.dedent(source), execution_count=len(node.cells) + 1
            )
            cell.outputs = [nbformat.v4.new_output('stream', text=prints)] if prints else []
            node.cells.append(cell)
        path = tmp_path / 'lesson.ipynb'
        nbformat.write(node, path)
        try:
            (record,) = soak.run([path], CONDITION[condition], seed)
        except CannotRunError as error:
            pytest.skip(str(error))
        return record

    return run


# --- What is left --------------------------------------------------------------------------------


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
        [sys.executable, '-c', textwrap.dedent(script)], capture_output=True, text=True, timeout=60
    )
    nothing, left, child = json.loads(answer.stdout)
    assert nothing == []
    assert 'The thread mine (Thread) still runs.' in left
    assert 'The thread dds.ev.0 still runs.' in left
    assert f'The process {child} still runs: sleep 9.' in left
    assert 'The kernel holds 2 domain ids instead of one.' in left
    assert any(sentence.startswith('The kernel still uses /dev/shm/fastrtps_') for sentence in left)


def test_a_child_that_ends_in_a_moment_is_not_left():
    with subprocess.Popen(['sleep', '0.1']) as ends, subprocess.Popen(['sleep', '60']) as stays:
        threading.Thread(target=ends.wait).start()
        left = processes_that_stay(1.0)
        assert str(ends.pid) not in left
        assert left[str(stays.pid)] == 'sleep 60'
        stays.kill()


LEAVES = """
    import os, subprocess
    from pathlib import Path
    # Its parent ends at once.
    _ = subprocess.run(['sh', '-c', 'setsid sleep 61 > /dev/null 2>&1 &'])
    Path('/dev/shm/fastrtps_left').touch()
    Path.home().joinpath('left').touch()
"""


def test_what_is_left_of_a_run_is_named_and_ended(lesson):
    record = lesson('idle', (LEAVES, ''))
    assert record['failed'][0] == 'after the run'
    (after, files) = [row['failed'] for row in record['report'] if row['failed']]
    assert ' still runs: sleep 61.' in after
    assert after.endswith('Shared memory is left: /dev/shm/fastrtps_left.')
    assert files.endswith('/home/left.')
    assert not any(
        'sleep 61' in ' '.join(p.info['cmdline'] or ()) for p in psutil.process_iter(['cmdline'])
    )


def test_shared_memory_of_a_killed_kernel_is_not_counted(lesson):
    record = lesson('kill', ("open('/dev/shm/fastrtps_mine', 'a').close()", ''))
    assert record['failed'] is None
    assert list(record['cells']) == ['code cell 1']


def test_a_changed_file_of_the_checkout_is_seen(tmp_path):
    subprocess.run(['git', 'init', '-q', tmp_path], check=True)
    Path(tmp_path, '.gitignore').write_text('/scratch/')
    Path(tmp_path, 'scratch').mkdir()
    before = files_of(tmp_path)
    for name in ('new', 'scratch/allowed'):
        Path(tmp_path, name).touch()
    assert [Path(file).name for file, _ in files_of(tmp_path) - before] == ['new']


# --- The modes -----------------------------------------------------------------------------------

COUNT = ("count = globals().get('count', 0) + 1\nprint(count)", '1\n')
WAIT = ('import threading\nthreading.Event().wait(3)\nprint("waited")', 'waited\n')
LEAVE = ('threading.Thread(target=threading.Event().wait, args=[60], name="left").start()', '')


def test_twice_compares_the_second_pass_too(lesson):
    record = lesson('twice', COUNT)
    assert record['failed'][0] == 'code cell 1 again'
    assert list(record['cells']) == ['code cell 1', 'code cell 1 again']


def test_after_a_killed_kernel_all_cells_run_in_a_fresh_one(lesson):
    assert lesson('kill', COUNT)['failed'] is None


def test_an_interrupted_cell_is_looked_at_and_run_again(lesson):
    record = lesson('interrupt', ('import threading', ''), WAIT, LEAVE, seed=3)
    interrupted, left = record['report'][1:3]
    assert interrupted['interrupted_after_s'] < 3
    assert interrupted['failed'] is None
    assert 'The thread left (Thread) still runs.' in left['failed']
    assert record['failed'][0] == 'code cell 3'


@pytest.mark.parametrize('times', [1, 2])
def test_a_kernel_that_an_interrupt_ends_is_given_a_second_try(lesson, tmp_path, times):
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
    record = lesson('interrupt', (cell, ''), seed=3)
    assert record['events']['with a lost kernel'] == 1
    if times == 1:
        assert record['failed'] is None
    else:
        assert 'The kernel is lost' in record['failed'][1]


def test_the_hints_of_a_second_try_are_not_compared():
    first = '[not yet] the depth is 10\n    (NameError: it\n[ok] all\nExercise 1: 1 of 2.\n'
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


# --- The conditions ------------------------------------------------------------------------------


FILL = ("_ = open('/dev/shm/more', 'wb').write(bytes(10**5))", '')


def test_a_full_shared_memory_is_full(lesson):
    assert 'No space left on device' in lesson('shm-full', FILL)['failed'][1]


def test_a_failure_is_excused_where_the_doctor_names_its_cause(lesson):
    assert lesson('shm-full-before', FILL)['failed'] is None


def test_conditions_that_this_machine_lacks_say_so(monkeypatch, tmp_path):
    with pytest.raises(CannotRunError, match=r'Python 3\.9'):
        python_of('3.9')
    (tmp_path / 'unshare').write_text('#!/bin/sh\necho no >&2; exit 1\n')
    (tmp_path / 'unshare').chmod(0o755)
    monkeypatch.setenv('PATH', f'{tmp_path}:/usr/bin:/bin')
    with pytest.raises(CannotRunError, match='may not mount, root may: no'):
        sandbox('true', tmp_path)


def test_busy_loops_end():
    before = set(psutil.Process().children())
    with busy_loops():
        assert len(set(psutil.Process().children()) - before) == 4
    assert set(psutil.Process().children()) <= before


# --- The tool ------------------------------------------------------------------------------------


def record(notebook: str, condition: str, failed=None) -> dict:
    return {
        'notebook': notebook,
        'condition': condition,
        'seed': 7,
        'cells': {'code cell 1': 0.1, 'code cell 2': 2.0},
        'events': {'interrupted': 2, 'in an import': 0, 'without a reply': 1},
        'failed': failed,
    }


def test_the_table():
    records = [
        record('01_a', 'idle'),
        record('01_a', 'busy', ['code cell 2', 'It differs.\nHere.']),
        record('02_b', 'idle'),
    ]
    lines = [' '.join(line.split()) for line in soak.table(records).splitlines()]
    assert '01_a 2 1 2.0 s, code cell 2 busy, code cell 2, seed 7' in lines
    assert '02_b 1 0 2.0 s, code cell 2' in lines
    assert {'idle 2 0', 'busy 1 1'} <= set(lines)
    assert 'Cells: 6 interrupted, 3 without a reply.' in lines
    assert lines[-2:] == ['01_a: It differs.', 'Here.']


@pytest.fixture
def sittings(monkeypatch, tmp_path):
    """Return the runs that sittings do, where each run passes at once and the fifth is Ctrl+C."""
    done = []

    def run(notebooks: list[Path], condition, seed: int) -> list[dict]:
        done.append((' '.join(path.stem[:2] for path in notebooks), condition.name))
        if len(done) == 5:
            raise KeyboardInterrupt
        if condition.name == 'python3.14':
            raise CannotRunError('There is none.')
        return [record(path.stem, condition.name) for path in notebooks]

    monkeypatch.setattr(soak, 'run', run)
    monkeypatch.setattr(soak, 'RUNS', tmp_path / 'new/runs.jsonl')
    return done


def test_sittings_add_up_and_an_interrupt_ends_one(sittings, capsys):
    assert soak.main(['--lesson', '01', '--conditions', 'idle']) == 0
    assert soak.main(['--lesson', '00 01', '--conditions', 'idle,python3.14,parallel']) == 0
    assert sittings == [('01', 'idle'), ('00', 'idle'), ('00', 'python3.14'), ('00 01', 'parallel')]
    soak.main(['--rounds', '3', '--lesson', '01', '--conditions', 'busy'])
    assert 'does not count' in capsys.readouterr().out
    assert soak.main(['--report', '--lesson', '01']) == 0
    (row,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith('01_')]
    assert row.split()[1:3] == ['2', '0']


def test_a_run_counts_until_what_it_used_has_changed(sittings, tmp_path, monkeypatch):
    monkeypatch.setattr(soak, 'ROOT', tmp_path)
    (tmp_path / 'helpers').mkdir()
    one, other, helper = (tmp_path / name for name in ('1.ipynb', '2.ipynb', 'helpers/one.py'))
    for path in (one, other, helper):
        path.write_text('old')
    soak.soak([one, other], [CONDITION['idle']], rounds=2, minutes=1, seed=0)
    assert len(soak.recorded([one, other])) == 4
    other.write_text('new')
    assert {record['notebook'] for record in soak.recorded([one, other])} == {'1'}
    helper.write_text('new')
    assert soak.recorded([one, other]) == []


@pytest.mark.parametrize('wrong', [['--conditions', 'idel'], ['--lesson', '77']])
def test_what_there_is_none_of_is_said(wrong, capsys):
    with pytest.raises(SystemExit):
        soak.main(wrong)
    assert 'There is no' in capsys.readouterr().err
