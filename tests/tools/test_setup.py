"""The set-up, on a lock of two packages that lie in a folder, and what the real locks must hold."""

import json
import os
import re
import shutil
import subprocess
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from support.processes import put
from support.small_checkout import ALL, BASE_PYTHON, HERE, LOCKS, ONE, Checkout, last_line

from helpers.lesson import ROOT, path_of
from helpers.machine import OWNED


def test_the_locks_name_no_package_index():
    locks = [*ROOT.glob('*.lock'), *(ROOT / LOCKS).glob('*.lock')]
    assert ROOT / LOCKS / 'requirements.lock' in locks
    for lock in locks:
        assert not re.search(r'://|--(extra-)?index|--find-links|file:|@', lock.read_text())


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
    assert checkout.installed() == ONE
    assert (folder / 'iniconfig/__init__.py').exists()


def test_a_group_is_kept_once_it_was_asked_for(checkout):
    checkout.lock('iniconfig')
    checkout.lock('pluggy', group='test')
    assert checkout.set_up().returncode == 0
    assert checkout.installed() == ONE
    for arguments in (['test'], []):
        answer = checkout.set_up(*arguments)
        assert answer.returncode == 0, answer.stderr
        assert checkout.installed() == ALL
    assert answer.stderr == ''


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


def test_a_folder_has_any_name_without_a_colon(checkout):
    checkout.lock()
    before = checkout.root
    checkout.root = before.rename(before.with_name('R&D, "robots" | 100 % of a$b#c\\d'))
    try:
        answer = checkout.set_up()
        assert answer.returncode == 0, answer.stderr
        assert checkout.installed() == ALL
        settings = checkout.root / '.venv/etc/jupyter/jupyter_server_config.json'
        command = json.loads(settings.read_text())['ServerApp']['terminado_settings']
        assert Path(command['shell_command'][-1]).is_file()
        checkout.root = checkout.root.rename(before.with_name('a:b'))
        assert checkout.set_up().stderr == (
            f'The folder {checkout.root} has a colon in its name, which no PATH can hold: give it '
            'another name, then try again.\n'
        )
    finally:
        checkout.root = checkout.root.rename(before)


@pytest.fixture(scope='module')
def index(wheels, tmp_path_factory):
    """Yield the address of a package index of one's own."""
    folder = tmp_path_factory.mktemp('index')
    for wheel in wheels.glob('*.whl'):
        place = folder / 'simple' / wheel.name.partition('-')[0]
        place.mkdir(parents=True)
        shutil.copy(wheel, place)
    pages = partial(SimpleHTTPRequestHandler, directory=folder)
    with ThreadingHTTPServer(('127.0.0.1', 0), pages) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f'http://127.0.0.1:{server.server_port}/simple/'
        server.shutdown()


@pytest.mark.parametrize('where', ['PIP_INDEX_URL', 'UV_DEFAULT_INDEX', 'pip.conf', 'uv.toml'])
def test_an_index_of_ones_own_is_used(tmp_path, wheels, installed, index, where):
    course = Checkout(tmp_path, wheels)
    own = {'PIP_NO_INDEX': '', 'PIP_FIND_LINKS': '', 'UV_CACHE_DIR': str(tmp_path / 'cache')}
    if where in ('UV_DEFAULT_INDEX', 'uv.toml'):  # not of pip, which fetches uv
        shutil.copytree(installed.root / '.uv', course.root / '.uv')
    if where == 'pip.conf':
        (tmp_path / 'pip.conf').write_text(f'[global]\nindex-url = {index}\n')
        own['PIP_CONFIG_FILE'] = str(tmp_path / 'pip.conf')
    elif where == 'uv.toml':
        (tmp_path / 'uv').mkdir()
        (tmp_path / 'uv/uv.toml').write_text(f'[[index]]\nurl = "{index}"\ndefault = true\n')
        own['XDG_CONFIG_HOME'] = str(tmp_path)
    else:
        own[where] = index
    answer = course.set_up(**own)
    assert answer.returncode == 0, answer.stderr
    assert course.installed() == ALL


@pytest.mark.parametrize('warns', [False, True])
def test_a_uv_on_the_path_is_used_unless_it_is_too_old(tmp_path, installed, warns):
    """One that does not understand pyproject.toml warns, and forgets all of its settings."""
    course = Checkout(tmp_path, installed.wheels)
    warning = 'echo "warning: unknown field" >&2; ' if warns else ''
    used = tmp_path / 'used'
    uv = installed.root / '.uv/bin/uv'
    put(course.bin, 'uv', f'{warning}echo "$1" >> "{used}"; exec "{uv}" "$@"')
    answer = course.set_up()
    assert answer.returncode == 0, answer.stderr
    assert (course.root / '.uv').exists() == warns
    assert ('pip' in used.read_text().split()) != warns


def test_packages_that_came_along_are_enough(tmp_path, wheels):
    offline = Checkout(tmp_path)
    shutil.copytree(wheels, offline.root / 'wheels', ignore=lambda *_: ['cache'])
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


def test_without_a_usable_python_it_says_which(tmp_path, wheels):
    unlucky = Checkout(tmp_path, wheels)
    lock = unlucky.root / LOCKS / 'requirements.lock'
    lock.write_text('# Every wheel exists for Python 3.14\n')
    answer = unlucky.set_up(UV_OFFLINE='1')
    assert answer.returncode == 1
    assert last_line(answer).startswith('No usable Python 3.14 to 3.14 is on the PATH')
    answer = unlucky.set_up('--python', '3.9')
    assert last_line(answer) == 'Not every pinned package has a wheel for Python 3.9.'


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
