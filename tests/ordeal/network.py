"""Two computers on one: two network namespaces with a cable between them, which can be cut.

Both are without a name, and end with the processes in them: nothing of the machine is changed.
"""

from __future__ import annotations

import ctypes
import subprocess

NEWNET = 0x40000000  # CLONE_NEWNET
PLUG = 'ip link add name cable type veth peer name'
GROUPS = 'ip route add 224.0.0.0/4 dev cable'  # discovery speaks to groups


def possible() -> str:
    """Return why two networks cannot be made here, or an empty text."""
    try:
        _run(f'unshare --net {PLUG} other')
    except OSError as error:
        return str(error)
    return ''


class Network:
    """Moves this process into a network of its own, and makes a second one for programs.

    To be made before rclpy is initialised, in a process that ends after its use. Raises OSError
    if this is not allowed: it takes root.
    """

    def __init__(self) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.unshare(NEWNET):
            raise OSError(ctypes.get_errno(), 'No network of its own: it takes root.')
        command = ['unshare', '--net', 'sh', '-c', 'echo; exec sleep 1000']
        self._other = subprocess.Popen(command, stdout=subprocess.PIPE)
        self._other.stdout.readline()
        self._enter = f'nsenter --net --target {self._other.pid} '
        _run(f'{PLUG} cable netns {self._other.pid}')
        for where, address in (('', '10.87.0.1/24'), (self._enter, '10.87.0.2/24')):
            _run(f'{where}ip link set lo up')
            _run(f'{where}ip link set cable up')
            _run(f'{where}ip address add {address} dev cable')
            _run(f'{where}{GROUPS}')

    def inside(self, command: list[str]) -> list[str]:
        """Return a command that runs another one on the second computer."""
        return [*self._enter.split(), *command]

    def cut(self) -> None:
        """Cut the cable."""
        _run('ip link set cable down')

    def mend(self) -> None:
        """Mend the cable. Its end here has lost its route."""
        _run('ip link set cable up')
        _run(GROUPS)

    def close(self) -> None:
        """End the second computer. The first one ends with this process."""
        self._other.kill()
        self._other.wait()


def _run(command: str) -> None:
    answer = subprocess.run(command.split(), capture_output=True, text=True)
    if answer.returncode:
        raise OSError(f'{command}: {answer.stderr.strip()}')
