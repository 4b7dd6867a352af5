"""A class on one machine: a real JupyterHub, and students who run lessons at the same time.

Everything goes through the hub, as in a browser: its REST API starts the servers, and the cells go
to the kernels over their websockets.
"""

import asyncio
import contextlib
import csv
import json
import os
import re
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import uuid
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty

import domain_coordinator
import domain_coordinator.impl
import nbformat
import psutil
import pytest
from nbformat import NotebookNode
from nbval.plugin import IPyNbFile, NbCellError
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from tools.class_server.lessons import Known
from tools.lessons.lesson import read

ROOT = Path(__file__).resolve().parent.parent.parent
CLAIMS = {  # of the lessons that the students run, by the lesson's name
    'lose_messages': 'All is as a KEEP_LAST queue must do it: True',
    'run_callbacks_in_parallel': 'D explained with 8 threads at work: True',
}
LESSONS = [next((ROOT / 'notebooks').glob(f'??_{name}.ipynb')) for name in CLAIMS]
STUDENTS = [f'student{number:02}' for number in range(1, 13)]
LATE = 'student101'
START_S = 300  # until the servers of all students answer
CELL_S = 120
END_S = 60

CONFIG = """
from pathlib import Path
load_subconfig({config!r})
folder = Path({folder!r})
c.JupyterHub.authenticator_class = 'dummy'
c.JupyterHub.spawner_class = 'simple'
c.SimpleLocalProcessSpawner.home_dir_template = str(folder / 'home' / '{{username}}')
c.JupyterHub.hub_port = {hub_port}
c.ConfigurableHTTPProxy.api_url = 'http://127.0.0.1:{proxy_port}'
c.ConfigurableHTTPProxy.pid_file = str(folder / 'proxy.pid')
c.JupyterHub.db_url = f'sqlite:///{{folder}}/hub.sqlite'
c.JupyterHub.cookie_secret_file = str(folder / 'cookie_secret')
c.Authenticator.admin_users = {{'teacher'}}
c.JupyterHub.services[0]['url'] = 'http://127.0.0.1:{class_port}'
c.JupyterHub.services[0]['environment']['CLASS_FOLDER'] = str(folder)
c.JupyterHub.services.append(dict(name='test', api_token={token!r}))
c.JupyterHub.load_roles.append(
    dict(name='test', services=['test'], scopes=['admin:users', 'admin:servers', 'tokens'])
)
c.Spawner.args.append('--allow-root')
c.Spawner.environment = dict(
    TMPDIR=str(folder), ROS2_NOTEBOOKS_CLASS='http://127.0.0.1:{class_port}/services/class'
)
"""


# --- The hub, as a browser uses it ---------------------------------------------------------------


def free_ports(count: int) -> list[int]:
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in sockets:
            one.bind(('127.0.0.1', 0))
        return [one.getsockname()[1] for one in sockets]


class Hub:
    """A running JupyterHub whose state, and whose students' homes, are in one folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.log = folder / 'hub.log'
        self.token = secrets.token_hex(16)
        port, hub_port, proxy_port, class_port = free_ports(4)
        self.url = f'http://127.0.0.1:{port}'
        config = folder / 'config.py'
        config.write_text(
            CONFIG.format(
                config=str(ROOT / 'tools/hub/jupyterhub_config.py'),
                folder=str(folder),
                hub_port=hub_port,
                proxy_port=proxy_port,
                class_port=class_port,
                token=self.token,
            )
        )
        self.process = subprocess.Popen(
            # If this test is killed, the hub is told, and ends the servers and the proxy.
            ['setpriv', '--pdeathsig', 'TERM', sys.executable, '-m', 'jupyterhub']
            + ['--config', config, '--url', self.url],
            cwd=folder,
            stdout=self.log.open('w'),
            stderr=subprocess.STDOUT,
        )

    async def ask(
        self, path: str, method: str = 'GET', body: object = None, token: str | None = None
    ) -> object:
        answer = await AsyncHTTPClient().fetch(
            HTTPRequest(
                self.url + path,
                method,
                headers={'Authorization': f'token {token or self.token}'},
                body=None if body is None else json.dumps(body),
                allow_nonstandard_methods=True,
                connect_timeout=START_S,
                request_timeout=START_S,
            )
        )
        return json.loads(answer.body) if answer.body else None

    async def text(self, path: str, token: str) -> str:
        headers = {'Authorization': f'token {token}'}
        answer = await AsyncHTTPClient().fetch(
            self.url + path, headers=headers, follow_redirects=False
        )
        return answer.body.decode()

    async def status(self, path: str, token: str) -> int:
        """Return the status with which something is refused; 200 where it is not."""
        try:
            await self.text(path, token)
        except HTTPClientError as refused:
            return refused.code
        return 200

    async def until_ready(self) -> None:
        async with asyncio.timeout(START_S):
            while self.process.poll() is None:
                # The proxy answers before the hub does.
                with contextlib.suppress(OSError, HTTPClientError):
                    return await self.ask('/hub/api/')
                await asyncio.sleep(0.1)
        raise RuntimeError(f'JupyterHub ended: {self.process.returncode}\n{self.log.read_text()}')

    def processes(self) -> list[psutil.Process]:
        """Return all processes of the students that are alive."""
        homes = str(self.folder / 'home')
        found = []
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                if process.environ().get('HOME', '').startswith(homes):
                    found.append(process)
        return found

    def stop(self) -> None:
        """End the hub, its proxy and the servers, as Ctrl+C does. Whatever is left is killed."""
        self.process.send_signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(END_S)
        self.process.kill()
        for process in self.processes():
            with contextlib.suppress(psutil.Error):
                process.kill()


class Kernel:
    """The kernel of one notebook that a student has opened."""

    def __init__(self, student: 'Student', id_: str) -> None:
        self.student, self.id = student, id_
        self._session = uuid.uuid4().hex
        self._messages = asyncio.Queue()

    async def connect(self) -> None:
        url = f'{self.student.hub.url}/user/{self.student.name}/api/kernels/{self.id}/channels'
        self._socket = await websocket_connect(
            HTTPRequest(
                url.replace('http', 'ws', 1),
                headers={'Authorization': f'token {self.student.token}'},
            ),
            # Messages are taken all the time: otherwise a connection that nobody reads is closed.
            on_message_callback=self._messages.put_nowait,
            max_message_size=2**26,
        )

    async def run(self, source: str, limit_s: float = CELL_S) -> list[NotebookNode]:
        """Run a cell as JupyterLab does. Return its outputs as JupyterLab shows them."""
        id_ = uuid.uuid4().hex
        content = {
            'code': source,
            'silent': False,
            'store_history': True,
            'user_expressions': {},
            'allow_stdin': True,
            'stop_on_error': True,
        }
        header = {
            'msg_id': id_,
            'msg_type': 'execute_request',
            'session': self._session,
            'username': self.student.name,
            'version': '5.4',
            'date': '',
        }
        message = {
            'channel': 'shell',
            'header': header,
            'parent_header': {},
            'metadata': {},
            'content': content,
        }
        await self._socket.write_message(json.dumps(message))
        outputs, clear, waited_for = [], False, {'idle', 'execute_reply'}
        async with asyncio.timeout(limit_s):
            while waited_for:
                message = json.loads(await self._messages.get())
                if message['parent_header'].get('msg_id') != id_:
                    continue
                kind, content = message['msg_type'], message['content']
                if kind == 'execute_reply':
                    waited_for.discard(kind)
                elif kind == 'status':
                    waited_for.discard(content['execution_state'])
                elif kind == 'clear_output':
                    outputs, clear = [] if not content['wait'] else outputs, content['wait']
                elif kind in ('stream', 'display_data', 'execute_result', 'error'):
                    outputs = [] if clear else outputs
                    clear = False
                    content.pop('transient', None)
                    outputs.append(nbformat.from_dict({'output_type': kind} | content))
        return outputs

    async def text(self, source: str) -> str:
        """Run a cell that must not fail, and return what it printed."""
        outputs = await self.run(source)
        assert [o.get('evalue') for o in outputs if o.output_type == 'error'] == []
        return ''.join(output.get('text', '') for output in outputs)

    async def end(self) -> None:
        self._socket.close()
        await self.student.ask(f'api/kernels/{self.id}', 'DELETE')


class Student:
    """Somebody who has logged in, and whose server runs."""

    def __init__(self, hub: Hub, name: str) -> None:
        self.hub, self.name = hub, name
        self.kernels: dict[str, Kernel] = {}

    async def log_in(self) -> None:
        await self.hub.ask(f'/hub/api/users/{self.name}', 'POST')
        answer = await self.hub.ask(f'/hub/api/users/{self.name}/tokens', 'POST', {})
        self.token = answer['token']
        await self.hub.ask(f'/hub/api/users/{self.name}/server', 'POST', {})
        async with asyncio.timeout(START_S):
            while not (await self.hub.ask(f'/hub/api/users/{self.name}'))['server']:
                await asyncio.sleep(0.5)

    async def ask(self, path: str, method: str = 'GET', body: object = None) -> object:
        return await self.hub.ask(f'/user/{self.name}/{path}', method, body, self.token)

    async def open(self, notebook: Path) -> Kernel:
        """Open a notebook of the student's own folder, with a kernel."""
        wanted = {
            'path': notebook.name,
            'name': notebook.name,
            'type': 'notebook',
            'kernel': {'name': 'python3'},
        }
        model = await self.ask('api/sessions', 'POST', wanted)
        self.kernels[notebook.name] = kernel = Kernel(self, model['kernel']['id'])
        await kernel.connect()
        return kernel

    async def log_out(self) -> None:
        await self.hub.ask(f'/hub/api/users/{self.name}/server', 'DELETE')
        async with asyncio.timeout(END_S):
            while (await self.hub.ask(f'/hub/api/users/{self.name}'))['servers']:
                await asyncio.sleep(0.2)

    def processes(self) -> list[psutil.Process]:
        home = str(self.hub.folder / 'home' / self.name)
        return [p for p in self.hub.processes() if p.environ()['HOME'] == home]

    def memory_mb(self) -> float:
        """What the student's processes take, shared pages divided among those who share them."""
        return sum(p.memory_full_info().pss for p in self.processes()) / 1e6


def shared_memory(processes: list[psutil.Process]) -> set[str]:
    """Return the files of shared memory that belong to these processes alone."""
    found = {mapped.path for process in processes for mapped in process.memory_maps()}
    # A file that is named after a port stays for the next one who takes the domain.
    return {path for path in found if re.fullmatch(r'/dev/shm/fastrtps_[0-9a-f]{16}', path)}


# --- The class -----------------------------------------------------------------------------------


@dataclass
class Lesson:
    """One lesson as one student ran it: the outputs of each code cell, and its time in seconds."""

    student: str
    path: Path
    outputs: list[list[NotebookNode]] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


@dataclass
class ClassHour:
    """What was seen of a class, from its first log-in to its end."""

    lessons: list[Lesson] = field(default_factory=list)
    log_in_s: float = 0.0
    lessons_s: float = 0.0
    domains: list[int] = field(default_factory=list)
    strangers: list[str] = field(default_factory=list)
    heard: dict[str, set[str]] = field(default_factory=dict)
    memory_mb: dict[str, float] = field(default_factory=dict)
    most_kernels: int = 0
    kernels_left: list[dict] = field(default_factory=list)
    segments: set[str] = field(default_factory=set)
    segments_left: set[str] = field(default_factory=set)
    late: list[str] = field(default_factory=list)
    told: list[list[str]] = field(default_factory=list)
    refused: list[int] = field(default_factory=list)
    processes_left: list[str] = field(default_factory=list)


async def run_lesson(student: Student, path: Path) -> Lesson:
    """Run all cells of the student's own copy of a lesson."""
    kernel = await student.open(path)
    model = await student.ask(f'api/contents/{path.name}')
    notebook = nbformat.from_dict(model['content'])
    lesson = Lesson(student.name, path)
    for cell in notebook.cells:
        if cell.cell_type == 'code':
            start = time.monotonic()
            lesson.outputs.append(await kernel.run(cell.source))
            lesson.seconds.append(time.monotonic() - start)
    return lesson


async def run_lessons(student: Student, paths: list[Path]) -> list[Lesson]:
    return [await run_lesson(student, path) for path in paths]


# After lesson 02: each message that its recordings hold was published here, and is heard once.
STRANGERS = """
for _table in (table, short_table, Recording.latest.table()):
    assert _table['seq'].is_unique
    for _seq in _table.loc[_table['published_s'].isna(), 'seq']:
        print(_seq)
"""
DOMAIN = 'import helpers.domain; print(helpers.domain.reserve_domain_id())'
# Everybody talks on one topic until everybody has heard something.
TALK = """
import threading
from helpers.session import ros_session
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

_session = ros_session().__enter__()
_heard = []
_node = Node('student')
_publisher = _node.create_publisher(String, 'topic', 10)
_subscription = _node.create_subscription(String, 'topic', lambda m: _heard.append(m.data), 10)
_timer = _node.create_timer(0.2, lambda: _publisher.publish(String(data={name!r})))
_executor = SingleThreadedExecutor()
_executor.add_node(_node)
_session.spin(_executor)
"""
LISTEN = """
_before = len(_heard)
_session.wait_until(lambda: len(_heard) >= _before + 5 and {expected!r} <= set(_heard), 60)
print(*set(_heard))
"""
CLOSE = '_session.__exit__(None, None, None)'
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
    hour.most_kernels = len(kernels)
    hour.domains = [int(await kernel.text(DOMAIN)) for kernel in kernels.values()]
    await asyncio.gather(*(k.text(TALK.format(name=name)) for name, k in kernels.items()))
    hour.segments = shared_memory(students[0].hub.processes())
    guest = subprocess.Popen([sys.executable, '-c', GUEST, str(hour.domains[0]), str(os.getpid())])
    try:
        heard = await asyncio.gather(
            *(
                kernel.text(LISTEN.format(expected={name, 'guest'} if i == 0 else {name}))
                for i, (name, kernel) in enumerate(kernels.items())
            )
        )
    finally:
        guest.terminate()
        guest.wait(END_S)
    hour.heard = {name: set(text.split()) for name, text in zip(kernels, heard, strict=True)}
    await asyncio.gather(*(kernel.text(CLOSE) for kernel in kernels.values()))


@contextlib.contextmanager
def all_domains_taken(first_port: int):
    """Reserve all 100 ids as 100 kernels would, in another range of ports than the class."""
    with pytest.MonkeyPatch.context() as patch, contextlib.ExitStack() as stack:
        patch.setattr(domain_coordinator.impl, 'PORT_BASE', first_port)
        with pytest.raises(RuntimeError):
            while True:
                stack.enter_context(domain_coordinator.domain_id())
        yield stack


async def one_too_many(hub: Hub) -> list[str]:
    """Somebody comes when all ids are taken, and tries again when a kernel has ended."""
    student = Student(hub, LATE)
    await student.log_in()
    kernel = await student.open(LESSONS[0])
    first_port = 22000
    await kernel.text(f'import domain_coordinator.impl as i; i.PORT_BASE = {first_port}')
    said = []
    with all_domains_taken(first_port) as taken:
        for _ in range(2):
            outputs = await kernel.run(TALK.format(name=LATE))
            said += [output.get('evalue', 'no error') for output in outputs] or ['open']
            taken.close()
    await kernel.text(CLOSE)
    await student.log_out()
    return said


async def told_to_the_class(hub: Hub) -> list[list[str]]:
    """Return the rows of the CSV that an administrator gets from the page of the class."""
    with contextlib.suppress(HTTPClientError):  # 409: there is one from the configuration
        await hub.ask('/hub/api/users/teacher', 'POST')
    teacher = (await hub.ask('/hub/api/users/teacher/tokens', 'POST', {}))['token']
    text = await hub.text('/services/class/class.csv', teacher)
    return list(csv.reader(text.splitlines()))


async def teach(hub: Hub) -> ClassHour:
    hour = ClassHour()
    students = [Student(hub, name) for name in STUDENTS]
    start = time.monotonic()
    await hub.until_ready()
    await asyncio.gather(*(student.log_in() for student in students))
    hour.log_in_s = time.monotonic() - start

    start = time.monotonic()
    orders = (LESSONS, LESSONS[::-1])
    for lessons in await asyncio.gather(
        *(run_lessons(student, orders[i % 2]) for i, student in enumerate(students))
    ):
        hour.lessons += lessons
    hour.lessons_s = time.monotonic() - start
    for student in students:
        hour.strangers += (await student.kernels[LESSONS[0].name].text(STRANGERS)).split()

    hour.told = await told_to_the_class(hub)
    for token in (students[0].token, 'no token'):
        for path in ('', 'live', 'class.csv'):
            hour.refused.append(await hub.status(f'/services/class/{path}', token))

    hour.memory_mb = {student.name: student.memory_mb() for student in students}
    await everybody_talks(students, hour)

    # Half of the class ends its kernels, the other half only logs out.
    for student in students[::2]:
        for kernel in student.kernels.values():
            await kernel.end()
        hour.kernels_left += await student.ask('api/kernels')
    await asyncio.gather(*(student.log_out() for student in students))
    hour.late = await one_too_many(hub)
    limit = time.monotonic() + END_S
    while (left := hub.processes()) and time.monotonic() < limit:
        await asyncio.sleep(0.2)
    hour.processes_left = [' '.join(process.cmdline()) for process in left]
    hour.segments_left = {path for path in hour.segments if os.path.exists(path)}
    return hour


@pytest.fixture(scope='module')
def hour(request) -> ClassHour:
    # A short name: the path of a socket file is limited to 107 bytes.
    folder = Path(tempfile.mkdtemp(prefix='hub-', dir='/tmp'))
    hub = Hub(folder)
    try:
        yield asyncio.run(teach(hub))
    except BaseException:
        print(hub.log.read_text()[-5000:])
        raise
    finally:
        hub.stop()
        shutil.rmtree(folder, ignore_errors=True)


# --- What is expected of it ----------------------------------------------------------------------


class Replay:
    """Gives nbval the outputs that a student's kernel gave, as if it were that kernel."""

    def __init__(self, outputs: list[list[NotebookNode]]) -> None:
        self._cells = iter(outputs)
        self._messages = iter(())

    def is_alive(self) -> bool:
        return True

    def execute_cell_input(self, source: str, allow_stdin: bool) -> str:
        idle = NotebookNode(output_type='status', execution_state='idle')
        self._messages = iter([*next(self._cells), idle])
        return 'cell'

    def await_reply(self, id_: str, timeout: float) -> None: ...

    def await_idle(self, id_: str, timeout: float) -> None: ...

    def get_message(self, stream: str, timeout: float) -> dict:
        output = next(self._messages, None)
        if output is None:
            raise Empty
        content = {'metadata': {}, 'execution_count': None} | output
        return {
            'msg_type': content.pop('output_type'),
            'parent_header': {'msg_id': 'cell'},
            'content': content,
        }


def differences(session, lesson: Lesson) -> list[str]:
    """Return what nbval says about the outputs of a lesson, compared with the saved ones."""
    file = IPyNbFile.from_parent(session, path=lesson.path)
    file.setup_sanitize_files()
    cells = list(file.collect())
    file.kernel = Replay(lesson.outputs)
    said = []
    for cell in cells:
        try:
            cell.runtest()
        except NbCellError as error:
            said.append(
                f'{lesson.student}, {lesson.path.name}, cell {error.cell_num}: {error}\n'
                f'{error.inner_traceback}'
            )
    assert next(file.kernel._cells, None) is None
    return said


def test_every_student_sees_what_is_saved(hour, request):
    assert len(hour.lessons) == 2 * len(STUDENTS)
    said = [text for lesson in hour.lessons for text in differences(request.session, lesson)]
    assert not said, '\n'.join(said)
    longest = max(max(lesson.seconds) for lesson in hour.lessons)
    print(
        f'\n{len(STUDENTS)} students: logged in after {hour.log_in_s:.0f} s, two lessons each in '
        f'{hour.lessons_s:.0f} s, the longest cell {longest:.0f} s'
    )


def test_every_student_is_in_the_class_and_only_administrators_see_it(hour):
    asked = {
        (known.lesson.name, question)
        for path in LESSONS
        for known in [Known(read(path.read_text(), path.name))]
        for question in known.guesses
    }
    told = {}
    for _, _, seat, name, lesson, kind, what, _ in hour.told[1:]:
        assert name == '""'
        told.setdefault(seat, set())
        if kind == 'guess':
            told[seat].add((lesson, what))
    assert len(told) == len(STUDENTS)
    assert all(guessed == asked for guessed in told.values())
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
    for lesson in hour.lessons:
        text = ''.join(output.get('text', '') for cell in lesson.outputs for output in cell)
        assert CLAIMS[lesson.path.stem[3:]] in text


def test_nobody_hears_anybody_else(hour):
    assert hour.most_kernels == 2 * len(STUDENTS)
    assert len(set(hour.domains)) == hour.most_kernels
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


def test_memory(hour):
    each = sorted(hour.memory_mb.values())
    print(f'\nMemory of a student with two kernels: {each[0]:.0f} to {each[-1]:.0f} MB')
    assert 30 * each[-1] < 24e3, 'thirty students need more than 24 GB'


def test_the_student_after_the_hundredth(hour):
    assert hour.late == [
        'All 100 ROS domain ids of this machine are in use: '
        'shut down the kernels that you no longer need, then run this cell again.',
        'open',
    ]
