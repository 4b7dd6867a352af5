"""How pytest runs the notebooks, with nbval: pyproject.toml loads this plugin for every test.

It is no conftest.py, because pytest would read one in tests/ only for what is in tests/.
"""

import os
import re
import signal
import tempfile
from itertools import count
from pathlib import Path

import pytest
from jupyter_client.manager import KernelManager

from helpers.checks.progress import FILE_VARIABLE
from helpers.lesson import chosen, chosen_tasks, outline
from tools.lessons.answers import answered
from tools.lessons.comparison import change_nbval

# No test reads or changes what the user of this checkout has solved. Kernels inherit it.
os.environ[FILE_VARIABLE] = ''

# What a shell starts in the background ignores Ctrl+C, below `nohup` also the end of a terminal.
# So would all processes that the tests start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        '--lesson', default='', help='only what tests these lessons, by number or name: "02 03"'
    )
    parser.addoption(
        '--task',
        default='',
        help='of one lesson: only the answers of these tasks, by number or name',
    )
    parser.addoption(
        '--seed', type=int, default=0, help='draws mutants among the answers; 0 draws none'
    )


def pytest_configure(config: pytest.Config) -> None:
    """Keep the sessions of other processes away, and let kernels talk over socket files.

    A terminal, which a lesson or a test opens, looks for sessions in all records of this user.

    jupyter_client chooses free TCP ports, closes them, and the kernel opens them again later. When
    several workers start kernels at once, two may choose the same port, and one kernel never
    answers. The folder is a short one, because the path of a socket file is limited to 107 bytes.
    A fixture would not do: pytest sets none up for the cells of a notebook.
    """
    folder = tempfile.TemporaryDirectory(prefix='kernels-')
    config.add_cleanup(folder.cleanup)
    sessions = tempfile.TemporaryDirectory(prefix='sessions-')
    config.add_cleanup(sessions.cleanup)
    os.environ['ROS2_SESSIONS'] = sessions.name
    number = count()

    def kernel_manager(**options: object) -> KernelManager:
        file = Path(folder.name, f'{next(number)}.json')
        return KernelManager(transport='ipc', connection_file=str(file), **options)

    config.add_cleanup(change_nbval(kernel_manager))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the tests of the chosen lessons: the cells of a notebook, and what has its name."""
    if not config.option.lesson:
        return
    try:
        paths = chosen(config.option.lesson)
        names = '|'.join(path.stem[3:] for path in paths)
        wanted = rf'[/\[](\d\d_)?({names})(\.ipynb)?(::|\]|-)'
        if config.option.task:
            found = chosen_tasks(config.option.task, outline(paths[0]))
            wanted = rf'\[{paths[0].stem[3:]}-({"|".join(task.name for task in found)})\]'
    except ValueError as error:
        raise pytest.UsageError(error) from None
    kept = [item for item in items if re.search(wanted, item.nodeid)]
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = kept


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which notebooks differ from the lesson because somebody has solved tasks in them."""
    failed = {report.nodeid.split('::')[0] for report in terminalreporter.getreports('failed')}
    files = [file for file in answered() if f'notebooks/{file}' in failed] if failed else []
    if files:
        terminalreporter.write_line(
            f'Answers of yours, or new tasks, are in {", ".join(files)}, so the lesson prints '
            'something else. After a new task, `make notebooks` saves it; after answers, another '
            'clone has the lessons as they are.'
        )
