"""A class in containers, as of `make hub CONTAINERS=yes`: nobody notices what another one does."""

import asyncio
import contextlib
import os
import socket
import subprocess
import sys
import time
from dataclasses import dataclass, field

import psutil
import pytest
from support.containers import leave_out
from support.hubs import (
    END_S,
    LESSONS,
    Hub,
    KernelEndedError,
    LessonRun,
    Student,
    asked_in,
    guesses_of,
    listen,
    log_in,
    needs_hub,
    run_lessons,
    talk,
    told_to_the_class,
)

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
pytestmark = needs_hub
STUDENTS = [f'student{number:02}' for number in range(1, 13)]
# What `make hub CONTAINERS=yes` looks at before it starts.
CHECK = (
    'from tools.classroom.hub.service import service, take_address\n'
    'print(service())\n'
    'take_address()'
)
MEMORY = 8e9  # bytes: eight students with two lessons, and one who fills 2 GB


@dataclass
class Seen:
    """What was seen of a class."""

    lessons: list[LessonRun] = field(default_factory=list)
    trouble: dict[str, set[str]] = field(default_factory=dict)
    used: list[str] = field(default_factory=list)
    after_trouble: list[str] = field(default_factory=list)
    heard: dict[str, set[str]] = field(default_factory=dict)
    told: list[list[str]] = field(default_factory=list)
    open_at: list[str] = field(default_factory=list)


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


async def teach(hub: Hub) -> Seen:
    seen = Seen()
    everybody = [Student(hub, name) for name in STUDENTS]
    troubled, others = everybody[: len(TROUBLE)], everybody[len(TROUBLE) :]
    await log_in(everybody)
    seen.open_at = open_addresses(hub.hub_port)

    over = asyncio.Event()
    trouble = [
        asyncio.create_task(make_trouble(student, kind, over))
        for student, kind in zip(troubled, TROUBLE, strict=True)
    ]
    try:
        seen.lessons = await run_lessons(others)
        kernels = {student.name: student.kernels[LESSONS[0].name] for student in others}
        seen.used = [(await kernel.text(USE)).split()[-1] for kernel in kernels.values()]
        # All in one domain, and not on their own machine only.
        await talk(kernels, 'domain_id=42, discovery="SUBNET"')
        seen.heard = await listen(kernels, {})
    finally:
        over.set()
    seen.trouble = dict(zip(TROUBLE, await asyncio.gather(*trouble), strict=True))
    seen.told = await told_to_the_class(hub)
    for student, kind in zip(troubled, TROUBLE, strict=True):
        seen.after_trouble.append(await go_on(student, kind))
    return seen


@pytest.fixture(scope='module')
def service(podman, image, folder):
    """Start podman's service, as `systemctl start podman.socket` does. Return its address."""
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
def seen(make, service, folder) -> Seen:
    """Teach a class on the hub of `make hub CONTAINERS=yes`, with a configuration of its own."""
    variables = {'PYTHONPATH': str(make.checkout), 'DOCKER_HOST': service}
    found = subprocess.run(
        [sys.executable, '-c', CHECK],
        cwd=make.checkout,
        env=os.environ | variables,
        text=True,
        capture_output=True,
    )
    assert (found.returncode, found.stdout) == (0, f'{service}\n'), found.stderr
    state = folder / 'hub'
    state.mkdir()
    with Hub(state, '', make.checkout, CONTAINERS='yes', **variables) as hub:
        return asyncio.run(teach(hub))


def test_nobody_notices_the_trouble_of_others(seen):
    assert seen.trouble == {kind: {said} for kind, (_, said) in TROUBLE.items()}
    assert len(seen.lessons) == 2 * (len(STUDENTS) - len(TROUBLE))
    assert [error for lesson in seen.lessons for error in lesson.errors] == []
    assert all(lesson.explained for lesson in seen.lessons)
    assert seen.used == ['done'] * (len(STUDENTS) - len(TROUBLE))


def test_a_server_goes_on_after_all_was_taken(seen):
    assert seen.after_trouble == ['done'] * len(TROUBLE)


def test_nobody_hears_anybody_else(seen):
    assert seen.heard == {name: {name} for name in STUDENTS[len(TROUBLE) :]}


def test_everybody_is_in_the_class(seen):
    guessed = list(guesses_of(seen.told).values())
    assert guessed.count(asked_in(LESSONS)) == len(STUDENTS) - len(TROUBLE)


def test_the_hub_is_not_open_in_the_network(seen):
    assert seen.open_at == [HUB]
