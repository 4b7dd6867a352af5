"""What container/run.sh says if it cannot go on, with commands that stand for podman."""

import shutil
import subprocess

import pytest
from support.processes import put

from classroom.grade import limits
from helpers.lesson import ROOT

USED = (
    'chown',
    'cksum',
    'cut',
    'dirname',
    'echo',
    'find',
    'id',
    'mkdir',
    'sh',
    'sort',
    'tr',
    'uname',
)


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
            [ROOT / 'classroom/container/run.sh', *what.split()],
            env=environment,
            capture_output=True,
            text=True,
            timeout=60,
        )

    return run


def label(folder):
    command = [folder / 'classroom/container/run.sh', 'label']
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_a_label_changes_with_all_that_an_image_gets(tmp_path):
    ignored = (ROOT / '.dockerignore').read_text(encoding='utf-8').splitlines()
    inside = [line[1:] for line in ignored if line.startswith('!')]
    script = 'classroom/container/run.sh'
    for name in [*inside, script]:
        if (ROOT / name).is_dir():
            (tmp_path / name).mkdir(parents=True)
            (tmp_path / name / 'a_file').touch()
        else:
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tmp_path / name)
    before = label(tmp_path)
    for name in inside:
        changed = tmp_path / name
        changed = changed / 'a_file' if changed.is_dir() else changed
        changed.write_text('changed')
        assert (after := label(tmp_path)) != before, name
        before = after
    (tmp_path / 'ros2/tests').mkdir()
    (tmp_path / 'ros2/tests/a_test.py').touch()
    assert label(tmp_path) == before


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


def test_a_container_that_cannot_run_is_said_once_before_students_are_judged(run):
    lessons = run('label').stdout.strip()
    image = f'image) echo {lessons} ;;'
    done = run('ready', f'{image} run) echo "error setting rlimit type 7" >&2; exit 126 ;;')
    assert done.returncode == 1
    said = 'No container can run here (error setting rlimit type 7): RUN_ARGS= adds options.'
    assert done.stderr.strip() == said
    done = run('ready', f'{image} run) case $* in *--network\\ none*true) ;; *) exit 9 ;; esac ;;')
    assert (done.returncode, done.stderr) == (0, '')


@pytest.mark.parametrize('cpus', ['', '0.5'])
def test_the_limits_are_those_of_which_the_table_speaks(run, cpus):
    said = run('judge a_name', 'run) echo "$@" ;;', CPUS=cpus).stdout
    for limit in (
        f'--cpus {cpus or int(limits.CPUS)} ',
        f'--memory {limits.ALL_GB}g --memory-swap {limits.ALL_GB}g',
        f'--pids-limit {limits.PROGRAMS}',
        f'--tmpfs /tmp:rw,exec,nosuid,nodev,size={limits.FILES_GB}g,',
        f'--shm-size={limits.SHM_MB}m',
    ):
        assert limit in said


@pytest.mark.parametrize(
    ('answer', 'is_limited'),
    [
        ('false [cpu memory pids]', True),
        ('true [cpu memory pids]', True),
        ('true [memory pids]', False),  # systemd does not let it
        ('', True),  # docker has no such answer
    ],
)
def test_podman_without_root_limits_the_cores_if_it_may(run, answer, is_limited):
    said = run('judge a_name', f'info) echo "{answer}" ;; run) echo "$@" ;;').stdout
    assert ('--cpus' in said) == is_limited
    assert '--memory' in said
