"""Run the notebooks again and again in hard conditions, and print one table.

    python -m tools.soak                                each notebook once in each condition
    python -m tools.soak --rounds 10 --conditions idle,busy --lesson 02
    python -m tools.soak --minutes 8                    begin no run after 8 minutes
    python -m tools.soak --seed 1234 ...                the random times of an earlier run
    python -m tools.soak --report                       the table only

Every run is a line of JSON in .soak/runs.jsonl. It counts until its notebook, or what all notebooks
use, has changed. What counts is not done again, so that several sittings add up to the rounds that
are asked for. Ctrl+C ends a sitting.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pandas as pd
import psutil

from tools.lessons.lesson import chosen
from tools.soak.conditions import CACHE, CONDITIONS, ROOT, CannotRunError, Condition, sandbox
from tools.soak.leftovers import adopt_orphans, files_of

RUNS = CACHE / 'runs.jsonl'
# What a notebook uses: with the notebook, all that can change how a run of it ends.
USED = ('helpers', 'conftest.py', 'pyproject.toml', 'requirements.lock', 'tests/nbval_sanitize.cfg')
RUN_TIMEOUT_S = 1800.0
LONGEST_TEXT = 1600
EVENTS = {
    'interrupted_after_s': 'interrupted',
    'import_interrupted': 'in an import',
    'no_reply': 'without a reply',
    'kernel_lost': 'with a lost kernel',
}


# --- One run -------------------------------------------------------------------------------------


def run(notebooks: list[Path], condition: Condition, seed: int) -> list[dict]:
    """Run some notebooks once, at the same time, and return a record for each.

    `failed` is None or [cell, text] of what failed first, `cells` the seconds of each cell. Raises
    CannotRunError where this machine cannot offer the condition.
    """
    with tempfile.TemporaryDirectory(prefix='soak-', ignore_cleanup_errors=True) as name:
        folder = Path(name)
        own = [folder / 'home', folder / 'tmp']
        for empty in (*own, folder / 'jupyter'):
            empty.mkdir()
        python = [condition.python(), '-m']
        before = sandbox(condition.mounts, folder)
        report = folder / 'report.jsonl'
        command = [
            *(*before, *python, 'pytest', *notebooks, '-c', ROOT / 'pyproject.toml'),
            *('--rootdir', ROOT, '-p', 'no:cacheprovider', '--color=no', '-p', 'tools.soak.plugin'),
            *('--soak-mode', condition.mode, '--soak-seed', str(seed), '--soak-report', report),
        ]
        if len(notebooks) > 1:
            command += ['-n', str(condition.at_once), '--dist', 'loadscope']
        if condition.sentence:  # the kernel may die, which nbval notices at its time-out only
            command += ['--exitfirst', '--nbval-cell-timeout=20']
        if condition.mode == 'kill':  # one of its items runs many cells
            command += ['-o', f'faulthandler_timeout={RUN_TIMEOUT_S:g}']
        variables = _variables(folder) | condition.variables(random.Random(seed))
        files_before = files_of(ROOT, *own)
        with condition.beside():
            status, printed = _call(command, variables, condition.cores)
        new = sorted({file for file, _ in files_of(ROOT, *own) - files_before})
        rows = []
        if report.exists():
            rows = [json.loads(line) for line in report.read_text(encoding='utf-8').splitlines()]
        if new:
            text = f'These files are new or have changed: {", ".join(new)}.'
            rows.append({'notebook': None, 'item': 'after the run', 'failed': text})
        if status and not any(row['failed'] for row in rows):
            text = f'pytest ended with {status}: {printed}'
            rows.append({'notebook': None, 'item': 'no cell', 'failed': text})
        if condition.sentence and any(row['failed'] for row in rows):
            said = _call([*before, *python, 'helpers.doctor'], variables)[1]
            if condition.sentence in said:
                rows = [row | {'failed': None} for row in rows]
    # What belongs to no notebook belongs to each that ran.
    return [
        _record([row for row in rows if row['notebook'] in (notebook.stem, None)])
        | {'notebook': notebook.stem, 'condition': condition.name, 'seed': seed}
        for notebook in notebooks
    ]


def _record(rows: list[dict]) -> dict:
    failed = [[row['item'], row['failed']] for row in rows if row['failed']]
    cells = {
        row['item']: round(row['seconds'], 3) for row in rows if row['item'].startswith('code cell')
    }
    events = {name: sum(key in row for row in rows) for key, name in EVENTS.items()}
    return {'failed': failed[0] if failed else None, 'cells': cells, 'events': events} | (
        {'report': rows} if failed else {}
    )


def _variables(folder: Path) -> dict[str, str]:
    """Return all variables of a run: a home, a temporary folder and a Jupyter of its own."""
    return {
        'PATH': os.environ['PATH'],
        'LANG': 'C.UTF-8',
        'HOME': str(folder / 'home'),
        'TMPDIR': str(folder / 'tmp'),
        'JUPYTER_CONFIG_DIR': str(folder / 'jupyter'),
        'JUPYTER_DATA_DIR': str(folder / 'jupyter/data'),
        'JUPYTER_RUNTIME_DIR': str(folder / 'jupyter/runtime'),
        'IPYTHONDIR': str(folder / 'jupyter/ipython'),
        'ROS_LOG_DIR': str(folder / 'jupyter/ros_log'),
        # Matplotlib's list of fonts, which takes seconds to make.
        'MPLCONFIGDIR': str(CACHE / 'matplotlib'),
    }


def _call(command: list, variables: dict[str, str], cores: int | None = None) -> tuple[int, str]:
    """Run a command and return its exit code and what it printed. Nothing of it stays behind."""
    adopt_orphans()
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        env=variables,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors='replace',
        start_new_session=True,  # Ctrl+C is for this tool
        preexec_fn=lambda: os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:cores]),
    )
    try:
        printed, _ = process.communicate(timeout=RUN_TIMEOUT_S)
        return process.returncode, printed
    except subprocess.TimeoutExpired:
        return -1, f'it took longer than {RUN_TIMEOUT_S:g} s'
    finally:
        for each in psutil.Process().children(recursive=True):
            with suppress(psutil.NoSuchProcess):
                each.kill()
        process.wait()


# --- Many runs -----------------------------------------------------------------------------------


def version(notebook: Path) -> str:
    """Return a hash of the notebook and of all that a notebook uses, as they are now."""
    used = [path for part in USED for path in (ROOT / part, *(ROOT / part).rglob('*.py'))]
    files = sorted(path for path in [notebook, *used] if path.is_file())
    return hashlib.sha256(b'\0'.join(path.read_bytes() for path in files)).hexdigest()[:12]


def recorded(notebooks: list[Path]) -> list[dict]:
    """Return the records of all runs of these notebooks that still count, oldest first."""
    versions = {notebook.stem: version(notebook) for notebook in notebooks}
    lines = RUNS.read_text(encoding='utf-8').splitlines() if RUNS.exists() else []
    records = [json.loads(line) for line in lines]
    return [r for r in records if r['version'] == versions.get(r['notebook'])]


def soak(
    notebooks: list[Path], conditions: list[Condition], rounds: int, minutes: float, seed: int
) -> None:
    """Run every notebook in every condition until `rounds` runs of it are recorded."""
    deadline = time.monotonic() + 60 * minutes
    done = Counter((r['notebook'], r['condition']) for r in recorded(notebooks))
    refused = set()
    for number in range(rounds):
        for condition in conditions:
            wanted = [path for path in notebooks if done[path.stem, condition.name] <= number]
            for group in [wanted] if condition.at_once > 1 else [[path] for path in wanted]:
                if not group or time.monotonic() > deadline or condition.name in refused:
                    break
                try:
                    _run_and_record(group, condition, seed + number)
                except CannotRunError as error:
                    refused.add(condition.name)
                    print(f'{condition.name}: skipped. {error}', flush=True)


def _run_and_record(group: list[Path], condition: Condition, seed: int) -> None:
    versions = {path.stem: version(path) for path in group}
    started = time.monotonic()
    records = run(group, condition, seed)
    RUNS.parent.mkdir(exist_ok=True)
    with RUNS.open('a', encoding='utf-8') as file:
        for record in records:
            record['version'] = versions[record['notebook']]
            print(json.dumps(record), file=file)
            ended = f'failed: {record["failed"][0]}' if record['failed'] else 'passed'
            print(
                f'{condition.name:<16} {record["notebook"]:<40} '
                f'{time.monotonic() - started:6.0f} s  seed {seed}  {ended}',
                flush=True,
            )


# --- The table -----------------------------------------------------------------------------------


def table(records: list[dict]) -> str:
    """Return one row for each notebook, one for each condition, and what failed first."""
    runs = pd.DataFrame(records)
    runs['slowest_s'] = [max(cells.values(), default=0) for cells in runs['cells']]
    runs['slowest'] = [max(cells, key=cells.get, default='none') for cells in runs['cells']]
    runs['first failure'] = [
        f'{r["condition"]}, {r["failed"][0]}, seed {r["seed"]}' if r['failed'] else None
        for r in records
    ]
    lesson = runs.groupby('notebook')
    slowest = runs.loc[lesson['slowest_s'].idxmax()].set_index('notebook')
    rows = pd.DataFrame(
        {
            'runs': lesson.size(),
            'failures': lesson['failed'].count(),
            'slowest cell': slowest['slowest_s'].map('{:.1f} s, '.format) + slowest['slowest'],
            'first failure': lesson['first failure'].first().fillna(''),
        }
    )
    of_condition = runs.groupby('condition')['failed'].agg(runs='size', failures='count')
    events = sum((Counter(record['events']) for record in records), Counter())
    texts = [rows.to_string(), of_condition.to_string()]
    if events:
        texts.append(f'Cells: {", ".join(f"{count} {what}" for what, count in events.items())}.')
    first = {r['notebook']: r for r in reversed(records) if r['failed']}
    texts += [f'{name}: {_short(first[name]["failed"][1])}' for name in sorted(first)]
    return '\n\n'.join(texts)


def _short(text: str) -> str:
    """Return the beginning and the end of a long text: all of it is in the file of runs."""
    half = LONGEST_TEXT // 2
    return text if len(text) <= LONGEST_TEXT else f'{text[:half]}\n...\n{text[-half:]}'


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return 1 where a run failed, otherwise 0."""
    names = [condition.name for condition in CONDITIONS]
    parser = argparse.ArgumentParser(
        prog='make soak', description='Run the notebooks in hard conditions.'
    )
    parser.add_argument('--rounds', type=int, default=1, metavar='N', help='of each condition')
    parser.add_argument('--conditions', default='', metavar='A,B', help=', '.join(names))
    parser.add_argument('--lesson', default='', metavar='NN', help='for example 02 or "02 03"')
    parser.add_argument('--minutes', type=float, default=math.inf, help='begin no run after these')
    parser.add_argument('--seed', type=int, help='of the random times; printed with each run')
    parser.add_argument('--report', action='store_true', help='the table only')
    options = parser.parse_args(arguments)
    wanted = options.conditions.replace(',', ' ').split() or names
    if unknown := set(wanted) - set(names):
        parser.error(f'There is no condition {min(unknown)!r}: take of {", ".join(names)}.')
    try:
        paths = chosen(options.lesson.replace(',', ' '))
    except ValueError as error:
        parser.error(str(error))
    notebooks = [path for path in paths if '"cell_type": "code"' in path.read_text('utf-8')]
    if not options.report:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        seed = options.seed if options.seed is not None else random.randrange(10**6)
        conditions = [condition for condition in CONDITIONS if condition.name in wanted]
        try:
            soak(notebooks, conditions, options.rounds, options.minutes, seed)
        except KeyboardInterrupt:
            print('Interrupted: the run that was going on does not count.')
    records = [r for r in recorded(notebooks) if r['condition'] in wanted]
    print(f'\n{table(records)}' if records else 'No run was done.')
    return int(any(record['failed'] for record in records))


if __name__ == '__main__':
    sys.exit(main())
