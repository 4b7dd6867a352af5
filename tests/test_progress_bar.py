import contextlib
import queue
import textwrap

import IPython
import IPython.display
import pytest
from jupyter_client.manager import KernelManager

from helpers import progress_bar
from helpers.progress_bar import ProgressBar


class Shell:
    """What `get_ipython` returns in a kernel: a person can be asked, or not."""

    def __init__(self, allow_stdin):
        self.kernel = type('Kernel', (), {'_allow_stdin': allow_stdin})()


@pytest.fixture
def calls(monkeypatch):
    """The display functions that were called, in order."""
    made = []

    class Handle:
        def update(self, bar):
            made.append(('update', bar.data))

    def display(bar, display_id):
        assert display_id is True
        made.append(('display', bar.data))
        return Handle()

    monkeypatch.setattr(IPython, 'get_ipython', lambda: Shell(allow_stdin=True))
    monkeypatch.setattr(IPython.display, 'display', display)
    monkeypatch.setattr(IPython.display, 'clear_output', lambda: made.append('clear'))
    return made


def bar(percent):
    return f'<progress value="{percent}" max="100"></progress> {percent} %'


def test_bar(calls):
    done = iter([0.25, 0.5, 1.2])
    with ProgressBar(lambda: next(done)) as shown:
        for waited_s in (0.0, 1.0, 1.99):
            shown.update(waited_s)
        assert calls == []  # a short wait shows nothing, and clears nothing
        for waited_s in (2.0, 2.1, 2.2, 2.3, 5.0):
            shown.update(waited_s)
        assert calls == [('display', bar(25)), ('update', bar(50)), ('update', bar(100))]
    assert calls[3:] == ['clear']


def test_failed_wait_is_cleared_too(calls):
    with pytest.raises(KeyError), ProgressBar(lambda: 0.5) as shown:
        shown.update(2.5)
        raise KeyError
    assert calls[-1] == 'clear'


@pytest.mark.parametrize('shell', [None, Shell(allow_stdin=False), object()])
def test_nobody_watches(calls, monkeypatch, shell):
    monkeypatch.setattr(IPython, 'get_ipython', lambda: shell)
    with ProgressBar(lambda: pytest.fail('nobody asked')) as shown:
        shown.update(100.0)
    assert calls == []


def test_no_progress_is_known(calls):
    with ProgressBar(None) as shown:
        shown.update(100.0)
    assert calls == []


CELL = """
    import helpers.progress_bar
    helpers.progress_bar.SHOW_AFTER_S = helpers.progress_bar.REFRESH_S = 0.0
    with helpers.progress_bar.ProgressBar(lambda: 0.5) as bar:
        bar.update(0.1)
        bar.update(0.2)
    print('heard 41')
"""


def test_real_kernel():
    """JupyterLab lets a cell ask for input, nbval and nbclient do not."""
    assert progress_bar.SHOW_AFTER_S == 2.0
    manager = KernelManager(kernel_name='python3')
    manager.start_kernel()
    client = manager.client()
    try:
        client.start_channels()
        client.wait_for_ready(timeout=60)
        shown = {}
        for allow_stdin in (False, True):
            kinds = shown[allow_stdin] = []
            client.execute_interactive(
                textwrap.dedent(CELL),
                allow_stdin=allow_stdin,
                output_hook=lambda message, kinds=kinds: kinds.append(message['msg_type']),
                timeout=60,
            )
            with contextlib.suppress(queue.Empty):
                client.get_iopub_msg(timeout=0)
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)
    quiet = {'status', 'execute_input'}
    assert [kind for kind in shown[False] if kind not in quiet] == ['stream']
    assert [kind for kind in shown[True] if kind not in quiet] == [
        'display_data',
        'update_display_data',
        'clear_output',
        'stream',
    ]
