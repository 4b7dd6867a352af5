"""What each kernel of this environment gets: the environment's own settings of IPython load it."""

import linecache
import os
import re
import sys
from subprocess import CalledProcessError

from IPython.core.error import UsageError
from IPython.utils.process import system

from helpers.notebook.interrupts import run_command

NOT_RUN = (
    'This kernel has not run the first cells of the lesson: choose Run > Run All Above Selected '
    'Cell, then run this cell again.'
)
CHECK = re.compile(r'check\(\d+,')
NO_ANSWER = '{} is not there yet: run the cell of the task above, then this one again.'
OF_A_CLASS = '{0} is for a class: write `from helpers.checks import {0}` above it.'
CLASS = 'join_class', 'leave_class', 'lower_hand', 'raise_hand'
NO_GUESS = '{} is a guess: make it in its cell above, run that cell, then this one again.'


def load_ipython_extension(shell) -> None:
    """Let `!ros2` be found, and a name or a magic that is missing say what to run.

    When a helper is imported, a missing name is the student's own, but for the name of a guess.

    An Interrupt of a `!command` ends its cell.
    """
    commands, path = os.path.join(sys.prefix, 'bin'), os.environ.get('PATH', os.defpath)
    if commands not in path.split(os.pathsep):
        os.environ['PATH'] = f'{commands}{os.pathsep}{path}'

    def explain(shell, kind, error, traceback, tb_offset=None) -> None:
        shell.showtraceback((kind, error, traceback), tb_offset=tb_offset)
        name = getattr(error, 'name', None) or ''
        if name in CLASS:
            print(OF_A_CLASS.format(name))
        elif 'helpers.ros.session' not in sys.modules and 'helpers.workspace' not in sys.modules:
            print(NOT_RUN)
        elif name.startswith('my_'):
            print(NO_GUESS.format(name))
        elif traceback.tb_next and CHECK.match(_first_line(traceback.tb_next)):
            print(NO_ANSWER.format(name))

    shell.set_custom_exc((NameError, UsageError), explain)

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
    del shell.system


def _first_line(traceback) -> str:
    return linecache.getline(traceback.tb_frame.f_code.co_filename, 1)


def can_ask(kernel: object) -> bool:
    """Return whether input() gets an answer: in JupyterLab it does, in nbval it does not."""
    return getattr(kernel, '_allow_stdin', False)  # private: a kernel, ipykernel 7.4.0


def hear_while_a_cell_runs(widget: object) -> None:
    """Let the messages of a widget come although the cell still runs.

    ipykernel 7.4 leads them to the thread that spoke last: that of the cell, which is busy. Then
    they go to the subshell, a thread of its own, that JupyterLab addresses.
    """
    vars(widget.comm).pop('_reply_subshell_id', None)  # private: a comm, ipykernel 7.4.0
