"""The image of the lessons, built and used: `make test-container`.

Its base is Debian from debootstrap, because a machine without a registry of images runs this, too.
Where podman, debootstrap, the rights or the network cannot be had, this says so and is left out.
"""

import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SUITE = 'trixie'  # the base that the Containerfile names
IMAGE = 'localhost/ros2_notebooks'
LIMITS = '--ulimit nofile=1024:1024 --ulimit nproc=1000:1000'
CERTIFICATES = Path('/etc/ssl/certs/ca-certificates.crt')
# One that loses messages and one that compiles. The others were tried by hand: environment.md.
LESSONS = ['lose_messages', 'use_a_message_in_your_own_interface']
START_S = 180
ROOM = 6e9  # bytes on the disk, for base, image and layers
# What apt, pip and uv say.
NO_NETWORK = ('Temporary failure', 'Could not connect', 'Failed to fetch', 'check the network')


def leave_out(why: str) -> None:
    pytest.skip(f'LEFT OUT: the container, because {why}.')


def output_of(*command: object) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.fixture(scope='module')
def folder():
    folder = Path(tempfile.mkdtemp(prefix='container-', dir='/var/tmp'))
    yield folder
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope='module')
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


@pytest.fixture(scope='module')
def podman(folder, base) -> list[str]:
    """Return podman with the options that work on this machine, and images of its own."""
    said = ''
    for driver in ('overlay', 'vfs'):
        for more in ([], ['--runtime', 'runc']):
            where = folder / driver
            podman = ['podman', f'--storage-driver={driver}', '--cgroup-manager=cgroupfs', *more]
            podman += ['--root', str(where / 'root'), '--runroot', str(where / 'run')]
            steps = ['import', base, 'localhost/base'], ['run', '--rm', *LIMITS.split()]
            steps[1].extend(['localhost/base', 'true'])
            done = [subprocess.run([*podman, *s], capture_output=True, text=True) for s in steps]
            if not any(one.returncode for one in done):
                yield podman
                subprocess.run([*podman, 'rm', '--all', '--force'], capture_output=True)
                subprocess.run([*podman, 'rmi', '--all', '--force'], capture_output=True)
                # Where podman has mounted its images.
                subprocess.run(['umount', where / 'root' / driver], capture_output=True)
                return
            said = ' '.join(done[-1].stderr.split())[-200:]
    leave_out(f'podman cannot run a container here ({said!r})')


@pytest.fixture(scope='module')
def make(folder, podman):
    """Return `make` in a checkout of its own, with the files that git knows."""
    checkout = folder / 'checkout'
    files = output_of('git', '-C', ROOT, 'ls-files', '-z', '--cached', '--others',
                      '--exclude-standard').split('\0')  # fmt: skip
    for name in filter(None, files):
        if (ROOT / name).exists():
            (checkout / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, checkout / name, follow_symlinks=False)

    def make(*arguments: str) -> subprocess.CompletedProcess:
        return subprocess.run(
            ['make', '--silent', f'CONTAINER={" ".join(podman)}', *arguments],
            cwd=checkout,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )

    make.checkout = checkout
    return make


@pytest.fixture(scope='module')
def image(make, podman):
    start = time.monotonic()
    done = make('image', 'BASE=localhost/base', f'IMAGE_ARGS={LIMITS}')
    if done.returncode and any(words in done.stdout for words in NO_NETWORK):
        leave_out('its network does not reach a package index')
    assert not done.returncode, done.stdout[-3000:]
    print(f'\nbuilt in {time.monotonic() - start:.0f} s')
    return json.loads(output_of(*podman, 'image', 'inspect', IMAGE))[0]


@pytest.fixture(scope='module')
def port() -> int:
    with socket.socket() as one:
        one.bind(('127.0.0.1', 0))
        return one.getsockname()[1]


@pytest.fixture
def lab(make, podman, image, folder, port):
    """Start the lessons as a student does, and wait for the server. Return the student's folder."""
    mine = folder / 'mine'

    def lab() -> Path:
        command = ['make', '--silent', 'lab-container', f'CONTAINER={" ".join(podman)}']
        command += [f'PORT={port}', f'LESSONS={mine}', f'RUN_ARGS={LIMITS} --name lab']
        server = subprocess.Popen(command, cwd=make.checkout, stdout=log, stderr=log)
        start = time.monotonic()
        while time.monotonic() < start + START_S and server.poll() is None:
            try:
                urllib.request.urlopen(f'http://127.0.0.1:{port}/api', timeout=5).close()
            except (OSError, urllib.error.URLError):
                time.sleep(0.2)
            else:
                print(f'\nanswers after {time.monotonic() - start:.1f} s')
                return mine
        raise AssertionError((folder / 'log').read_text())

    with (folder / 'log').open('w') as log:
        yield lab
    subprocess.run([*podman, 'rm', '--force', 'lab'], capture_output=True)


def test_size_and_user(image):
    print(f'\n{image["Size"] / 1e9:.2f} GB')
    assert image['Size'] <= 1.6e9
    assert image['Config']['User'] == '1000'
    assert '8888/tcp' in image['Config']['ExposedPorts']


def test_lessons(podman, image, make):
    """Run lessons with the image's packages, and compare their outputs with the saved ones."""
    notebooks = [next(make.checkout.glob(f'notebooks/??_{name}.ipynb')).name for name in LESSONS]
    # The user of the image is not root, and lessons write beside themselves.
    checkout = shutil.copytree(make.checkout, make.checkout.with_name('lessons'), symlinks=True)
    subprocess.run(['chmod', '-R', 'a+rwX', checkout], check=True)
    checkout.parent.chmod(0o755)
    done = subprocess.run(
        [*podman, 'run', '--rm', *LIMITS.split(), '--shm-size=256m']
        + ['--volume', f'{checkout}:/checkout', '--workdir', '/checkout', IMAGE]
        + ['python', '-m', 'pytest', '-p', 'no:cacheprovider', '-n', '2', '--dist', 'loadscope']
        + [f'notebooks/{name}' for name in notebooks],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert not done.returncode, done.stdout[-5000:]
    assert ' passed' in done.stdout


def test_a_new_version_keeps_what_was_written(lab, make, podman, port):
    mine = lab()
    assert not subprocess.run([*podman, 'healthcheck', 'run', 'lab']).returncode
    # The port is the student's machine's only, and another container cannot have it.
    done = make('lab-container', f'PORT={port}', f'RUN_ARGS={LIMITS}', f'LESSONS={mine}-2')
    assert f'The port {port} is already in use' in done.stdout
    subprocess.run([*podman, 'stop', 'lab'], capture_output=True, check=True)

    name = next(make.checkout.glob(f'notebooks/??_{LESSONS[0]}.ipynb')).name
    written, newer = mine / 'ros2_notebooks' / name, make.checkout / 'notebooks' / name
    for path, words in (written, 'I have written this.'), (newer, 'This is newer.'):
        notebook = json.loads(path.read_text())
        at = 1 if path == written else 2
        cell = {'cell_type': 'markdown', 'id': f'c{at}', 'metadata': {}, 'source': words}
        notebook['cells'].insert(at, cell)
        path.write_text(json.dumps(notebook))

    done = make('lab-container', f'PORT={port}', f'RUN_ARGS={LIMITS}', f'LESSONS={mine}')
    assert 'The image is not of these lessons: run `make image`, then try again.' in done.stdout
    start = time.monotonic()
    done = make('image', 'BASE=localhost/base', f'IMAGE_ARGS={LIMITS}')
    assert not done.returncode, done.stdout[-3000:]
    print(f'\nnewer lessons in {time.monotonic() - start:.0f} s')
    lab()
    text = written.read_text()
    assert 'I have written this.' in text
    assert 'This is newer.' in text
