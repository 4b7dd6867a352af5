"""A real JupyterHub for tests, and students who use it as a browser does.

Its REST API starts the servers, and the cells go to the kernels over their websockets.
"""

import asyncio
import contextlib
import json
import os
import random
import secrets
import signal
import socket
import sqlite3
import subprocess
import sys
from http.cookiejar import CookieJar
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import urlencode
from urllib.request import HTTPCookieProcessor, build_opener

import psutil
import pytest
from jupyter_client.jsonutil import json_default
from jupyter_client.session import Session
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest, HTTPResponse
from tornado.websocket import websocket_connect

from classroom.class_page.lessons import Known
from helpers.lesson import read

ROOT = Path(__file__).resolve().parents[3]
STUDENTS = [f'student{number:02}' for number in range(1, 13)]
CLAIMS = {  # of the lessons that the students run, by the lesson's name
    'lose_messages': 'Everything follows the rules of a KEEP_LAST queue: True',
    'run_callbacks_in_parallel': 'D, threads at work: 8. Every loss is explained: True',
}
# What a student types in place of the dots, in the order of the guesses.
TYPED = {
    'lose_messages': ('14', '[1, 2, 3, 4]', '10', '1', '[1, 2, 3]', '10', '0'),
    'run_callbacks_in_parallel': ("['B', 'D']", '2', '8', '1', '2'),
}
LESSONS = [next((ROOT / 'notebooks').glob(f'??_{name}.ipynb')) for name in CLAIMS]
QUESTIONS = {path: len(Known(read(path.read_text(), path.name)).guesses) for path in LESSONS}
needs_hub = pytest.mark.skipif(
    not (ROOT / '.venv/hub_proxy').is_dir(), reason='LEFT OUT: `make hub` is not installed.'
)
START_S = 300  # until the servers of all students answer
CELL_S = 120
END_S = 60

CONFIG = """
from pathlib import Path
load_subconfig({config!r})
folder = Path({folder!r})
c.JupyterHub.authenticator_class = 'dummy'
c.Spawner.start_timeout = c.Spawner.http_timeout = {limit}
# Ports of its own: another hub may run on this machine.
for one in (c.JupyterHub, c.Spawner):
    for name in ('hub_bind_url', 'hub_connect_url'):
        if name in one:
            setattr(one, name, getattr(one, name).replace('8081', '{ports[0]}'))
c.ConfigurableHTTPProxy.api_url = 'http://127.0.0.1:{ports[1]}'
CLASS_URL = 'http://127.0.0.1:{ports[2]}'
c.JupyterHub.services[0]['environment']['JUPYTERHUB_SERVICE_URL'] = CLASS_URL
c.Proxy.extra_routes = {{'/services/class/': CLASS_URL}}
in_class = c.Spawner.environment['ROS2_NOTEBOOKS_CLASS']
c.Spawner.environment['ROS2_NOTEBOOKS_CLASS'] = in_class.replace('8764', '{ports[2]}')
c.ConfigurableHTTPProxy.pid_file = str(folder / 'proxy.pid')
c.JupyterHub.db_url = f'sqlite:///{{folder}}/hub.sqlite'
c.JupyterHub.cookie_secret_file = str(folder / 'cookie_secret')
c.Authenticator.admin_users = {{'teacher'}}
c.JupyterHub.services[0]['environment']['CLASS_FOLDER'] = str(folder)
c.JupyterHub.services.append(dict(name='test', api_token={token!r}))
c.JupyterHub.load_roles.append(
    dict(name='test', services=['test'], scopes=['admin:users', 'admin:servers', 'tokens'])
)
"""


def free_ports(count: int) -> list[int]:
    """Return ports that no kernel takes meanwhile: the system gives those from 32768 on."""
    found = []
    for port in random.sample(range(10000, 20000), 1000):
        with contextlib.suppress(OSError), socket.create_server(('127.0.0.1', port)):
            found.append(port)
        if len(found) == count:
            return found
    raise OSError('no port is free')


class Hub:
    """A running JupyterHub: that of `make hub` in `root`, with its state in `folder`.

    It ends with its `with` block. If that fails, it prints what the hub said last. `config` is
    added to its configuration, and `variables` to its environment.
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
        self.url = f'http://127.0.0.1:{port or free_ports(1)[0]}'
        self.ports = free_ports(3)
        self.file = folder / 'config.py'
        self.variables = variables
        self.file.write_text(
            CONFIG.format(
                config=str(root / 'classroom/hub/jupyterhub_config.py'),
                folder=str(folder),
                token=self.token,
                limit=START_S,
                ports=self.ports,
            )
            + config
        )
        self.start()

    def start(self) -> None:
        """Start it, or start it again after it was killed."""
        self.process = subprocess.Popen(
            # If this test is killed, the hub is told, and ends the servers and the proxy.
            ['setpriv', '--pdeathsig', 'TERM', sys.executable, '-m', 'jupyterhub']
            + ['--config', self.file, '--url', self.url],
            cwd=self.folder,
            env=os.environ | self.variables,
            stdout=self.log.open('a'),
            stderr=subprocess.STDOUT,
        )

    async def answer(
        self, path: str, token: str, method: str = 'GET', body: object = None
    ) -> HTTPResponse:
        """Return what the hub answers, whatever its status is."""
        request = HTTPRequest(
            self.url + path,
            method,
            headers={'Authorization': f'token {token}'},
            body=None if body is None else json.dumps(body),
            allow_nonstandard_methods=True,
            follow_redirects=False,
            connect_timeout=START_S,
            request_timeout=START_S,
        )
        return await AsyncHTTPClient().fetch(request, raise_error=False)

    def in_browser(self, name: str, path: str) -> int:
        """Log somebody in and open a page, with cookies as a browser has. Return its status."""
        cookies = CookieJar()
        browser = build_opener(HTTPCookieProcessor(cookies))
        browser.open(f'{self.url}/hub/login').close()
        [xsrf] = [cookie.value for cookie in cookies if cookie.name == '_xsrf']
        form = urlencode({'username': name, 'password': 'any', '_xsrf': xsrf}).encode()
        # Without `next` the hub would start a server.
        browser.open(f'{self.url}/hub/login?next=/hub/home', form).close()
        try:
            with browser.open(self.url + path) as page:
                return page.status
        except HTTPError as error:
            return error.code

    async def ask(
        self, path: str, method: str = 'GET', body: object = None, token: str | None = None
    ) -> object:
        """Return what the JSON of an answer holds. Raises HTTPClientError if it is refused."""
        answer = await self.answer(path, token or self.token, method, body)
        answer.rethrow()
        return json.loads(answer.body) if answer.body else None

    async def token_of(self, name: str) -> str:
        """Return a token of somebody, who need not have been here before."""
        with contextlib.suppress(HTTPClientError):  # 409: there is one
            await self.ask(f'/hub/api/users/{name}', 'POST')
        return (await self.ask(f'/hub/api/users/{name}/tokens', 'POST', {}))['token']

    def ask_class(self, query: str) -> list:
        """Return the first column of what the class keeps."""
        with contextlib.closing(sqlite3.connect(self.folder / 'class.sqlite')) as db:
            return [first for first, *_ in db.execute(query)]

    def last_guesses(self) -> list[int]:
        """Return the last guess of each seat."""
        last = "SELECT value, max(n) FROM events WHERE kind = 'guess' GROUP BY seat"
        return [json.loads(value) for value in self.ask_class(last)]

    def guesses(self) -> list[int]:
        """Return how many questions each seat has answered, the most first."""
        assert self.ask_class('SELECT DISTINCT name FROM seats') == ['']  # nobody has given one
        questions = "SELECT DISTINCT seat, lesson, what FROM events WHERE kind = 'guess'"
        answered = f'SELECT count(*) AS n FROM ({questions}) GROUP BY seat ORDER BY n DESC'
        return self.ask_class(answered)

    async def until_ready(self) -> None:
        async with asyncio.timeout(START_S):
            while self.process.poll() is None:
                # The proxy answers before the hub does.
                with contextlib.suppress(OSError, HTTPClientError):
                    await self.ask('/hub/api/')
                    # The class page comes after the hub, which does not wait for it.
                    if (await self.answer('/services/class/', 'no token')).code != 503:
                        return
                await asyncio.sleep(0.1)
        raise RuntimeError(f'JupyterHub ended: {self.process.returncode}\n{self.log.read_text()}')

    def processes(self) -> list[psutil.Process]:
        """Return all processes of the students that are alive, in containers or not."""
        found = []
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                variables = process.environ()
                mine = f':{self.ports[0]}/' in variables.get('JUPYTERHUB_API_URL', '')
                if mine and variables.get('JUPYTERHUB_USER'):  # empty in the hub's services
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

    async def connect(self) -> None:
        self._messages = asyncio.Queue()  # an earlier connection fills another one
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

    async def text(self, source: str) -> str:
        """Run a cell that must not fail. Return what it printed. Raises KernelEndedError."""
        request = self._session.msg('execute_request', {'code': source, 'allow_stdin': True})
        message = json.dumps(request | {'channel': 'shell'}, default=json_default)
        await self._socket.write_message(message)
        printed, waited_for = '', {'idle', 'execute_reply'}
        async with asyncio.timeout(CELL_S):
            while waited_for:
                message = json.loads(await self._messages.get())
                kind, content = message['msg_type'], message['content']
                state = content.get('execution_state')
                if state in ('restarting', 'dead'):
                    raise KernelEndedError
                if message['parent_header'].get('msg_id') == request['msg_id']:
                    waited_for -= {kind, state}
                    printed += content['text'] if kind == 'stream' else ''
                    assert kind != 'error', (self.student.name, source, content)
        return printed

    async def end(self) -> None:
        """End the kernel. While its server starts one anew that was killed, it answers 500."""
        self._socket.close()
        async with asyncio.timeout(END_S):
            while True:
                try:
                    return await self.student.ask(f'api/kernels/{self.id}', 'DELETE')
                except HTTPClientError as error:
                    if error.code != 500:
                        raise
                await asyncio.sleep(0.5)


class Student:
    """Somebody who has logged in, and whose server runs."""

    def __init__(self, hub: Hub, name: str) -> None:
        self.hub, self.name = hub, name
        self.kernels: dict[str, Kernel] = {}

    async def log_in(self) -> None:
        self.token = await self.hub.token_of(self.name)
        if not (await self.hub.ask(f'/hub/api/users/{self.name}'))['server']:
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


async def run_lesson(student: Student, path: Path) -> None:
    """Write a guess in place of the dots, and run all cells of the student's copy of a lesson.

    No cell fails, and every loss is explained.
    """
    kernel = await student.open(path)
    printed, typed = '', iter(TYPED[path.stem[3:]])
    for cell in (await student.ask(f'api/contents/{path.name}'))['content']['cells']:
        if cell['cell_type'] == 'code':
            predicts = 'predict' in cell['metadata'].get('tags', ())
            source = cell['source']
            if predicts:
                source = source.replace('...', next(typed), 1)
            printed += await kernel.text(source)
    assert CLAIMS[path.stem[3:]] in printed, student.name


async def run_lessons(students: list[Student]) -> list[int]:
    """Let all run a lesson at once, every second student the other one.

    Return how many guesses each has told, the most first.
    """
    lessons = [LESSONS[number % 2] for number in range(len(students))]
    await asyncio.gather(*map(run_lesson, students, lessons))
    return sorted((QUESTIONS[lesson] for lesson in lessons), reverse=True)


async def log_in(hub: Hub, names: list[str] = STUDENTS) -> list[Student]:
    """Log in all students at once, as soon as the hub answers."""
    await hub.until_ready()
    students = [Student(hub, name) for name in names]
    await asyncio.gather(*(student.log_in() for student in students))
    return students


# Everybody talks on one topic until everybody has heard something.
TALK = """
from helpers.ros import ros_session
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
_session.wait_until(lambda: len(_heard) >= _before + 5, 60)
_session.__exit__(None, None, None)
print(*set(_heard))
"""


async def talk(kernels: dict[str, Kernel], session: str = '') -> None:
    """Let all kernels talk at once, each with its name, in sessions with these arguments."""
    texts = (k.text(TALK.format(name=name, session=session)) for name, k in kernels.items())
    await asyncio.gather(*texts)


async def listen(kernels: dict[str, Kernel]) -> None:
    """Each kernel that talks hears itself, and nobody else."""
    heard = await asyncio.gather(*(kernel.text(LISTEN) for kernel in kernels.values()))
    assert [text.split() for text in heard] == [[name] for name in kernels]
