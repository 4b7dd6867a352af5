"""What a notebook leaves behind: threads, processes, shared memory.

`look` looks at a kernel from inside, the functions below it at what is there after the kernel.
"""

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
    sentences = threads_of_process() | processes_that_stay(children, MOMENT_S)
    for file in SHARED_MEMORY.findall(Path('/proc/self/maps').read_text()):
        sentences[file] = f'The kernel still uses {file}.'
    return sentences


def threads_of_process() -> dict[str, str]:
    """Return a sentence for each thread, by a key of its own.

    Of the threads that C++ started, those of Fast DDS's participants.
    """
    sentences = {
        f'thread {thread.name} {thread.ident}': f'The thread {thread.name} still runs.'
        for thread in threading.enumerate()
        if type(thread).__name__ != OF_ZMQ
    }
    for task in Path('/proc/self/task').iterdir():
        with suppress(OSError):  # it has ended
            name = (task / 'comm').read_text().strip()
            if name.startswith('dds.') and name not in OF_PROCESS:
                sentences[f'native {name} {task.name}'] = f'The thread {name} still runs.'
    return sentences


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
        return any(ancestor.pid in open_now for ancestor in (process, *process.parents()))
    return False


def processes_that_stay(processes: list[psutil.Process], timeout_s: float) -> dict[str, str]:
    """Return a sentence for each of the processes that does not end within a time."""
    deadline = time.monotonic() + timeout_s
    # Not `psutil.wait_procs`: the end of a child belongs to the process that started it.
    while processes and time.monotonic() < deadline:
        time.sleep(0.01)
        processes = [process for process in processes if process.is_running()]
    sentences = {}
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            kind = 'process'
            try:
                command = ' '.join(process.cmdline())[:100] or process.name()
            except psutil.ZombieProcess:
                kind, command = 'zombie', f'{process.name()} (nobody has waited for its end)'
            sentences[f'{kind} {process.pid}'] = f'The process {process.pid} still runs: {command}.'
    return sentences
