"""Run the notebooks again and again in hard conditions, and print one table.

    python -m tools.soak                                each notebook once in each condition
    python -m tools.soak --rounds 10 --conditions idle,busy --lesson 02
    python -m tools.soak --minutes 8                    begin no run after 8 minutes
    python -m tools.soak --seed 1234 ...                the random times of an earlier run
    python -m tools.soak --report                       all runs so far

A run counts until its notebook, or what all notebooks use, has changed. What has run least often
comes first, so that several sittings add up. Ctrl+C ends it with the table of what was done. Every
run is a line of JSON in .soak/runs.jsonl.
"""

from __future__ import annotations

import argparse
import contextlib
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
import uuid
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import cycle, islice
from pathlib import Path

import psutil

from tools.notebooks import FOLDER, lessons
from tools.soak.conditions import CACHE, CONDITIONS, ROOT, CannotRunError, Condition
from tools.soak.leftovers import MARK, Watch, processes_of

RUNS = CACHE / 'runs.jsonl'
# What a notebook uses: with the notebook, all that can change how a run of it ends.
USED = ('helpers', 'conftest.py', 'pyproject.toml', 'requirements.lock', 'tests/nbval_sanitize.cfg')
RUN_TIMEOUT_S = 1800.0
DOCTOR_TIMEOUT_S = 60.0
LONGEST_TEXT = 1600


# --- One run -------------------------------------------------------------------------------------


def run(notebook: Path, condition: Condition, seed: int) -> dict:
    """Run a notebook once in a condition and return the record of it.

    `failed` is None or [cell, text] of what failed first, `seconds` the run's, `cells` those of
    each cell. Raises CannotRunError where this machine cannot offer the condition.
    """
    mark = uuid.uuid4().hex
    with tempfile.TemporaryDirectory(prefix='soak-', ignore_cleanup_errors=True) as name:
        folder = Path(name)
        own = [folder / 'home', folder / 'tmp']
        for empty in (*own, folder / 'jupyter'):
            empty.mkdir()
        python, before = condition.python(), condition.before(folder)
        report = folder / 'report.jsonl'
        command = [
            *(*before, python, '-m', 'pytest', notebook, '-c', ROOT / 'pyproject.toml'),
            *('--rootdir', ROOT, '-p', 'no:cacheprovider', '--color=no', '-p', 'tools.soak.plugin'),
            *('--soak-mode', condition.mode, '--soak-seed', str(seed), '--soak-report', report),
        ]
        if condition.sentence:  # the kernel may die, which nbval notices at its time-out only
            command += ['--exitfirst', '--nbval-cell-timeout=20']
        if condition.mode == 'kill':  # one of its items runs many cells
            command += ['-o', f'faulthandler_timeout={RUN_TIMEOUT_S:g}']
        environment = _environment(folder) | {MARK: mark}
        environment |= condition.environment(random.Random(seed))
        started = time.monotonic()
        with Watch(mark, own, [ROOT]) as watch:
            status, printed = _call(command, environment, RUN_TIMEOUT_S)
        seconds = time.monotonic() - started
        rows = []
        if report.exists():
            rows = [json.loads(line) for line in report.read_text(encoding='utf-8').splitlines()]
        domain_ids = next((row['domain_ids'] for row in rows if 'domain_ids' in row), {})
        killed_held = {name for row in rows for name in row.get('killed_held', ())}
        left = watch.left(domain_ids, killed_held)
        failures = [[row['item'], row['failed']] for row in rows if row['failed']]
        if status and not failures:
            failures = [['no cell', f'pytest ended with {status}: {printed}']]
        if left:
            failures.append(['after the run', ' '.join(left)])
        if failures and condition.sentence:
            doctor = [*before, python, '-m', 'helpers.doctor']
            if condition.sentence in _call(doctor, environment, DOCTOR_TIMEOUT_S)[1]:
                failures = []
    return {
        'notebook': notebook.stem,
        'condition': condition.name,
        'seed': seed,
        'seconds': round(seconds, 1),
        'cells': {
            row['item']: round(row['seconds'], 3)
            for row in rows
            if row['item'].startswith('code cell')
        },
        'interrupts': {
            'interrupted': sum('interrupted_after_s' in row for row in rows),
            'in an import': sum('import_interrupted' in row for row in rows),
            'without a reply': sum('no_reply' in row for row in rows),
            'with a lost kernel': sum('kernel_lost' in row for row in rows),
        },
        'failed': failures[0] if failures else None,
        'report': rows if failures else [],
    }


def _environment(folder: Path) -> dict[str, str]:
    """Return the variables of a run: a home, a temporary folder and a Jupyter of its own."""
    inherited = dict(os.environ)
    # The wheels set these when this Python started. Another Python must set its own.
    inherited.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None)
    libraries = inherited.pop('LD_LIBRARY_PATH', '').split(os.pathsep)
    libraries = [path for path in libraries if path and not path.startswith(sys.prefix)]
    if libraries:
        inherited['LD_LIBRARY_PATH'] = os.pathsep.join(libraries)
    return inherited | {
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


def _call(command: list, environment: dict[str, str], timeout_s: float) -> tuple[int, str]:
    """Run a command and return its exit code and what it printed. Nothing of it stays behind."""
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors='replace',
        start_new_session=True,  # Ctrl+C is for this tool
    )
    mark = environment[MARK]
    _running.add(mark)
    try:
        printed, _ = process.communicate(timeout=timeout_s)
        return process.returncode, printed
    except subprocess.TimeoutExpired:
        return -1, f'it took longer than {timeout_s:g} s'
    finally:
        _running.discard(mark)
        if process.poll() is None:
            _kill(mark)
            process.wait()


_running: set[str] = set()  # the marks of the runs that go on


def _kill(mark: str) -> None:
    for process in processes_of(mark):
        with contextlib.suppress(psutil.Error):
            process.kill()


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
    return [r for r in records if r.get('version') == versions.get(r['notebook'], '')]


def soak(
    notebooks: list[Path], conditions: list[Condition], rounds: int, minutes: float, seed: int
) -> list[dict]:
    """Run and record every notebook `rounds` times in every condition; return the records."""
    versions = {notebook.stem: version(notebook) for notebook in notebooks}
    deadline = time.monotonic() + 60 * minutes
    counts = Counter((r['notebook'], r['condition']) for r in recorded(notebooks))
    jobs: list[tuple[int, int, Condition, list[Path]]] = []
    for number in range(rounds):
        for condition in conditions:
            # As many at once as the condition asks for, also where fewer notebooks are wanted.
            several = list(islice(cycle(notebooks), max(len(notebooks), condition.at_once)))
            groups = [several] if condition.at_once > 1 else [[notebook] for notebook in several]
            for group in groups:
                done = min(counts[notebook.stem, condition.name] for notebook in group)
                jobs.append((done + number, number, condition, group))
    records, refused = [], {}
    RUNS.parent.mkdir(exist_ok=True)
    with RUNS.open('a', encoding='utf-8') as file:
        for _, number, condition, group in sorted(jobs, key=lambda job: job[0]):
            if time.monotonic() > deadline:
                break
            if condition.name in refused:
                continue
            try:
                for record in _together(group, condition, seed + 100 * number):
                    added = {'version': versions[record['notebook']], 'time': time.time()}
                    records.append(record | added)
                    print(json.dumps(records[-1]), file=file, flush=True)
                    print(_line(record), flush=True)
            except CannotRunError as error:
                refused[condition.name] = str(error)
                print(f'{condition.name}: skipped. {error}', flush=True)
            except KeyboardInterrupt:
                print('Interrupted: the runs that were going on do not count.')
                break
    return records


def _together(group: list[Path], condition: Condition, seed: int) -> Iterator[dict]:
    """Run notebooks at the same time and yield their records, each as it ends."""
    with condition.beside(), ThreadPoolExecutor(condition.at_once) as pool:
        going_on = [
            pool.submit(run, notebook, condition, seed + number)
            for number, notebook in enumerate(group)
        ]
        try:
            for done in as_completed(going_on):
                yield done.result()
        finally:  # interrupted
            pool.shutdown(wait=False, cancel_futures=True)
            for mark in list(_running):
                _kill(mark)


# --- The table -----------------------------------------------------------------------------------


def table(records: list[dict]) -> str:
    """Return one row for each notebook, and below it one line for each condition."""
    rows = [('notebook', 'runs', 'failures', 'slowest cell', 'first failure')]
    texts = []
    for notebook in sorted({record['notebook'] for record in records}):
        of_notebook = [record for record in records if record['notebook'] == notebook]
        failed = [record for record in of_notebook if record['failed']]
        cells = ((s, cell) for record in of_notebook for cell, s in record['cells'].items())
        slowest_s, slowest = max(cells, default=(0, 'none'))
        first = f'{failed[0]["condition"]}, {failed[0]["failed"][0]}' if failed else ''
        rows.append(
            (notebook, len(of_notebook), len(failed), f'{slowest_s:.1f} s, {slowest}', first)
        )
        if failed:
            texts += ['', _line(failed[0]), _short(failed[0]['failed'][1])]
    widths = [max(len(str(row[column])) for row in rows) for column in range(5)]
    lines = [
        '  '.join(str(word).ljust(width) for word, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    runs = Counter(record['condition'] for record in records)
    failures = Counter(record['condition'] for record in records if record['failed'])
    conditions = [f'{name} {failures[name]} of {runs[name]}' for name in runs]
    lines += ['', f'Failures by condition: {", ".join(conditions)}.']
    interrupts = sum((Counter(record['interrupts']) for record in records), Counter())
    if interrupts:
        counts = ', '.join(f'{count} {what}' for what, count in interrupts.items())
        lines.append(f'Cells: {counts}.')
    return '\n'.join(lines + texts)


def _short(text: str) -> str:
    """Return the beginning and the end of a long text: all of it is in the file of runs."""
    return (
        text
        if len(text) <= LONGEST_TEXT
        else f'{text[: LONGEST_TEXT // 2]}\n...\n{text[-LONGEST_TEXT // 2 :]}'
    )


def _line(record: dict) -> str:
    failed = record['failed']
    return (
        f'{record["condition"]:<16} {record["notebook"]:<40} {record["seconds"]:6.0f} s  '
        f'seed {record["seed"]}  {"failed: " + failed[0] if failed else "passed"}'
    )


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return 1 where a run failed, otherwise 0."""
    parser = argparse.ArgumentParser(
        prog='make soak', description='Run the notebooks in hard conditions.'
    )
    names = [condition.name for condition in CONDITIONS]
    parser.add_argument('--rounds', type=int, default=1, metavar='N', help='of each condition')
    parser.add_argument('--conditions', default='', metavar='A,B', help=', '.join(names))
    parser.add_argument('--lesson', default='', metavar='NN', help='for example 02 or "02 03"')
    parser.add_argument('--minutes', type=float, default=math.inf, help='begin no run after these')
    parser.add_argument('--seed', type=int, help='of the random times; printed with each run')
    parser.add_argument('--report', action='store_true', help='all runs so far')
    options = parser.parse_args(arguments)
    wanted = options.conditions.replace(',', ' ').split() or names
    if unknown := set(wanted) - set(names):
        parser.error(f'There is no condition {min(unknown)!r}: take of {", ".join(names)}.')
    try:
        chosen = lessons(options.lesson.replace(',', ' ').split(), FOLDER)
    except ValueError as error:
        parser.error(str(error))
    notebooks = [path for path in chosen if '"cell_type": "code"' in path.read_text('utf-8')]
    if options.report:
        records = [r for r in recorded(notebooks) if r['condition'] in wanted]
    else:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        seed = options.seed if options.seed is not None else random.randrange(10**6)
        conditions = [condition for condition in CONDITIONS if condition.name in wanted]
        records = soak(notebooks, conditions, options.rounds, options.minutes, seed)
    print(f'\n{table(records)}' if records else 'No run was done.')
    return int(any(record['failed'] for record in records))


if __name__ == '__main__':
    sys.exit(main())
