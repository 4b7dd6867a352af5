"""What a run of a notebook leaves behind: threads, processes, domain ids, shared memory, files.

A kernel is looked at from inside, after a cell. When it has ended, the run as a whole is looked at:
it has a /dev/shm, a home and a temporary folder of its own, and adopts the processes that it has
started, so that whatever is there was left.
"""

from __future__ import annotations

import ctypes
import os
import re
import socket
import subprocess
import threading
import time
from contextlib import suppress
from pathlib import Path

import psutil

SHARED_MEMORY = re.compile(r'/dev/shm/fastrtps_\w+')
# Threads of Fast DDS that belong to no participant: they live until the process ends.
OF_PROCESS = ('dds.shm.wdog', 'dds.log')
OF_ZMQ = 'GarbageCollectorThread'  # frees what Jupyter has sent, from its first picture on
MOMENT_S = 1.0
END_TIMEOUT_S = 10.0
PR_SET_CHILD_SUBREAPER = 36  # of linux/prctl.h


# --- Inside the kernel ---------------------------------------------------------------------------


def state_of_process() -> dict:
    """Return what this process has: threads, children, shared memory, and the domain ids' number.

    Of the threads that C++ started, those of Fast DDS's participants.
    """
    threads = {
        str(thread.ident): f'{thread.name} ({type(thread).__name__})'
        for thread in threading.enumerate()
        if type(thread).__name__ != OF_ZMQ
    }
    for task in Path('/proc/self/task').iterdir():
        with suppress(OSError):  # it has ended
            name = (task / 'comm').read_text().strip()
            if name.startswith('dds.') and name not in OF_PROCESS:
                threads[f'native {task.name}'] = name
    return {
        'threads': threads,
        # Where /dev/shm cannot be written, LTTng, which rclpy is linked with, forks a child of a
        # kernel every 5 s. It tries once more to write, and ends.
        'children': processes_that_stay(MOMENT_S),
        'shared_memory': sorted(set(SHARED_MEMORY.findall(Path('/proc/self/maps').read_text()))),
        'domain_ids': sum(map(_reserves_an_id, Path('/proc/self/fd').iterdir())),
    }


def left_in_process(before: dict, now: dict) -> list[str]:
    """Return a sentence for each thing that a process has now and had not when it started.

    One domain id is allowed: a kernel keeps its own until it ends.
    """
    new = now['threads'].keys() - before['threads'].keys()
    found = [f'The thread {now["threads"][key]} still runs.' for key in sorted(new)]
    new = now['children'].keys() - before['children'].keys()
    found += [f'The process {pid} still runs: {now["children"][pid]}.' for pid in sorted(new)]
    if now['domain_ids'] > 1:
        found.append(f'The kernel holds {now["domain_ids"]} domain ids instead of one.')
    return found + [f'The kernel still uses {name}.' for name in now['shared_memory']]


def processes_that_stay(timeout_s: float) -> dict[str, str]:
    """Return pid and command of the children of this process that do not end within a time."""
    deadline = time.monotonic() + timeout_s
    children = psutil.Process().children(recursive=True)
    while children and time.monotonic() < deadline:
        time.sleep(0.01)
        children = [child for child in children if child.is_running()]
    found = {}
    for child in children:
        with suppress(psutil.NoSuchProcess):
            try:
                found[str(child.pid)] = ' '.join(child.cmdline())[:100] or child.name()
            except psutil.ZombieProcess:
                found[str(child.pid)] = f'{child.name()} (nobody has waited for its end)'
    return found


def _reserves_an_id(file: Path) -> bool:
    """Return whether an open file of this process is a socket that reserves a domain id."""
    from domain_coordinator.impl import PORT_BASE

    with suppress(OSError):
        if not os.readlink(file).startswith('socket:'):
            return False
    with suppress(OSError), socket.socket(fileno=os.dup(int(file.name))) as copy:
        if (copy.family, copy.type) != (socket.AF_INET, socket.SOCK_STREAM):
            return False
        # Others may have got a port of this range from the system; they use theirs.
        used = copy.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN) or _connected(copy)
        return PORT_BASE <= copy.getsockname()[1] <= PORT_BASE + 101 and not used
    return False


def _connected(connection: socket.socket) -> bool:
    with suppress(OSError):
        connection.getpeername()
        return True
    return False


# --- After the run -------------------------------------------------------------------------------


def adopt_orphans() -> None:
    """Become the parent of each process whose parent ends, below this process."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def shared_memory() -> set[str]:
    """Return the files of Fast DDS in the /dev/shm that this process sees."""
    return {str(file) for file in Path('/dev/shm').glob('fastrtps_*')}


def left_by_processes(killed_held: set[str]) -> list[str]:
    """Return a sentence for each process and each shared memory that a run has left.

    `killed_held` is what was there when a kernel was killed: nobody could remove it.
    """
    deadline = time.monotonic() + END_TIMEOUT_S
    while psutil.Process().children(recursive=True) and time.monotonic() < deadline:
        with suppress(ChildProcessError):  # an adopted one that has ended waits for us
            os.waitpid(-1, os.WNOHANG)
        time.sleep(0.01)
    found = [f'The process {pid} still runs: {it}.' for pid, it in processes_that_stay(0).items()]
    left = shared_memory() - killed_held
    return found + [f'Shared memory is left: {file}.' for file in sorted(left)]


def files_of(checkout: Path, *own: Path) -> set[tuple[str, int]]:
    """Return name and time of the files in a run's own folders, and of what git sees as changed.

    Without the workspaces of the lessons, which are in the temporary folder where the checkout
    cannot hold them.
    """
    git = ['git', '-C', checkout, 'ls-files', '-z', '--modified', '--others', '--exclude-standard']
    names = subprocess.run(git, stdout=subprocess.PIPE, text=True, check=True).stdout.split('\0')
    files = [checkout / name for name in names if name]
    files += [file for folder in own for file in folder.rglob('*')]
    found = set()
    for file in files:
        with suppress(OSError):  # it is gone
            if not file.is_dir() and not any('ros2_notebooks_' in part for part in file.parts):
                found.add((str(file), file.lstat().st_mtime_ns))
    return found
