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
from nbformat import NotebookNode
from support.hubs import (
    END_S,
    LESSONS,
    START_S,
    Hour,
    Hub,
    Lesson,
    Student,
    asked_in,
    differences,
    guesses_of,
    listen,
    talk,
    told_to_the_class,
)
from support.processes import segments

STUDENTS = [f'student{number:02}' for number in range(1, 13)]
# The accounts are folders, and all run as whoever runs this test.
CONFIG = """
c.JupyterHub.spawner_class = 'simple'
c.SimpleLocalProcessSpawner.home_dir_template = str(folder / 'home' / '{username}')
c.Spawner.args.append('--allow-root')
c.Spawner.environment['TMPDIR'] = str(folder)
"""


# --- The class -----------------------------------------------------------------------------------


@dataclass
class ClassHour(Hour):
    """What was seen of a class, from its first log-in to its end."""

    domains: list[int] = field(default_factory=list)
    strangers: list[str] = field(default_factory=list)
    stalled: dict[str, str] = field(default_factory=dict)
    kernels_left: list[dict] = field(default_factory=list)
    segments: set[str] = field(default_factory=set)
    segments_left: set[str] = field(default_factory=set)
    refused: list[int] = field(default_factory=list)
    processes_left: list[str] = field(default_factory=list)


# After lesson 02: each message that its recordings hold was published here, and is heard once.
STRANGERS = """
for _table in (table, short_table, Recording.latest.table()):
    assert _table['seq'].is_unique
    for _seq in _table.loc[_table['published_s'].isna(), 'seq']:
        print(_seq)
"""
# After lesson 03: did D lose a message although it ran as many callbacks at once as it needs? Then
# its executor got no turn for ten periods, half a second: the machine was too busy.
STALLED = """
_d = tables['D']
if _d['started_s'].isna().any() and most_at_once(_d) >= CALLBACK_S / PERIOD_S:
    print(f"waited {(_d['started_s'] - _d['published_s']).max():.2f} s")
"""
DOMAIN = 'import helpers.domain; print(helpers.domain.reserve_domain_id())'
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


async def everybody_talks(students: list[Student], hour: ClassHour) -> None:
    """All kernels talk at once, and a guest in the domain of the first one."""
    kernels = {
        f'{student.name}_{name[:2]}': kernel
        for student in students
        for name, kernel in student.kernels.items()
    }
    hour.domains = [int(await kernel.text(DOMAIN)) for kernel in kernels.values()]
    await talk(kernels)
    hour.segments = set().union(*(segments(one.pid) for one in students[0].hub.processes()))
    guest = subprocess.Popen([sys.executable, '-c', GUEST, str(hour.domains[0]), str(os.getpid())])
    try:
        hour.heard = await listen(kernels, {next(iter(kernels)): {'guest'}})
    finally:
        guest.terminate()
        guest.wait(END_S)


async def teach(hub: Hub) -> ClassHour:
    hour = ClassHour()
    students = [Student(hub, name) for name in STUDENTS]
    await hour.log_in(students)
    await hour.run_lessons(students)
    for student in students:
        hour.strangers += (await student.kernels[LESSONS[0].name].text(STRANGERS)).split()
        if waited := await student.kernels[LESSONS[1].name].text(STALLED):
            hour.stalled[student.name] = waited

    hour.told = await told_to_the_class(hub)
    for token in (students[0].token, 'no token'):
        for path in ('', 'live', 'class.csv'):
            hour.refused.append(await hub.status(f'/services/class/{path}', token))

    await everybody_talks(students, hour)

    # Half of the class ends its kernels, the other half only logs out.
    for student in students[::2]:
        for kernel in student.kernels.values():
            await kernel.end()
        hour.kernels_left += await student.ask('api/kernels')
    await asyncio.gather(*(student.log_out() for student in students))
    limit = time.monotonic() + END_S
    while (left := hub.processes()) and time.monotonic() < limit:
        await asyncio.sleep(0.2)
    hour.processes_left = [' '.join(process.cmdline()) for process in left]
    hour.segments_left = {path for path in hour.segments if os.path.exists(path)}
    return hour


@pytest.fixture(scope='module')
def hour(request) -> ClassHour:
    # A short name: the path of a socket file is limited to 107 bytes.
    short = tempfile.TemporaryDirectory(prefix='hub-', dir='/tmp', ignore_cleanup_errors=True)
    with short as folder, Hub(Path(folder), CONFIG) as hub:
        yield asyncio.run(teach(hub))


# --- What is expected of it ----------------------------------------------------------------------


def test_every_student_sees_what_is_saved(hour, request):
    assert len(hour.lessons) == 2 * len(STUDENTS)
    compared = [
        lesson
        for lesson in hour.lessons
        if lesson.path == LESSONS[0] or lesson.student not in hour.stalled
    ]
    said = [text for lesson in compared for text in differences(request.session, lesson)]
    assert not said, '\n'.join(said)
    assert len(hour.stalled) < len(STUDENTS), 'in each run of lesson 03 the machine was too busy'
    longest = max(max(lesson.seconds) for lesson in hour.lessons)
    print(
        f'\nThe longest cell took {longest:.0f} s. '
        f'Too busy for D of lesson 03: {hour.stalled or "none"}'
    )


def test_every_student_is_in_the_class_and_only_administrators_see_it(hour):
    told = guesses_of(hour.told)
    assert len(told) == len(STUDENTS)
    assert all(guessed == asked_in(LESSONS) for guessed in told.values())
    assert set(hour.refused) <= {302, 403}


def test_a_difference_would_be_seen(hour, request):
    lesson = hour.lessons[0]
    outputs = [[NotebookNode(output) for output in cell] for cell in lesson.outputs]
    last = next(o for cell in reversed(outputs) for o in cell if 'text' in o)
    last['text'] = last['text'].replace('[ok]', '[not yet]')
    said = differences(request.session, Lesson(lesson.student, lesson.path, outputs))
    assert len(said) == 1
    assert 'Cell outputs differ' in said[0]


def test_every_loss_is_explained(hour):
    assert [lesson.student for lesson in hour.lessons if not lesson.explained] == []


def test_nobody_hears_anybody_else(hour):
    assert len(hour.heard) == 2 * len(STUDENTS)
    assert len(set(hour.domains)) == len(hour.heard)
    assert all(1 <= domain <= 100 for domain in hour.domains)
    assert hour.strangers == []
    guests_host = next(iter(hour.heard))
    assert hour.heard == {
        name: {name, 'guest'} if name == guests_host else {name} for name in hour.heard
    }


def test_nothing_is_left(hour):
    assert hour.kernels_left == []
    assert hour.processes_left == []
    assert hour.segments, 'no kernel used shared memory: this would not notice what is left'
    assert hour.segments_left == set()


def test_costs(hour):
    hour.print_costs()
    assert 30 * max(hour.costs)[0] < 24e3, 'thirty students need more than 24 GB'


def test_a_port_in_use(tmp_path):
    with socket.create_server(('127.0.0.1', 0)) as taken:
        hub = Hub(tmp_path, CONFIG, port=taken.getsockname()[1])
        assert hub.process.wait(START_S) == 1
    *_, said = hub.log.read_text().splitlines()
    assert f'The port of {hub.url} is already in use: choose another one' in said
