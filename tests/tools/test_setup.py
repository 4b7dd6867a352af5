"""The set-up, on a lock of two packages that lie in a folder, and what the real locks must hold."""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from support.processes import put

from helpers.lesson import ROOT, path_of
from helpers.machine import OWNED

LOCKS = Path('tools/locks')
BASE_PYTHON = Path(sys._base_executable)
HERE = f'{sys.version_info.major}.{sys.version_info.minor}'
COMMANDS = 'cat cksum cp df dirname env flock getconf grep head mkdir mv rm sed sh sort tr uname wc'


def test_the_locks_name_no_package_index():
    locks = [*ROOT.glob('*.lock'), *(ROOT / LOCKS).glob('*.lock')]
    assert ROOT / LOCKS / 'requirements.lock' in locks
    for lock in locks:
        assert not re.search(r'://|--(extra-)?index|--find-links|file:|@', lock.read_text())


def last_line(answer: subprocess.CompletedProcess) -> str:
    return answer.stderr.strip().rpartition('\n')[2]


class Checkout:
    """A copy of this project with a small lock, on a machine with nothing but some commands."""

    def __init__(self, folder: Path) -> None:
        self.wheels, self.bin = folder / 'wheels', folder / 'bin'
        self.bin.mkdir()
        for command in COMMANDS.split():
            if where := shutil.which(command):
                put(self.bin, command, f'exec {where} "$@"')  # no link: a test may write here
        put(self.bin, 'python3', f'exec "{BASE_PYTHON}" "$@"')
        put(self.bin, 'python3.14', 'echo "pyenv: python3.14: command not found" >&2; exit 127')
        self.root = folder / 'élève one'
        self.root.mkdir()
        for name in ('tools', 'helpers', 'ros2'):
            shutil.copytree(ROOT / name, self.root / name)
        for name in ('pyproject.toml', 'LICENSE'):
            shutil.copy(ROOT / name, self.root)
        blocks = re.split(r'\n(?=[a-z])', (ROOT / LOCKS / 'requirements.lock').read_text())
        self.pins = {
            name: next(f'{block}\n' for block in blocks if block.startswith(f'{name}=='))
            for name in ('iniconfig', 'pluggy')
        }
        self.lock()

    def fetch(self) -> None:
        """Fetch the packages of the locks, as `make handout OFFLINE=yes` does."""
        for lock in ('requirements.lock', 'requirements-uv.lock'):
            command = [BASE_PYTHON, '-I', ROOT / 'tools/pip.py', 'download', '--quiet', '--no-deps']
            command += ['--require-hashes', '--requirement', self.root / LOCKS / lock]
            subprocess.run([*command, '--dest', self.wheels], check=True)

    def lock(self, *names: str, group: str = '') -> None:
        """Write a lock of these packages, or of all."""
        file = self.root / LOCKS / f'requirements{group and f"-{group}"}.lock'
        header = f'# Every wheel exists for Python 3.14 {HERE}\n'
        file.write_text(header + ''.join(self.pins[name] for name in names or self.pins))

    def start(
        self, *arguments: str, user: int | None = None, **environment: str
    ) -> subprocess.Popen:
        """Start the set-up offline. As a user may have it: settings of pip only, none of uv."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(('PIP_', 'UV_'))}
        kept |= {'PIP_NO_INDEX': '1', 'PIP_FIND_LINKS': self.wheels.as_uri()}
        kept |= {'UV_CACHE_DIR': str(self.wheels / 'cache'), 'PIP_CONFIG_FILE': os.devnull}
        return subprocess.Popen(
            [self.root / 'tools/set_up.sh', *arguments],
            env=kept | {'PATH': str(self.bin)} | environment,
            cwd='/',
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            user=user,
        )

    def set_up(
        self, *arguments: str, user: int | None = None, **environment: str
    ) -> subprocess.CompletedProcess:
        """Run the set-up to its end."""
        process = self.start(*arguments, user=user, **environment)
        out, err = process.communicate()
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def installed(self) -> list[str]:
        code = 'from importlib.metadata import distributions as d; print(*(i.name for i in d()))'
        command = [self.root / '.venv/bin/python', '-I', '-c', code]
        return sorted(subprocess.check_output(command, text=True).split())

    def stamp(self) -> str:
        stamp = self.root / '.venv/set_up.stamp'
        return f'{stamp.stat().st_mtime_ns} {stamp.read_text()}' if stamp.exists() else ''


@pytest.fixture
def folder_for_all():
    """A folder that each user may enter: TMPDIR may lie in one that only its owner may."""
    with tempfile.TemporaryDirectory(dir='/tmp') as folder:
        Path(folder).chmod(0o755)
        yield Path(folder)


@pytest.fixture(scope='module')
def checkout(tmp_path_factory):
    checkout = Checkout(tmp_path_factory.mktemp('set_up'))
    checkout.fetch()
    return checkout


ALL = ['iniconfig', 'pluggy', 'ros2-command', 'ros2-notebooks']


def test_set_up_from_nothing_then_only_what_changed(checkout):
    # Variables that would put the packages elsewhere, or others in.
    hostile = {'PIP_USER': '1', 'PIP_TARGET': '/nowhere', 'UV_PYTHON': '3.9', 'PYTHONPATH': '/no'}
    first = checkout.set_up(**hostile)
    assert first.returncode == 0, first.stderr
    assert checkout.installed() == ALL
    python = checkout.root / '.venv/bin/python'
    assert python.resolve().samefile(BASE_PYTHON)
    settings = checkout.root / '.venv/share/jupyter/lab/settings/overrides.json'
    assert '"fetchNews": "false"' in settings.read_text()
    where = [python, '-I', '-c', 'import helpers; print(helpers.__file__)']
    helpers = subprocess.check_output(where, text=True, cwd='/').strip()
    assert helpers == str(checkout.root / 'helpers/__init__.py')

    done = checkout.stamp()
    second = checkout.set_up()
    assert (second.returncode, second.stdout, second.stderr) == (0, '', '')
    assert checkout.stamp() == done, 'it did the work twice'

    # What each ROS 2 wheel also holds: the metadata of another package with the same module.
    folder = next((checkout.root / '.venv/lib').glob('python*/site-packages'))
    old_format = folder / f'old_name-1.0-py{HERE}.egg-info'
    old_format.mkdir()
    (old_format / 'PKG-INFO').write_text('Metadata-Version: 2.1\nName: old-name\nVersion: 1.0\n')
    (old_format / 'top_level.txt').write_text('iniconfig\n')
    checkout.lock('iniconfig')
    third = checkout.set_up()
    assert third.returncode == 0, third.stderr
    assert 'Making' not in third.stderr
    assert checkout.installed() == ['iniconfig', 'ros2-command', 'ros2-notebooks']
    assert (folder / 'iniconfig/__init__.py').exists()


def test_a_group_is_kept_once_it_was_asked_for(checkout):
    checkout.lock('iniconfig')
    checkout.lock('pluggy', group='test')
    assert checkout.set_up().returncode == 0
    assert checkout.installed() == ['iniconfig', 'ros2-command', 'ros2-notebooks']
    for arguments in (['test'], []):
        answer = checkout.set_up(*arguments)
        assert answer.returncode == 0, answer.stderr
        assert checkout.installed() == ALL
    assert answer.stderr == ''


NO_NETWORK = {'PIP_NO_INDEX': '0', 'PIP_INDEX_URL': 'http://127.0.0.1:9/', 'PIP_RETRIES': '0'}
NO_NETWORK |= {'UV_HTTP_RETRIES': '0', 'PIP_FIND_LINKS': '', 'UV_NO_CACHE': '1'}


@pytest.fixture
def installed(checkout):
    """A checkout with one of two packages, and a lock that now wants the other."""
    for folder in checkout.root.glob('.venv*'):
        shutil.rmtree(folder)
    checkout.lock('iniconfig')
    assert checkout.set_up().returncode == 0
    checkout.lock()
    return checkout


ONE = ['iniconfig', 'ros2-command', 'ros2-notebooks']


def test_without_a_network_a_lesson_goes_on_with_the_packages_of_before(installed):
    before = installed.stamp()
    for _ in range(2):
        answer = installed.set_up(**NO_NETWORK)
        assert answer.returncode == 0
        assert last_line(answer) == (
            'uv could not install requirements.lock: check the network, or name your package '
            'index with UV_DEFAULT_INDEX, then try again. Until then you have the packages of '
            'before.'
        )
        assert (installed.installed(), installed.stamp()) == (ONE, before)
    assert installed.set_up().returncode == 0
    assert installed.installed() == ALL


def test_without_a_network_a_command_that_needs_more_ends_and_the_rest_works(installed):
    installed.lock('iniconfig')
    installed.lock('pluggy', group='site')
    before = installed.stamp()
    answer = installed.set_up('site', **NO_NETWORK, HTTPS_PROXY='http://127.0.0.1:9')
    assert answer.returncode == 1
    assert 'check the network and the proxy http://127.0.0.1:9, or name' in last_line(answer)
    answer = installed.set_up(**NO_NETWORK)
    assert (answer.returncode, answer.stderr) == (0, '')
    assert (installed.installed(), installed.stamp()) == (ONE, before)


def test_a_wrong_hash_installs_nothing(installed):
    lock = installed.root / LOCKS / 'requirements.lock'
    lock.write_text(re.sub(r'sha256:\w+', f'sha256:{"0" * 64}', lock.read_text()))
    answer = installed.set_up()
    assert last_line(answer).startswith('uv could not install requirements.lock: check the network')
    assert installed.installed() == ONE


@pytest.mark.parametrize('how', [signal.SIGINT, signal.SIGKILL])
def test_what_was_there_works_after_an_end_in_the_middle(installed, how):
    process = installed.start()
    while not (installed.root / '.venv.new/lib').exists():
        assert process.poll() is None
        time.sleep(0.001)  # the end may come anywhere after this
    os.killpg(process.pid, how)
    process.communicate()
    assert installed.installed() == ONE
    answer = installed.set_up()
    assert answer.returncode == 0, answer.stderr
    assert installed.installed() == ALL
    assert not [*installed.root.glob('.venv.*')]


def test_what_was_there_works_after_an_end_between_the_two_renames(installed):
    (installed.root / '.venv').rename(installed.root / '.venv.old')
    (installed.root / '.venv.new').mkdir()
    assert installed.set_up(**NO_NETWORK).returncode == 0
    assert installed.installed() == ONE


def test_two_calls_at_once_make_one_environment(installed):
    two = [installed.start(), installed.start()]
    answers = [process.communicate()[1] for process in two]
    assert [process.returncode for process in two] == [0, 0], answers
    assert '' in answers, 'both did the work'
    assert installed.installed() == ALL


def test_a_command_runs_wherever_the_new_environment_grew(installed):
    """uv writes the folder of an environment into its commands, unless it may not."""
    script = installed.root / '.venv/bin/ros2'
    assert '.venv' not in script.read_text().splitlines()[0]
    # An environment that version 0.3 has made.
    (installed.root / '.venv/pyvenv.cfg').write_text(
        re.sub('relocatable.*\n', '', (installed.root / '.venv/pyvenv.cfg').read_text())
    )
    assert installed.set_up().returncode == 0
    done = subprocess.run([script, '--help'], capture_output=True, text=True)
    assert 'usage: ros2' in done.stdout, done.stderr


def test_a_moved_checkout_is_made_anew(checkout):
    assert checkout.set_up().returncode == 0
    before = checkout.root
    checkout.root = before.rename(before.with_name('two'))
    try:
        answer = checkout.set_up()
        assert answer.returncode == 0, answer.stderr
        assert answer.stderr.startswith('Making .venv')
    finally:
        checkout.root = checkout.root.rename(before)


def test_packages_that_came_along_are_enough(tmp_path, checkout):
    offline = Checkout(tmp_path)
    shutil.copytree(checkout.wheels, offline.root / 'wheels', ignore=lambda *_: ['cache'])
    (offline.root / 'wheels/pythons').write_text(HERE)
    nowhere = {'UV_DEFAULT_INDEX': 'http://127.0.0.1:9/', 'PIP_FIND_LINKS': '/nowhere'}
    answer = offline.set_up(**nowhere, PIP_NO_INDEX='0')
    assert answer.returncode == 0, answer.stderr
    assert offline.installed() == ALL


# --- One sentence says what to do ----------------------------------------------------------------


def test_without_a_python_it_says_what_to_install(tmp_path):
    checkout = Checkout(tmp_path)
    for name in ('python3', 'python3.14'):
        (checkout.bin / name).unlink()
    assert last_line(checkout.set_up()).startswith('No Python is on the PATH: install one')


def test_without_venv_it_says_what_to_install(tmp_path):
    checkout = Checkout(tmp_path)
    # What Debian's python3 is without the package python3-venv, and without pip.
    put(checkout.bin, 'python3', f'case $* in *pip*) exit 1 ;; esac; exec "{BASE_PYTHON}" "$@"')
    assert last_line(checkout.set_up()) == (
        'python3 has no pip and no venv: run `sudo apt install python3-venv`, then try again.'
    )


def test_without_a_usable_python_it_says_which(tmp_path, checkout):
    unlucky = Checkout(tmp_path)
    unlucky.wheels = checkout.wheels
    lock = unlucky.root / LOCKS / 'requirements.lock'
    lock.write_text('# Every wheel exists for Python 3.14\n')
    answer = unlucky.set_up(UV_OFFLINE='1')
    assert answer.returncode == 1
    assert last_line(answer).startswith('No usable Python 3.14 to 3.14 is on the PATH')
    answer = unlucky.set_up('--python', '3.9')
    assert last_line(answer) == 'Not every pinned package has a wheel for Python 3.9.'


def test_without_a_network_it_says_what_to_check(tmp_path):
    answer = Checkout(tmp_path).set_up(**NO_NETWORK)
    assert answer.returncode == 1
    assert last_line(answer).startswith('pip could not install uv: check the network')


as_root = pytest.mark.skipif(os.getuid() != 0, reason='only root becomes another user, or mounts')


@as_root
def test_a_full_disk_is_named(tmp_path, checkout):
    disk = tmp_path / 'disk'
    disk.mkdir()
    subprocess.run(['mount', '-t', 'tmpfs', '-o', 'size=20m', 'tmpfs', disk], check=True)
    try:
        full = Checkout(disk)
        full.wheels = checkout.wheels
        (disk / 'ballast').write_bytes(b'.' * (full_up_to(disk) - 300_000))
        answer = full.set_up()
        assert answer.returncode == 1
        assert last_line(answer).endswith(
            f'only 0 MB are free in {full.root}. Make room for 1 GB, then try again.'
        )
    finally:
        subprocess.run(['umount', '--lazy', disk], check=True)


def full_up_to(disk: Path) -> int:
    state = os.statvfs(disk)
    return state.f_bavail * state.f_frsize


@as_root
def test_what_another_user_owns_is_named(folder_for_all):
    nobody = 65534
    others = Checkout(folder_for_all)
    answer = others.set_up(user=nobody)
    assert (answer.returncode, answer.stderr) == (
        1,
        f'The folder {others.root} cannot be written: copy it to one of your own, then try again'
        '.\n',
    )
    os.chown(others.root, nobody, nobody)
    (others.root / '.jupyter').mkdir()
    answer = others.set_up(user=nobody)
    assert answer.returncode == 1
    assert answer.stderr.startswith(f"{others.root}/.jupyter is another user's: take it with")
    (others.root / '.jupyter').rmdir()
    (others.root / '.venv').mkdir()
    answer = others.set_up(user=nobody)
    assert answer.stderr.startswith(f"{others.root}/.venv is another user's: take it with")


def test_another_machine_is_sent_to_environment_md(tmp_path):
    checkout = Checkout(tmp_path)
    put(checkout.bin, 'uname', 'echo Linux aarch64')
    assert 'environment.md says what to do on other machines' in last_line(checkout.set_up())


# --- make ----------------------------------------------------------------------------------------


@pytest.mark.parametrize('makefile', ['Makefile', 'classroom/handout.mk'])
def test_another_ros_and_other_settings_stay_out(tmp_path, makefile):
    """What the recipes of the Makefile get from an environment in which ROS 2 is sourced."""
    (tmp_path / 'tools').mkdir()
    shutil.copy(ROOT / 'tools/environment.mk', tmp_path / 'tools')
    show = tmp_path / 'show.mk'
    show.write_text(f'include {ROOT / makefile}\nshow_environment:\n\t@env\n')
    foreign = {
        'AMENT_PREFIX_PATH': '/opt/ros/humble',
        'LD_LIBRARY_PATH': '/opt/ros/humble/lib',
        'PYTHONPATH': '/opt/ros/humble/lib/python3.10/site-packages',
        'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp',
        'ROS_LOCALHOST_ONLY': '0',
        '_ROS_WHEELS_BOOTSTRAP_COMPLETE': '1',
        'JUPYTER_PATH': '/home/somebody/share/jupyter',
        'MPLBACKEND': 'TkAgg',
    }
    mine = {'PATH': os.environ['PATH'], 'PIP_INDEX_URL': 'mirror', 'HTTPS_PROXY': 'proxy'}
    answer = subprocess.run(
        ['make', '--no-print-directory', '-f', show, 'show_environment'],
        cwd=tmp_path,
        env=foreign | mine,
        capture_output=True,
        text=True,
        check=True,
    )
    seen = dict(line.split('=', 1) for line in answer.stdout.splitlines())
    assert not foreign.keys() & seen.keys()
    assert mine.items() <= seen.items()
    for name in ('JUPYTER_CONFIG_DIR', 'JUPYTER_DATA_DIR', 'IPYTHONDIR', 'MPLCONFIGDIR'):
        assert seen[name].startswith(f'{tmp_path}/.jupyter')


def test_a_file_with_the_name_of_a_command_changes_nothing():
    text = (ROOT / 'Makefile').read_text().replace('\\\n', '')
    commands = set(re.findall(r'^([a-z0-9_-]+):(?!=)', text, re.MULTILINE))
    assert commands == set(re.search(r'^\.PHONY:(.*)', text, re.MULTILINE)[1].split())


def test_what_somebody_wrote_is_not_cleaned(tmp_path):
    removed = [
        '.venv/bin/python',
        '.jupyter/lab/workspaces/tabs',
        '.jupyter/data/kernels/kernel.json',
        'helpers/__pycache__/one.pyc',
        'scratch/.make_a_package.lock',
        'scratch/.find_the_fault.lock',
        'scratch/make_a_package/src/of_a_run_without_a_person.py',
        'scratch/find_the_fault/build/ada/setup.py',
        'scratch/find_the_fault/install/setup.bash',
        'scratch/find_the_fault/log/COLCON_IGNORE',
        'scratch/find_the_fault/src/ada/__pycache__/brake.pyc',
    ]
    kept = [
        f'notebooks/{path_of("lose_messages").name}',
        '.jupyter/hub/jupyterhub.sqlite',
        '.jupyter/class/class.sqlite',
        '.jupyter/data/ros2_notebooks_progress.txt',
        'scratch/by_hand/build/notes.txt',
        f'scratch/make_a_package.before_1/{OWNED}',
        'scratch/make_a_package.before_1/src/talker.py',
        f'scratch/find_the_fault/{OWNED}',
        'scratch/find_the_fault/src/ada/ada/brake.py',
        'scratch/find_the_fault/record.txt',
    ]
    root = tmp_path / 'élève one'
    for name in (*removed, *kept):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text('text')
    (root / 'tools').mkdir()
    tools = {'Makefile', 'tools/clean.sh', 'tools/environment.mk'}
    for name in tools:
        shutil.copy(ROOT / name, root / name)
    for _ in range(2):  # the second time there is nothing to do
        command = ['make', '--silent', 'clean']
        answer = subprocess.run(command, cwd=root, capture_output=True, text=True)
        assert (answer.returncode, answer.stdout, answer.stderr) == (0, '', '')
        left = {str(path.relative_to(root)) for path in root.rglob('*') if path.is_file()}
        assert left == {*kept, *tools}
    shutil.rmtree(root / 'scratch')
    shutil.rmtree(root / '.jupyter')
    subprocess.run(command, cwd=root, check=True)  # as before the first lesson
