"""The image of the lessons, used: `make test-containers`."""

import contextlib
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path

import nbformat
import pytest

from classroom.tests.support.containers import IMAGE, LIMITS
from classroom.tests.support.hubs import free_ports
from helpers.checks.verdict import KEY
from helpers.lesson import tags

# One that compiles, for the class in containers runs others.
LESSON = 'use_a_message_in_your_own_interface'
START_S = 180


@pytest.fixture(scope='module')
def port() -> int:
    [port] = free_ports(1)
    return port


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
            with contextlib.suppress(OSError):
                urllib.request.urlopen(f'http://127.0.0.1:{port}/api', timeout=5).close()
                print(f'\nanswers after {time.monotonic() - start:.1f} s')
                return mine
            time.sleep(0.2)
        raise AssertionError((folder / 'log').read_text())

    with (folder / 'log').open('w') as log:
        yield lab
    subprocess.run([*podman, 'rm', '--force', 'lab'], capture_output=True)


def test_size_and_user(image):
    print(f'\n{image["Size"] / 1e9:.2f} GB')
    assert image['Size'] <= 1.6e9
    assert image['Config']['User'] == '1000'
    assert '8888/tcp' in image['Config']['ExposedPorts']


def judged(notebook: Path) -> list:
    """Return the verdicts of a lesson's checks: as data, of an older check as text."""
    cells = nbformat.read(notebook, as_version=4).cells
    outputs = [
        cell.outputs
        for cell in cells
        if cell.cell_type == 'code' and {'check', 'solution'} & tags(cell)
    ]
    data = [out.metadata[KEY] for outs in outputs for out in outs if KEY in out.get('metadata', {})]
    # In however many pieces the text came.
    return data or [''.join(out.get('text', '') for out in outs) for outs in outputs]


def test_a_lesson(podman, image, make):
    """Run a lesson with the image's packages: its checks say what the saved ones say."""
    notebook = next(make.checkout.glob(f'notebooks/??_{LESSON}.ipynb'))
    # The user of the image is not root, and lessons write beside themselves.
    checkout = shutil.copytree(
        make.checkout,
        make.checkout.with_name('lessons'),
        symlinks=True,
    )
    subprocess.run(['chmod', '-R', 'a+rwX', checkout], check=True)
    checkout.parent.chmod(0o755)
    done = subprocess.run(
        [*podman, 'run', '--rm', *LIMITS.split(), '--shm-size=256m']
        + ['--volume', f'{checkout}:/checkout', '--workdir', '/checkout', IMAGE]
        + ['jupyter', 'nbconvert', '--execute', '--to=notebook', '--output=ran.ipynb']
        + [f'notebooks/{notebook.name}'],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert not done.returncode, done.stdout[-5000:]
    assert judged(checkout / 'notebooks/ran.ipynb') == judged(notebook)


def test_a_student_stops_and_goes_on(lab, make, podman, port):
    mine = lab()
    assert not subprocess.run([*podman, 'healthcheck', 'run', 'lab']).returncode
    # The port is the student's machine's only, and another container cannot have it.
    done = make('lab-container', f'PORT={port}', f'RUN_ARGS={LIMITS}', f'LESSONS={mine}-2')
    assert done.returncode
    assert 'in use' in done.stdout
    [notebook] = mine.glob(f'ros2_notebooks/??_{LESSON}.ipynb')
    written = notebook.read_text().replace('**You will**', 'I have written this.')
    notebook.write_text(written)
    subprocess.run([*podman, 'rm', '--force', 'lab'], capture_output=True)
    lab()
    assert 'I have written this.' in notebook.read_text()
