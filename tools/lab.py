"""Open JupyterLab on this course: `make lab`.

python -m tools.lab --port 8890 --no-browser -- --LabApp.expose_app_in_browser=True
"""

import argparse
import json
import os
import socket
import sys
import tempfile
from pathlib import Path
from typing import NoReturn

from jupyter_core.paths import jupyter_config_dir, jupyter_data_dir, jupyter_runtime_dir

from helpers.machine import OWNED, sentence_about

ROOT = Path(__file__).resolve().parents[1]
PLAIN = 'jupyter_server.services.contents.largefilemanager.AsyncLargeFileManager'
NOTES = '/* The notes for the instructor. */'  # from here on, for students only
FIRST = 'lab/tree/notebooks/00_start_here.ipynb'
# How JupyterLab looks the first time: the page has the whole window, and the sidebar is closed.
WORKSPACE = {
    'layout-restorer:data': {
        'main': {'dock': None},
        'left': {'collapsed': True, 'visible': True},
        'right': {'collapsed': True, 'visible': True},
        'relativeSizes': [0, 1, 0],
    }
}


def parser(description: str) -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(description=description)
    options.add_argument('--root', type=Path, default=ROOT, help='the folder that JupyterLab shows')
    options.add_argument(
        '--port', help='this port or none; otherwise the first free one from 8888 on'
    )
    options.add_argument('--no-browser', dest='browser', action='store_false')
    options.add_argument(
        '--outputs', action='store_true', help='show lessons with the outputs of the repository'
    )
    options.add_argument('more', nargs='*', help="JupyterLab's own options, after --")
    return options


def open_lab(
    options: argparse.Namespace,
    address: str,
    more: tuple[str, ...] = (),
    name: str = 'user',
    settings: dict[str, dict] | None = None,
) -> NoReturn:
    """Become the server of JupyterLab, which opens `address`.

    Two servers may run side by side if each has a `name`, and settings of its own. `settings` are
    those of JupyterLab's plugins, by names such as 'notebook-extension/tracker'; `more` are options
    of JupyterLab.
    """
    _must_be_free(options.port)
    try:
        folder = _write_settings(name, settings or {}, notes=options.outputs)
        for state in (jupyter_config_dir(), jupyter_data_dir(), jupyter_runtime_dir()):
            _must_take_files(Path(state))
    except OSError as error:
        sys.exit(sentence_about(error))
    os.environ['JUPYTERLAB_SETTINGS_DIR'] = str(folder)
    # A terminal finds `ros2`, `colcon` and this Python.
    os.environ['PATH'] = f'{sys.prefix}/bin{os.pathsep}{os.environ["PATH"]}'
    command = [sys.executable, '-m', 'jupyterlab', f'--ServerApp.root_dir={options.root}']
    command += ['--LabApp.custom_css=True', f'--LabApp.default_url=/{address}', *more]
    # The address is all that a student must see.
    command += ['--ServerApp.log_level=WARN', '--LabApp.log_level=WARN']
    if options.port:
        command += [f'--port={options.port}', '--ServerApp.port_retries=0']
    if options.outputs:
        command.append(f'--ServerApp.contents_manager_class={PLAIN}')
    if not options.browser:
        command.append('--no-browser')
    if os.getuid() == 0:
        print(
            'You are root: each cell that runs may change all of this machine. Start JupyterLab as '
            'another user if you can.',
            file=sys.stderr,
        )
        command.append('--allow-root')
    print('Ctrl+C, twice, ends JupyterLab.', file=sys.stderr)
    os.execv(sys.executable, [*command, *options.more])


def not_brought_over(root: Path) -> str:
    """Return a sentence if files of version 0.3, whose update left them, wait for another one."""
    left = sorted(path.parent for path in root.glob(f'scratch/lesson_[0-9][0-9]/{OWNED}'))
    if not left:
        return ''
    names = ', '.join(path.relative_to(root).as_posix() for path in left)
    return f'Type `make update` once more, as before: it brings over what is in {names}.'


def _must_be_free(port: str | None) -> None:
    try:
        socket.create_server(('localhost', int(port or 0))).close()
    except (ValueError, OverflowError):
        sys.exit(f'{port} is no port: give a number, such as PORT=8899.')
    except PermissionError:
        sys.exit(f'Only root may open port {port}: give another one, such as PORT=8899.')
    except OSError:
        sys.exit(f'Port {port} is in use: give another one, such as PORT=8899.')


def _write_settings(name: str, settings: dict[str, dict], notes: bool) -> Path:
    """Write how JupyterLab looks, with or without the `notes`; return the folder of `settings`."""
    config = Path(jupyter_config_dir())
    folder = config / 'lab' / f'{name}-settings'
    for plugin, values in settings.items():
        file = folder / '@jupyterlab' / f'{plugin}.jupyterlab-settings'
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(values))
    workspaces = config / 'lab' / 'workspaces'
    if not any(workspaces.glob('default-*')):  # else somebody has arranged it
        from jupyterlab_server.workspaces_handler import WorkspacesManager  # slow, and once

        workspace = {'data': WORKSPACE, 'metadata': {'id': 'default'}}
        WorkspacesManager(str(workspaces)).save('default', json.dumps(workspace))
    custom = config / 'custom' / 'custom.css'
    custom.parent.mkdir(parents=True, exist_ok=True)
    css = Path(__file__).with_name('lab.css').read_text()
    custom.write_text(css.partition(NOTES)[0] if notes else css)
    return folder


def _must_take_files(folder: Path) -> None:
    """Raise OSError if JupyterLab, which would show a traceback, could not write its state."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder) as file:
        file.write(bytes(1_000_000))


if __name__ == '__main__':
    if left := not_brought_over(ROOT):
        print(left, file=sys.stderr)
    open_lab(parser('Open JupyterLab on this course.').parse_args(), FIRST)
