"""JupyterHub for a class on one machine, started by `make hub`. HOSTING.md says how to use it.

Everybody who has an account on this machine may log in, with its password. With CONTAINERS=yes each
student's server runs in a container of the image of `make image`, with limits of its own.
"""

import asyncio
import os
import socket
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

from jupyterhub.proxy import ConfigurableHTTPProxy

from helpers.checks.classroom import HUB_VARIABLE

ROOT = Path(__file__).resolve().parents[2]
STATE = ROOT / '.jupyter/hub'
FIRST_PORT = 20000

STATE.mkdir(mode=0o700, parents=True, exist_ok=True)
c = get_config()  # noqa: F821

c.JupyterHub.bind_url = 'http://127.0.0.1:8000'
c.JupyterHub.hub_bind_url = 'http://127.0.0.1:8081'
c.JupyterHub.db_url = f'sqlite:///{STATE}/jupyterhub.sqlite'
c.JupyterHub.cookie_secret_file = str(STATE / 'cookie_secret')
c.ConfigurableHTTPProxy.pid_file = str(STATE / 'proxy.pid')
c.ConfigurableHTTPProxy.command = (
    f'{sys.prefix}/hub_proxy/node_modules/.bin/configurable-http-proxy'
)
c.Authenticator.allow_all = True


class Proxy(ConfigurableHTTPProxy):
    """The proxy, which says so where its port is in use. By itself it would go on without one."""

    async def start(self) -> None:
        """Start it, or end the hub with a sentence."""
        self._check_previous_process()  # one that a hub has left, which was killed
        where = urlsplit(self.public_url)
        port = where.port or (443 if where.scheme == 'https' else 80)
        try:
            socket.create_server((where.hostname, port)).close()
        except OSError as problem:
            self.log.critical(
                'The port of %s cannot be used (%s): choose another one, for example '
                "`make hub HUB_ARGS='--url=http://127.0.0.1:8001'`.",
                self.public_url,
                os.strerror(problem.errno),
            )
            self.app.exit(1)
        await super().start()


c.JupyterHub.proxy_class = Proxy

c.Spawner.cmd = [str(ROOT / 'classroom/container/start_student.sh')]
c.Spawner.notebook_dir = '~/ros2_notebooks'
c.Spawner.default_url = '/lab/tree/00_start_here.ipynb'
# All log in at once, and each server needs seconds of a core.
c.Spawner.start_timeout = c.Spawner.http_timeout = 180
c.Spawner.args = [
    # Ports are chosen, closed and opened again later: of 30 kernels that start at once, two would
    # often choose the same one. Files have names of their own.
    '--KernelManager.transport=ipc',
    # A kernel that nobody has used for an hour gives its domain id back, also with its tab open.
    '--MappingKernelManager.cull_idle_timeout=3600',
    '--MappingKernelManager.cull_connected=True',
]


def choose_port(spawner) -> None:
    """Give each student's server a port that no other one takes."""
    spawner.port = FIRST_PORT + spawner.user.id


c.Spawner.pre_spawn_hook = choose_port

# The class that sees itself. The kernels of the students tell it; its page is for administrators.
CLASS_URL = 'http://127.0.0.1:8764'
c.JupyterHub.services = [
    {
        'name': 'class',
        'url': CLASS_URL,
        'command': [sys.executable, '-m', 'classroom.hub.class_service'],
        'cwd': str(ROOT),
        'environment': {'CLASS_FOLDER': str(STATE)},
        'oauth_no_confirm': True,
        'timeout': 180,  # the hub ends where a service takes longer to start
    }
]
c.Spawner.environment = {HUB_VARIABLE: f'{CLASS_URL}/services/class'}

# --- A server that nobody has used for an hour is ended ------------------------------------------

c.JupyterHub.services.append(
    {
        'name': 'idle-culler',
        'command': [sys.executable, '-m', 'jupyterhub_idle_culler', '--timeout=3600'],
    }
)
c.JupyterHub.load_roles.append(
    {
        'name': 'idle-culler',
        'services': ['idle-culler'],
        'scopes': ['list:users', 'read:users:activity', 'read:servers', 'delete:servers'],
    }
)

# --- Each student in a container -----------------------------------------------------------------

STUDENT = 1000  # the user of the image
DISK = '1G'  # what a student may fill


def mount_disk(name: str) -> Path:
    """Return the student's home, on a disk of their own. Raises RuntimeError.

    All its room is taken from the machine's disk at once: that one cannot become full in a lesson.
    """
    home, disk = STATE / 'homes' / name, STATE / 'disks' / name
    if not disk.exists():
        disk.parent.mkdir(exist_ok=True)
        new = disk.with_suffix('.new')
        options = f'nodiscard,root_owner={STUDENT}:{STUDENT}'
        try:
            for command in (
                ['fallocate', f'--length={DISK}', new],
                ['mkfs.ext4', '-q', '-F', '-m', '0', '-E', options, new],
            ):
                subprocess.run(command, check=True, capture_output=True, text=True)
        except subprocess.CalledProcessError as problem:
            new.unlink(missing_ok=True)
            # The student sees this, too.
            raise RuntimeError(
                f'There is no room for your disk of {DISK}: tell your teacher '
                f'({problem.stderr.strip()}).'
            ) from None
        new.rename(disk)
    home.mkdir(parents=True, exist_ok=True)
    if not home.is_mount():
        subprocess.run(['mount', '-o', 'loop,nosuid,nodev', disk, home], check=True)
    return home


def make_network(name: str) -> None:
    """Make a network if there is none with this name."""
    import docker

    networks = docker.from_env().networks
    if name not in {one.name for one in networks.list()}:
        networks.create(name, driver='bridge')


async def prepare_container(spawner) -> None:
    """Give a student a disk of their own, which cannot fill the machine's, and a network."""
    spawner.port = 8888
    name = spawner.escaped_name
    spawner.network_name = f'ros2-{name}'
    # In threads: meanwhile the hub answers others.
    home = await asyncio.to_thread(mount_disk, name)
    await asyncio.to_thread(make_network, spawner.network_name)
    spawner.volumes = {str(home): '/home/student'}


if os.environ.get('CONTAINERS') == 'yes':
    from docker.types import Ulimit

    from classroom.hub.service import HUB, IMAGE

    # An address of this machine that its containers reach, and no other machine knows: not the
    # network's. The hub asks for the students' tokens there.
    c.JupyterHub.hub_bind_url = f'http://{HUB}:8081'
    CLASS_URL = f'http://{HUB}:8764'
    c.JupyterHub.services[0]['url'] = CLASS_URL
    c.JupyterHub.spawner_class = 'dockerspawner.DockerSpawner'
    c.Spawner.pre_spawn_hook = prepare_container
    c.Spawner.cmd = ['/opt/ros2_notebooks/classroom/container/start_student.sh']
    c.Spawner.notebook_dir = '/home/student/ros2_notebooks'
    # A trash on a full disk would keep it full.
    c.Spawner.args.append('--FileContentsManager.delete_to_trash=False')
    c.Spawner.mem_limit, c.Spawner.cpu_limit = '2G', 2
    c.DockerSpawner.image = IMAGE
    c.DockerSpawner.pull_policy = 'never'
    c.DockerSpawner.remove = True
    c.DockerSpawner.extra_host_config = {
        'shm_size': '256m',
        'pids_limit': 400,
        # Podman's own are more than some machines allow. `nproc` counts all students together:
        # what one may have is pids_limit.
        'ulimits': [
            Ulimit(name='nofile', soft=4096, hard=4096),
            Ulimit(name='nproc', soft=30000, hard=30000),
        ],
        'cap_drop': ['ALL'],
        'security_opt': ['no-new-privileges'],
        # What is neither the home nor in memory cannot be written.
        'read_only': True,
        'tmpfs': {'/tmp': 'size=64m,mode=1777'},
    }
    c.Spawner.environment = {
        HUB_VARIABLE: f'{CLASS_URL}/services/class',
        'TMPDIR': '/home/student/.tmp',  # builds and temporary files go to the student's disk
    }
