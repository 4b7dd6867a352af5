"""The extension: `!ros2` is found, an Interrupt ends a `!command`, and an error is explained.

What is explained: a name that is missing, and a cell that needs one which has not run to its end.
"""

from __future__ import annotations

import linecache
import os
import sys
from subprocess import CalledProcessError
from types import TracebackType

from IPython.core.error import UsageError
from IPython.utils.process import system

from helpers.notebook import run_command

# The first cells of each lesson load one of them.
OF_FIRST_CELLS = 'helpers.ros.session', 'helpers.workspace'


def load_ipython_extension(shell) -> None:
    """Let `!ros2` be found, and a cell that fails say which other cell is to be run first.

    An Interrupt of a `!command` ends its cell.
    """
    commands, path = os.path.join(sys.prefix, 'bin'), os.environ.get('PATH', os.defpath)
    if commands not in path.split(os.pathsep):
        os.environ['PATH'] = f'{commands}{os.pathsep}{path}'

    def explain(shell, kind, error, traceback, tb_offset=None) -> None:
        shell.showtraceback((kind, error, traceback), tb_offset=tb_offset)
        begun = any(module in sys.modules for module in OF_FIRST_CELLS)
        from helpers.checks import explain_missing_name  # no kernel waits for it when it starts

        name = getattr(error, 'name', None) or ''
        if text := explain_missing_name(name, _first_line(traceback), begun):
            print(text)

    shell.set_custom_exc((NameError, UsageError), explain)
    shell.events.register('post_run_cell', _explain_unfinished)

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


def unload_ipython_extension(shell) -> None:
    """Let the shell be as IPython has it."""
    shell.set_custom_exc((), None)
    shell.events.unregister('post_run_cell', _explain_unfinished)
    del shell.system


_unfinished = None  # until a cell has failed: no kernel waits for helpers.checks before


def _explain_unfinished(result) -> None:
    """Say below the error of a cell whether it needs one that has not run to its end."""
    global _unfinished
    if result.success and _unfinished is None:
        return
    from helpers.checks import Unfinished

    _unfinished = _unfinished or Unfinished()
    source = result.info.raw_cell
    interrupted = isinstance(result.error_in_exec, KeyboardInterrupt)
    if not result.success and not interrupted and (text := _unfinished.explain(source)):
        print(text)
    _unfinished.ended(source, result.success)


def _first_line(traceback: TracebackType) -> str:
    """Return the first line of the cell that failed, '' if the error is not in its code."""
    if traceback.tb_next is None:
        return ''
    return linecache.getline(traceback.tb_next.tb_frame.f_code.co_filename, 1)
