"""The soak: it notices what is left, whoever left it, and runs cells as each mode says."""

import os
import textwrap

import nbformat
import psutil
import pytest

from tools.soak import __main__ as soak
from tools.soak.conditions import CONDITIONS, Condition
from tools.soak.plugin import HINTS, IN_IMPORT

CONDITION = {condition.name: condition for condition in CONDITIONS}
needs_root = pytest.mark.skipif(os.getuid() != 0, reason='Only root may mount.')


@pytest.fixture
def failures(tmp_path):
    """Return a function that runs cells, each a source and what it prints, and says what failed."""

    def run(condition: str, *cells: tuple[str, str]) -> dict[str, str]:
        node = nbformat.v4.new_notebook()
        for source, prints in cells:
            cell = nbformat.v4.new_code_cell(textwrap.dedent(source), execution_count=1)
            cell.outputs = [nbformat.v4.new_output('stream', text=prints)] if prints else []
            node.cells.append(cell)
        path = tmp_path / 'lesson.ipynb'
        nbformat.write(node, path)
        rows = soak.run([path], CONDITION[condition])
        assert {row['notebook'] for row in rows} == {'lesson'}
        return {row['item']: row['failed'] for row in rows if row['failed']}

    return run


COUNT = ("count = globals().get('count', 0) + 1\nprint(count)", '1\n')
LEFT_IN_KERNEL = """
    import subprocess, threading
    from helpers.session import ros_session
    with ros_session():
        pass
    threading.Thread(target=threading.Event().wait, args=[60], name='mine').start()
    child = subprocess.Popen(['sleep', '62'])
    _ = ros_session().__enter__()
"""
LEFT_AFTER_RUN = """
    import subprocess
    from pathlib import Path
    # Its parent ends at once.
    _ = subprocess.run(['sh', '-c', 'setsid sleep 61 > /dev/null 2>&1 &'])
    _ = Path('/dev/shm/fastrtps_left').write_text('left')
    Path.home().joinpath('left').touch()
"""


@needs_root
def test_what_is_left_is_named_and_ended(failures):
    found = failures('idle', (LEFT_IN_KERNEL, ''), (LEFT_AFTER_RUN, ''))
    said = found['what is left in the kernel']
    assert 'The thread mine still runs.' in said
    assert 'still runs: sleep 62.' in said
    assert 'The thread dds.' in said
    assert 'The kernel still uses /dev/shm/fastrtps_' in said
    said = found['after the run']
    assert ' still runs: sleep 61.' in said
    assert 'Shared memory is left: /dev/shm/fastrtps_left.' in said
    assert '/home/left has changed.' in said
    commands = [' '.join(p.info['cmdline'] or ()) for p in psutil.process_iter(['cmdline'])]
    assert 'sleep 61' not in commands


@needs_root
def test_where_a_cell_hangs_is_told(failures, monkeypatch):
    monkeypatch.setattr(soak, 'SLOW_S', 0.5)
    found = failures('idle', ('import threading\nthreading.Event().wait(2)', 'something else\n'))
    assert list(found) == ['code cell 1', 'where cells stood after 0.5 s']
    assert ' in wait\n' in found['where cells stood after 0.5 s']


@needs_root
def test_twice_compares_each_cell_again_at_once_and_after_the_last_one(failures):
    assert list(failures('twice', COUNT)) == ['code cell 1 at once again', 'code cell 1 again']


@needs_root
def test_after_a_killed_kernel_all_cells_run_in_a_fresh_one(failures):
    # Only a kernel that lives removes it.
    held = (
        "import time; from pathlib import Path; file = Path('/dev/shm/fastrtps_mine')\n"
        'file.touch(); time.sleep(11); file.unlink()',
        '',
    )
    assert failures('kill', held) == {}


@needs_root
@pytest.mark.parametrize('lost', [0, 1, 2])
def test_an_interrupted_cell_is_run_again_and_a_lost_kernel_given_a_second_try(
    failures, tmp_path, lost
):
    cell = f"""
        import os, threading, time
        from pathlib import Path
        run = len(list(Path('{tmp_path}').glob('run*')))
        Path(f'{tmp_path}/run{{run}}').touch()
        try:
            time.sleep(20 if run <= min({lost}, 1) else 0)
        except KeyboardInterrupt:
            if run < {lost}:
                Path(f'{tmp_path}/lost{{run}}').touch()
                os._exit(1)
            Path('{tmp_path}/left').touch()
            threading.Thread(target=threading.Event().wait, args=[60], name='left').start()
            raise
        print('done')
    """
    said = failures('interrupt', (cell, 'done\n'))
    # The random time may be over before the cell is in its `try`. Then nothing is lost or left.
    if len(list(tmp_path.glob('lost*'))) == 2:
        assert list(said) == ['code cell 1 interrupted']
        assert 'The kernel is lost' in said['code cell 1 interrupted']
    elif not (tmp_path / 'left').exists():
        assert said == {}
    else:
        assert list(said) == [
            'what code cell 1 left when interrupted',
            'what is left in the kernel',
        ]
        assert all('The thread left still runs.' in text for text in said.values())


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
        ('Cell In[1], line 1\n----> 1 import numpy', True),
        ('Cell In[1], line 1\n----> 1 important = ones(3)', False),
    ],
)
def test_an_interrupted_import_is_seen_in_the_traceback(frame, import_):
    assert bool(IN_IMPORT.search(f'KeyboardInterrupt\n{frame}\n')) is import_


@needs_root
def test_a_full_shared_memory_is_full(failures):
    fill = ("_ = open('/dev/shm/more', 'wb').write(bytes(10**5))", '')
    assert 'No space left on device' in failures('shm-full', fill)['code cell 1']
    session = 'from helpers.session import ros_session\nwith ros_session():\n    pass'
    assert failures('shm-full', (session, '')) == {}


@needs_root
def test_sittings_add_up_and_an_interrupt_ends_one(monkeypatch, tmp_path, capsys):
    done = []

    def run(notebooks, condition, python) -> list[dict]:
        done.append((' '.join(path.stem[:2] for path in notebooks), condition.name))
        if len(done) == 5:
            raise KeyboardInterrupt
        rows = [
            {'notebook': path.stem, 'item': 'a', 'seconds': 1, 'failed': None} for path in notebooks
        ]
        rows[0]['failed'] = 'It differs.' if condition.name == 'busy' else None
        return [row | {'condition': condition.name, 'began': str(len(done))} for row in rows]

    monkeypatch.setattr(soak, 'run', run)
    monkeypatch.setattr(soak, 'RUNS', tmp_path / 'new/runs.jsonl')
    assert soak.main(['--lesson', '00 01', '--conditions', 'idle,parallel']) == 0
    assert soak.main(['--lesson', '01', '--conditions', 'busy', '--rounds', '2']) == 1
    assert done == [
        ('00', 'idle'),
        ('01', 'idle'),
        ('00 01', 'parallel'),
        ('01', 'busy'),
        ('01', 'busy'),
    ]
    said = capsys.readouterr().out
    assert 'does not count' in said
    lines = [' '.join(line.split()) for line in said.splitlines()]
    assert {'busy 1/1', 'idle 0/1 0/1', 'parallel 0/1 0/1'} <= set(lines)
    assert lines[-1].startswith('busy, 01_')
    assert lines[-1].endswith(', a: It differs.')


@pytest.mark.parametrize('wrong', [['--conditions', 'idel'], ['--lesson', '77']])
def test_what_there_is_none_of_is_said(wrong, capsys):
    with pytest.raises(SystemExit):
        soak.main(wrong)
    assert 'There is no' in capsys.readouterr().err


def test_a_python_that_this_machine_lacks_is_said():
    with pytest.raises(ValueError, match=r'for Python 3\.9\.'):
        Condition('old', version='3.9').python()
