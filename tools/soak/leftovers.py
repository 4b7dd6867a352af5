"""What a run of a notebook leaves behind: threads, processes, shared memory.

`look` looks at a kernel from inside, and lets it note where a cell hangs. When all kernels have
ended, this module as a program looks at the run: it has a /dev/shm and a table of processes of its
own, so that whatever is there was left.
"""

import faulthandler
import os
import re
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
# Fast DDS's watchdog lets go of the memory of another process up to a second after the participant
# has ended. Where /dev/shm cannot be written, LTTng, which rclpy is linked with, forks a child of a
# kernel every 5 s, which tries to write once more, and ends. LTTng waits for any child: where that
# was another one, its own is a zombie until the next round.
ENDS_LATER = re.compile(rf'{SHARED_MEMORY.pattern}|zombie \d+')
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
        _note_where_cells_hang(float(os.environ['SOAK_SLOW_S']), os.environ['SOAK_STACKS'])
    left = now.keys() - _before.keys()
    while left and all(map(ENDS_LATER.fullmatch, left)) and time.monotonic() < deadline:
        time.sleep(0.01)
        left &= state_of_process().keys()
    assert not left, ' '.join(now[key] for key in sorted(left))


def _note_where_cells_hang(slow_s: float, file: str) -> None:
    """Write the stack of each thread to a file when a cell takes longer than some seconds."""
    from IPython import get_ipython

    stacks = open(file, 'a')  # noqa: SIM115, it is for the kernel's life
    events = get_ipython().events
    # C does it: also where the cell holds the GIL, or waits for it.
    events.register(
        'pre_run_cell', lambda info: faulthandler.dump_traceback_later(slow_s, file=stacks)
    )
    events.register('post_run_cell', lambda result: faulthandler.cancel_dump_traceback_later())


def state_of_process() -> dict[str, str]:
    """Return a sentence for each thread, child and shared memory, by a key of its own."""
    children = [child for child in psutil.Process().children(recursive=True) if not _of_pool(child)]
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


def processes_that_stay(processes: list[psutil.Process], timeout_s: float) -> dict[str, str]:
    """Return a sentence for each of the processes that does not end within a time."""
    deadline = time.monotonic() + timeout_s
    # Not `psutil.wait_procs`: the end of a child belongs to who has started it.
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
        # Where there is no room for a segment, Fast DDS leaves its empty file.
        if file.stat().st_size:
            print(f'Shared memory is left: {file}.')
