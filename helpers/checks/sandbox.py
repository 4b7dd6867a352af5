"""Runs a function in a process of its own, within limits, so that nothing it does reaches us.

The code of a student may do anything: loop for ever, catch every exception, end its process, take
all memory, hold the interpreter's lock, leave threads and programs behind. So it runs in a copy of
this process, made by `fork`: it has every name and object that the notebook has, and what it does
to them is gone with it.

Three processes take part:

- this one waits for messages;
- its child, the guard, watches the clock, the CPU and what is printed. Linux gives it all
  descendants that lose their parent (PR_SET_CHILD_SUBREAPER), so it can end every one of them. It
  also ends them when this process ends or is interrupted;
- the child of the guard, the worker, runs the function.

A worker opens a ROS session like any process; a session that is still open here is closed before.
What a killed worker leaves in shared memory and in the temporary folder is removed, also that of
programs that a judge has killed, to see what a student's code does then. Files of the student in
which a judge has put other texts are given back.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import gc
import math
import os
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, Pipe, wait
from typing import NoReturn

import psutil

from helpers.notebook import uninterrupted
from helpers.ros import fork, leave_ros, remove_dead_segments
from helpers.workspace import give_files_back

PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
POLL_S = 0.05
MOST_PATIENCE = 3.0
DUMP_S = 0.5  # for the worker to write where its threads are
MEMORY_BYTES = 1 << 30  # more than it has when it begins
PRINTED_BYTES = 20_000  # that are kept of what it prints
CPU_TICKS = os.sysconf('SC_CLK_TCK')


@dataclass
class Ending:
    """How a worker ended.

    `reason` is 'done', 'computes' or 'waits' (a limit was reached), 'late' (the deadline of all was
    reached), 'exit' (with its `status`) or 'signal' (with the signal's number as `status`).
    `frames` are the places where its threads were when a limit was reached, the innermost first:
    file and line. `left` names the processes that it had started and not ended. `printed` is what
    it printed, at most `PRINTED_BYTES` of it.
    """

    reason: str = 'done'
    status: int = 0
    frames: list[tuple[str, int]] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    printed: str = ''


class Sandbox:
    """A function that runs in a worker. Iterate over what it sends; then read `ending`.

    `function(send)` gets a function that sends any object that can be pickled. Each message begins
    the limits anew: `cpu_s` seconds of CPU of the worker itself, and `limit_s` seconds of the
    clock, which are more while other programs use this machine. A message may bring its own limits:
    `send(message, cpu_s=20)`. `since` and `together_s` may be set at any message: so long after
    that time of `time.monotonic()` the worker ends at the latest, on an idle machine.
    """

    since, together_s = 0.0, math.inf

    def __init__(self, function: Callable, cpu_s: float, limit_s: float) -> None:
        self._function, self._limits = function, (cpu_s, limit_s)
        self.ending = Ending('exit', 0)

    def __iter__(self) -> Iterator[object]:
        leave_ros()
        messages, guards_end = Pipe(duplex=False)
        alive, hold = os.pipe()  # the guard reads its end when nobody holds the other one any more
        guard = 0
        try:
            with uninterrupted():  # a guard needs somebody who ends it
                guard = fork()
                if guard == 0:
                    messages.close()
                    os.close(hold)
                    _be_guard(self._function, self._limits, guards_end, alive)
                guards_end.close()
                os.close(alive)
            while True:
                if not self._comes(messages):
                    self.ending = Ending('late')
                    return
                try:
                    message = messages.recv()
                except (EOFError, OSError):
                    return
                if isinstance(message, Ending):
                    self.ending = message
                    return
                yield message
        finally:
            with uninterrupted():
                os.close(hold)
                messages.close()
                if guard:
                    os.waitpid(guard, 0)

    def _comes(self, messages: Connection) -> bool:
        """Wait for a message, or for the end of those that send any, while there is time."""
        while not messages.poll(POLL_S):
            if time.monotonic() - self.since > self.together_s * _patience():
                return False
        return True


# --- The guard ------------------------------------------------------------------------------------


def _be_guard(
    function: Callable, limits: tuple[float, float], messages: Connection, alive: int
) -> NoReturn:
    """Run the worker, watch it, send its ending, and end all that it has started."""
    try:
        os.setsid()  # an Interrupt of the kernel's group must not reach it
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
        with (
            tempfile.TemporaryFile(buffering=0) as dump,
            tempfile.TemporaryDirectory(prefix='check-', ignore_cleanup_errors=True) as folder,
        ):
            from_worker, workers_end = Pipe(duplex=False)
            printed, printer = os.pipe()
            worker = fork()
            if worker == 0:
                messages.close()
                for unused in (from_worker.fileno(), printed, alive):
                    os.close(unused)
                os.environ['TMPDIR'] = tempfile.tempdir = folder  # also of programs that it starts
                _be_worker(function, limits, workers_end, printer, dump.fileno())
            workers_end.close()
            os.close(printer)
            ending = _watch(worker, limits, from_worker, printed, messages, alive, dump.fileno())
            _end_all()
        remove_dead_segments()
        give_files_back()
        _send(messages, ending)
    finally:
        try:
            _end_all()
        finally:
            os._exit(0)


def _watch(
    worker: int,
    limits: tuple[float, float],
    from_worker: Connection,
    printed: int,
    messages: Connection,
    alive: int,
    dump: int,
) -> Ending:
    ending, kept, done, status = Ending(), b'', False, None
    sources: list = [from_worker, printed, alive]
    since_s, since_cpu_s = time.monotonic(), 0.0
    cpu_s, limit_s = limits
    while status is None or len(sources) > 1:
        ready = wait(sources, POLL_S)
        if alive in ready:
            break  # the kernel has ended, or was interrupted
        if printed in ready:
            part = os.read(printed, 65536)
            kept = (kept + part)[:PRINTED_BYTES]
            if not part:
                sources.remove(printed)
        if from_worker in ready:
            try:
                (cpu_s, limit_s), message = from_worker.recv()
            except (EOFError, OSError):
                sources.remove(from_worker)
            else:
                done = message is None
                if done:
                    ending.left = _names_of_others(worker)
                    break
                _send(messages, message)
                since_s, since_cpu_s = time.monotonic(), _cpu_s(worker)
        if status is None:
            pid, how = os.waitpid(worker, os.WNOHANG)
            status = how if pid else None
        if status is not None and not ready:
            break  # what it left may still hold the pipes
        if status is None:
            computed = _cpu_s(worker) - since_cpu_s > cpu_s
            if computed or time.monotonic() - since_s > limit_s * _patience():
                ending.reason = 'computes' if computed else 'waits'
                ending.frames = _frames(worker, dump)
                break
    if ending.reason == 'done' and not done and status is not None:
        ending.reason = 'signal' if os.WIFSIGNALED(status) else 'exit'
        ending.status = os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)
    ending.printed = kept.decode(errors='replace')
    return ending


def _patience() -> float:
    """Return how much longer a right answer may take, because other programs want the CPUs, too."""
    return min(MOST_PATIENCE, max(1.0, os.getloadavg()[0] / len(os.sched_getaffinity(0))))


def _send(messages: Connection, message: object) -> None:
    with contextlib.suppress(OSError):  # nobody listens any more: the next look sees it
        messages.send(message)


def _cpu_s(pid: int) -> float:
    """Return the seconds of CPU that a process has used, without those of its children."""
    try:
        with open(f'/proc/{pid}/stat') as file:
            fields = file.read().rpartition(')')[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / CPU_TICKS


def _frames(worker: int, dump: int) -> list[tuple[str, int]]:
    """Return where the threads of the worker are, also of one that holds the interpreter's lock."""
    os.kill(worker, signal.SIGUSR1)
    end, size = time.monotonic() + DUMP_S, -1
    while time.monotonic() < end:
        time.sleep(POLL_S)
        before, size = size, os.fstat(dump).st_size
        if size and size == before:
            break
    text = os.pread(dump, 1 << 20, 0).decode(errors='replace')
    # The thread that runs comes first, then the others.
    threads = re.split(r'(?m)^(?:Current thread|Thread) ', text)
    current = [part for part in re.split(r'(?m)^(?=Current thread)', text) if part[:7] == 'Current']
    ordered = ''.join([*current[:1], *threads])
    return [(name, int(line)) for name, line in re.findall(r'File "(.*?)", line (\d+)', ordered)]


def _names_of_others(worker: int) -> list[str]:
    names = []
    for process in psutil.Process().children(recursive=True):
        if process.pid != worker:
            try:
                if process.status() != psutil.STATUS_ZOMBIE:
                    names.append(process.name())
            except psutil.NoSuchProcess:
                continue
    return names


def _end_all() -> None:
    """Kill all descendants. Those that lose their parent come to this process."""
    end = time.monotonic() + 5
    while time.monotonic() < end:
        for process in psutil.Process().children(recursive=True):
            try:
                process.kill()
            except psutil.NoSuchProcess:
                continue
        try:
            while os.waitpid(-1, os.WNOHANG) != (0, 0):
                pass
        except ChildProcessError:
            return
        time.sleep(0.01)


# --- The worker -----------------------------------------------------------------------------------


def _be_worker(
    function: Callable,
    limits: tuple[float, float],
    messages: Connection,
    printer: int,
    dump: int,
) -> NoReturn:
    try:
        os.setpgid(0, 0)  # a kill of its own group does not reach the guard
        signal.signal(signal.SIGINT, signal.default_int_handler)
        _speak_into(printer)
        faulthandler.register(signal.SIGUSR1, file=dump, all_threads=True)
        _limit_memory()
        gc.freeze()  # the objects of the kernel: a collection would only copy their pages
        _leave_kernel()

        def send(message: object, cpu_s: float = limits[0], limit_s: float = limits[1]) -> None:
            messages.send(((cpu_s, limit_s), message))

        function(send)
        with contextlib.suppress(Exception):  # whatever a student has put in its place
            sys.stdout.flush()
        send(None)
        signal.pause()  # the guard looks at what is left, then kills it
    except BaseException:  # a mistake of ours: a student's errors do not come here
        traceback.print_exc()
    finally:
        os._exit(3)


def _speak_into(printer: int) -> None:
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number in (1, 2):
        os.dup2(printer, number)
    os.close(printer)
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    # In lines: what is printed before a crash is not lost.
    sys.stdout = open(1, 'w', buffering=1, closefd=False)  # noqa: SIM115
    sys.stderr = open(2, 'w', buffering=1, closefd=False)  # noqa: SIM115


def _limit_memory() -> None:
    with open('/proc/self/status') as file:
        data = re.search(r'^VmData:\s+(\d+) kB', file.read(), re.MULTILINE)
    if data:
        limit = int(data[1]) * 1024 + MEMORY_BYTES
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _leave_kernel() -> None:
    """Forget that this is a kernel: no display, no input, no sockets of its parent."""
    if 'IPython' in sys.modules and (shell := sys.modules['IPython'].get_ipython()):
        type(shell).clear_instance()
