"""The extension: `!ros2` is found, an Interrupt says what waited, a missing name is explained."""

from __future__ import annotations

import contextlib
import linecache
import os
import signal
import sys
import threading
from collections.abc import Callable
from subprocess import CalledProcessError
from traceback import walk_tb
from types import FrameType, TracebackType

from IPython.core.error import UsageError
from IPython.display import display
from IPython.utils.process import system

from helpers.notebook import PatientInterrupt, own_line, run_command

# The first cells of each lesson load one of them.
IN_IMPORT, IN_TRACKER = '<frozen importlib', 'resource_tracker.py'
OF_FIRST_CELLS = 'helpers.ros.session', 'helpers.workspace'


def load_ipython_extension(shell) -> None:
    """Let `!ros2` be found, and a name or a magic that is missing say what to run.

    An Interrupt of a `!command` ends its cell. That of any cell is one line; if the cell or a
    callback waited for something, lines below it say for what, and why it has not come; a picture
    shows the circle, if callbacks waited for each other.
    """
    commands, path = os.path.join(sys.prefix, 'bin'), os.environ.get('PATH', os.defpath)
    if commands not in path.split(os.pathsep):
        os.environ['PATH'] = f'{commands}{os.pathsep}{path}'

    told = _watch_interrupts(shell)

    def explain(shell, kind, error, traceback, tb_offset=None) -> None:
        if kind is KeyboardInterrupt and not _breaks_kernel(traceback):
            line = own_line(
                (frame.f_code.co_filename, number) for frame, number in _frames(traceback)
            )
            lines = [line for one in told for line in one.text.splitlines()]
            # private: an error that IPython shows, IPython 9.18
            error._render_traceback_ = lambda: [f'Interrupted. {line}'.strip(), *lines]
        shell.showtraceback((kind, error, traceback), tb_offset=tb_offset)
        if kind is KeyboardInterrupt:
            if told and told[0].circle:
                from helpers.waits_view import Circle  # only if there is one to draw

                display(Circle(told[0].circle))
            return
        begun = any(module in sys.modules for module in OF_FIRST_CELLS)
        from helpers.checks import explain_missing_name  # no kernel waits for them when it starts
        from helpers.notebook import wrap

        name = getattr(error, 'name', None) or ''
        if text := explain_missing_name(name, _first_line(traceback), begun):
            print(*wrap(text), sep='\n')

    shell.set_custom_exc((NameError, UsageError, KeyboardInterrupt), explain)

    def run(command: str) -> None:
        """Do what ipykernel's `system` does."""
        if command.rstrip().endswith('&'):
            raise OSError('Background processes not supported.')
        # The variables of the cell, or of its function, are one frame above.
        status = run_command(system, shell.var_expand(command, depth=1))
        shell.user_ns['_exit_code'] = status
        if status and getattr(shell, 'system_raise_on_error', False):
            raise CalledProcessError(status, command)

    shell.system = run


def _watch_interrupts(shell) -> list:
    """Return a list that has, after an Interrupt of a cell, what is told of that moment.

    Afterwards it is too late to look: the `with` blocks of the cell have ended all that ran.
    """
    told = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        # Nothing must keep an Interrupt from ending the cell. Where no ROS is, nothing is known.
        if 'rclpy' in sys.modules:
            with contextlib.suppress(Exception):
                from helpers.waits import tell_interrupt

                told[:] = [tell_interrupt(frame)]
        signal.default_int_handler(number, frame)

    handler = PatientInterrupt(interrupt)

    def begin(*_) -> None:
        told.clear()
        main = threading.current_thread() is threading.main_thread()
        if main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, handler)  # ipykernel sets its own after the cell

    def end(*_) -> None:
        handler.forget()

    _watches[shell] = {'pre_run_cell': begin, 'post_run_cell': end}
    for event, watch in _watches[shell].items():
        shell.events.register(event, watch)
    return told


_watches: dict[object, dict[str, Callable]] = {}


def unload_ipython_extension(shell) -> None:
    """Let the shell be as IPython has it."""
    for event, watch in _watches.pop(shell).items():
        shell.events.unregister(event, watch)
    shell.set_custom_exc((), None)
    del shell.system


def _frames(traceback: TracebackType) -> list[tuple[FrameType, int]]:
    """Return the frames of a traceback and their lines, the innermost first."""
    return [*walk_tb(traceback)][::-1]


def _breaks_kernel(traceback: TracebackType) -> bool:
    """Return whether an interrupt has left an import half done: who restarts the kernel sees it."""
    files = (frame.f_code.co_filename for frame, _ in _frames(traceback))
    return any(file.startswith(IN_IMPORT) or file.endswith(IN_TRACKER) for file in files)


def _first_line(traceback: TracebackType) -> str:
    """Return the first line of the cell that failed, '' if the error is not in its code."""
    if traceback.tb_next is None:
        return ''
    return linecache.getline(traceback.tb_next.tb_frame.f_code.co_filename, 1)
