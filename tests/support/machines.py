"""Machines that are network namespaces, joined by a veth pair, each with its own shared memory.

They are gone when the processes in them are.
"""

import contextlib
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator

import pytest

from support.waits import START_LIMIT_S, wait_for

ADDRESSES = ('192.0.2.1', '192.0.2.2')  # reserved for documentation: nobody's


class Machine:
    """A machine that is a few namespaces, held by a process that ends with this one."""

    def __init__(self, stack: contextlib.ExitStack, inside: str = '') -> None:
        own = ['--net', '--mount', '--ipc', '--fork']
        user = ['--user', '--map-root-user'] if os.getuid() and not inside else []
        # `read` ends when this process does.
        hold = 'mount -t tmpfs shm /dev/shm && ip link set lo up && echo $$ && read line'
        self._process = subprocess.Popen(
            [*inside.split(), 'unshare', *user, *own, 'sh', '-c', hold],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        stack.callback(self._end)
        self.pid = self._process.stdout.readline().strip()
        if not self.pid:
            pytest.skip(f'no namespaces here: {self._process.stderr.read().strip()}')
        target = f'nsenter --target {self.pid}'
        self.user = f'{target} --user --preserve-credentials' if os.getuid() else ''
        self._enter = f'{self.user or target} --net --mount --ipc'.split()

    def _end(self) -> None:
        self._process.communicate()  # ends its input, as the kernel does when this one is killed

    def run(self, command: str) -> str:
        answer = subprocess.run(
            [*self._enter, *shlex.split(command)], capture_output=True, text=True
        )
        if answer.returncode:
            pytest.skip(f'no network between namespaces here: {answer.stderr.strip()}')
        return answer.stdout

    def wait_for_cable(self) -> None:
        """Fast DDS knows the interfaces that are up when a participant starts, no later ones."""
        show = 'ip -brief link show eth0'
        wait_for(lambda: ' UP ' in self.run(show), timeout_s=START_LIMIT_S)

    @contextlib.contextmanager
    def firewall(self, policy: str, rule: str) -> Iterator[None]:
        """Let a rule of nftables decide which packets from outside come in."""
        if not shutil.which('nft'):
            pytest.skip('nft not found: install nftables')
        chain = f'type filter hook input priority 0 ; policy {policy} ;'
        self.run('nft add table inet test')
        self.run(f"nft 'add chain inet test input {{ {chain} }}'")
        self.run('nft add rule inet test input iif lo accept')
        self.run(f'nft add rule inet test input {rule}')
        try:
            yield
        finally:
            self.run('nft delete table inet test')

    def start(self, script: str, *arguments: object, **environment: str) -> subprocess.Popen:
        """Start a Python script, whose end of input says that this process has ended."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(('ROS_', 'RMW_'))}
        return subprocess.Popen(
            [*self._enter, sys.executable, '-c', script, *map(str, arguments)],
            env=kept | environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )


@contextlib.contextmanager
def two_machines() -> Iterator[list[Machine]]:
    """Yield two machines on one cable, with ADDRESSES."""
    missing = [name for name in ('unshare', 'nsenter', 'ip') if not shutil.which(name)]
    if missing:
        pytest.skip(f'{" and ".join(missing)} not found: install util-linux and iproute2')
    with contextlib.ExitStack() as stack:
        one = Machine(stack)
        two = Machine(stack, inside=one.user)
        one.run(f'ip link add eth0 type veth peer name eth0 netns {two.pid}')
        for machine, address in zip((one, two), ADDRESSES, strict=True):
            machine.run(f'ip address add {address}/24 dev eth0')
            machine.run('ip link set eth0 up')
        one.wait_for_cable()
        two.wait_for_cable()
        yield [one, two]


@contextlib.contextmanager
def ended(*processes: subprocess.Popen) -> Iterator[None]:
    """End the processes at the end of the block, whatever happened in it."""
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.communicate()
