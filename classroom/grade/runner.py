"""Start `judge` for one student, read what it says, and end it when its time is over."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from uuid import uuid4

import psutil

from classroom.grade import limits
from helpers.lesson import ROOT

SCRIPT = ROOT / 'classroom/container/run.sh'
MOST_SAID = 30_000_000  # bytes that are read of what it says
NOT_STARTED = 'it could not be judged: '
LATE = 'it was ended after'
INTERRUPTED = 'it was interrupted'
KILLED = 137  # the exit status of a container that had no memory left


@dataclass
class Said:
    """What `judge` said: the outputs of cells, and the tasks that it gave up, with the reason."""

    outputs: dict[str, list[dict]] = field(default_factory=dict)
    given_up: dict[str, str] = field(default_factory=dict)
    canaries: list[str] = field(default_factory=list)  # tasks whose checks take the starter, too
    forged: dict[str, str] = field(default_factory=dict)  # tasks whose verdict is not their check's
    did: dict[str, set[str]] = field(default_factory=dict)  # tasks, and what no answer needs
    begun: bool = False  # before any code of a student
    ended: bool = False
    trouble: str = ''  # why it did not end by itself
    is_ours: bool = False  # the trouble is that of this machine: to be tried again
    seconds: float = 0.0


class Where:
    """Where jobs run, each with some cores. What runs is known, so that it can be ended."""

    def __init__(self, cpus: float = limits.CPUS) -> None:
        self.cpus = cpus
        self.stopped = False
        self.ends: set[Callable] = set()

    def stop(self) -> None:
        """End all jobs: they are to be tried again."""
        self.stopped = True
        for end in list(self.ends):
            end()

    def ready(self) -> str:
        """Return why nothing can be run, or nothing."""
        return ''

    def start(self, **pipes: object) -> tuple[subprocess.Popen, Callable]:
        """Start `judge`, and return it with what ends it."""
        raise NotImplementedError


class Container(Where):
    """Runs a job in a container of `make image`, without network: see container/run.sh."""

    def ready(self) -> str:
        done = subprocess.run([SCRIPT, 'ready'], capture_output=True, text=True)
        return done.stderr.strip() if done.returncode else ''

    def start(self, **pipes: object) -> tuple[subprocess.Popen, Callable]:
        name = f'ros2_notebooks_grade_{uuid4().hex[:12]}'
        command, environment = [SCRIPT, 'judge', name], os.environ | {'CPUS': f'{self.cpus:g}'}
        # Ctrl+C is for this program, which then ends it.
        process = subprocess.Popen(command, env=environment, start_new_session=True, **pipes)

        def end() -> None:
            subprocess.run([SCRIPT, 'end', name], capture_output=True)
            process.kill()

        return process, end


class Trusted(Where):
    """Runs a job on this machine, as you: it may use less, and reach what you reach."""

    def __init__(self, cpus: float = limits.CPUS) -> None:
        super().__init__(cpus)
        self._started = itertools.count()

    def start(self, **pipes: object) -> tuple[subprocess.Popen, Callable]:
        environment = os.environ | {'PYTHONPATH': str(ROOT)}
        command = [sys.executable, '-m', 'classroom.grade.judge']
        process = subprocess.Popen(command, env=environment, start_new_session=True, **pipes)
        self._limit(process.pid)

        def end() -> None:
            with contextlib.suppress(psutil.NoSuchProcess):
                for child in psutil.Process(process.pid).children(recursive=True):
                    with contextlib.suppress(psutil.NoSuchProcess):
                        child.kill()
            process.kill()

        return process, end

    def _limit(self, pid: int) -> None:
        """Give a job its cores, and no more programs than a container has. Root may start any."""
        cores = sorted(os.sched_getaffinity(0))
        count = min(len(cores), max(1, round(self.cpus)))
        first = next(self._started) * count
        os.sched_setaffinity(pid, {cores[(first + n) % len(cores)] for n in range(count)})
        mine = (one.info for one in psutil.process_iter(['uids', 'num_threads']))
        threads = sum(one['num_threads'] for one in mine if one['uids'].real == os.getuid())
        most = threads + limits.PROGRAMS
        _, hard = resource.getrlimit(resource.RLIMIT_NPROC)
        if hard == resource.RLIM_INFINITY or most < hard:
            resource.prlimit(pid, resource.RLIMIT_NPROC, (most, most))


def run(job: dict, where: Where, limit_s: float) -> Said:
    """Run a job for at most `limit_s` seconds, and return what was said until then."""
    if where.stopped:
        return Said(trouble=INTERRUPTED, is_ours=True)
    said, begun = Said(), time.monotonic()
    with tempfile.TemporaryFile() as errors:
        pipes = {'stdin': subprocess.PIPE, 'stdout': subprocess.PIPE, 'stderr': errors}
        process, end = where.start(**pipes)
        where.ends.add(end)
        if where.stopped:  # while this job started, so that nobody has ended it
            end()
        late = threading.Event()

        def stop() -> None:
            late.set()
            end()

        timer = threading.Timer(limit_s, stop)
        timer.start()
        try:
            threading.Thread(target=_feed, args=(process, job), daemon=True).start()
            left = MOST_SAID
            while line := process.stdout.readline(left):
                _read(line, said)
                left -= len(line)
                if left <= 0:
                    said.trouble = 'it said too much, and was ended'
                    break
        finally:
            timer.cancel()
            where.ends.discard(end)
            if process.poll() is None and not said.ended:
                end()
            process.stdout.close()
            process.wait()
        said.seconds = time.monotonic() - begun
        if where.stopped:
            said.trouble, said.is_ours = INTERRUPTED, True
        elif late.is_set():
            said.trouble = f'{LATE} {limit_s / 60:.0f} min'
        elif not said.ended and not said.trouble:
            errors.seek(0)
            lines = errors.read()[-10_000:].decode(errors='replace').strip().splitlines()
            reason = lines[-1][:200] if lines else f'exit status {process.returncode}'
            if said.begun and process.returncode == KILLED:
                reason = f'its code {limits.ALL_MEMORY}'
            said.is_ours = not said.begun
            said.trouble = f'{NOT_STARTED if said.is_ours else "it was ended: "}{reason}'
    return said


def _feed(process: subprocess.Popen, job: dict) -> None:
    with contextlib.suppress(OSError), process.stdin as pipe:
        pipe.write(json.dumps(job).encode())


def _read(line: bytes, said: Said) -> None:
    """Take a line of what hostile code may have written: what has another form is left out."""
    try:
        event = json.loads(line)
    except (ValueError, RecursionError):
        return
    if not isinstance(event, dict):
        return
    outputs, given_up = event.get('outputs'), event.get('given_up')
    if isinstance(event.get('cell'), str) and isinstance(outputs, list):
        said.outputs[event['cell']] = [one for one in outputs if isinstance(one, dict)]
    elif isinstance(event.get('canary'), str):
        said.canaries.append(event['canary'][:200])
    elif isinstance(event.get('forged'), str):
        said.forged[event['forged']] = str(event.get('why', ''))[:200]
    elif isinstance(event.get('did'), str):
        said.did.setdefault(event['did'], set()).add(str(event.get('what', ''))[:100])
    elif isinstance(given_up, str):
        said.given_up[given_up] = str(event.get('why', ''))[:200]
    said.begun |= event.get('begin') is True
    said.ended |= event.get('end') is True or given_up == ''
