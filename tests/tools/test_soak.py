"""The soak notices what a cell leaves, and that a cell prints something else when run again."""

import os
import textwrap

import nbformat
import psutil
import pytest

from tools.soak import __main__ as soak

LEAVES = """
    import subprocess, threading
    from pathlib import Path
    from helpers.ros import ros_session
    threading.Thread(target=threading.Event().wait, args=[60], name='mine').start()
    _ = ros_session().__enter__()
    # Its parent ends at once.
    _ = subprocess.run(['sh', '-c', 'setsid sleep 61 > /dev/null 2>&1 &'])
    _ = Path('/dev/shm/fastrtps_left').write_text('left')
    Path.home().joinpath('left').touch()
"""


@pytest.mark.skipif(os.getuid() != 0, reason='Only root may mount.')
def test_what_is_left_and_what_differs_is_named(tmp_path):
    count = nbformat.v4.new_code_cell("count = globals().get('count', 0) + 1\nprint(count)")
    count.outputs = [nbformat.v4.new_output('stream', text='1\n')]
    cells = [count, nbformat.v4.new_code_cell(textwrap.dedent(LEAVES))]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / 'lesson.ipynb')
    found = soak.run(tmp_path / 'lesson.ipynb', 'twice')
    assert {'code cell 1 at once again', 'code cell 1 again'} <= found.keys()
    said = found['what is left in the kernel'] + found['after the run']
    for left in (
        'The thread mine still runs.',
        'The kernel still uses /dev/shm/fastrtps_',
        ' still runs: sleep 61.',
        'Shared memory is left: /dev/shm/fastrtps_left.',
        '/home/left has changed.',
    ):
        assert left in said
    commands = [' '.join(p.info['cmdline'] or ()) for p in psutil.process_iter(['cmdline'])]
    assert 'sleep 61' not in commands
