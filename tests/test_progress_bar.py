"""The bar in a real kernel. JupyterLab lets a cell ask for input, nbval and nbclient do not."""

import textwrap

import pytest
from jupyter_client.manager import run_kernel

CELL = """
    from helpers.notebook.progress_bar import ProgressBar
    parts = iter([0.25, 0.5, 1.2])
    with ProgressBar({progress}) as bar:
        for waited_s in {waits}:
            bar.update(waited_s)
        {then}
    print('heard 41')
"""
HEARD, ERROR = ('stream', 'heard 41\n'), ('error', '')


@pytest.fixture(scope='module')
def kernel():
    with run_kernel(kernel_name='python3') as client:
        yield client


def shown(kernel, waits, progress='lambda: next(parts)', then='', watched=True):
    """Return what a cell shows whose bar is updated after these waits, in seconds."""
    found = []

    def show(message):
        kind, content = message['msg_type'], message['content']
        if kind.endswith('display_data'):
            found.append((kind.removesuffix('_display_data'), content['data']['text/html']))
        elif kind == 'stream' and found and found[-1][0] == kind:
            # In how many pieces a kernel sends what is printed, its clock decides.
            found[-1] = kind, found[-1][1] + content['text']
        elif kind not in ('status', 'execute_input'):
            found.append((kind, content.get('text', '')))

    cell = textwrap.dedent(CELL).format(waits=waits, progress=progress, then=then)
    kernel.execute_interactive(cell, allow_stdin=watched, output_hook=show, timeout=60)
    return found


def bar(percent):
    return f'<progress value="{percent}" max="100"></progress> {percent} %'


def test_a_long_wait_shows_a_bar(kernel):
    assert shown(kernel, [0, 1.99, 2, 2.1, 2.2, 2.3, 5]) == [
        ('display_data', bar(25)),
        ('update', bar(50)),
        ('update', bar(100)),
        ('update', ''),
        HEARD,
    ]
    ended = [('display_data', bar(25)), ('update', ''), ERROR]
    assert shown(kernel, [2], then='raise KeyError') == ended


def test_a_bar_that_is_not_needed_shows_nothing(kernel):
    assert shown(kernel, [0, 1.99]) == [HEARD]
    assert shown(kernel, [100], progress=None) == [HEARD]
    assert shown(kernel, [100], progress='lambda: 1 / 0', watched=False) == [HEARD]


WHY = "bar.say('A node & no executor.')"


def test_an_interrupted_wait_keeps_its_reason(kernel):
    said = '<pre>A node &amp; no executor.</pre>'
    first = [('display_data', bar(25)), ('update', bar(25) + said)]
    assert shown(kernel, [2], then=WHY) == [*first, ('update', ''), HEARD]
    then = f'{WHY}; raise KeyboardInterrupt'
    assert shown(kernel, [2], then=then) == [*first, ('update', said), ERROR]
    assert shown(kernel, [2], then=WHY, watched=False) == [HEARD]
