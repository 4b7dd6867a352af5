"""What a run of a notebook leaves behind: threads, processes, domain ids, shared memory, files.

Two looks, each where it can see. `left_in_process` runs inside the kernel, after its last cell.
`Watch` stands outside: it notes what the processes of one run hold while they live, and says what
is still there when they should be gone. Other people's processes are left alone: the processes of a
run carry its mark in their environment, and nothing else is looked at.
"""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import psutil

MARK = 'SOAK_RUN'  # the environment variable that all processes of a run inherit
SHARED_MEMORY = '/dev/shm/fastrtps_'
LOCK_FILES = ('_el', '_sl')  # of a segment or a port, locked while a process uses it
# Threads of Fast DDS that belong to no participant: they live until the process ends.
OF_PROCESS = ('dds.shm.wdog', 'dds.log')
OF_ZMQ = 'GarbageCollectorThread'  # frees what Jupyter has sent, from its first picture on
LOOK_EVERY_S = 0.1
MOMENT_S = 1.0
END_TIMEOUT_S = 10.0


# --- Inside the kernel ---------------------------------------------------------------------------


def state_of_process() -> dict:
    """Return what this process has: its threads, its children, its domain ids, its shared memory.

    Of the threads that C++ started, those of Fast DDS's participants. `domain_ids` maps each
    reserved id to the inode of the socket that reserves it.
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
    children = _that_stay(psutil.Process().children(recursive=True))
    return {
        'threads': threads,
        'children': {str(child.pid): name for child, name in _named(children)},
        'domain_ids': {str(domain_id): inode for domain_id, inode in _reserved_ids()},
        'shared_memory': sorted(_segments(os.getpid())),
    }


def left_in_process(before: dict, now: dict) -> list[str]:
    """Return a sentence for each thing that a process has now and had not when it started.

    One domain id is allowed: a kernel keeps its own until it ends.
    """
    new = {
        part: {key: name for key, name in now[part].items() if key not in before[part]}
        for part in ('threads', 'children')
    }
    found = [f'The thread {name} still runs.' for name in sorted(new['threads'].values())]
    found += [f'The process {pid} still runs: {name}.' for pid, name in new['children'].items()]
    if len(now['domain_ids']) > 1:
        found.append(f'The kernel holds {len(now["domain_ids"])} domain ids instead of one.')
    found += [f'The kernel still uses {name}.' for name in now['shared_memory']]
    return found


def _that_stay(processes: list[psutil.Process]) -> list[psutil.Process]:
    """Return the processes that do not end within a moment.

    Where /dev/shm cannot be written, LTTng, which rclpy is linked with, forks a child of a kernel
    every 5 s. It tries once more to write, and ends.
    """
    deadline = time.monotonic() + MOMENT_S
    while processes and time.monotonic() < deadline:
        time.sleep(MOMENT_S / 100)
        processes = [process for process in processes if process.is_running()]
    return processes


def _reserved_ids() -> Iterator[tuple[int, int]]:
    """Yield (domain id, inode) of each socket of this process that reserves an id."""
    from domain_coordinator.impl import PORT_BASE

    for number, target in _open_files(os.getpid()):
        if not target.startswith('socket:'):
            continue
        with suppress(OSError), socket.socket(fileno=os.dup(number)) as copy:
            if (copy.family, copy.type) != (socket.AF_INET, socket.SOCK_STREAM):
                continue
            port = copy.getsockname()[1]
            # Others may have got a port of this range from the system; they use theirs.
            used = copy.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN) or _connected(copy)
            if PORT_BASE <= port <= PORT_BASE + 101 and not used:
                yield port - PORT_BASE, os.fstat(number).st_ino


def _connected(connection: socket.socket) -> bool:
    try:
        connection.getpeername()
    except OSError:
        return False
    return True


# --- From outside --------------------------------------------------------------------------------


def processes_of(mark: str) -> list[psutil.Process]:
    """Return the living processes that carry this mark."""
    wanted = f'{MARK}={mark}'.encode()
    found = []
    for pid in psutil.pids():
        with suppress(OSError, psutil.Error):
            if wanted in Path(f'/proc/{pid}/environ').read_bytes().split(b'\0'):
                found.append(psutil.Process(pid))
    return found


def files_in(*folders: Path) -> dict[Path, tuple[int, int]]:
    """Return size and time of each file below these folders, without what is hidden or cached."""
    found = {}
    for top in folders:
        for folder, below, names in os.walk(top):
            below[:] = [name for name in below if name not in ('scratch', '__pycache__')]
            if folder == str(top):  # .git, .venv and the caches of the checkout
                below[:] = [name for name in below if not name.startswith('.')]
            for name in (*names, *below):
                with suppress(OSError):
                    status = os.lstat(os.path.join(folder, name))
                    size_and_time = (status.st_size, status.st_mtime_ns)
                    found[Path(folder, name)] = (0, 0) if name in below else size_and_time
    return found


class Watch:
    """Looks at the processes that carry a mark while its `with` block runs.

    `own` are folders of this run alone, empty at its start: whatever is in them at the end was
    left. `shared` are folders that were there before.
    """

    def __init__(self, mark: str, own: list[Path], shared: list[Path]) -> None:
        self.mark, self.own, self.shared = mark, own, shared
        self._held: set[File] = set()  # shared memory that a process of this run has used
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._watch, name=f'watch {mark}')

    def __enter__(self) -> Watch:
        self._before = files_in(*self.shared)
        # A participant also locks the ports of dead processes, to see whether it can have them.
        self._there = _files(map(str, Path(SHARED_MEMORY).parent.glob('fastrtps_*')))
        self._thread.start()
        return self

    def __exit__(self, *exception) -> None:
        self._end.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._end.wait(LOOK_EVERY_S):
            for segment in held_by(processes_of(self.mark)):
                self._held |= _files(files_of(segment))

    def left(self, domain_ids: dict[str, int], killed: set[str]) -> list[str]:
        """Return a sentence for each thing that is still there once the processes should be gone.

        `domain_ids` are those that the kernel had reserved, as in `state_of_process`. `killed` is
        the shared memory that a process held when it was killed: nobody can remove it then but
        another process, as `fastdds shm clean` does, so it is removed here and not reported.
        """
        deadline = time.monotonic() + END_TIMEOUT_S
        while True:
            found = self._processes_left(domain_ids)
            time.sleep(LOOK_EVERY_S)  # a process that has just ended closes its files last
            unused = [file for file in self._unused() if _segment(file) not in killed]
            found += [f'Shared memory is left: {file}.' for file in unused]
            if not found or time.monotonic() > deadline:
                break
        if found or killed:  # otherwise what is unused is about to be another run's
            for file in self._unused():
                Path(file).unlink(missing_ok=True)
        return found + [f'The file {file} is new or has changed.' for file in self._files_left()]

    def _processes_left(self, domain_ids: dict[str, int]) -> list[str]:
        found = [
            f'The process {process.pid} still runs: {name}.'
            for process, name in _named(processes_of(self.mark))
        ]
        for domain_id, inode in domain_ids.items():
            holders = [pid for pid in psutil.pids() if _holds_socket(pid, inode)]
            found += [f'The process {pid} still reserves domain id {domain_id}.' for pid in holders]
        return found

    def _unused(self) -> list[str]:
        """Return the files of shared memory that this run has used and nobody uses now.

        A port may be another run's in a moment: Fast DDS counts them through all domains.
        """
        left = self._held - self._there
        left &= _files(name for name, _ in left)  # of the same name, they may be another run's
        used = set().union(*map(_segments, psutil.pids())) if left else set()
        return sorted(name for name, _ in left if _segment(name) not in used)

    def _files_left(self) -> list[Path]:
        after = files_in(*self.shared)
        changed = {file for file, state in after.items() if self._before.get(file) != state}
        changed |= set(files_in(*self.own))
        # The workspaces are there when the checkout cannot hold them.
        scratch = f'ros2_notebooks_{os.getuid()}'
        changed = {file for file in changed if scratch not in file.parts}
        # Of a new folder, the folder is enough.
        return sorted(file for file in changed if file.parent not in changed)


File = tuple[str, int]  # its name, and its inode: another file of that name is not the same


def _files(names: Iterable[str]) -> set[File]:
    """Return those of these files that exist."""
    found = set()
    for name in names:
        with suppress(OSError):
            found.add((name, os.stat(name).st_ino))
    return found


def files_of(segment: str) -> list[str]:
    """Return the names of the files that a segment or port may have."""
    return [segment, *(segment + end for end in LOCK_FILES)]


def _segment(file: str) -> str:
    """Return the segment or port that a file belongs to."""
    return file[:-3] if file.endswith(LOCK_FILES) else file


def _segments(pid: int) -> set[str]:
    """Return the segments and ports of Fast DDS that a process has locked, which is: uses."""
    return {
        _segment(target)
        for number, target in _open_files(pid)
        if target.startswith(SHARED_MEMORY)
        and target.endswith(LOCK_FILES)
        and _has_locked(pid, number, target)
    }


def _has_locked(pid: int, number: int, file: str) -> bool:
    """Return whether a process has locked a file that it has open, and that is this one here.

    A participant opens the locks of other ports too, to see whether they are free. In another mount
    namespace, a file of the same name is another file.
    """
    with suppress(OSError):
        here = os.path.samestat(os.stat(f'/proc/{pid}/fd/{number}'), os.stat(file))
        return here and '\nlock:' in Path(f'/proc/{pid}/fdinfo/{number}').read_text()
    return False


def held_by(processes: list[psutil.Process]) -> set[str]:
    """Return the segments and ports of Fast DDS that these processes use."""
    return set().union(*(_segments(process.pid) for process in processes))


def _open_files(pid: int) -> Iterator[tuple[int, str]]:
    """Yield (number, target) of each file that a process has open; none of a process that ended."""
    with suppress(OSError):
        for number in os.listdir(f'/proc/{pid}/fd'):
            with suppress(OSError):
                yield int(number), os.readlink(f'/proc/{pid}/fd/{number}')


def _holds_socket(pid: int, inode: int) -> bool:
    return any(target == f'socket:[{inode}]' for _, target in _open_files(pid))


def _named(processes: list[psutil.Process]) -> Iterator[tuple[psutil.Process, str]]:
    """Yield each process with its command, shortened; not one that has ended meanwhile."""
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            try:
                name = ' '.join(process.cmdline())[:100] or process.name()
            except psutil.ZombieProcess:
                name = f'{process.name()} (a zombie: nobody has waited for its end)'
            yield process, name
