"""The hub on a real Kubernetes: the chart of Zero to JupyterHub with our values, and a small class.

It needs a cluster that nobody else uses, such as that of `kind create cluster`, with the image of
`make image` in it, and helm and kubectl. CHART is the chart, `jupyterhub` of its repository or a
folder, and CLUSTER_IMAGE the name of the image. Without them it is left out. CLUSTER_VALUES is a
file of values that only this cluster needs, such as a class of storage.

What is not as in values.yaml: no certificate, since Let's Encrypt must reach the address; and a
service of the test, which may start servers.
"""

import asyncio
import contextlib
import json
import os
import re
import secrets
import shutil
import subprocess
import time
from pathlib import Path

import pytest
import yaml

from classroom.tests.support.hubs import (
    LESSONS,
    QUESTIONS,
    ROOT,
    START_S,
    Hub,
    KernelEndedError,
    Student,
    run_lesson,
)

CHART, IMAGE = os.environ.get('CHART', ''), os.environ.get('CLUSTER_IMAGE', '')
MORE_VALUES = os.environ.get('CLUSTER_VALUES', '')
VERSION = '4.4.0'
NAMESPACE = 'ros2-notebooks-test'
NAMES = ['ada', 'bob']
FORWARDED = re.compile(r'Forwarding from 127\.0\.0\.1:(\d+)')
FILL = 'hoard = []\nwhile True: hoard.append(bytearray(b"x") * 10**8)'
pytestmark = pytest.mark.skipif(
    not (CHART and IMAGE and shutil.which('helm') and shutil.which('kubectl')),
    reason='LEFT OUT: a cluster. CHART and CLUSTER_IMAGE name the chart and the image, and helm '
    'and kubectl must be there.',
)


def run(*command: str, data: bytes | None = None) -> bytes:
    """Run a command of the cluster, and return what it printed."""
    done = subprocess.run(command, input=data, capture_output=True)
    assert not done.returncode, (command, done.stdout[-2000:], done.stderr[-2000:])
    return done.stdout


def kubectl(*arguments: str, data: bytes | None = None) -> bytes:
    return run('kubectl', '--namespace', NAMESPACE, *arguments, data=data)


class Cluster(Hub):
    """The hub of a cluster, reached through a port of this machine."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.token = folder, secrets.token_hex(16)
        self.url, self.forward = '', None
        here = {
            'proxy': {'https': {'enabled': False}, 'service': {'type': 'ClusterIP'}},
            'hub': {
                'services': {'test': {'apiToken': self.token}},
                'loadRoles': {
                    'test': {
                        'services': ['test'],
                        'scopes': ['admin:users', 'admin:servers', 'tokens'],
                    }
                },
            },
        }
        (folder / 'here.yaml').write_text(yaml.safe_dump(here))

    def install(self, *more: str, **secret: str) -> None:
        """Install the chart as HOSTING.md says, with more files of values, and wait for the hub."""
        version = ['--version', VERSION, '--repo', 'https://hub.jupyter.org/helm-chart/']
        files = [self.values(name) for name in ('values.yaml', *more)]
        files += [self.folder / 'here.yaml', *filter(None, [MORE_VALUES])]
        run(
            *('helm', 'upgrade', '--install', 'class', CHART, '--reset-values'),
            *([] if Path(CHART).is_dir() else version),
            *('--namespace', NAMESPACE, '--create-namespace', '--timeout', '10m'),
            *(word for file in files for word in ('--values', str(file))),
            *(
                word
                for key, value in secret.items()
                for word in ('--set', f'hub.config.{key}={value}')
            ),
        )
        for name in ('hub', 'proxy'):
            kubectl('rollout', 'status', f'deploy/{name}', '--timeout', '5m')
        self.reach()

    def values(self, name: str) -> Path:
        """Return a file of values with the image in place of what is in capitals."""
        image, _, tag = IMAGE.rpartition(':')
        values = (ROOT / 'classroom/hub' / name).read_text()
        for placeholder, mine in (
            ('REGISTRY/ros2_notebooks', image),
            (':TAG', f':{tag}'),
            ('tag: TAG', f'tag: "{tag}"'),
        ):
            values = values.replace(placeholder, mine)
        (self.folder / name).write_text(values)
        return self.folder / name

    def reach(self) -> None:
        """Bring the hub to a port of this machine."""
        self.leave()
        self.forward = subprocess.Popen(
            ['kubectl', '--namespace', NAMESPACE, 'port-forward', 'service/proxy-public', ':http'],
            stdout=subprocess.PIPE,
            text=True,
        )
        found = FORWARDED.search(self.forward.stdout.readline())
        self.url = f'http://127.0.0.1:{found[1]}'

    def leave(self) -> None:
        if self.forward:
            self.forward.kill()
            self.forward.wait()
            self.forward.stdout.close()
        self.forward = None

    async def until_ready(self) -> None:
        async with asyncio.timeout(START_S):
            while True:
                with contextlib.suppress(OSError):
                    if (await self.answer('/hub/api/', self.token)).code == 200:
                        return
                await asyncio.sleep(1)

    def ask_class(self, query: str) -> list:
        """Return the first column of what the class keeps, in the container beside the hub."""
        script = (
            'import json, sqlite3, sys; '
            'print(json.dumps([r[0] for r in sqlite3.connect("/class/class.sqlite").execute('
            'sys.argv[1])]))'
        )
        python = '/opt/ros2_notebooks/.venv/bin/python'
        where = ('deploy/hub', '--container', 'class', '--')
        return json.loads(kubectl('exec', *where, python, '-c', script, query))

    def pod_of(self, name: str) -> dict:
        return json.loads(kubectl('get', 'pod', f'jupyter-{name}', '--output', 'json'))

    def in_pod(self, name: str, script: str) -> str:
        return kubectl('exec', f'jupyter-{name}', '--', 'sh', '-c', script).decode().strip()


@contextlib.contextmanager
def keeper_of(claim: str):
    """Hold a pod that mounts a claim, and yield what runs a command in it as root."""
    container = {'name': 'keeper', 'image': IMAGE, 'command': ['sleep', 'infinity']}
    container['volumeMounts'] = [{'name': 'claim', 'mountPath': '/claim'}]
    spec = {
        'securityContext': {'runAsUser': 0},
        'terminationGracePeriodSeconds': 0,
        'containers': [container],
        'volumes': [{'name': 'claim', 'persistentVolumeClaim': {'claimName': claim}}],
    }
    pod = {'apiVersion': 'v1', 'kind': 'Pod', 'metadata': {'name': 'keeper'}, 'spec': spec}
    kubectl('apply', '--filename', '-', data=json.dumps(pod).encode())
    kubectl('wait', '--for', 'condition=Ready', 'pod/keeper', '--timeout', '2m')
    try:
        yield lambda *command, data=None: kubectl(
            'exec', '--stdin', 'keeper', '--', *command, data=data
        )
    finally:
        kubectl('delete', 'pod', 'keeper', '--wait')


@pytest.fixture(scope='module')
def cluster(tmp_path_factory):
    """Yield a cluster with the hub, and take all of it away again."""
    one = Cluster(tmp_path_factory.mktemp('cluster'))
    try:
        one.install()
        yield one
    finally:
        one.leave()
        subprocess.run(['helm', '--namespace', NAMESPACE, 'uninstall', 'class'])
        subprocess.run(['kubectl', 'delete', 'namespace', NAMESPACE, '--wait'])


async def logged_in(cluster: Cluster) -> list[Student]:
    await cluster.until_ready()
    students = [Student(cluster, name) for name in NAMES]
    start = time.monotonic()
    try:
        await asyncio.gather(*(student.log_in() for student in students))
    except BaseException:
        said = kubectl('logs', 'deploy/hub', '--container', 'hub', '--tail', '40')
        print(said.decode(), kubectl('get', 'events').decode(), kubectl('get', 'pods').decode())
        raise
    print(f'{len(students)} servers started in {time.monotonic() - start:.0f} s')
    return students


def test_a_small_class_runs_lessons_and_is_seen(cluster):
    async def use() -> None:
        students = await logged_in(cluster)
        await asyncio.gather(*map(run_lesson, students, LESSONS))
        teacher, ada = await cluster.token_of('teacher'), students[0].token
        assert (await cluster.answer('/services/class/', teacher)).code == 200
        assert (await cluster.answer('/services/class/', ada)).code in (302, 403)
        wanted = sorted((QUESTIONS[lesson] for lesson in LESSONS), reverse=True)
        async with asyncio.timeout(60):
            while cluster.guesses() != wanted:
                await asyncio.sleep(1)

    asyncio.run(use())


def test_a_student_has_the_limits_of_the_values(cluster):
    [container] = cluster.pod_of('ada')['spec']['containers']
    resources = container['resources']
    assert resources['limits'] == {'cpu': '2', 'memory': str(2 * 2**30)}
    assert resources['requests'] == {'cpu': '100m', 'memory': str(400 * 2**20)}
    assert cluster.in_pod('ada', 'df --output=size -B1M /dev/shm | tail -1') == '256'
    assert cluster.in_pod('ada', 'id -u') == '1000'


def test_a_kernel_that_takes_all_memory_ends_alone(cluster):
    async def use() -> None:
        ada, bob = await logged_in(cluster)
        ours, theirs = await ada.open(LESSONS[0]), await bob.open(LESSONS[0])
        with pytest.raises(KernelEndedError):
            await ours.text(FILL)
        assert await theirs.text('print(6 * 7)') == '42\n'
        assert (await ada.ask('api/status'))['started']

    asyncio.run(use())
    [status] = cluster.pod_of('ada')['status']['containerStatuses']
    assert status['restartCount'] == 0


def test_a_hub_that_is_killed_finds_its_students_again(cluster):
    async def use() -> None:
        before = [cluster.pod_of(name)['metadata']['uid'] for name in NAMES]
        kubectl('delete', 'pod', '--selector', 'component=hub', '--grace-period', '0', '--force')
        kubectl('rollout', 'status', 'deploy/hub', '--timeout', '5m')
        await logged_in(cluster)
        assert [cluster.pod_of(name)['metadata']['uid'] for name in NAMES] == before

    asyncio.run(use())


def test_accounts_and_homes_come_back_from_a_backup(cluster):
    """As HOSTING.md says it: the hub stops, files are copied into its volume, it starts."""

    async def use() -> None:
        ada, bob = await logged_in(cluster)
        cluster.in_pod('ada', 'echo mine > ros2_notebooks/mine.txt')
        for student in (ada, bob):
            await student.log_out()

    asyncio.run(use())
    claim = json.loads(kubectl('get', 'pvc', '--output', 'json', '--selector', 'component'))
    [home] = [one['metadata']['name'] for one in claim['items'] if 'ada' in one['metadata']['name']]
    stop, start = (
        ('scale', 'deploy/hub', '--replicas', '0'),
        ('scale', 'deploy/hub', '--replicas=1'),
    )
    gone = ('wait', '--for', 'delete', 'pod', '--selector', 'component=hub', '--timeout', '2m')
    saved = {}
    kubectl(*stop)
    kubectl(*gone)
    for name in ('hub-db-dir', home):
        with keeper_of(name) as keeper:
            saved[name] = keeper('tar', '--create', '--directory', '/claim', '.')
            keeper('sh', '-c', 'rm -rf /claim/* /claim/.[!.]*')  # the disk is lost
    kubectl(*start)
    kubectl('rollout', 'status', 'deploy/hub', '--timeout', '5m')
    asyncio.run(cluster.until_ready())
    assert names_of(cluster).isdisjoint(NAMES)

    kubectl(*stop)
    kubectl(*gone)
    for name, data in saved.items():
        with keeper_of(name) as keeper:
            keeper('sh', '-c', 'rm -rf /claim/* /claim/.[!.]*')
            keeper('tar', '--extract', '--directory', '/claim', data=data)
    kubectl(*start)
    kubectl('rollout', 'status', 'deploy/hub', '--timeout', '5m')
    asyncio.run(cluster.until_ready())
    assert names_of(cluster) >= {*NAMES}
    asyncio.run(logged_in(cluster))
    assert cluster.in_pod('ada', 'cat ros2_notebooks/mine.txt') == 'mine'


@pytest.mark.parametrize(
    ('name', 'secret', 'page', 'leads_to'),
    [
        (
            'values-oidc.yaml',
            {'GenericOAuthenticator.client_secret': 'of the test'},
            '/hub/oauth_login',
            'https://LOGIN.EXAMPLE.ORG/authorize?',
        ),
        ('values-lti.yaml', {}, '/hub/lti13/config', ''),
    ],
)
def test_a_hub_has_the_login_of_its_university(cluster, name, secret, page, leads_to):
    """test_logins.py logs in; here the hub of the chart has what that needs."""
    cluster.install(name, **secret)
    asyncio.run(cluster.until_ready())
    answer = asyncio.run(cluster.answer(page, 'no token'))
    assert (answer.code, answer.headers.get('Location', '').startswith(leads_to)) == (
        302 if leads_to else 200,
        True,
    )


# A folder of the only machine in the place of a share: its owner is root, as on a server of NFS.
SHARE = """
apiVersion: v1
kind: PersistentVolume
metadata: {{name: homes}}
spec:
  capacity: {{storage: 60Gi}}
  accessModes: [ReadWriteMany]
  storageClassName: ""
  hostPath: {{path: {folder}, type: DirectoryOrCreate}}
  claimRef: {{namespace: {namespace}, name: homes}}
---
apiVersion: v1
kind: PersistentVolumeClaim
metadata: {{name: homes}}
spec:
  accessModes: [ReadWriteMany]
  storageClassName: ""
  volumeName: homes
  resources: {{requests: {{storage: 60Gi}}}}
"""


@pytest.fixture
def share(cluster):
    folder = f'/tmp/ros2_notebooks_homes_{secrets.token_hex(4)}'
    yaml_ = SHARE.format(folder=folder, namespace=NAMESPACE)
    kubectl('apply', '--filename', '-', data=yaml_.encode())
    yield
    with keeper_of('homes') as keeper:
        keeper('sh', '-c', 'rm -rf /claim/*')
    kubectl('delete', '--filename', '-', '--wait=false', data=yaml_.encode())


def test_three_hundred_have_homes_on_a_share_and_room_before_placeholders(cluster, share):
    cluster.install('values-300.yaml', 'values-nfs.yaml')

    async def use() -> None:
        cat = Student(cluster, 'cat')
        await cluster.until_ready()
        await cat.log_in()
        kernel = await cat.open(LESSONS[0])
        assert await kernel.text('print(6 * 7)') == '42\n'
        await kernel.end()
        await cat.log_out()

    asyncio.run(use())
    with keeper_of('homes') as keeper:
        assert b'02_lose_messages.ipynb' in keeper('ls', '/claim/home/cat/ros2_notebooks')
        assert keeper('stat', '--format', '%u', '/claim/home/cat').strip() == b'1000'
    placeholders = kubectl('get', 'statefulset', 'user-placeholder', '--output', 'json')
    assert json.loads(placeholders)['spec']['replicas'] == 30


def names_of(cluster: Cluster) -> set[str]:
    """Return the names of the accounts."""
    users = asyncio.run(cluster.ask('/hub/api/users'))
    return {user['name'] for user in users}
