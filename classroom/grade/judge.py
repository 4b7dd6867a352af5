"""Run a lesson with a student's answers, and say what its checks say. It runs in the container.

The job comes as JSON on stdin, and what happens goes as lines of JSON to stdout, so that nothing is
lost if this is ended:

    {"begin": true}                                  before any code of the student
    {"cell": "check-02-1", "outputs": [...]}         for each cell of a task
    {"canary": "a_driver"}                           its check takes the starter, too: forged
    {"forged": "a_driver", "why": "..."}             its verdict is not what its check found
    {"did": "a_driver", "what": "gc.get_objects"}    its code did what no answer needs
    {"given_up": "a_driver", "why": "its code ended ..."}     a task hung, or ended the kernel
    {"end": true}

After a task was given up, the lesson runs again, with the starter of that task.

The code of a student runs in the kernel that judges it, and may have changed what judges, or what
shows the verdict. So a verdict counts if witness.py, which was in the kernel before, has seen the
same points, and nothing that judges has changed. And when all is judged, each check that has taken
an answer gets the starter in the same kernel. Starters are wrong: if one passes, nobody judges here
any more. The answers of tasks that begin with a terminal are left out of this: what a terminal has
made is still there.

Job: `cells`, each with `id`, `source`, `kind` ('', 'exercise', 'check', 'solution'), `task`, and
for an exercise its `starter`; `lesson`, the file that the helpers read, without solutions;
`module`, the checks; `files`, of a workspace, in Base64, and `overlay`, the tasks for which they
count; `answered`, those with an answer; `cell_s`, the seconds that a cell may take.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import ctypes
import hmac
import json
import os
import queue
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from hashlib import blake2b
from pathlib import Path

import psutil
from jupyter_client.manager import KernelManager
from nbformat.v4 import output_from_msg

from classroom.grade import limits
from helpers.checks.progress import IS_GRADED
from helpers.checks.verdict import verdict_in
from helpers.lesson import magic_of

PR_SET_DUMPABLE, PR_SET_CHILD_SUBREAPER = 4, 36  # linux/prctl.h
INTERRUPT_S = 5  # for a cell to end after an interrupt
END_S = 20  # for all that a kernel has started to end
START_S = 120
CHECK_TIMES = 3  # as long as another cell
POLL_S = 0.1
FULL = 0.98  # of its memory: a kernel that has more may have no room to say so
NEARLY_FULL = 0.9  # what a kernel once had that ended without a word
MOST_PRINTED = 2_000_000  # letters of a cell
ENDLESS = 'Interrupted: it printed without end.'
LIMIT_MET = 'Noticed: it {}.'  # while a cell ran
MOST_OUTPUTS = 50  # of a cell
LONGEST = 100_000  # letters of an output
IS_ALONE = __name__ == '__main__' and os.getpid() == 1  # but for students' programs: a container
WITNESS = Path(__file__).with_name('witness.py')
# What no answer has to open. The helpers themselves read the lesson that lies beside the kernel.
SECRET_FILES = ('.ipynb', '/tests/answers', '/tests/mutants', '/proc/self/mem', '/proc/self/fd')
FROM_WITNESS_S = 10  # for what the witness has written to arrive
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
        self._others = _children()
        self._most_taken, self._looked_s = 0.0, 0.0
        self._manager = KernelManager(kernel_name='python3')
        quiet = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL}
        self._manager.start_kernel(cwd=str(folder), env=environment, **quiet)
        self._client = self._manager.client()
        self._client.start_channels()
        self._client.wait_for_ready(timeout=START_S)
        # A program of the student could read it, and tell the kernel what to run.
        Path(self._manager.connection_file).unlink(missing_ok=True)

    def close(self) -> None:
        # First, because a container that is full of programs has no room for a thread of ours.
        _end_programs(self._others)
        self._client.stop_channels()
        self._manager.shutdown_kernel(now=True)

    def run(self, source: str, limit_s: float, silent: bool = False) -> list[dict]:
        """Run a cell, and return its outputs. Raises HungError."""
        asked = self._client.execute(source, silent, allow_stdin=False, stop_on_error=False)
        outputs: list[dict] = []
        end = time.monotonic() + limit_s
        interrupted, printed, before = '', 0, limits.counts()
        # One that is full already may end before it is looked at.
        self._most_taken = limits.memory_taken(self._manager.provisioner.pid) or self._most_taken
        while True:
            self._look()
            if not interrupted and (time.monotonic() > end or printed > MOST_PRINTED):
                interrupted = f'Interrupted after {limit_s:.0f} s.'
                if printed > MOST_PRINTED:
                    interrupted = ENDLESS
                end = time.monotonic() + INTERRUPT_S
                outputs.insert(0, _stream(f'{interrupted}\n'))
                self._manager.interrupt_kernel()
            if time.monotonic() > end:
                what = 'printed without end'
                if interrupted != ENDLESS:
                    what = f'did not end in {limit_s:.0f} s'
                met = self._met(before)
                raise HungError(f'its code {met or f"{what}, nor by an interrupt"}')
            try:
                message = self._client.get_iopub_msg(timeout=POLL_S)
            except queue.Empty:
                if not self._manager.is_alive():
                    met = self._met(before)
                    raise HungError(f'its code {met or "ended the kernel"}') from None
                continue
            if message['parent_header'].get('msg_id') != asked:
                continue
            kind, content = message['msg_type'], message['content']
            if kind == 'status' and content['execution_state'] == 'idle':
                if met := self._met(before):
                    outputs.insert(0, _stream(f'{LIMIT_MET.format(met)}\n'))
                return outputs
            if kind in ('stream', 'display_data', 'execute_result', 'error'):
                printed += len(str(content.get('text', content.get('data', ''))))
                _add(outputs, dict(output_from_msg(message)))

    def _look(self) -> None:
        """Look now and then how much memory a cell takes: a kernel that ended does not tell."""
        if time.monotonic() - self._looked_s > POLL_S:
            self._looked_s = time.monotonic()
            taken = limits.memory_taken(self._manager.provisioner.pid)
            self._most_taken = max(self._most_taken, taken)

    def _met(self, before: dict[str, int]) -> str:
        """Return the limit that was met since then, or nothing."""
        taken = limits.memory_taken(self._manager.provisioner.pid)
        full = taken > FULL if taken else self._most_taken > NEARLY_FULL
        return limits.met_since(before) or (limits.MUCH_MEMORY if full else '')


def _children() -> set[psutil.Process]:
    return {*psutil.Process().children(recursive=True)}


def _end_programs(others: set[psutil.Process]) -> None:
    """End all programs but these, and wait for them: one that nobody has waited for counts, too."""
    if IS_ALONE:  # all at once, for programs may start more of them meanwhile
        with contextlib.suppress(ProcessLookupError):
            os.kill(-1, signal.SIGKILL)
    end = time.monotonic() + END_S
    while (left := _children() - others) and time.monotonic() < end:
        for child in left:
            with contextlib.suppress(psutil.NoSuchProcess):
                child.kill()
        psutil.wait_procs(left, timeout=1)


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


class Witness:
    """What witness.py tells of a kernel: see there."""

    def __init__(self, kernel: Kernel, folder: Path, module: str) -> None:
        self._kernel, self._key, self._orders = kernel, secrets.token_bytes(32), 0
        self._left, self.lines = b'', []
        path = folder / '.witness'
        os.mkfifo(path, 0o600)
        self._pipe = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        names = {
            'KEY': self._key,
            'PIPE': str(path),
            'SECRET_FILES': SECRET_FILES,
            'CHECKS': 'helpers.checks.',
            'LESSON': module,
        }
        source = (
            f'import helpers.checks.lessons.{module}, ctypes, resource, threading\n'
            # If memory is short, the system ends it, and not what judges.
            'with open("/proc/self/oom_score_adj", "w") as file: file.write("1000")\n'
            # No program of the same user may look into its memory: linux/prctl.h.
            f'ctypes.CDLL(None).prctl({PR_SET_DUMPABLE}, 0, 0, 0, 0)\n'
            'data = open("/proc/self/status").read().partition("VmData:")[2].split()[0]\n'
            f'limit = (int(data) << 10) + ({limits.MEMORY_GB} << 30)\n'
            'resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))\n'
            # With stacks of 8 MB, as they are otherwise, 250 threads would take all of it.
            'threading.stack_size(2 << 20)\n'
            f'limit = {limits.FILES_GB} << 30\n'
            'resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))\n'
            'del data, file, limit, ctypes, resource, threading, helpers\n'
            f'exec(compile(open({str(WITNESS)!r}).read(), "<witness>", "exec"), '
            f'{{"__builtins__": dict(vars(__import__("builtins"))), **{names!r}}})'
        )
        self._said = kernel.run(source, START_S, silent=True)
        path.unlink()

    def close(self) -> None:
        os.close(self._pipe)

    def order(self, mode: str) -> str:
        """Say what follows. Return what has changed of what judges, '' if nothing has."""
        self._orders += 1
        code = self._code(f'{self._orders} {mode}')
        self._kernel.run(f'__import__("sys").audit("ros2_notebooks.order", {code!r}, {mode!r})', 60)
        end = time.monotonic() + FROM_WITNESS_S
        while True:
            for line in self.read():
                if line[1:4] == ('heard', self._orders, mode):
                    return str(line[4])
            if time.monotonic() > end:
                return 'what hears the orders of the grader'
            time.sleep(0.01)

    def take(self) -> list[tuple]:
        """Return all that was told since the last time, and forget it."""
        self.read()
        taken, self.lines = self.lines, []
        return taken

    def read(self) -> list[tuple]:
        """Return what has come now. A line with another code is told as one that was forged."""
        try:
            while part := os.read(self._pipe, 1 << 16):
                self._left += part
        except BlockingIOError:
            pass
        *lines, self._left = self._left.split(b'\n')
        found = []
        for line in lines:
            code, _, text = line.decode(errors='replace').partition(' ')
            if hmac.compare_digest(code.encode(), self._code(text).encode()):
                found.append(ast.literal_eval(text))
            else:
                found.append((0, 'did', 'a line in the place of what judges'))
        self.lines += found
        return found

    def _code(self, text: str) -> str:
        data = text.encode(errors='replace')
        return blake2b(data, key=self._key, digest_size=16).hexdigest()


def what_is_forged(task: str, outputs: list[dict], changed: str, told: list[tuple]) -> str:
    """Return why a verdict that says solved does not count, or nothing."""
    shown = [verdict.get('points') for verdict in map(verdict_in, outputs) if verdict is not None]
    counts = [len(points) if isinstance(points, list) else None for points in shown]
    seen = [line[2:] for line in told if line[1] == 'point']
    changed = changed or next((line[-1] for line in seen if line[-1]), '')
    if changed:
        return f'its code has changed what judges it: {changed[:80]}'
    right = [(task, True)] * len(seen)
    if [(name, ok) for name, _, ok, _ in seen] != right or counts != [len(seen)]:
        return 'its verdict is not what its check found'
    return ''


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
    answered = {*job['answered']}
    for attempt in range(len(answered) + 1):
        here = folder / f'run_{attempt}'
        here.mkdir()
        for name, text in job.get('lesson', {}).items():
            (here / name).write_text(text, encoding='utf-8')
        task = ''  # the last one that was reached
        passed: set[str] = set()  # tasks with an answer
        kernel = Kernel(here)
        witness = Witness(kernel, here, job['module'])
        try:
            known = False
            for cell in job['cells']:
                task = cell['task'] or task
                is_answer = cell['kind'] == 'exercise' and task in answered - given_up
                if is_answer and not known:
                    known = True
                    witness.order('know')
                changed = ''
                if cell['kind'] == 'check':
                    # Whatever the answer calls `check` now.
                    kernel.run(f'from helpers.checks.lessons.{job["module"]} import check', 60)
                    if task in job['overlay']:
                        kernel.run(f'{OVERLAY}({str(files)!r})', 60)
                    if known:
                        yield from _deeds(witness, task)
                        changed = witness.order('check')
                elif is_answer:
                    witness.order('student')
                starter = task in given_up and cell['kind'] == 'exercise'
                # A check has limits of its own, for each of its points.
                limit_s = job['cell_s'] * (CHECK_TIMES if cell['kind'] == 'check' else 1)
                outputs = kernel.run(cell['starter' if starter else 'source'], limit_s)
                if is_answer:
                    witness.order('lesson')
                    yield from _deeds(witness, task)
                if cell['kind'] == 'check' and known:
                    changed = changed or witness.order('lesson')
                    told = witness.take()
                    yield from _deeds_of(told, task)
                    if task in answered - given_up and _is_solved(outputs):
                        passed.add(task)
                        if why := what_is_forged(task, outputs, changed, told):
                            yield {'forged': task, 'why': why}
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
            witness.close()
            shutil.rmtree(here, ignore_errors=True)  # it may have filled the disk


def _deeds(witness: Witness, task: str) -> Iterator[dict]:
    """Yield what code of a student has done that no answer needs."""
    yield from _deeds_of(witness.take(), task)


def _deeds_of(told: list[tuple], task: str) -> Iterator[dict]:
    for line in told:
        if line[1] == 'did':
            yield {'did': task, 'what': str(line[2])}


def _canaries(kernel: Kernel, job: dict, passed: set[str]) -> Iterator[dict]:
    """Let the checks that have passed judge the starters; yield the tasks whose starter passes."""
    for task in dict.fromkeys(cell['task'] for cell in job['cells'] if cell['task'] in passed):
        cells = [cell for cell in job['cells'] if cell['task'] == task]
        starters = [cell['starter'] for cell in cells if cell['kind'] == 'exercise']
        if not starters or any(magic_of(one).name == 'terminal' for one in starters):
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
    return any(one.get('solved') is True for one in filter(None, map(verdict_in, outputs)))


# In the kernel of the student: what the archive has takes the place of what the cells wrote.
OVERLAY = "__import__('classroom.grade.judge', fromlist=['_']).overlay"


def overlay(files: str) -> None:
    """Copy the student's files over those of the workspace that is open."""
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
    # What a student's program has started comes to this one when that program ends.
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    signal.signal(signal.SIGINT, lambda *_: None)  # an answer may send it; the runner kills
    job = json.load(sys.stdin)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        for event in judge(job, Path(folder)):
            said.write(json.dumps(event) + '\n')
            said.flush()
    return 0


if __name__ == '__main__':
    sys.exit(main())
