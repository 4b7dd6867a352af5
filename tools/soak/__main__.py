"""Run the notebooks in hard conditions, once in each: `make soak`, before a release.

    python -m tools.soak
    python -m tools.soak --conditions interrupt kill --lesson "02 03"

It prints a line for each run, and what failed in it. Ctrl+C ends it.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from xml.etree import ElementTree

from tools.lessons.lesson import ROOT, chosen

CONDITIONS = ('idle', 'busy', 'twice', 'interrupt', 'kill')  # plugin.py says what they do
BUSY_LOOPS = 4  # beside a run that is `busy`
COLOURS = re.compile(r'#x1B\[[0-9;]*m')  # of IPython's tracebacks, as pytest's report has them
RUN_TIMEOUT_S = 1800.0
# What would be in the home otherwise.
STATE = ('JUPYTER_CONFIG_DIR', 'JUPYTER_DATA_DIR', 'JUPYTER_RUNTIME_DIR', 'IPYTHONDIR')
STATE += ('ROS_LOG_DIR', 'MPLCONFIGDIR')
LONGEST_TEXT = 1600
# $0 is the folder of the run, $1 the interpreter, the rest is the command.
INSIDE = """
set -e
mount -t tmpfs tmpfs /dev/shm
python=$1
shift
status=0
"$@" > "$0/printed" 2>&1 || status=$?
"$python" -m tools.soak.leftovers > "$0/left"
exit $status
"""


def run(notebook: Path, condition: str) -> dict[str, str]:
    """Run a notebook once; return by the name of a cell, or of what was looked at, how it failed.

    The run has a /dev/shm, a table of processes, a record of kernels (which has process ids), a
    home and a temporary folder of its own.
    """
    with tempfile.TemporaryDirectory(prefix='soak-', ignore_cleanup_errors=True) as temporary:
        folder = Path(temporary)
        for part in ('home', 'tmp', 'state'):
            (folder / part).mkdir()
        variables = os.environ | {'HOME': f'{folder}/home', 'TMPDIR': f'{folder}/tmp'}
        variables |= dict.fromkeys(STATE, f'{folder}/state')
        before = _files_of(folder)
        loop = [sys.executable, '-ISc', 'while True: pass']
        loops = [subprocess.Popen(loop) for _ in range(BUSY_LOOPS if condition == 'busy' else 0)]
        try:
            status = subprocess.run(
                _command(notebook, condition, folder),
                cwd=ROOT,
                env=variables,
                stdin=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl+C is for this tool
                timeout=RUN_TIMEOUT_S,
            ).returncode
        except subprocess.TimeoutExpired:
            status = f'no status in {RUN_TIMEOUT_S:g} s'
        finally:
            for each in loops:
                each.kill()
                each.wait()
        failed, held = _reported(folder / 'report.xml')
        left = [line for line in _lines(folder / 'left') if not any(file in line for file in held)]
        left += sorted(f'{file} has changed.' for file in _files_of(folder) - before)
        if status and not failed:
            failed['no cell'] = '\n'.join(
                [f'pytest ended with {status}:', *_lines(folder / 'printed')]
            )
        if left:
            failed['after the run'] = ' '.join(left)
    return failed


def _command(notebook: Path, condition: str, folder: Path) -> list:
    return [
        *('unshare', '--mount', '--pid', '--fork', '--kill-child', '--mount-proc'),
        *('sh', '-c', INSIDE, folder, sys.executable),
        *(sys.executable, '-m', 'pytest', notebook, '-c', ROOT / 'pyproject.toml'),
        *('--rootdir', ROOT, '-p', 'no:cacheprovider', '--color=no', '-n', '0'),
        *('-o', 'faulthandler_timeout=0', '--junit-xml', folder / 'report.xml'),
        *('-p', 'tools.soak.plugin', '--soak', condition),
    ]


def _reported(file: Path) -> tuple[dict[str, str], list[str]]:
    """Return how cells failed, by name, and the shared memory that a killed kernel held."""
    if not file.exists():
        return {}, []
    report = ElementTree.parse(file)
    failed = {
        # nbval's `Cell 0` is called as the tests call it: `code cell 1`.
        re.sub(r'Cell (\d+)', lambda cell: f'code cell {int(cell[1]) + 1}', case.get('name')): (
            COLOURS.sub('', problem.text)
        )
        for case in report.iter('testcase')
        for problem in [*case.iter('failure'), *case.iter('error')]
    }
    return failed, [one.get('value') for one in report.iter('property')]


def _lines(file: Path) -> list[str]:
    return file.read_text(encoding='utf-8').splitlines() if file.exists() else []


def _files_of(folder: Path) -> set[str]:
    """Return the files in a run's own home and temporary folder, and what git sees as changed."""
    git = ['git', '-C', ROOT, 'status', '--porcelain', '--untracked-files=all']
    changed = subprocess.run(git, stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()
    own = [file for part in ('home', 'tmp') for file in (folder / part).rglob('*')]
    return {*changed, *(str(file) for file in own if not file.is_dir())}


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return 1 if a run failed, otherwise 0."""
    parser = argparse.ArgumentParser(
        prog='make soak', description='Run the notebooks in hard conditions.'
    )
    parser.add_argument('--conditions', nargs='+', choices=CONDITIONS, default=CONDITIONS)
    parser.add_argument('--lesson', default='', metavar='NN', help='for example 02 or "02 03"')
    options = parser.parse_args(arguments)
    try:
        paths = chosen(options.lesson)
    except ValueError as error:
        parser.error(str(error))
    if os.getuid():
        parser.error('Each run has a /dev/shm of its own, which only root can mount: use sudo.')
    failures = 0
    for condition in options.conditions:
        for path in paths:
            if '"cell_type": "code"' not in path.read_text('utf-8'):
                continue
            start = time.monotonic()
            failed = run(path, condition)
            said = f'failed: {", ".join(failed)}' if failed else 'passed'
            print(f'{condition:<9} {path.stem} {time.monotonic() - start:4.0f} s  {said}')
            for item, text in failed.items():
                print(f'\n{item}: {text[-LONGEST_TEXT:]}\n')
            sys.stdout.flush()
            failures += len(failed)
    return int(failures > 0)


if __name__ == '__main__':
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit('Interrupted: the run that was going on does not count.')
