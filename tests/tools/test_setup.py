"""The set-up script, on a small lock that needs no network, and what the real lock must hold."""

import base64
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
import zipfile
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import distribution
from pathlib import Path

import pytest
from support.processes import put

from tools.lessons.lesson import ROOT

BASE_PYTHON = Path(sys._base_executable)
HERE = f'{sys.version_info.major}.{sys.version_info.minor}'


def test_a_direct_dependency_has_its_reason():
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text())
    lists = [*project['project']['optional-dependencies'].values()]
    lists += [project['project']['dependencies'], *project['dependency-groups'].values()]
    names = [re.match(r'[\w-]+', requirement)[0] for one in lists for requirement in one]
    for file in (ROOT / 'tools').glob('*/package.json'):
        names += json.loads(file.read_text())['dependencies']
    reasons = (ROOT / 'environment.md').read_text()
    for name in names:
        reason = rf'^\| `{re.escape(name)}(\[\w+\])?` \| .{{10,}} \|$'
        assert re.search(reason, reasons, re.MULTILINE), f'environment.md: why {name}?'


def test_the_locks_name_no_package_index():
    for lock in ROOT.glob('requirements*.lock'):
        assert not re.search(r'://|--(extra-)?index|--find-links|file:|@', lock.read_text())
    for lock in (ROOT / 'tools').glob('*/package-lock.json'):
        packages = json.loads(lock.read_text())['packages']
        assert not any('resolved' in package for package in packages.values())
        assert all(package['integrity'] for name, package in packages.items() if name)


# --- The choice of a Python ----------------------------------------------------------------------


@pytest.fixture
def path(tmp_path):
    """Return a folder that is the whole PATH, with the commands that the scripts use."""
    for command in ('cat', 'cksum', 'cp', 'dirname', 'env', 'flock', 'grep', 'head', 'mkdir', 'mv',
                    'rm', 'sed', 'sh', 'tr'):  # fmt: skip
        if where := shutil.which(command):
            (tmp_path / command).symlink_to(where)
    return tmp_path


def find_python(path: Path, versions: str = '3.14 3.13 3.12 3.11') -> subprocess.CompletedProcess:
    return subprocess.run(
        ['/bin/sh', ROOT / 'tools/find_python.sh', versions],
        # The variables of the user change nothing.
        env={'PATH': str(path), 'PYTHONHOME': '/nowhere', 'PYTHONPATH': '/nowhere'},
        capture_output=True,
        text=True,
    )


def last_line(text: str) -> str:
    return text.strip().rpartition('\n')[2]


def test_a_shim_that_does_not_run_is_passed_over(path):
    put(path, 'python3.14', 'echo "pyenv: python3.14: command not found" >&2; exit 127')
    put(path, 'python3', f'exec "{BASE_PYTHON}" "$@"')
    answer = find_python(path)
    assert answer.returncode == 0, answer.stderr
    assert Path(answer.stdout.strip()).samefile(BASE_PYTHON)


def test_the_newest_is_chosen_whatever_its_place_on_the_path(path):
    for name, version in {'python3': '3.12', 'python3.11': '3.11', 'python3.13': '3.13'}.items():
        put(path, name, f'echo "{version} /chosen/{version}"')
    assert find_python(path).stdout == '/chosen/3.13\n'
    assert find_python(path, '3.12 3.11').stdout == '/chosen/3.12\n'


def test_a_python_of_a_virtual_environment_stands_for_the_one_it_was_made_with(path):
    (path / 'python3').symlink_to(sys.executable)
    answer = find_python(path)
    assert answer.returncode == 0, answer.stderr
    assert Path(answer.stdout.strip()).samefile(BASE_PYTHON)
    assert not Path(answer.stdout.strip()).is_relative_to(sys.prefix)


def test_without_a_python_one_sentence_says_what_to_install(path):
    put(path, 'python3', 'exit 1')
    answer = find_python(path)
    assert answer.returncode == 1
    assert answer.stdout == ''
    assert f'{path}/python3 does not run\n' in answer.stderr
    assert last_line(answer.stderr) == (
        'No usable Python 3.11 to 3.14 is on the PATH: install one, for example with '
        '`sudo apt install python3 python3-venv`, then try again.'
    )


def test_a_python_without_venv_is_said_to_be_one(path):
    # What Debian's python3 is without the package python3-venv.
    put(
        path,
        'python3',
        f"""
for word; do
    case $word in *ensurepip*) probe=$word ;; esac
done
without_ensurepip='import sys; sys.modules["ensurepip"] = None'
exec "{BASE_PYTHON}" -I -S -c "$without_ensurepip
$probe" "{HERE}"
""",
    )
    answer = find_python(path)
    assert answer.returncode == 1
    assert last_line(answer.stderr) == (
        'python3 cannot make a virtual environment: run `sudo apt install python3-venv`, '
        'then try again.'
    )


# --- Making .venv --------------------------------------------------------------------------------


def wheel_of(name: str, folder: Path) -> str:
    """Pack an installed distribution into a wheel again. Return its pin, with the hash."""
    installed = distribution(name)
    info = next(f.parts[0] for f in installed.files if f.parts[0].endswith('.dist-info'))
    tag = re.search(r'^Tag: (.*)$', installed.read_text('WHEEL'), re.MULTILINE)[1]
    wheel = folder / f'{info.removesuffix(".dist-info")}-{tag}.whl'
    data = info.replace('.dist-info', '.data')
    records = []
    with zipfile.ZipFile(wheel, 'w') as archive:
        for file in installed.files:
            source = Path(installed.locate_file(file))
            if file.suffix == '.pyc' or file.name in ('RECORD', 'INSTALLER', 'REQUESTED'):
                continue
            inside = str(file) if file.parts[0] != '..' else f'{data}/scripts/{file.name}'
            archive.write(source, inside)
            digest = base64.urlsafe_b64encode(hashlib.sha256(source.read_bytes()).digest())
            records.append(f'{inside},sha256={digest.decode().rstrip("=")},')
        records.append(f'{info}/RECORD,,')
        archive.writestr(f'{info}/RECORD', '\n'.join(records) + '\n')
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    return f'{name}=={installed.version} \\\n    --hash=sha256:{digest}\n'


class Checkout:
    """A copy of this project whose lock holds three packages, which pip finds in a folder."""

    def __init__(self, folder: Path) -> None:
        self.wheels = folder / 'wheels'
        self.wheels.mkdir()
        self.pins = {
            name: wheel_of(name, self.wheels) for name in ('iniconfig', 'setuptools', 'uv')
        }
        self.root = folder / 'élève one'
        self.root.mkdir()
        for name in ('tools', 'helpers'):
            shutil.copytree(ROOT / name, self.root / name)
        for name in ('pyproject.toml', 'LICENSE', 'Makefile'):
            shutil.copy(ROOT / name, self.root)
        self.lock(self.pins.values())

    def lock(self, pins) -> None:
        header = f'# Every wheel exists for Python {HERE}\n'
        (self.root / 'requirements.lock').write_text(header + ''.join(pins))

    def start(self, *arguments: str, **environment: str) -> subprocess.Popen:
        """Run the script offline. As a user may have it: settings of pip only, none of uv."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(('PIP_', 'UV_'))}
        kept |= {'PIP_NO_INDEX': '1', 'PIP_FIND_LINKS': self.wheels.as_uri()}
        kept |= {'UV_CACHE_DIR': str(self.wheels / 'cache'), 'PIP_CONFIG_FILE': os.devnull}
        kept |= {'PATH': f'{BASE_PYTHON.parent}{os.pathsep}{kept["PATH"]}'}
        return subprocess.Popen(
            [self.root / 'tools/set_up.sh', *arguments],
            env=kept | environment,
            cwd='/',
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def set_up(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess:
        """Run the script to its end."""
        process = self.start(*arguments, **environment)
        out, err = process.communicate()
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def installed(self) -> list[str]:
        code = 'from importlib.metadata import distributions as d; print(*(i.name for i in d()))'
        answer = subprocess.run(
            [self.root / '.venv/bin/python', '-I', '-c', code], capture_output=True, text=True
        )
        return sorted(answer.stdout.split())

    def stamp(self) -> str:
        stamp = self.root / '.venv/set_up.stamp'
        return f'{stamp.stat().st_mtime_ns} {stamp.read_text()}' if stamp.exists() else ''


@pytest.fixture(scope='module')
def checkout(tmp_path_factory):
    return Checkout(tmp_path_factory.mktemp('set_up'))


ALL = ['iniconfig', 'pip', 'ros2-notebooks', 'setuptools', 'uv']


def test_set_up_from_nothing_then_only_what_changed(checkout):
    # Variables that would put the packages elsewhere, or others in.
    hostile = {'PIP_USER': '1', 'PIP_TARGET': '/nowhere', 'UV_PYTHON': '3.9', 'PYTHONPATH': '/no'}
    first = checkout.set_up(**hostile)
    assert first.returncode == 0, first.stderr
    assert checkout.installed() == ALL
    settings = checkout.root / '.venv/share/jupyter/lab/settings/overrides.json'
    assert '"fetchNews": "false"' in settings.read_text()
    imported = subprocess.run(
        [checkout.root / '.venv/bin/python', '-I', '-c', 'import helpers; print(helpers.__file__)'],
        cwd='/',
        capture_output=True,
        text=True,
    )
    assert imported.stdout.strip() == str(checkout.root / 'helpers/__init__.py')

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
    checkout.lock([*checkout.pins.values(), '# changed\n'])
    changed = checkout.set_up()
    assert changed.returncode == 0, changed.stderr
    assert (folder / 'iniconfig/__init__.py').exists()

    checkout.lock(pin for name, pin in checkout.pins.items() if name != 'iniconfig')
    third = checkout.set_up()
    assert third.returncode == 0, third.stderr
    assert 'Making' not in third.stderr
    assert checkout.installed() == [name for name in ALL if name != 'iniconfig']


def test_a_wrong_hash_installs_nothing_and_the_next_call_repairs(checkout):
    wrong = re.sub(r'sha256:\w+', f'sha256:{"0" * 64}', checkout.pins['iniconfig'])
    checkout.lock({**checkout.pins, 'iniconfig': wrong}.values())
    answer = checkout.set_up()
    assert answer.returncode == 1
    assert last_line(answer.stderr).startswith('uv could not install requirements.lock:')
    assert 'iniconfig' not in checkout.installed()
    assert checkout.stamp() == ''

    # Without its stamp an environment may hold anything: it is made anew.
    checkout.lock(checkout.pins.values())
    (checkout.root / '.venv/lib/damage').write_text('')
    again = checkout.set_up()
    assert again.returncode == 0, again.stderr
    assert again.stderr.startswith('Making .venv')
    assert not (checkout.root / '.venv/lib/damage').exists()
    assert checkout.installed() == ALL


def test_packages_that_came_along_are_enough(tmp_path):
    one = Checkout(tmp_path)
    one.wheels.rename(one.root / 'wheels')
    (one.root / 'wheels/pythons').write_text(HERE)
    nowhere = {'UV_DEFAULT_INDEX': 'http://127.0.0.1:9/', 'PIP_FIND_LINKS': '/nowhere'}
    answer = one.set_up(**nowhere, PIP_NO_INDEX='0')
    assert answer.returncode == 0, answer.stderr
    assert one.installed() == ALL
    (one.root / 'wheels/pythons').write_text('3.9')
    answer = one.set_up()
    assert answer.returncode == 0, 'what is installed is used on'
    shutil.rmtree(one.root / '.venv')
    assert 'Python 3.9' in last_line(one.set_up().stderr)


def test_what_a_group_needs_is_kept_once_it_was_asked_for(checkout):
    checkout.lock(checkout.pins[name] for name in ('setuptools', 'uv'))
    for group, name in (('browser', 'iniconfig'), ('hub', 'pluggy')):
        pin = checkout.pins.get(name) or wheel_of(name, checkout.wheels)
        (checkout.root / f'requirements-{group}.lock').write_text(pin)
    without = [name for name in ALL if name != 'iniconfig']
    with_both = sorted([*ALL, 'pluggy'])
    for arguments, expected in (
        ([], without), (['browser'], ALL), ([], ALL), (['hub'], with_both), ([], with_both)
    ):  # fmt: skip
        answer = checkout.set_up(*arguments)
        assert answer.returncode == 0, answer.stderr
        assert checkout.installed() == expected
    assert answer.stderr == ''


def test_an_environment_in_another_folder_made_by_two_calls_at_once(checkout):
    before = checkout.stamp()
    with ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(checkout.set_up, ['--in'] * 2, ['.soak/other'] * 2, [HERE] * 2))
    assert [answer.returncode for answer in answers] == [0, 0], answers
    assert sorted('Making' in answer.stderr for answer in answers) == [False, True]
    assert (checkout.root / '.soak/other/bin/python').exists()
    assert checkout.stamp() == before, 'it touched .venv'
    answer = checkout.set_up('--in', '.soak/older', '3.9')
    assert last_line(answer.stderr) == 'Not every pinned package has a wheel for Python 3.9.'


def test_after_an_interruption_the_next_call_repairs(checkout):
    """Ctrl+C while packages are installed, as a terminal sends it: to all processes."""
    (checkout.root / '.venv/set_up.stamp').unlink(missing_ok=True)
    with checkout.start() as process:
        while not process.stderr.readline().startswith('Installing'):
            assert process.poll() is None
        os.killpg(process.pid, signal.SIGINT)
    assert checkout.stamp() == ''
    again = checkout.set_up()
    assert again.returncode == 0, again.stderr
    assert again.stderr.startswith('Making .venv')


def test_a_moved_checkout_is_noticed(checkout, path):
    checkout.lock(checkout.pins.values())
    assert checkout.set_up().returncode == 0
    assert checkout.set_up().stderr == ''
    before = checkout.root
    checkout.root = before.rename(before.with_name('two'))
    # Without a Python it ends where it would make .venv anew, and touches nothing.
    answer = checkout.set_up(PATH=str(path))
    assert answer.returncode == 1
    assert last_line(answer.stderr).startswith('No usable Python')
    checkout.root = checkout.root.rename(before)
    assert checkout.set_up().stderr == ''


# --- make ----------------------------------------------------------------------------------------


def test_another_ros_and_other_settings_stay_out(tmp_path):
    """What the recipes of the Makefile get from an environment in which ROS 2 is sourced."""
    show = tmp_path / 'show.mk'
    show.write_text(f'include {ROOT}/Makefile\nshow_environment:\n\t@env\n')
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


def test_this_project_is_found_without_an_import_hook():
    assert not [finder for finder in sys.meta_path if 'editable' in repr(finder)]
