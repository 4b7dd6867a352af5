"""Whatever fails while packages are installed: one sentence, and what worked still works."""

import os
import re
import shutil
import signal
import time
from pathlib import Path

import pytest
from support.processes import put
from support.small_checkout import ALL, LOCKS, NO_NETWORK, ONE, Checkout, last_line
from support.troubles import NOBODY, as_root, folder_of_all, full, read_only, small_disk, take

UNTIL_THEN = 'Until then you have the packages of before.'
CHECK = 'check the network, or name your package index with'

# --- No network, a dead proxy ---------------------------------------------------------------------


def test_without_a_network_it_says_what_to_check(tmp_path):
    answer = Checkout(tmp_path).set_up(**NO_NETWORK)
    assert answer.returncode == 1
    assert last_line(answer) == f'pip could not install uv: {CHECK} PIP_INDEX_URL, then try again.'


def test_without_a_network_a_lesson_goes_on_with_the_packages_of_before(installed):
    before = installed.stamp()
    for _ in range(2):
        answer = installed.set_up(**NO_NETWORK)
        assert answer.returncode == 0
        assert last_line(answer) == (
            f'uv could not install requirements.lock: {CHECK} UV_DEFAULT_INDEX, then try again. '
            f'{UNTIL_THEN}'
        )
        assert (installed.installed(), installed.stamp()) == (ONE, before)
    assert installed.set_up().returncode == 0
    assert installed.installed() == ALL


def test_without_a_network_a_command_that_needs_more_ends_and_the_rest_works(installed):
    installed.lock('iniconfig')
    installed.lock('pluggy', group='site')
    before = installed.stamp()
    answer = installed.set_up('site', **NO_NETWORK)
    assert answer.returncode == 1
    assert CHECK in last_line(answer)
    answer = installed.set_up(**NO_NETWORK)
    assert (answer.returncode, answer.stderr) == (0, '')
    assert (installed.installed(), installed.stamp()) == (ONE, before)


@pytest.mark.parametrize('where', ['variable', 'pip.conf', 'pip.conf, before there is uv'])
def test_a_dead_proxy_is_named_without_its_password(installed, tmp_path, where):
    (tmp_path / 'pip.conf').write_text('[global]\nproxy = http://me:secret@127.0.0.1:9\n')
    proxy = {'PIP_CONFIG_FILE': str(tmp_path / 'pip.conf')}
    if where == 'variable':
        proxy = {'HTTPS_PROXY': 'http://me:secret@127.0.0.1:9'}
    elif 'before' in where:
        shutil.rmtree(installed.root / '.uv')
    answer = installed.set_up(**NO_NETWORK, **proxy)
    assert answer.returncode == 0
    said = last_line(answer)
    assert ': check the network and the proxy http://127.0.0.1:9, or name your' in said
    assert said.endswith(UNTIL_THEN)
    assert installed.installed() == ONE
    assert installed.set_up().returncode == 0
    assert installed.installed() == ALL


def test_a_wrong_hash_installs_nothing(installed):
    lock = installed.root / LOCKS / 'requirements.lock'
    lock.write_text(re.sub(r'sha256:\w+', f'sha256:{"0" * 64}', lock.read_text()))
    answer = installed.set_up()
    assert last_line(answer).startswith('uv could not install requirements.lock: check the network')
    assert installed.installed() == ONE


# --- Ctrl+C, kill -9, two at once -----------------------------------------------------------------


@pytest.mark.parametrize('how', [signal.SIGINT, signal.SIGKILL])
def test_what_was_there_works_after_an_end_in_the_middle(installed, how):
    process = installed.start()
    while not (installed.root / '.venv.new/lib').exists():
        assert process.poll() is None
        time.sleep(0.001)  # the end may come anywhere after this
    os.killpg(process.pid, how)
    said = process.communicate()[1]
    if how == signal.SIGINT:
        assert said.endswith(
            'Interrupted: what was there is as it was. Type the same again to go on.\n'
        )
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


# --- A full disk ----------------------------------------------------------------------------------


def no_room_in(folder: Path) -> str:
    return f'there is no room for 300 MB in {folder}: make room for 1 GB, then try again.'


@as_root
def test_a_full_disk_is_named_and_with_room_it_is_made(tmp_path, wheels):
    with small_disk(tmp_path / 'disk', '200m') as disk:
        checkout = Checkout(disk, wheels)
        with full(disk, but=300_000):
            answer = checkout.set_up()
        assert answer.returncode == 1
        assert last_line(answer) == f'pip could not install uv: {no_room_in(checkout.root)}'
        answer = checkout.set_up()
        assert answer.returncode == 0, answer.stderr
        with full(disk):
            shutil.rmtree(checkout.root / '.venv/lib')  # and all that it takes to make it anew
            (checkout.root / '.venv/bin/python').unlink()
        with full(disk):
            answer = checkout.set_up()
        assert answer.returncode == 1
        assert last_line(answer) == (
            f'The environment could not be made: {no_room_in(checkout.root)}'
        )


@as_root
def test_on_a_full_disk_a_lesson_goes_on_with_the_packages_of_before(tmp_path, wheels):
    with small_disk(tmp_path / 'disk', '200m') as disk:
        checkout = Checkout(disk, wheels)
        checkout.lock('iniconfig')
        assert checkout.set_up().returncode == 0
        checkout.lock()
        before = checkout.stamp()
        for room in (0, 30_000, 60_000):  # it ends at another step
            with full(disk, but=room):
                answer = checkout.set_up()
                assert answer.returncode == 0
                assert last_line(answer).endswith(f'{no_room_in(checkout.root)} {UNTIL_THEN}')
                assert (checkout.installed(), checkout.stamp()) == (ONE, before)
            assert not (checkout.root / '.venv.new').exists()
        assert checkout.set_up().returncode == 0
        assert checkout.installed() == ALL


@as_root
@pytest.mark.parametrize('variable', ['TMPDIR', 'UV_CACHE_DIR'])
def test_another_disk_that_is_full_is_named(tmp_path, wheels, variable):
    """The folder for temporary files, or that of a home, may be on a disk of its own."""
    checkout = Checkout(tmp_path, wheels)
    with small_disk(tmp_path / 'disk') as disk, full(disk, but=100_000):
        answer = checkout.set_up(**{variable: str(disk)})
        assert answer.returncode == 1
        assert last_line(answer).endswith(no_room_in(disk))


def test_a_quota_is_named(installed):
    """No disk of the tests has one, so the command that finds it says what it says there."""
    said = 'fallocate: fallocate failed: Disk quota exceeded'
    command = put(installed.bin, 'fallocate', f'echo "{said}" >&2; exit 1')
    answer = installed.set_up(**NO_NETWORK)
    command.unlink()
    assert last_line(answer).endswith(f'{no_room_in(installed.root)} {UNTIL_THEN}')


# --- A folder that cannot be written, another user's files ----------------------------------------


def cannot_be_written(root: Path) -> str:
    return f'The folder {root} cannot be written: copy it to one of your own, then try again.'


def is_of_another(path: Path, root: Path) -> str:
    return (
        f'{path} is another user\'s: take it with `sudo chown -R "$(id -u)" "{root}"`, then '
        'try again.'
    )


@as_root
def test_a_folder_that_nobody_can_write_is_named(installed):
    with read_only(installed.root):
        answer = installed.set_up()
        assert (answer.returncode, answer.stderr) == (1, f'{cannot_be_written(installed.root)}\n')
        assert installed.installed() == ONE
    assert installed.set_up().returncode == 0
    assert installed.installed() == ALL


@as_root
def test_a_home_that_cannot_be_written_is_no_trouble(installed, tmp_path):
    (tmp_path / '.cache').mkdir()
    home = {'HOME': str(tmp_path), 'UV_CACHE_DIR': str(tmp_path / '.cache/uv')}
    with read_only(tmp_path):
        assert installed.set_up(**home).returncode == 0
    assert installed.installed() == ALL


@as_root
def test_what_another_user_owns_is_named():
    with folder_of_all() as folder:
        others = Checkout(folder)
        answer = others.set_up(user=NOBODY)
        assert (answer.returncode, answer.stderr) == (1, f'{cannot_be_written(others.root)}\n')
        os.chown(others.root, NOBODY, NOBODY)
        for name in ('.jupyter', '.venv', '.venv.new', '.uv'):
            (others.root / name).mkdir()
            (others.root / name / 'file').touch()
            answer = others.set_up(user=NOBODY)
            said = is_of_another(others.root / name, others.root)
            assert (answer.returncode, answer.stderr) == (1, f'{said}\n')
            shutil.rmtree(others.root / name)


@as_root
def test_after_an_end_as_root_a_lesson_goes_on_until_the_files_are_taken(wheels):
    """Somebody has typed `sudo make lab`, and pressed Ctrl+C."""
    with folder_of_all() as folder:
        checkout = Checkout(folder)
        shutil.copytree(wheels, checkout.wheels, ignore=lambda *_: ['cache'])
        # Not those in a home, which may be closed.
        put(checkout.bin, 'python3', 'exec /usr/bin/python3 "$@"')
        checkout.pythons = '3.14 3.13 3.12 3.11'
        checkout.lock('iniconfig')
        assert checkout.set_up(UV_PYTHON_INSTALL_DIR=str(folder / 'none')).returncode == 0
        take(folder)
        checkout.lock()
        (checkout.root / '.venv.new').mkdir()
        (checkout.root / '.venv.new/half').touch()
        (checkout.root / '.jupyter/lab').mkdir()
        answer = checkout.set_up(user=NOBODY)
        said = is_of_another(checkout.root / '.jupyter/lab', checkout.root)
        assert (answer.returncode, answer.stderr) == (1, f'{said}\n')
        take(checkout.root / '.jupyter')
        answer = checkout.set_up(user=NOBODY)
        said = is_of_another(checkout.root / '.venv.new', checkout.root)
        assert (answer.returncode, answer.stderr) == (0, f'{said} {UNTIL_THEN}\n')
        assert checkout.installed() == ONE
        take(checkout.root)
        answer = checkout.set_up(user=NOBODY)
        assert answer.returncode == 0, answer.stderr
        assert checkout.installed() == ALL
