"""A class on one machine: a real JupyterHub, and students who run lessons at the same time.

Everything goes through the hub, as in a browser.
"""

import asyncio
import os
import socket
import tempfile
from pathlib import Path

from support.processes import segments
from support.waits import wait_for

from classroom.class_page.lessons import Known
from classroom.tests.support.hubs import (
    END_S,
    LESSONS,
    START_S,
    STUDENTS,
    Hub,
    listen,
    log_in,
    needs_hub,
    run_lessons,
    talk,
)
from helpers.lesson import read

pytestmark = needs_hub
# The accounts are folders, and all run as the user of this test.
CONFIG = """
c.JupyterHub.spawner_class = 'simple'
c.SimpleLocalProcessSpawner.home_dir_template = str(folder / 'home' / '{username}')
c.Spawner.args.append('--allow-root')
c.Spawner.environment['TMPDIR'] = str(folder)
"""
DOMAIN = 'import helpers.ros.domain; print(helpers.ros.domain.reserve_domain_id())'


async def teach(hub: Hub) -> None:
    students = await log_in(hub)
    guesses = await run_lessons(students)

    # All are in the class at once. Only administrators see it.
    assert hub.guesses() == guesses
    for token in (students[0].token, 'no token'):
        for path in ('', 'live', 'class.js'):
            answer = await hub.answer(f'/services/class/{path}', token)
            assert answer.code in (302, 403), path
    codes = [
        await asyncio.to_thread(hub.in_browser, name, '/services/class/')
        for name in ('teacher', STUDENTS[0])
    ]
    assert codes == [200, 403]

    # Nobody hears anybody else, not even a second kernel of the same student.
    others = ((s, path) for s in students for path in LESSONS if path.name not in s.kernels)
    await asyncio.gather(*(student.open(path) for student, path in others))
    kernels = {
        f'{student.name}_{name[:2]}': kernel
        for student in students
        for name, kernel in student.kernels.items()
    }
    assert len(kernels) == 2 * len(STUDENTS)
    domains = [int(await kernel.text(DOMAIN)) for kernel in kernels.values()]
    assert len(set(domains)) == len(kernels)
    await talk(kernels)
    used = set().union(*(segments(one.pid) for one in hub.processes()))
    assert used, 'no kernel used shared memory: this would not notice what is left'
    await listen(kernels)

    # Nothing is left.
    await asyncio.gather(*(student.log_out() for student in students))
    await asyncio.to_thread(wait_for, hub.processes, lambda left: not left, END_S)
    assert [path for path in used if os.path.exists(path)] == []


def test_a_class_of_twelve():
    # A short name: the path of a socket file is limited to 107 bytes.
    short = tempfile.TemporaryDirectory(prefix='hub-', dir='/tmp', ignore_cleanup_errors=True)
    with short as folder, Hub(Path(folder), CONFIG) as hub:
        asyncio.run(teach(hub))


async def survive(hub: Hub) -> None:
    """Six are at work when the hub is killed, and started again: all of it answers."""
    students = await log_in(hub, STUDENTS[:6])
    for student in students:
        await student.open(LESSONS[0])
    await guess(hub, students, 41)
    teacher = await hub.token_of('teacher')
    running = {process.pid for process in hub.processes()}

    hub.process.kill()
    hub.process.wait()
    hub.start()
    await hub.until_ready()
    assert (await hub.answer('/services/class/', teacher)).code == 200
    assert hub.last_guesses() == [41] * len(students)  # what was told is kept
    assert {process.pid for process in hub.processes()} >= running  # the kernels go on
    for student in students:
        for kernel in student.kernels.values():
            await kernel.connect()
            assert await kernel.text('print(my_guess)') == '41\n'
    await guess(hub, students, 14)

    # The deck is on another machine: the address with the secret opens the page, and no other one.
    secret = hub.ask_class('SELECT secret FROM class')[0]
    for wanted, code in ((secret, 200), ('0' * 16, 404)):
        assert (await hub.answer(f'/services/class/{wanted}/', 'no token')).code == code


async def guess(hub: Hub, students: list, number: int) -> None:
    """Let everybody guess a number, and wait until the class has been told."""
    question = next(iter(Known(read(LESSONS[0].read_text(), LESSONS[0].name)).guesses))
    code = f'from helpers.checks import *\nmy_guess = guess({question!r}, {number})'
    kernels = [kernel for student in students for kernel in student.kernels.values()]
    await asyncio.gather(*(kernel.text(code) for kernel in kernels))
    everybody = [number] * len(kernels)
    await asyncio.to_thread(wait_for, hub.last_guesses, lambda told: told == everybody, END_S)


def test_a_hub_that_was_killed():
    short = tempfile.TemporaryDirectory(prefix='hub-', dir='/tmp', ignore_cleanup_errors=True)
    with short as folder, Hub(Path(folder), CONFIG) as hub:
        asyncio.run(survive(hub))


def test_a_port_in_use(tmp_path):
    with socket.create_server(('127.0.0.1', 0)) as taken:
        hub = Hub(tmp_path, CONFIG, port=taken.getsockname()[1])
        assert hub.process.wait(START_S) == 1
    *_, said = hub.log.read_text().splitlines()
    assert f'The port of {hub.url} cannot be used (Address already in use' in said
