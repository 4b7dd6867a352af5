"""Run a lesson with a student's answers, and say what its checks say. It runs in the container.

The job comes as JSON on stdin, and what happens goes as lines of JSON to stdout, so that nothing is
lost if this is ended:

    {"begin": true}                                  before any code of the student
    {"cell": "check-02-1", "outputs": [...]}         for each cell of a task
    {"canary": "a_driver"}                           its check takes the starter, too: forged
    {"given_up": "a_driver", "why": "its code ended ..."}     a task hung, or ended the kernel
    {"end": true}

After a task was given up, the lesson runs again, with the starter of that task.

The code of a student runs in the kernel that judges it, and may have changed what judges. So when
all is judged, each check that has taken an answer gets the starter in the same kernel. Starters are
wrong: if one passes, nobody judges here any more. The answers of tasks that begin with a terminal
are left out: what a terminal has made is still there.

Job: `cells`, each with `id`, `source`, `kind` ('', 'exercise', 'check', 'solution'), `task`, and
for an exercise its `starter`; `module`, the checks; `files`, of a workspace, in Base64, and
`overlay`, the tasks for which they count; `cell_s`, the seconds that a cell may take.
"""

from __future__ import annotations

import base64
import ctypes
import json
import os
import queue
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
from jupyter_client.manager import KernelManager
from nbformat.v4 import output_from_msg

from helpers.checks.progress import IS_GRADED
from helpers.checks.verdict import KEY

PR_SET_DUMPABLE = 4  # linux/prctl.h
INTERRUPT_S = 5  # for a cell to end after an interrupt
START_S = 120
CHECK_TIMES = 3  # as long as another cell
POLL_S = 0.5
MOST_OUTPUTS = 50  # of a cell
LONGEST = 100_000  # letters of an output
KEPT = ('text/plain', 'text/html', 'image/png', 'image/svg+xml')


class HungError(Exception):
    """The kernel does not answer any more. Its text says why."""


class Kernel:
    """A fresh kernel in a folder of its own, ended with all that it has started."""

    def __init__(self, folder: Path) -> None:
        environment = os.environ | {
            'ROS2_NOTEBOOKS_PROGRESS': '',  # and with it no class
            IS_GRADED: 'yes',
            'JUPYTER_DATA_DIR': str(folder / '.data'),
            'JUPYTER_RUNTIME_DIR': str(folder / '.runtime'),
            'IPYTHONDIR': str(folder / '.ipython'),
            'MPLCONFIGDIR': str(folder / '.matplotlib'),
            # As the saved outputs were made: ipykernel leaves alone what C writes.
            'PYTEST_CURRENT_TEST': 'classroom/grade/judge.py',
        }
        self._manager = KernelManager(kernel_name='python3')
        quiet = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL}
        self._manager.start_kernel(cwd=str(folder), env=environment, **quiet)
        self._client = self._manager.client()
        self._client.start_channels()
        self._client.wait_for_ready(timeout=START_S)

    def close(self) -> None:
        children = psutil.Process().children(recursive=True)
        self._client.stop_channels()
        self._manager.shutdown_kernel(now=True)
        for child in children:
            try:
                child.kill()
            except psutil.NoSuchProcess:
                continue

    def run(self, source: str, limit_s: float) -> list[dict]:
        """Run a cell, and return its outputs. Raises HungError."""
        asked = self._client.execute(source, allow_stdin=False, stop_on_error=False)
        outputs: list[dict] = []
        end = time.monotonic() + limit_s
        interrupted = False
        while True:
            if time.monotonic() > end:
                if interrupted:
                    raise HungError(f'its code did not end in {limit_s:.0f} s, nor by an interrupt')
                interrupted, end = True, time.monotonic() + INTERRUPT_S
                outputs.append(_stream(f'Interrupted after {limit_s:.0f} s.\n'))
                self._manager.interrupt_kernel()
            try:
                message = self._client.get_iopub_msg(timeout=POLL_S)
            except queue.Empty:
                if not self._manager.is_alive():
                    raise HungError('its code ended the kernel') from None
                continue
            if message['parent_header'].get('msg_id') != asked:
                continue
            kind, content = message['msg_type'], message['content']
            if kind == 'status' and content['execution_state'] == 'idle':
                return outputs
            if kind in ('stream', 'display_data', 'execute_result', 'error'):
                _add(outputs, dict(output_from_msg(message)))


def _stream(text: str) -> dict:
    return {'output_type': 'stream', 'name': 'stderr', 'text': text}


def _add(outputs: list[dict], output: dict) -> None:
    """Add an output, if there is room: code may print without an end."""
    last = outputs[-1] if outputs else {}
    if output['output_type'] == 'stream' and output['name'] == last.get('name'):
        last['text'] = (last['text'] + output['text'])[:LONGEST]
    elif len(outputs) < MOST_OUTPUTS:
        if 'text' in output:
            output['text'] = output['text'][:LONGEST]
        if 'data' in output:
            data = output['data'].items()
            output['data'] = {k: v for k, v in data if k in KEPT and len(str(v)) <= 10 * LONGEST}
        if 'traceback' in output:
            output['traceback'] = [line[:LONGEST] for line in output['traceback'][-20:]]
        outputs.append(output)


def judge(job: dict, folder: Path) -> Iterator[dict]:
    """Yield what happens in a lesson with answers."""
    files = folder / 'files'
    for name, content in job['files'].items():
        path = files / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(base64.b64decode(content))
    yield {'begin': True}
    given_up: set[str] = set()
    tasks = [*dict.fromkeys(cell['task'] for cell in job['cells'] if cell['task'])]  # in order
    exercises = [cell for cell in job['cells'] if cell['kind'] == 'exercise']
    answered = {cell['task'] for cell in exercises if cell['source'] != cell['starter']}
    answered |= {*job['overlay']}
    for attempt in range(len(answered) + 1):
        here = folder / f'run_{attempt}'
        here.mkdir()
        task = ''  # the last one that was reached
        passed: set[str] = set()  # tasks with an answer
        kernel = Kernel(here)
        try:
            for cell in job['cells']:
                task = cell['task'] or task
                if cell['kind'] == 'check':
                    # Whatever the answer calls `check` now.
                    kernel.run(f'from helpers.checks.lessons.{job["module"]} import check', 60)
                    if task in job['overlay']:
                        kernel.run(f'{OVERLAY}({str(files)!r})', 60)
                starter = task in given_up and cell['kind'] == 'exercise'
                # A check has limits of its own, for each of its points.
                limit_s = job['cell_s'] * (CHECK_TIMES if cell['kind'] == 'check' else 1)
                outputs = kernel.run(cell['starter' if starter else 'source'], limit_s)
                if cell['kind'] == 'check' and task in answered - given_up and _is_solved(outputs):
                    passed.add(task)
                if cell['kind'] in ('exercise', 'check'):
                    yield {'cell': cell['id'], 'outputs': outputs}
        except HungError as why:
            # The code that hangs may be that of a task above: its class is used in a later cell.
            reached = tasks[: tasks.index(task) + 1] if task else []
            suspects = [one for one in reached if one in answered - given_up]
            if not suspects:
                yield {'given_up': '', 'why': str(why)}
                return
            blamed = suspects[-1]
            given_up.add(blamed)
            yield {'given_up': blamed, 'why': str(why)}
            if answered == given_up:
                yield {'end': True}
                return
        else:
            yield from _canaries(kernel, job, passed)
            yield {'end': True}
            return
        finally:
            kernel.close()


def _canaries(kernel: Kernel, job: dict, passed: set[str]) -> Iterator[dict]:
    """Let the checks that have passed judge the starters; yield the tasks whose starter passes."""
    for task in dict.fromkeys(cell['task'] for cell in job['cells'] if cell['task'] in passed):
        cells = [cell for cell in job['cells'] if cell['task'] == task]
        starters = [cell['starter'] for cell in cells if cell['kind'] == 'exercise']
        if not starters or any(one.startswith('%%terminal') for one in starters):
            continue
        try:
            for starter in starters:
                kernel.run(starter, job['cell_s'])
            kernel.run(f'from helpers.checks.lessons.{job["module"]} import check', 60)
            checks = [cell for cell in cells if cell['kind'] == 'check']
            found = [kernel.run(one['source'], job['cell_s'] * CHECK_TIMES) for one in checks]
        except HungError:  # no starter does that: something in this kernel looks for them
            yield {'canary': task}
            return
        if found and all(map(_is_solved, found)):
            yield {'canary': task}


def _is_solved(outputs: list[dict]) -> bool:
    verdicts = [output.get('metadata', {}).get(KEY) for output in outputs]
    return any(isinstance(one, dict) and one.get('solved') is True for one in verdicts)


# In the kernel of the student: what the archive has takes the place of what the cells wrote.
OVERLAY = "__import__('classroom.grade.judge', fromlist=['_']).overlay"


def overlay(files: str) -> None:
    """Copy the student's files over those of the workspace that is open."""
    import shutil

    from IPython import get_ipython

    from helpers.workspace import Workspace

    for value in list(get_ipython().user_ns.values()):
        if isinstance(value, Workspace):
            shutil.copytree(files, value.path / 'src', dirs_exist_ok=True)
            return


def main() -> int:
    """Judge the job of stdin."""
    # No program inherits it. As this process is not dumpable, none of the same user may look into
    # /proc for it, or trace this process.
    said = os.fdopen(os.dup(1), 'w', encoding='utf-8')
    os.dup2(2, 1)
    ctypes.CDLL(None).prctl(PR_SET_DUMPABLE, 0, 0, 0, 0)
    job = json.load(sys.stdin)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        for event in judge(job, Path(folder)):
            said.write(json.dumps(event) + '\n')
            said.flush()
    return 0


if __name__ == '__main__':
    sys.exit(main())
