"""The domain id of this process, its discovery range, and its turn in shared memory."""

from __future__ import annotations

import atexit
import contextlib
import fcntl
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path

from helpers.ros.session_record import recorded

SHARED_MEMORY = '/dev/shm'
DOMAIN_IDS = range(1, 101)  # those of domain_coordinator
# portBase and domainIDGain of Fast DDS (class PortParameters): the ports of domain 1 begin at 7650.
FIRST_PORT, PORTS_PER_DOMAIN = 7400, 250
MARK_ADDRESS = '127.0.0.2'  # of this machine; no connection comes from it
TURN_TIMEOUT_S = 5.0
YOUNG_S = 0.2  # a lock of a process that is just about to take it
POLL_S = 0.01
ANNOUNCEMENTS = Path(__file__).with_name('announcements.xml')

_reserved = contextlib.ExitStack()
atexit.register(_reserved.close)
_domain_id: int | None = None
_timed_out = False  # the last wait for a turn timed out


def reserve_domain_id() -> int:
    """Return a domain id (1 to 100) that belongs to this process until it ends.

    Raises RuntimeError if all of them are taken.
    """
    global _domain_id
    if _domain_id is None:
        _domain_id = _reserve()
        # For the ros2 command, which looks where this user's kernels are.
        _reserved.enter_context(recorded(domain_variables(_domain_id, 'LOCALHOST'), 'reserved'))
    return _domain_id


def change_domain_id() -> None:
    """Let `reserve_domain_id` return another id from now on, also in a copy of a kernel.

    The kernel and its terminals keep theirs, so neither hears the other. Open no session before.
    Raises RuntimeError if all ids are taken.
    """
    global _domain_id
    _domain_id = _reserve()  # and no record: no terminal shall join it


def _reserve() -> int:
    from domain_coordinator import domain_id

    # What nobody has reserved may be in use all the same: by a program whose kernel was killed, or
    # by one of a terminal. Its nodes would be in the graph of this process: such an id comes last.
    spoken_in = _spoken_in()
    in_order = sorted(DOMAIN_IDS, key=lambda number: number in spoken_in)
    try:
        return _reserved.enter_context(domain_id(iter(in_order).__next__))
    except RuntimeError as error:
        raise RuntimeError(
            'All 100 ROS domain ids of this machine are in use: '
            'shut down the kernels that you no longer need, then run this cell again.'
        ) from error


def _spoken_in() -> set[int]:
    """Return the domain ids in which a participant of this machine has a port."""
    ports = []
    for table in ('/proc/net/udp', '/proc/net/udp6'):
        with contextlib.suppress(OSError):
            # The second word of each line is the local address and port, in hexadecimal.
            lines = Path(table).read_text().splitlines()[1:]
            ports += [int(line.split()[1].rpartition(':')[2], 16) for line in lines]
    return {(port - FIRST_PORT) // PORTS_PER_DOMAIN for port in ports}


@contextlib.contextmanager
def share_domain_id(domain_id: int) -> Iterator[None]:
    """Keep `reserve_domain_id` of all processes away from this id, which several may share.

    Raises ValueError if a process has reserved it for itself.
    """
    from domain_coordinator.impl import PORT_BASE

    # The coordinator holds the port of an id without this option. Two sockets can share a port
    # only if both have it, or have other addresses: a connection may have the port by chance.
    with socket.socket() as mark:
        mark.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            mark.bind((MARK_ADDRESS, PORT_BASE + domain_id))
        except OSError:
            raise ValueError(
                f'Domain {domain_id} is reserved on this machine: agree on another one. '
                'No kernel reserves 0 and 101.'
            ) from None
        yield


def check_domain(domain_id: int | None, discovery: str) -> None:
    """Raise ValueError if a session cannot use this domain and this range."""
    whole = isinstance(domain_id, int) and not isinstance(domain_id, bool)
    if domain_id is not None and not (whole and 0 <= domain_id <= 101):
        raise ValueError(f'domain_id must be a whole number from 0 to 101, not {domain_id!r}.')
    if discovery not in ('LOCALHOST', 'SUBNET'):
        raise ValueError(f"discovery must be 'LOCALHOST' or 'SUBNET', not {discovery!r}.")
    if discovery == 'SUBNET' and domain_id is None:
        raise ValueError(
            "discovery='SUBNET' needs the domain id that the other machines use, for example "
            "ros_session(domain_id=42, discovery='SUBNET')."
        )


def configure_discovery(discovery: str) -> None:
    """Let the nodes of this process be discovered on this machine only, or in its network.

    With 'SUBNET', ROS_STATIC_PEERS stays what it is.
    """
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = discovery
    # Both would widen or replace the range.
    os.environ.pop('ROS_LOCALHOST_ONLY', None)
    if discovery == 'LOCALHOST':
        os.environ.pop('ROS_STATIC_PEERS', None)
    announce_often()


def announce_often() -> None:
    """Let participants of this process say every 0.5 s who they are. Fast DDS does so every 3 s.

    A participant of Fast DDS 2.14 announces itself before its threads take what comes
    (RTPSParticipantImpl::enable). So a program that starts after this process may miss our answer,
    and discovers us only when we say again who we are. A file of the user's own stays in force.
    """
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(ANNOUNCEMENTS))


def domain_variables(domain_id: int, discovery: str) -> dict[str, str]:
    """Return the variables with which another process hears this one."""
    variables = {'ROS_DOMAIN_ID': str(domain_id), 'ROS_AUTOMATIC_DISCOVERY_RANGE': discovery}
    if discovery == 'SUBNET' and 'ROS_STATIC_PEERS' in os.environ:
        variables['ROS_STATIC_PEERS'] = os.environ['ROS_STATIC_PEERS']
    return variables


def remove_dead_segments() -> None:
    """Remove what killed processes have left in shared memory, as `fastdds shm clean` does.

    Fast DDS holds a lock on a file beside each segment and each port, as long as its owner lives.
    A port that only writers have opened has no such file: if they are killed, it stays.
    """
    with one_process_at_a_time():  # none of ours is just making one, but a student's program may
        for lock in Path(SHARED_MEMORY).glob('fastrtps_*_[es]l'):
            with contextlib.suppress(OSError), lock.open('rb') as file:
                if time.time() - os.fstat(file.fileno()).st_mtime < YOUNG_S:
                    continue
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                name = lock.name[:-3]
                for left in (lock.name, name, f'sem.{name}_mutex'):
                    Path(SHARED_MEMORY, left).unlink(missing_ok=True)


@contextlib.contextmanager
def one_process_at_a_time() -> Iterator[None]:
    """Wait for the turn of this process to make or to end a participant.

    Fast DDS counts some ports in shared memory through all domains. It reports an error, in the
    middle of a cell, if one process wants the number that another one is just giving back, and
    takes the next number. After `TURN_TIMEOUT_S` the process goes on without a turn: the error is
    better than to wait for a process that was stopped. From then on it does not wait, until it gets
    a turn.
    """
    global _timed_out
    try:
        folder = os.open(SHARED_MEMORY, os.O_RDONLY)
    except OSError:  # no shared memory, no such port
        yield
        return
    try:
        deadline = time.monotonic() + (0.0 if _timed_out else TURN_TIMEOUT_S)
        while True:
            with contextlib.suppress(BlockingIOError):
                fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
                _timed_out = False
                break
            if time.monotonic() >= deadline:
                _timed_out = True
                break
            time.sleep(POLL_S)
        yield
    finally:
        # A child that was forked meanwhile has the folder open, too: closing would not unlock it.
        fcntl.flock(folder, fcntl.LOCK_UN)
        os.close(folder)
