"""A class in containers, as of `make hub CONTAINERS=yes`: nobody notices what another one does."""

import asyncio
import contextlib
import os
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from support.waits import wait_for

from classroom.tests.support.containers import leave_out
from classroom.tests.support.hubs import (
    END_S,
    LESSONS,
    Hub,
    KernelEndedError,
    Student,
    listen,
    log_in,
    needs_hub,
    run_lessons,
    talk,
)

pytestmark = needs_hub
FILL = """
with open('/dev/shm/full', 'wb', buffering=0) as file:
    try:
        while True: file.write(bytes(2**20))
    except OSError as problem: print(problem.strerror)
"""
# What three of twelve students do while the others run lessons, and what each is told.
TROUBLE = {
    'memory': ('held = []\nwhile True: held.append(bytearray(b"x") * 10**8)', 'the kernel ended'),
    'shm': (FILL, 'No space left on device'),
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
# What `make hub CONTAINERS=yes` looks at before it starts.
CHECK = 'from classroom.hub.containers import use_service; print(use_service({!r})[0])'
MEMORY = 8e9  # bytes: nine students with a lesson, and one who fills 2 GB


async def make_trouble(student: Student, kind: str, over: asyncio.Event) -> None:
    """Take all that there is of one thing until the lessons of the others are over."""
    source, expected = TROUBLE[kind]
    while not over.is_set():
        kernel = await student.open(LESSONS[0])
        try:
            said = (await kernel.text(source)).strip()
        except KernelEndedError:
            said = 'the kernel ended'
            # A new kernel each moment would only keep the computer busy.
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(over.wait(), 10)
        else:
            await over.wait()  # what was taken is held
        assert said == expected
        await kernel.end()


async def use(student: Student) -> None:
    kernel = await student.open(LESSONS[0])
    assert (await kernel.text(USE)).split()[-1] == 'done'


async def go_on(student: Student, kind: str) -> None:
    """Free what was taken, and use a new kernel, on the same server."""
    if kind == 'shm':
        kernel = await student.open(LESSONS[0])
        await kernel.text('import os; os.remove("/dev/shm/full")')
    await use(student)


async def teach(hub: Hub) -> None:
    everybody = await log_in(hub)
    troubled = dict(zip(TROUBLE, everybody, strict=False))
    others = everybody[len(TROUBLE) :]

    over = asyncio.Event()
    tasks = [make_trouble(student, kind, over) for kind, student in troubled.items()]
    trouble = [asyncio.create_task(task) for task in tasks]
    try:
        guesses = await run_lessons(others)
        # All in one domain, each in a container. Nobody hears anybody else.
        kernels = {s.name: kernel for s in others for kernel in s.kernels.values()}
        await talk(kernels, 'domain_id=42')
        await listen(kernels)
        for student in others:
            await use(student)
    finally:
        over.set()
    await asyncio.gather(*trouble)
    assert hub.guesses() == guesses
    for kind, student in troubled.items():
        await go_on(student, kind)


@pytest.fixture
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
        wait_for(Path(folder, 'podman.sock').exists, timeout_s=END_S)
        yield address
    finally:
        process.terminate()
        process.wait(END_S)


def test_nobody_notices_the_trouble_of_others(make, service, folder):
    variables = {'PYTHONPATH': str(make.checkout), 'DOCKER_HOST': service}
    found, refused = (
        subprocess.run(
            [sys.executable, '-c', CHECK.format(solutions)],
            cwd=make.checkout,
            env=os.environ | variables,
            text=True,
            capture_output=True,
        )
        for solutions in ('yes', '00 01')
    )
    assert (found.returncode, found.stdout) == (0, 'host.containers.internal\n'), found.stderr
    assert 'run `sudo make image SOLUTIONS="00 01"` first' in refused.stderr
    state = folder / 'hub'
    state.mkdir()
    with Hub(state, '', make.checkout, CONTAINERS='yes', **variables) as hub:
        asyncio.run(teach(hub))
