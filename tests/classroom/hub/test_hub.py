"""A class on one machine: a real JupyterHub, and students who run lessons at the same time.

Everything goes through the hub, as in a browser: its REST API starts the servers, and the cells go
to the kernels over their websockets.
"""

import asyncio
import os
import socket
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from support.hubs import (
    END_S,
    LESSONS,
    START_S,
    Hub,
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
from support.processes import segments

pytestmark = needs_hub
STUDENTS = [f'student{number:02}' for number in range(1, 13)]
# The accounts are folders, and all run as whoever runs this test.
CONFIG = """
c.JupyterHub.spawner_class = 'simple'
c.SimpleLocalProcessSpawner.home_dir_template = str(folder / 'home' / '{username}')
c.Spawner.args.append('--allow-root')
c.Spawner.environment['TMPDIR'] = str(folder)
"""
# Somebody in the domain of a student, as no session does it.
GUEST = """
import os, sys, time, rclpy
from std_msgs.msg import String
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
rclpy.init(domain_id=int(sys.argv[1]))
publisher = rclpy.create_node('guest').create_publisher(String, 'topic', 10)
while rclpy.ok() and os.getppid() == int(sys.argv[2]):
    publisher.publish(String(data='guest'))
    time.sleep(0.1)
"""
DOMAIN = 'import helpers._plumbing.domain; print(helpers._plumbing.domain.reserve_domain_id())'


@dataclass
class Seen:
    """What was seen of a class, from its first log-in to its end."""

    lessons: list[LessonRun] = field(default_factory=list)
    told: list[list[str]] = field(default_factory=list)
    refused: list[int] = field(default_factory=list)
    domains: list[int] = field(default_factory=list)
    heard: dict[str, set[str]] = field(default_factory=dict)
    segments: set[str] = field(default_factory=set)
    segments_left: set[str] = field(default_factory=set)
    processes_left: list[str] = field(default_factory=list)


async def everybody_talks(students: list[Student], seen: Seen) -> None:
    """All kernels talk at once, and a guest in the domain of the first one."""
    kernels = {
        f'{student.name}_{name[:2]}': kernel
        for student in students
        for name, kernel in student.kernels.items()
    }
    seen.domains = [int(await kernel.text(DOMAIN)) for kernel in kernels.values()]
    await talk(kernels)
    seen.segments = set().union(*(segments(one.pid) for one in students[0].hub.processes()))
    guest = subprocess.Popen([sys.executable, '-c', GUEST, str(seen.domains[0]), str(os.getpid())])
    try:
        seen.heard = await listen(kernels, {next(iter(kernels)): {'guest'}})
    finally:
        guest.terminate()
        guest.wait(END_S)


async def teach(hub: Hub) -> Seen:
    seen = Seen()
    students = [Student(hub, name) for name in STUDENTS]
    await log_in(students)
    seen.lessons = await run_lessons(students)
    seen.told = await told_to_the_class(hub)
    for token in (students[0].token, 'no token'):
        for path in ('', 'live', 'class.csv'):
            seen.refused.append(await hub.status(f'/services/class/{path}', token))
    await everybody_talks(students, seen)
    await asyncio.gather(*(student.log_out() for student in students))
    limit = time.monotonic() + END_S
    while (left := hub.processes()) and time.monotonic() < limit:
        await asyncio.sleep(0.2)
    seen.processes_left = [' '.join(process.cmdline()) for process in left]
    seen.segments_left = {path for path in seen.segments if os.path.exists(path)}
    return seen


@pytest.fixture(scope='module')
def seen() -> Seen:
    # A short name: the path of a socket file is limited to 107 bytes.
    short = tempfile.TemporaryDirectory(prefix='hub-', dir='/tmp', ignore_cleanup_errors=True)
    with short as folder, Hub(Path(folder), CONFIG) as hub:
        return asyncio.run(teach(hub))


def test_every_loss_is_explained_to_each_student(seen):
    assert len(seen.lessons) == 2 * len(STUDENTS)
    assert [error for lesson in seen.lessons for error in lesson.errors] == []
    assert [lesson.student for lesson in seen.lessons if not lesson.explained] == []


def test_only_administrators_see_the_class(seen):
    told = guesses_of(seen.told)
    assert len(told) == len(STUDENTS)
    assert all(guessed == asked_in(LESSONS) for guessed in told.values())
    assert set(seen.refused) <= {302, 403}


def test_nobody_hears_anybody_else(seen):
    assert len(seen.heard) == 2 * len(STUDENTS)
    assert len(set(seen.domains)) == len(seen.heard)
    guests_host = next(iter(seen.heard))
    assert seen.heard == {
        name: {name, 'guest'} if name == guests_host else {name} for name in seen.heard
    }


def test_nothing_is_left(seen):
    assert seen.processes_left == []
    assert seen.segments, 'no kernel used shared memory: this would not notice what is left'
    assert seen.segments_left == set()


def test_a_port_in_use(tmp_path):
    with socket.create_server(('127.0.0.1', 0)) as taken:
        hub = Hub(tmp_path, CONFIG, port=taken.getsockname()[1])
        assert hub.process.wait(START_S) == 1
    *_, said = hub.log.read_text().splitlines()
    assert f'The port of {hub.url} is already in use: choose another one' in said
