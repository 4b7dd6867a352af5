"""What a run of a notebook leaves behind: threads, processes, shared memory.

`look` looks at a kernel from inside. When all kernels have ended, this module as a program looks at
the run: it has a /dev/shm and a table of processes of its own, so that whatever is there was left.
"""

import os
import re
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import psutil

SHARED_MEMORY = re.compile(r'/dev/shm/fastrtps_\w+')
# Threads of Fast DDS that belong to no participant: they live until the process ends.
OF_PROCESS = ('dds.shm.wdog', 'dds.log')
OF_ZMQ = 'GarbageCollectorThread'  # frees what Jupyter has sent, from its first picture on
# Of Python: it comes with the first pool of processes, and lives until the kernel ends.
TRACKER = 'from multiprocessing.resource_tracker import main'
MOMENT_S = 1.0
END_TIMEOUT_S = 10.0

_before: dict[str, str] | None = None


def look() -> None:
    """Note what this process has; from the second call on, raise AssertionError for what is new."""
    global _before
    deadline = time.monotonic() + END_TIMEOUT_S
    now = state_of_process()
    if _before is None:
        _before = now
    left = now.keys() - _before.keys()
    # Fast DDS's watchdog lets go of another process's memory up to a second after a participant.
    while left and all(map(SHARED_MEMORY.fullmatch, left)) and time.monotonic() < deadline:
        time.sleep(0.01)
        left &= state_of_process().keys()
    assert not left, ' '.join(now[key] for key in sorted(left))


def state_of_process() -> dict[str, str]:
    """Return a sentence for each thread, child and shared memory, by a key of its own."""
    children = [
        child
        for child in psutil.Process().children(recursive=True)
        if not _of_pool(child) and not _of_terminal(child)
    ]
    found = threads_of_process() | processes_that_stay(children, MOMENT_S)
    for file in SHARED_MEMORY.findall(Path('/proc/self/maps').read_text()):
        found[file] = f'The kernel still uses {file}.'
    return found


def threads_of_process() -> dict[str, str]:
    """Return a sentence for each thread, by a key of its own.

    Of the threads that C++ started, those of Fast DDS's participants.
    """
    found = {
        f'thread {thread.name} {thread.ident}': f'The thread {thread.name} still runs.'
        for thread in threading.enumerate()
        if type(thread).__name__ != OF_ZMQ
    }
    for task in Path('/proc/self/task').iterdir():
        with suppress(OSError):  # it has ended
            name = (task / 'comm').read_text().strip()
            if name.startswith('dds.') and name not in OF_PROCESS:
                found[f'native {name} {task.name}'] = f'The thread {name} still runs.'
    return found


def _of_pool(process: psutil.Process) -> bool:
    with suppress(psutil.NoSuchProcess):  # nor a zombie
        return any(word.startswith(TRACKER) for word in process.cmdline())
    return False


def _of_terminal(process: psutil.Process) -> bool:
    """Return whether it runs in a terminal that a cell has opened, and that is to stay open."""
    processes = sys.modules.get('helpers.workspace.processes')
    terminals = processes._started if processes else ()  # noqa: SLF001
    open_now = {terminal._process.pid for terminal in terminals}  # noqa: SLF001
    with suppress(psutil.NoSuchProcess):
        return any(one.pid in open_now for one in (process, *process.parents()))
    return False


def processes_that_stay(processes: list[psutil.Process], timeout_s: float) -> dict[str, str]:
    """Return a sentence for each of the processes that does not end within a time."""
    deadline = time.monotonic() + timeout_s
    # Not `psutil.wait_procs`: the end of a child belongs to the process that started it.
    while processes and time.monotonic() < deadline:
        time.sleep(0.01)
        processes = [process for process in processes if process.is_running()]
    found = {}
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            kind = 'process'
            try:
                what = ' '.join(process.cmdline())[:100] or process.name()
            except psutil.ZombieProcess:
                kind, what = 'zombie', f'{process.name()} (nobody has waited for its end)'
            found[f'{kind} {process.pid}'] = f'The process {process.pid} still runs: {what}.'
    return found


if __name__ == '__main__':
    # 1 is the shell that has started the run, and this program.
    others = [process for process in psutil.process_iter() if process.pid not in (1, os.getpid())]
    for sentence in processes_that_stay(others, END_TIMEOUT_S).values():
        print(sentence)
    for file in sorted(Path('/dev/shm').glob('fastrtps_*')):
        print(f'Shared memory is left: {file}.')
