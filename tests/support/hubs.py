"""A real JupyterHub for tests, and students who use it as a browser does.

Its REST API starts the servers, and the cells go to the kernels over their websockets.
"""

import asyncio
import contextlib
import csv
import json
import os
import secrets
import signal
import socket
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import nbformat
import psutil
import pytest
from jupyter_client.jsonutil import json_default
from jupyter_client.session import Session
from nbclient import NotebookClient
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_notebook
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from tools.classroom.class_page.lessons import Known
from tools.lessons.lesson import read, tags

ROOT = Path(__file__).resolve().parents[2]
CLAIMS = {  # of the lessons that the students run, by the lesson's name
    'lose_messages': 'All is as a KEEP_LAST queue must do it: True',
    'run_callbacks_in_parallel': 'D explained, threads at work: 8: True',
}
needs_hub = pytest.mark.skipif(
    not (ROOT / '.venv/hub_proxy').is_dir(), reason='LEFT OUT: `make hub` is not installed.'
)
LESSONS = [next((ROOT / 'notebooks').glob(f'??_{name}.ipynb')) for name in CLAIMS]
START_S = 300  # until the servers of all students answer
CELL_S = 120
END_S = 60

CONFIG = """
from pathlib import Path
load_subconfig({config!r})
folder = Path({folder!r})
c.JupyterHub.authenticator_class = 'dummy'
c.Spawner.start_timeout = c.Spawner.http_timeout = {limit}
c.JupyterHub.hub_bind_url = c.JupyterHub.hub_bind_url.replace('8081', '{hub_port}')
c.ConfigurableHTTPProxy.api_url = 'http://127.0.0.1:{proxy_port}'
c.ConfigurableHTTPProxy.pid_file = str(folder / 'proxy.pid')
c.JupyterHub.db_url = f'sqlite:///{{folder}}/hub.sqlite'
c.JupyterHub.cookie_secret_file = str(folder / 'cookie_secret')
c.Authenticator.admin_users = {{'teacher'}}
in_class = c.JupyterHub.services[0]
in_class['url'] = in_class['url'].replace('8764', '{class_port}')
in_class['environment']['CLASS_FOLDER'] = str(folder)
c.Spawner.environment['ROS2_NOTEBOOKS_CLASS'] = in_class['url'] + '/services/class'
c.JupyterHub.services.append(dict(name='test', api_token={token!r}))
c.JupyterHub.load_roles.append(
    dict(name='test', services=['test'], scopes=['admin:users', 'admin:servers', 'tokens'])
)
"""


def free_ports(count: int) -> list[int]:
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in sockets:
            one.bind(('127.0.0.1', 0))
        return [one.getsockname()[1] for one in sockets]


class Hub:
    """A running JupyterHub: that of `make hub` in `root`, with its state in `folder`.

    It ends with its `with` block. If that fails, it prints what the hub said last.

    `config` is added to its configuration, and `variables` to its environment.
    """

    def __init__(
        self,
        folder: Path,
        config: str = '',
        root: Path = ROOT,
        port: int | None = None,
        **variables: str,
    ) -> None:
        self.folder = folder
        self.log = folder / 'hub.log'
        self.token = secrets.token_hex(16)
        free_port, hub_port, proxy_port, class_port = free_ports(4)
        self.url = f'http://127.0.0.1:{port or free_port}'
        self.hub_port = hub_port
        file = folder / 'config.py'
        file.write_text(
            CONFIG.format(
                config=str(root / 'tools/classroom/hub/jupyterhub_config.py'),
                folder=str(folder),
                hub_port=hub_port,
                proxy_port=proxy_port,
                class_port=class_port,
                token=self.token,
                limit=START_S,
            )
            + config
        )
        self.process = subprocess.Popen(
            # If this test is killed, the hub is told, and ends the servers and the proxy.
            ['setpriv', '--pdeathsig', 'TERM', sys.executable, '-m', 'jupyterhub']
            + ['--config', file, '--url', self.url],
            cwd=folder,
            env=os.environ | variables,
            stdout=self.log.open('a'),
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

    async def token_of(self, name: str) -> str:
        """Return a token of somebody, who need not have been here before."""
        with contextlib.suppress(HTTPClientError):  # 409: there is one
            await self.ask(f'/hub/api/users/{name}', 'POST')
        return (await self.ask(f'/hub/api/users/{name}/tokens', 'POST', {}))['token']

    async def text(self, path: str, token: str) -> str:
        headers = {'Authorization': f'token {token}'}
        answer = await AsyncHTTPClient().fetch(
            self.url + path, headers=headers, follow_redirects=False
        )
        return answer.body.decode()

    async def status(self, path: str, token: str) -> int:
        """Return the status with which something is refused; 200 if it is not."""
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

    def processes(self, student: str = '') -> list[psutil.Process]:
        """Return all processes of the students that are alive, in containers or not, or of one."""
        found = []
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                variables = process.environ()
                mine = f':{self.hub_port}/' in variables.get('JUPYTERHUB_API_URL', '')
                name = variables.get('JUPYTERHUB_USER')
                if mine and name and student in ('', name):
                    found.append(process)
        return found

    def __enter__(self) -> 'Hub':
        return self

    def __exit__(self, failure: type | None, *_) -> None:
        """End the hub, its proxy and the servers, as Ctrl+C does. Whatever is left is killed."""
        if failure:
            print(self.log.read_text()[-5000:])
        self.process.send_signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(END_S)
        self.process.kill()
        for process in self.processes():
            with contextlib.suppress(psutil.Error):
                process.kill()


class KernelEndedError(Exception):
    """The kernel ended while a cell ran. The server starts it again."""


class Kernel:
    """The kernel of one notebook that a student has opened."""

    def __init__(self, student: 'Student', id_: str) -> None:
        self.student, self.id = student, id_
        self._session = Session(username=student.name)
        self._messages = asyncio.Queue()

    async def connect(self) -> None:
        url = f'{self.student.hub.url}/user/{self.student.name}/api/kernels/{self.id}/channels'
        self._socket = await websocket_connect(
            HTTPRequest(
                url.replace('http', 'ws', 1),
                headers={'Authorization': f'token {self.student.token}'},
                connect_timeout=START_S,  # the kernel must have started
                request_timeout=START_S,
            ),
            # Messages are taken all the time: otherwise a connection that nobody reads is closed.
            on_message_callback=self._messages.put_nowait,
            max_message_size=2**26,
        )

    async def run(self, source: str) -> list[NotebookNode]:
        """Run a cell as JupyterLab does. Return its outputs as JupyterLab shows them.

        Raises KernelEndedError.
        """
        request = self._session.msg('execute_request', {'code': source, 'allow_stdin': True})
        message = json.dumps(request | {'channel': 'shell'}, default=json_default)
        await self._socket.write_message(message)
        cell = new_code_cell(source)
        shown = NotebookClient(new_notebook(cells=[cell]), record_timing=False)
        shown.clear_before_next_output = False
        waited_for = {'idle', 'execute_reply'}
        async with asyncio.timeout(CELL_S):
            while waited_for:
                message = json.loads(await self._messages.get())
                state = message['content'].get('execution_state')
                if state in ('restarting', 'dead'):
                    raise KernelEndedError
                if message['parent_header'].get('msg_id') != request['msg_id']:
                    continue
                if message['msg_type'] in ('status', 'execute_reply'):
                    waited_for -= {message['msg_type'], state}
                else:
                    shown.process_message(message, cell, 0)
        # A progress bar is empty at its end.
        return [output for output in cell.outputs if output.get('data') != {'text/html': ''}]

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
        self.token = await self.hub.token_of(self.name)
        await self.hub.ask(f'/hub/api/users/{self.name}/server', 'POST', {})
        async with asyncio.timeout(START_S):
            while not (user := await self.hub.ask(f'/hub/api/users/{self.name}'))['server']:
                assert user['pending'], f'the server of {self.name} did not start'
                await asyncio.sleep(1)

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


@dataclass
class LessonRun:
    """A lesson as one student ran it: the outputs of its code cells."""

    student: str
    path: Path
    outputs: list[NotebookNode] = field(default_factory=list)

    @property
    def errors(self) -> list[str]:
        return [output.evalue for output in self.outputs if output.output_type == 'error']

    @property
    def explained(self) -> bool:
        text = ''.join(output.get('text', '') for output in self.outputs)
        return CLAIMS[self.path.stem[3:]] in text


async def run_lesson(student: Student, path: Path) -> LessonRun:
    """Write a guess in place of the dots, and run all cells of the student's copy of a lesson."""
    kernel = await student.open(path)
    model = await student.ask(f'api/contents/{path.name}')
    notebook = nbformat.from_dict(model['content'])
    run = LessonRun(student.name, path)
    for cell in notebook.cells:
        if cell.cell_type == 'code':
            guessed = (
                cell.source.replace(', ...)', ', 1)') if 'predict' in tags(cell) else cell.source
            )
            run.outputs += await kernel.run(guessed)
    return run


async def log_in(students: list[Student]) -> None:
    """Log in all at once, as soon as the hub answers."""
    await students[0].hub.until_ready()
    await asyncio.gather(*(student.log_in() for student in students))


async def run_lessons(students: list[Student]) -> list[LessonRun]:
    """Let all run both lessons at once, every second student the later one first."""

    async def run(student: Student, paths: list[Path]) -> list[LessonRun]:
        return [await run_lesson(student, path) for path in paths]

    runs = (run(student, LESSONS[:: (-1) ** i]) for i, student in enumerate(students))
    return sum(await asyncio.gather(*runs), [])


# Everybody talks on one topic until everybody has heard something.
TALK = """
import threading
from helpers.session import ros_session
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

_session = ros_session({session}).__enter__()
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


async def talk(kernels: dict[str, Kernel], session: str = '') -> None:
    """Let all kernels talk at once, each with its name, in sessions with these arguments."""
    texts = (k.text(TALK.format(name=name, session=session)) for name, k in kernels.items())
    await asyncio.gather(*texts)


async def listen(kernels: dict[str, Kernel], guests: dict[str, set[str]]) -> dict[str, set[str]]:
    """Return whom each kernel hears, once it has heard itself and its guests."""
    texts = (
        kernel.text(LISTEN.format(expected={name} | guests.get(name, set())))
        for name, kernel in kernels.items()
    )
    heard = dict(zip(kernels, await asyncio.gather(*texts), strict=True))
    await asyncio.gather(*(kernel.text(CLOSE) for kernel in kernels.values()))
    return {name: set(text.split()) for name, text in heard.items()}


async def told_to_the_class(hub: Hub) -> list[list[str]]:
    """Return the rows of the CSV that an administrator gets from the page of the class."""
    teacher = await hub.token_of('teacher')
    text = await hub.text('/services/class/class.csv', teacher)
    return list(csv.reader(text.splitlines()))


def guesses_of(told: list[list[str]]) -> dict[str, set[tuple[str, str]]]:
    """Return what each seat has guessed: lesson and question. Nobody has given a name."""
    guessed = {}
    for _, _, seat, name, lesson, kind, what, _ in told[1:]:
        assert name == '""'
        guessed.setdefault(seat, set())
        if kind == 'guess':
            guessed[seat].add((lesson, what))
    return guessed


def asked_in(paths: list[Path]) -> set[tuple[str, str]]:
    """Return the questions of these lessons: lesson and question."""
    return {
        (known.lesson.name, question)
        for path in paths
        for known in [Known(read(path.read_text(), path.name))]
        for question in known.guesses
    }
