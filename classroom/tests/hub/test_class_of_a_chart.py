"""The class page as Zero to JupyterHub runs it: in a container of its own beside the hub.

Its environment is that of hub/values.yaml, but for the addresses and the folder of this machine.
"""

import asyncio
import contextlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import yaml

from classroom.tests.support.hubs import END_S, ROOT, STUDENTS, Hub, needs_hub

pytestmark = needs_hub
VALUES = yaml.safe_load((ROOT / 'classroom/hub/values.yaml').read_text())['hub']
TOKEN = 'token-of-the-class'
CONFIG = """
c.Proxy.extra_routes = {{}}
c.JupyterHub.services[0] = dict({service!r}, name='class', api_token={token!r}, url=CLASS_URL)
c.JupyterHub.spawner_class = 'simple'
"""


@contextlib.contextmanager
def class_beside(hub: Hub):
    """Run the container's command, as a process."""
    [container] = VALUES['extraContainers']
    hub_port, _, port = hub.ports
    known = {'CLASS_FOLDER': str(hub.folder), 'CLASS_LISTEN': '127.0.0.1'}
    known['JUPYTERHUB_API_TOKEN'] = TOKEN
    variables = {}
    for one in container['env']:
        value = known.get(one['name'], one.get('value', ''))
        value = value.replace('hub:8764', f'127.0.0.1:{port}').replace('8081', str(hub_port))
        variables[one['name']] = value
    command = [sys.executable, *container['command'][1:]]
    process = subprocess.Popen(command, cwd=ROOT, env=os.environ | variables)
    try:
        yield
    finally:
        process.terminate()
        process.wait(END_S)


async def ask(hub: Hub) -> None:
    await hub.until_ready()
    teacher, student = [await hub.token_of(name) for name in ('teacher', STUDENTS[0])]
    async with asyncio.timeout(END_S):
        while (await hub.answer('/services/class/', teacher)).code != 200:
            await asyncio.sleep(0.2)
    answer = await hub.answer('/services/class/', student)
    assert answer.code in (302, 403)
    joined = await hub.ask('/services/class/join', 'POST', {'code': '', 'name': ''}, student)
    assert joined == {'seat': 1, 'token': ''}
    question = {'id': f'{7:016x}', 'kind': 'guess', 'lesson': 'lose_messages', 'value': 41}
    question['question'] = 'How many of the 41 messages are received?'
    told = await hub.ask('/services/class/events', 'POST', {'events': [question]}, student)
    assert told == {'refused': ''}
    assert hub.last_guesses() == [41]


def test_a_class_beside_the_hub():
    [service] = VALUES['services'].values()
    short = tempfile.TemporaryDirectory(prefix='hub-', dir='/tmp', ignore_cleanup_errors=True)
    config = CONFIG.format(service=service, token=TOKEN)
    with short as folder, Hub(Path(folder), config) as hub, class_beside(hub):
        asyncio.run(ask(hub))
