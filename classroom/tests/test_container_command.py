"""What container/run.sh says if it cannot go on, with commands that stand for podman."""

import shutil
import subprocess

import pytest
from support.processes import put

from helpers.lesson import ROOT

USED = ('chown', 'cksum', 'cut', 'dirname', 'find', 'id', 'mkdir', 'sh', 'sort', 'tr', 'uname')


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
            [ROOT / 'classroom/container/run.sh', what],
            env=environment,
            capture_output=True,
            text=True,
            timeout=60,
        )

    return run


@pytest.mark.parametrize('what', ['image', 'lab'])
def test_no_command(run, what):
    done = run(what)
    assert done.returncode == 1
    assert done.stderr.startswith('There is neither podman nor docker: install one')
    done = run(what, CONTAINER='nerdctl --namespace x')
    assert done.stderr.startswith('There is no command nerdctl')


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
