"""`make lab`: whatever keeps JupyterLab from starting gets one sentence, and then it starts."""

import json
import os
import shutil
import signal
import socket
import subprocess
import urllib.request

import pexpect
import pytest
from support.lab_server import ROOT, START_LIMIT_S, command_of, made
from support.processes import put
from support.troubles import another_user, as_root, folder_of_all, full, read_only, small_disk

from helpers.lesson import path_of
from helpers.machine import OWNED, sentence_about
from tools.lab import not_brought_over

ADDRESS = r'http://localhost:(\d+)/lab/tree/notebooks/00_start_here.ipynb\?token=\w+'
# A network without anything but this machine.
ALONE = ('unshare', '--net', 'sh', '-c', 'ip link set lo up && exec "$@"', 'sh')


def said(folder, *options):
    """Return the sentence with which `make lab` ends at once."""
    command = command_of(folder, 'lab', *options)
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode
    return done.stderr.splitlines()[-2]  # the last line is that of make


@as_root
def test_a_full_disk_is_named_and_with_room_it_starts(tmp_path):
    with small_disk(tmp_path / 'disk') as disk:
        with full(disk, but=500_000):
            assert said(disk) == f'There is no room left in {ROOT}. Make room, then try again.'
        with made(disk, ADDRESS, 'lab'):
            pass


@pytest.mark.parametrize('port', ['eight', '70000', '-1'])
def test_what_is_no_port_is_named(tmp_path, port):
    assert said(tmp_path, f'PORT={port}') == (
        f'{port} is no port: give a number, such as PORT=8899.'
    )


def test_a_port_in_use_is_named(tmp_path):
    with socket.create_server(('localhost', 0)) as taken:
        port = taken.getsockname()[1]
        assert said(tmp_path, f'PORT={port}') == (
            f'Port {port} is in use: give another one, such as PORT=8899.'
        )


def test_two_at_once_have_two_ports(tmp_path):
    for name in 'one', 'two':
        (tmp_path / name).mkdir()
    with (
        made(tmp_path / 'one', ADDRESS, 'lab', 'PORT=') as (_, one),
        made(tmp_path / 'two', ADDRESS, 'lab', 'PORT=') as (_, two),
    ):
        assert one[1] != two[1]


def test_after_kill_9_it_starts_again(tmp_path):
    with made(tmp_path, ADDRESS, 'lab') as (process, _):
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    with made(tmp_path, ADDRESS, 'lab'):
        pass


def test_ctrl_c_twice_ends_it(tmp_path):
    command, *arguments = command_of(tmp_path, 'lab')
    lab = pexpect.spawn(command, arguments, cwd=ROOT, timeout=START_LIMIT_S, encoding='utf-8')
    lab.expect(ADDRESS)
    lab.sendintr()
    lab.expect('Shut down this Jupyter server')
    lab.sendintr()
    lab.expect(pexpect.EOF)
    lab.close()
    assert 'Traceback' not in lab.before


def test_nothing_is_written_into_the_home(tmp_path, monkeypatch):
    home = tmp_path / 'home'
    home.mkdir()
    # As the npm of a machine does, which JupyterLab asks for language servers.
    put(tmp_path, 'npm', 'mkdir -p ~/.npm/_logs')
    monkeypatch.setenv('HOME', str(home))
    monkeypatch.setenv('PATH', f'{tmp_path}:{os.environ["PATH"]}')
    with made(tmp_path, ADDRESS, 'lab') as (_, found):
        urllib.request.urlopen(found[0]).read()
    assert not list(home.iterdir())


@pytest.mark.parametrize('outputs', ['no', 'yes'])
def test_saved_outputs_are_shown_to_those_who_ask_for_them(tmp_path, outputs):
    lesson = path_of('publish_and_subscribe')
    (tmp_path / 'notebooks').mkdir()
    shutil.copy(lesson, tmp_path / 'notebooks')
    with made(tmp_path, ADDRESS, 'lab', f'OUTPUTS={outputs}') as (_, found):
        address = found[0].replace('lab/tree/notebooks/00_start_here.ipynb', '')
        server, token = address.split('?')
        file = f'{server}api/contents/notebooks/{lesson.name}?{token}'
        cells = json.load(urllib.request.urlopen(file))['content']['cells']
    assert any(cell.get('outputs') for cell in cells) == (outputs == 'yes')


@as_root
def test_it_starts_without_a_network(tmp_path):
    if not shutil.which('ip'):
        pytest.skip('LEFT OUT: a machine without a network needs iproute2.')
    with made(tmp_path, ADDRESS, 'lab', inside=ALONE):
        pass


# --- What a disk refuses --------------------------------------------------------------------------


def sentence(file, root):
    try:
        file.write_bytes(bytes(10_000))
    except OSError as error:
        return sentence_about(error, root)
    return 'It was written.'


@as_root
def test_each_trouble_of_a_disk_has_its_sentence():
    with folder_of_all() as root, small_disk(root / 'disk') as disk:
        cannot = f'The folder {root} cannot be written: copy it to one of your own, then try again.'
        with full(disk):
            assert sentence(disk / 'a', root) == (
                f'There is no room left in {root}. Make room, then try again.'
            )
        with read_only(root):
            assert sentence(root / 'a', root) == cannot
        file = root / 'notebooks' / 'a'
        file.parent.mkdir()
        with another_user():
            assert sentence(file, root) == cannot
        os.chown(root, 65534, 65534)
        with another_user():
            assert sentence(file, root) == (
                f"{file.parent} is another user's: take it with "
                f'`sudo chown -R "$(id -u)" "{root}"`, then try again.'
            )
            assert sentence(root.parent / 'a' / 'b', root).endswith(
                '/b: No such file or directory.'
            )


def test_files_of_version_0_3_that_wait_for_a_second_update_are_named(tmp_path):
    folder = tmp_path / 'scratch/lesson_09'
    folder.mkdir(parents=True)
    assert not_brought_over(tmp_path) == ''  # nobody has written anything there
    (folder / OWNED).touch()
    assert 'once more, as before: it brings over what is in scratch/lesson_09.' in (
        not_brought_over(tmp_path)
    )
