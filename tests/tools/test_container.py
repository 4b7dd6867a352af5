"""What tools/container/run.sh says where it cannot go on, with commands that stand for podman."""

import os
import shutil
import subprocess
import sys

import pytest
from support.processes import put

from tools.lessons.lesson import ROOT

USED = ('cat', 'chown', 'cksum', 'cut', 'dirname', 'find', 'grep', 'id', 'mkdir', 'mktemp', 'rm',
        'sh', 'sort', 'tee', 'tr', 'uname')  # fmt: skip


@pytest.fixture
def run(tmp_path):
    """Run the script where no other commands are. `podman` is what a stand-in does, in sh."""
    path = tmp_path / 'path'
    path.mkdir()
    for command in USED:
        (path / command).symlink_to(shutil.which(command))

    def run(what, podman=None, **variables):
        if podman is not None:
            put(path, 'podman', f'case $1 in version | --version) ;; {podman} esac')
        environment = {'PATH': str(path), 'LESSONS': str(tmp_path / 'lessons')} | variables
        return subprocess.run(
            [ROOT / 'tools/container/run.sh', what],
            env=environment,
            capture_output=True,
            text=True,
            timeout=60,
        )

    return run


# The words of podman 4.3, and after them those of docker 28.
FULL = 'write /var/tmp/buildah: no space left on device'
PORT = 'bind: address already in use', 'Bind for 127.0.0.1:8888 failed: port is already allocated'


@pytest.mark.parametrize('what', ['image', 'lab'])
def test_no_command(run, what):
    done = run(what)
    assert done.returncode == 1
    assert done.stderr.startswith('There is neither podman nor docker: install one')
    done = run(what, CONTAINER='nerdctl --namespace x')
    assert done.stderr.startswith('There is no command nerdctl')


def test_a_command_that_does_not_answer(run):
    done = run('image', CONTAINER=shutil.which('false'))
    assert done.returncode == 1
    assert done.stderr.startswith('false does not answer: start it')


def test_a_full_disk(run):
    done = run('image', f'build) echo "{FULL}" >&2; exit 125 ;;')
    assert done.returncode == 125
    assert FULL in done.stdout
    assert done.stderr.startswith('The disk is full: the image needs 5 GB while it is made.')


def test_another_failure_speaks_for_itself(run):
    done = run('image', 'build) echo "no such base" >&2; exit 125 ;;')
    assert (done.returncode, done.stdout, done.stderr) == (125, 'no such base\n', '')


@pytest.mark.parametrize(
    ('answer', 'problem'),
    [
        ('exit 125', 'There is no image yet'),
        ('echo 123-456', 'The image is not of these lessons'),
    ],
)
def test_no_image_of_these_lessons(run, answer, problem):
    done = run('lab', f'image) {answer} ;;')
    said = f'{problem}: run `make image`, then try again.\n'
    assert (done.returncode, done.stderr) == (1, said)


def label(run):
    """Return what the script writes onto an image that it builds."""
    done = run('image', 'build) echo "$*" ;;')
    assert done.returncode == 0, done.stderr
    return done.stdout.partition('--label lessons=')[2].split()[0]


@pytest.mark.parametrize('words', PORT)
def test_a_port_in_use(run, words):
    own = label(run)
    done = run('lab', f'image) echo {own} ;; run) echo "{words}" >&2; exit 126 ;;', PORT='8931')
    assert done.returncode == 126
    assert done.stderr.startswith('The port 8931 is already in use: choose another one')


def test_the_lessons_and_the_port_of_a_run(run, tmp_path):
    own = label(run)
    done = run('lab', f'image) echo {own} ;; run) echo "$*" ;;', PORT='8931')
    assert done.returncode == 0, done.stderr
    said = done.stdout
    assert '--publish 127.0.0.1:8931:8931' in said
    assert f'--volume {tmp_path / "lessons"}:/home/student' in said
    assert '--user 0:' not in said
    assert os.path.isdir(tmp_path / 'lessons')


@pytest.mark.skipif(os.geteuid() != 0, reason='a class in containers needs root')
def test_a_class_without_a_service():
    pytest.importorskip('docker', reason='`make test-hub` installs it')
    done = subprocess.run(
        [sys.executable, ROOT / 'tools/hub/service.py', 'label'],
        env=os.environ | {'DOCKER_HOST': 'unix:///nowhere'},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (
        1,
        '',
        'unix:///nowhere does not answer: start podman.socket or docker, then try again.\n',
    )
