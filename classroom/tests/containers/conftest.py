"""The image of the lessons, built once for all tests of `make test-containers`.

Its base is Debian from debootstrap, because a machine without a registry of images runs this, too.
If podman, debootstrap, the rights or the network cannot be had, this says so and is left out.
"""

import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import pytest
from support.checkouts import copy_checkout

from classroom.tests.support.containers import IMAGE, LIMITS, leave_out

SUITE = 'trixie'  # the base that the Containerfile names
CERTIFICATES = Path('/etc/ssl/certs/ca-certificates.crt')
ROOM = 6e9  # bytes on the disk, for base, image and layers
END_S = 30
# What apt, pip and uv say.
NO_NETWORK = ('Temporary failure', 'Could not connect', 'Failed to fetch', 'check the network')


@pytest.fixture(scope='session')
def folder():
    folder = Path(tempfile.mkdtemp(prefix='container-', dir='/var/tmp'))
    yield folder
    # Where podman has mounted its images. It may mount these once more, in the process that cleans
    # up after a container.
    limit = time.monotonic() + END_S
    while folder.exists() and time.monotonic() < limit:
        for line in reversed(Path('/proc/self/mounts').read_text().splitlines()):
            if line.split()[1].startswith(f'{folder}/'):
                subprocess.run(['umount', line.split()[1]], capture_output=True)
        shutil.rmtree(folder, ignore_errors=True)
    assert not folder.exists()


@pytest.fixture(scope='session')
def base(folder) -> Path:
    """Return an archive with the files of a Debian."""
    if os.geteuid():
        leave_out('only root can make its base')
    for command in ('podman', 'debootstrap'):
        if not shutil.which(command):
            leave_out(f'there is no {command}')
    if shutil.disk_usage(folder).free < ROOM:
        leave_out(f'{folder.parent} has less than {ROOM / 1e9:.0f} GB')
    files, archive = folder / 'base', folder / 'base.tar'
    done = subprocess.run(
        ['debootstrap', '--variant=minbase', SUITE, files], capture_output=True, text=True
    )
    if done.returncode:
        leave_out(f'debootstrap could not make its base ({done.stdout[-200:].strip()!r})')
    # The certificates of a network that inspects what passes, as pip is told outside.
    if CERTIFICATES.exists():
        copy = Path('/usr/local/share/ca-certificates/machine.crt')
        (files / copy.relative_to('/')).parent.mkdir(parents=True)
        shutil.copy(CERTIFICATES, files / copy.relative_to('/'))
        (files / 'etc/pip.conf').write_text(f'[global]\ncert = {copy}\n')
    for downloaded in (files / 'var/cache/apt/archives').glob('*.deb'):
        downloaded.unlink()
    subprocess.run(['tar', '--create', '--file', archive, '--directory', files, '.'], check=True)
    shutil.rmtree(files)
    return archive


@pytest.fixture(scope='session')
def podman(folder, base) -> list[str]:
    """Return podman with the options that work on this machine, and images of its own."""
    said = ''
    for driver in ('overlay', 'vfs'):
        for more in ([], ['--runtime', 'runc']):
            where = folder / driver
            podman = ['podman', f'--storage-driver={driver}', '--cgroup-manager=cgroupfs', *more]
            podman += ['--root', str(where / 'root'), '--runroot', str(where / 'run')]
            podman += ['--network-config-dir', str(where / 'networks')]
            steps = ['import', base, 'localhost/base'], ['run', '--rm', *LIMITS.split()]
            steps[1].extend(['localhost/base', 'true'])
            done = [subprocess.run([*podman, *s], capture_output=True, text=True) for s in steps]
            if not any(one.returncode for one in done):
                yield podman
                subprocess.run([*podman, 'rm', '--all', '--force'], capture_output=True)
                subprocess.run([*podman, 'rmi', '--all', '--force'], capture_output=True)
                return
            said = ' '.join(done[-1].stderr.split())[-200:]
    leave_out(f'podman cannot run a container here ({said!r})')


@pytest.fixture(scope='session')
def make(folder, podman):
    """Return `make` in a checkout of its own, with the files that git knows, and `make.image`."""
    checkout = folder / 'checkout'
    copy_checkout(checkout)

    def make(*arguments: str) -> subprocess.CompletedProcess:
        return subprocess.run(
            ['make', '--silent', f'CONTAINER={" ".join(podman)}', *arguments],
            cwd=checkout,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )

    def image() -> None:
        start = time.monotonic()
        done = make('image', 'BASE=localhost/base', f'IMAGE_ARGS={LIMITS}')
        if done.returncode and any(words in done.stdout for words in NO_NETWORK):
            leave_out('its network does not reach a package index')
        assert not done.returncode, done.stdout[-3000:]
        print(f'\nbuilt in {time.monotonic() - start:.0f} s')

    make.checkout, make.image = checkout, image
    return make


@pytest.fixture(scope='session')
def image(make, podman):
    make.image()
    command = [*podman, 'image', 'inspect', IMAGE]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)[0]
