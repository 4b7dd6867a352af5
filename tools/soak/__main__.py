"""Run the notebooks again and again in hard conditions, and print one table.

    python -m tools.soak                                each notebook once in each condition
    python -m tools.soak --rounds 10 --conditions idle,busy --lesson "02 03"

What each cell did is a line of JSON in .soak/runs.jsonl. Several sittings add up there: the table
is of all runs in the file. Remove it to begin anew. Ctrl+C ends a sitting.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd

from tools.lessons.lesson import chosen
from tools.soak.conditions import CACHE, CONDITIONS, ROOT, Condition

RUNS = CACHE / 'runs.jsonl'
RUN_TIMEOUT_S = 1800.0
SLOW_S = 90.0  # nbval gives a cell 100
# What would be in the home otherwise.
STATE = ('JUPYTER_CONFIG_DIR', 'JUPYTER_DATA_DIR', 'JUPYTER_RUNTIME_DIR', 'IPYTHONDIR')
STATE += ('ROS_LOG_DIR', 'MPLCONFIGDIR')
LONGEST_TEXT = 1600
EVENTS = ['interrupted_after_s', 'killed_after_s', 'in_import', 'in_tracker', 'kernel_lost']
# $0 is the folder of the run, $1 the interpreter, the rest is the command.
INSIDE = """
set -e
MOUNTS
python=$1
shift
status=0
"$@" > "$0/printed" 2>&1 || status=$?
"$python" -m tools.soak.leftovers > "$0/left"
exit $status
"""


def run(notebooks: list[Path], condition: Condition, python: str = sys.executable) -> list[dict]:
    """Run some notebooks once, at the same time, and return a row for what each cell did.

    `failed` of a row is None or a text. What is of the run as a whole has the notebook `all` where
    there are several.
    """
    began = time.strftime('%F %T')
    with tempfile.TemporaryDirectory(prefix='soak-', ignore_cleanup_errors=True) as temporary:
        folder = Path(temporary)
        for part in ('home', 'tmp', 'state'):
            (folder / part).mkdir()
        variables = os.environ | {'HOME': f'{folder}/home', 'TMPDIR': f'{folder}/tmp'}
        variables |= dict.fromkeys(STATE, f'{folder}/state') | condition.variables
        variables |= {'SOAK_SLOW_S': str(SLOW_S), 'SOAK_STACKS': f'{folder}/stacks'}
        before = files_of(folder)
        loop = [sys.executable, '-ISc', 'while True: pass']
        loops = [subprocess.Popen(loop) for _ in range(condition.busy_loops)]
        try:
            status = subprocess.run(
                _command(notebooks, condition, folder, python),
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
        rows = [json.loads(line) for line in _lines(folder / 'report.jsonl')]
        held = {file for row in rows for file in row.get('held', ())}
        left = [
            sentence
            for sentence in _lines(folder / 'left')
            if not any(file in sentence for file in held)
        ]
        left += sorted(f'{file} has changed.' for file in files_of(folder) - before)
        failures = [('after the run', ' '.join(left))] if left else []
        if status and not any(row['failed'] for row in rows):
            printed = '\n'.join(_lines(folder / 'printed'))
            failures.append(('no cell', f'pytest ended with {status}: {printed}'))
        stacks = '\n'.join(_lines(folder / 'stacks'))
        if stacks and (failures or any(row['failed'] for row in rows)):
            failures.append((f'where cells stood after {SLOW_S:g} s', stacks))
    name = notebooks[0].stem if len(notebooks) == 1 else 'all'
    rows += [{'notebook': name, 'item': item, 'failed': text} for item, text in failures]
    return [row | {'condition': condition.name, 'began': began} for row in rows]


def _command(notebooks: list[Path], condition: Condition, folder: Path, python: str) -> list:
    return [
        *('unshare', '--mount', '--pid', '--fork', '--kill-child', '--mount-proc'),
        *('sh', '-c', INSIDE.replace('MOUNTS', condition.mounts), folder, python),
        *(*condition.before, python, '-m', 'pytest', *notebooks, '-c', ROOT / 'pyproject.toml'),
        *('--rootdir', ROOT, '-p', 'no:cacheprovider', '--color=no'),
        *('-o', 'faulthandler_timeout=0', '-p', 'tools.soak.plugin'),
        *('--soak-mode', condition.mode, '--soak-report', folder / 'report.jsonl'),
        *('-n', str(condition.at_once) if len(notebooks) > 1 else '0', '--dist', 'loadscope'),
    ]


def _lines(file: Path) -> list[str]:
    return file.read_text(encoding='utf-8').splitlines() if file.exists() else []


def files_of(folder: Path) -> set[str]:
    """Return the files in a run's own home and temporary folder, and what git sees as changed."""
    git = ['git', '-C', ROOT, 'status', '--porcelain', '--untracked-files=all']
    changed = subprocess.run(git, stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()
    own = [file for part in ('home', 'tmp') for file in (folder / part).rglob('*')]
    return {*changed, *(str(file) for file in own if not file.is_dir())}


def table(rows: list[dict]) -> str:
    """Return how many runs failed, the slowest cells, what was done, and what failed first."""
    cells = pd.DataFrame(rows)
    cells['lesson'] = cells['notebook'].str[:3].str.strip('_')
    runs = cells.groupby(['condition', 'lesson', 'began'], sort=False)['failed'].count() > 0
    of_pair = runs.groupby(['condition', 'lesson'])
    counts = of_pair.sum().astype(str) + '/' + of_pair.size().astype(str)
    slowest = cells.nlargest(5, 'seconds')[['notebook', 'item', 'condition', 'seconds']]
    events = cells.reindex(columns=EVENTS).count()
    texts = [
        f'Failed runs of all runs\n{counts.unstack(fill_value="").to_string()}',
        f'Slowest\n{slowest.to_string(index=False)}',
        f'Cells\n{events.to_string()}',
    ]
    first = cells.dropna(subset='failed').drop_duplicates(['notebook', 'condition'])
    texts += [
        f'{row.condition}, {row.notebook}, {row.item}: {row.failed[-LONGEST_TEXT:]}'
        for row in first.itertuples()
    ]
    return '\n\n'.join(texts)


def soak(notebooks: list[Path], conditions: list[Condition], rounds: int) -> None:
    """Run every notebook in every condition some times, and keep what it did in the file RUNS."""
    RUNS.parent.mkdir(exist_ok=True)
    for _ in range(rounds):
        for condition in conditions:
            try:
                python = condition.python()
            except ValueError as error:
                print(f'{condition.name}: skipped. {error}', flush=True)
                continue
            possible = [path for path in notebooks if condition.process_pools or not _pools(path)]
            for group in [possible] if condition.at_once > 1 else [[path] for path in possible]:
                started = time.monotonic()
                rows = run(group, condition, python)
                with RUNS.open('a', encoding='utf-8') as file:
                    file.writelines(f'{json.dumps(row)}\n' for row in rows)
                failed = [row['item'] for row in rows if row['failed']]
                names = ' '.join(path.stem[:2] for path in group)
                ended = f'failed: {failed[0]}' if failed else 'passed'
                seconds = time.monotonic() - started
                print(f'{condition.name:<13} {names} {seconds:6.0f} s  {ended}', flush=True)


def _pools(notebook: Path) -> bool:
    return 'ProcessPoolExecutor' in notebook.read_text('utf-8')


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return 1 where a run failed, otherwise 0."""
    names = [condition.name for condition in CONDITIONS]
    parser = argparse.ArgumentParser(
        prog='make soak', description='Run the notebooks in hard conditions.'
    )
    parser.add_argument('--rounds', type=int, default=1, metavar='N', help='of each condition')
    parser.add_argument('--conditions', default='', metavar='A,B', help=', '.join(names))
    parser.add_argument('--lesson', default='', metavar='NN', help='for example 02 or "02 03"')
    options = parser.parse_args(arguments)
    wanted = options.conditions.replace(',', ' ').split() or names
    if unknown := set(wanted) - set(names):
        parser.error(f'There is no condition {min(unknown)!r}: take of {", ".join(names)}.')
    try:
        paths = chosen(options.lesson)
    except ValueError as error:
        parser.error(str(error))
    if os.getuid():
        parser.error('Each run has a /dev/shm of its own, which only root can mount: use sudo.')
    notebooks = [path for path in paths if '"cell_type": "code"' in path.read_text('utf-8')]
    try:
        soak(notebooks, [one for one in CONDITIONS if one.name in wanted], options.rounds)
    except KeyboardInterrupt:
        print('Interrupted: the run that was going on does not count.')
    rows = [json.loads(line) for line in _lines(RUNS)]
    print(f'\n{table(rows)}' if rows else 'No run was done.')
    return int(any(row['failed'] for row in rows))


if __name__ == '__main__':
    sys.exit(main())
