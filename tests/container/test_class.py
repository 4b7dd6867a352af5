"""A class in containers, as of `make hub CONTAINERS=yes`: nobody notices what another one does."""

import asyncio
import contextlib
import importlib.util
import json
import os
import random
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import nbformat
import psutil
import pytest
from support.containers import leave_out
from support.hubs import (
    END_S,
    LESSONS,
    START_S,
    Hour,
    Hub,
    KernelEndedError,
    Student,
    asked_in,
    guesses_of,
    listen,
    talk,
    told_to_the_class,
)
from tornado.httpclient import HTTPClientError

HUB = '169.254.20.81'  # where containers reach the hub, and no other machine

# What four of twelve students do while the others run lessons, and what each is told.
TROUBLE = {
    'memory': ('held = []\nwhile True: held.append(bytearray(b"x") * 10**8)', 'the kernel ended'),
    'disk': (
        'with open("full", "wb", buffering=0) as file:\n'
        '    try:\n'
        '        while True: file.write(bytes(2**20))\n'
        '    except OSError as problem: print(problem.strerror)',
        'No space left on device',
    ),
    'shm': (
        'with open("/dev/shm/full", "wb", buffering=0) as file:\n'
        '    try:\n'
        '        while True: file.write(bytes(2**20))\n'
        '    except OSError as problem: print(problem.strerror)',
        'No space left on device',
    ),
    'threads': (
        'import threading\n'
        'stop = threading.Event()\n'
        'try:\n'
        '    for _ in range(500): threading.Thread(target=stop.wait).start()\n'
        'except RuntimeError as problem: print(problem)\n',
        "can't start new thread",
    ),
}
# What the others do meanwhile, besides their lessons.
USE = """
import threading
for _path in ('small', '/dev/shm/small'):
    with open(_path, 'wb') as _file:
        _file.write(bytes(10**7))
_memory = bytearray(b'x') * 3 * 10**8
for _ in range(50):
    threading.Thread(target=print).start()
del _memory
print('done')
"""
STUDENTS = [f'student{number:02}' for number in range(1, 13)]
MEMORY = 8e9  # bytes: eight students with two lessons, and one who fills 2 GB
IDLE_S = 20  # after which a server is ended here; in a class it is an hour
CULL = f"""
c.JupyterHub.services[1]['command'] = [
    {sys.executable!r}, '-m', 'jupyterhub_idle_culler', '--timeout={IDLE_S}', '--cull-every=2',
]
"""


@dataclass
class ClassHour(Hour):
    """What was seen of a class."""

    disk_mb: list[float] = field(default_factory=list)
    trouble: dict[str, set[str]] = field(default_factory=dict)
    used: list[str] = field(default_factory=list)
    after_trouble: list[str] = field(default_factory=list)
    open_at: list[str] = field(default_factory=list)
    written: dict[str, set[str]] = field(default_factory=dict)


@dataclass
class NextHour:
    """What was seen after the hub had started again, with newer lessons."""

    newer: set[str] = field(default_factory=set)
    lines: dict[str, set[str]] = field(default_factory=dict)
    running: set[str] = field(default_factory=set)
    log: str = ''


def open_addresses(port: int) -> list[str]:
    """Return at which addresses of this machine something listens on a port."""
    addresses = {
        one.address
        for interface in psutil.net_if_addrs().values()
        for one in interface
        if one.family == socket.AF_INET
    }
    found = []
    for address in sorted(addresses):
        with contextlib.suppress(OSError), socket.create_connection((address, port), timeout=5):
            found.append(address)
    return found


async def make_trouble(student: Student, kind: str, over: asyncio.Event) -> set[str]:
    """Take all that there is of one thing until the lessons of the others are over."""
    source, _ = TROUBLE[kind]
    said = set()
    while not over.is_set():
        kernel = await student.open(LESSONS[0])
        try:
            said.add((await kernel.text(source)).strip())
        except KernelEndedError:
            said.add('the kernel ended')
            await asyncio.sleep(2)
        else:
            await over.wait()  # what was taken is held
        await kernel.end()
    return said


async def go_on(student: Student, kind: str) -> str:
    """Free what was taken, and use a new kernel, on the same server."""
    if kind == 'disk':
        await student.ask('api/contents/full', 'DELETE')  # as in JupyterLab
    kernel = await student.open(LESSONS[0])
    if kind == 'shm':
        await kernel.text('import os; os.remove("/dev/shm/full")')
    return (await kernel.text(USE)).split()[-1]


def write(notebook: dict, words: str, draw: random.Random) -> set[str]:
    """Write into a notebook as somebody who takes notes and tries things. Return the new lines."""
    lines = set()
    for number, cell in enumerate(draw.sample(notebook['cells'], 6)):
        line = f'# {words} {number}'
        lines.add(line)
        if number % 2:
            cell['source'] += f'\n{line}'
        else:
            new = {'cell_type': 'markdown', 'id': f'{draw.getrandbits(32):08x}', 'metadata': {}}
            notebook['cells'].insert(notebook['cells'].index(cell), new | {'source': line})
    return lines


async def write_own(student: Student) -> set[str]:
    model = await student.ask(f'api/contents/{LESSONS[0].name}')
    lines = write(model['content'], f'{student.name} wrote', random.Random(student.name))
    wanted = {'type': 'notebook', 'content': model['content']}
    await student.ask(f'api/contents/{LESSONS[0].name}', 'PUT', wanted)
    return lines


async def lines_of(student: Student) -> set[str]:
    model = await student.ask(f'api/contents/{LESSONS[0].name}')
    cells = nbformat.from_dict(model['content']).cells
    return {line for cell in cells for line in cell.source.split('\n')}


async def teach(hub: Hub, homes: Path) -> ClassHour:
    hour = ClassHour()
    everybody = [Student(hub, name) for name in STUDENTS]
    troubled, others = everybody[: len(TROUBLE)], everybody[len(TROUBLE) :]
    await hour.log_in(everybody)
    hour.open_at = open_addresses(hub.hub_port)

    over = asyncio.Event()
    trouble = [
        asyncio.create_task(make_trouble(student, kind, over))
        for student, kind in zip(troubled, TROUBLE, strict=True)
    ]
    try:
        await hour.run_lessons(others)
        kernels = {student.name: student.kernels[LESSONS[0].name] for student in others}
        hour.used = [(await kernel.text(USE)).split()[-1] for kernel in kernels.values()]
        # All in one domain, and not on their own machine only.
        session = 'domain_id=42, discovery="SUBNET"'
        await talk(kernels, session)
        hour.heard = await listen(kernels, {})
    finally:
        over.set()
    hour.trouble = dict(zip(TROUBLE, await asyncio.gather(*trouble), strict=True))
    hour.told = await told_to_the_class(hub)

    for student, kind in zip(troubled, TROUBLE, strict=True):
        hour.after_trouble.append(await go_on(student, kind))
    hour.disk_mb = [shutil.disk_usage(homes / student.name).used / 1e6 for student in others]
    hour.written = {student.name: await write_own(student) for student in others}
    return hour


async def teach_newer_lessons(hub: Hub, homes: Path, running: Callable[[], set[str]]) -> NextHour:
    """Let three students of the class come back twice, and one come whose disk has no room."""
    hour = NextHour()
    students = [Student(hub, name) for name in STUDENTS[-3:]]
    await hub.until_ready()
    for again in range(2):
        await asyncio.gather(*(student.log_in() for student in students))
        hour.lines = {student.name: await lines_of(student) for student in students}
        if not again:
            hour.running = running()
            async with asyncio.timeout(IDLE_S + START_S):
                while running():
                    await asyncio.sleep(1)
    disks = homes.with_name('disks')
    subprocess.run(['mount', '-t', 'tmpfs', '-o', 'size=100m', 'tmpfs', disks], check=True)
    with contextlib.suppress(AssertionError, HTTPClientError):  # the server does not start
        await Student(hub, 'late').log_in()
    subprocess.run(['umount', disks], check=True)
    return hour


@pytest.fixture(scope='module')
def service(podman, image, folder):
    """Start podman's service, as `systemctl start podman.socket` does. Return its address."""
    if not all(map(importlib.util.find_spec, ('jupyterhub', 'dockerspawner'))):
        leave_out('the packages of `make hub` are not installed')
    if psutil.virtual_memory().available < MEMORY:
        leave_out(f'a class needs {MEMORY / 1e9:.0f} GB of memory')
    address = f'unix://{folder}/podman.sock'
    with (folder / 'service.log').open('w') as log:
        process = subprocess.Popen(
            [*podman, 'system', 'service', '--time=0', address],
            cwd=folder,  # where it writes a file `oom`
            stdout=log,
            stderr=log,
        )
    try:
        limit = time.monotonic() + END_S
        while not (folder / 'podman.sock').exists():
            assert process.poll() is None
            assert time.monotonic() < limit
            time.sleep(0.1)
        yield address
    finally:
        process.terminate()
        process.wait(END_S)


@pytest.fixture(scope='module')
def start(make, service, folder):
    """Start the hub of `make hub CONTAINERS=yes`, with a configuration of its own."""

    variables = {'PYTHONPATH': str(make.checkout), 'DOCKER_HOST': service}

    def check() -> str:
        """Return what `make hub` says before it starts, if it cannot."""
        script = 'exec "$0" tools/hub/service.py "$(tools/container/run.sh label)"'
        done = subprocess.run(
            ['sh', '-c', script, sys.executable],
            cwd=make.checkout,
            env=os.environ | variables,
            capture_output=True,
            text=True,
        )
        assert done.stdout == ('' if done.returncode else f'{service}\n')
        return done.stderr

    def start(config: str = '') -> Hub:
        assert check() == ''
        state = folder / 'hub'
        state.mkdir(exist_ok=True)
        return Hub(state, config, make.checkout, CONTAINERS='yes', **variables)

    start.check = check
    return start


@pytest.fixture(scope='module')
def homes(make) -> Path:
    return make.checkout / '.jupyter/hub/homes'


@pytest.fixture(scope='module')
def hour(start, homes) -> ClassHour:
    with start() as hub:
        return asyncio.run(teach(hub, homes))


@pytest.fixture(scope='module')
def next_hour(hour, start, homes, make, podman) -> NextHour:
    """Make newer lessons, then start the hub once more."""
    path = make.checkout / 'notebooks' / LESSONS[0].name
    notebook = json.loads(path.read_text())
    for cell in notebook['cells']:
        cell['source'] = ''.join(cell['source'])
    newer = write(notebook, 'newer', random.Random(0))
    path.write_text(json.dumps(notebook))
    assert start.check() == (
        'The image is not of these lessons: run `sudo make image`, then try again.\n'
    )
    make.image()

    def running() -> set[str]:
        names = [*podman, 'ps', '--format', '{{.Names}}']
        return set(subprocess.run(names, check=True, capture_output=True, text=True).stdout.split())

    with start(CULL) as hub:
        found = asyncio.run(teach_newer_lessons(hub, homes, running))
        found.log = hub.log.read_text()
    found.newer = newer
    return found


def test_nobody_notices_the_trouble_of_others(hour):
    hour.print_costs()
    print(f'Disk {max(hour.disk_mb):.0f} MB')
    assert hour.trouble == {kind: {said} for kind, (_, said) in TROUBLE.items()}
    assert len(hour.lessons) == 2 * (len(STUDENTS) - len(TROUBLE))
    for lesson in hour.lessons:
        outputs = [output for cell in lesson.outputs for output in cell]
        assert [o.get('evalue') for o in outputs if o.output_type == 'error'] == []
        assert lesson.explained
    assert hour.used == ['done'] * (len(STUDENTS) - len(TROUBLE))


def test_the_server_of_who_took_all_goes_on(hour):
    assert hour.after_trouble == ['done'] * len(TROUBLE)


def test_nobody_hears_anybody_else(hour):
    assert hour.heard == {name: {name} for name in STUDENTS[len(TROUBLE) :]}


def test_everybody_is_in_the_class(hour):
    guessed = list(guesses_of(hour.told).values())
    assert guessed.count(asked_in(LESSONS)) == len(STUDENTS) - len(TROUBLE)


def test_the_hub_is_not_open_in_the_network(hour):
    assert hour.open_at == [HUB]


def test_newer_lessons_lose_no_line(hour, next_hour):
    for name, lines in next_hour.lines.items():
        assert hour.written[name] | next_hour.newer <= lines


def test_an_idle_server_is_ended_and_its_files_stay(next_hour):
    assert len(next_hour.running) == len(next_hour.lines)
    assert len(next_hour.lines) == 3


def test_no_room_for_a_disk(next_hour):
    assert 'There is no room for your disk of 1G: tell your teacher' in next_hour.log
