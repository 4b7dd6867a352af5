"""JupyterHub for a class on one machine, started by `make hub`. HOSTING.md says how to use it.

Everybody who has an account on this machine may log in, with its password. With CONTAINERS=yes each
student's server runs in a container of the image of `make image`, with limits of its own.
"""

import os
import socket
import sys
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

from jupyterhub.proxy import ConfigurableHTTPProxy

from helpers.checks.classroom import HUB_VARIABLE

ROOT = Path(__file__).resolve().parents[2]
STATE = ROOT / '.jupyter/hub'
FIRST_PORT, LAST_PORT = 20000, 32767  # of the students' servers


def is_free(port: int, address: str = '') -> bool:
    """Return whether a server could have this port now; 0 stands for any."""
    with suppress(OSError), socket.create_server((address, port)):
        return True
    return False


def port_of(wanted: int) -> int:
    """Return a port that is free: the wanted one, or one of those that follow."""
    return next(filter(is_free, range(wanted, LAST_PORT)))


STATE.mkdir(mode=0o700, parents=True, exist_ok=True)
c = get_config()  # noqa: F821

c.JupyterHub.bind_url = 'http://127.0.0.1:8000'
HUB_PORT, CLASS_PORT = port_of(8081), port_of(8764)
c.JupyterHub.hub_bind_url = f'http://127.0.0.1:{HUB_PORT}'
c.ConfigurableHTTPProxy.api_url = f'http://127.0.0.1:{port_of(8001)}'
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
    """Give each student's server a port of its own: many start at the same moment."""
    ports = range(FIRST_PORT + spawner.user.id % 1000, LAST_PORT, 1000)
    spawner.port = next(filter(is_free, ports))


c.Spawner.pre_spawn_hook = choose_port

# The class that sees itself. The kernels of the students tell it; its page is for administrators.
CLASS_URL = f'http://127.0.0.1:{CLASS_PORT}'
c.JupyterHub.services = [
    {
        'name': 'class',
        'url': CLASS_URL,
        # It ends with the hub, also if that is killed.
        'command': ['setpriv', '--pdeathsig', 'TERM', sys.executable]
        + ['-m', 'classroom.hub.class_service'],
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

if os.environ.get('CONTAINERS') == 'yes':
    from docker.types import Ulimit

    from classroom.hub.service import IMAGE, gateway

    # The address of this machine in the network of the containers. Podman has it only while one of
    # them runs: then the hub listens at all addresses.
    HOST = gateway(os.environ['DOCKER_HOST'])
    LISTEN, LOCAL = (HOST, HOST) if is_free(0, HOST) else ('0.0.0.0', '127.0.0.1')
    c.JupyterHub.hub_bind_url = f'http://{LISTEN}:{HUB_PORT}'
    c.JupyterHub.hub_connect_url = f'http://{LOCAL}:{HUB_PORT}'
    c.Spawner.hub_connect_url = f'http://{HOST}:{HUB_PORT}'
    c.JupyterHub.services[0]['url'] = f'http://{LOCAL}:{CLASS_PORT}'
    c.JupyterHub.services[0]['environment']['CLASS_LISTEN'] = LISTEN
    c.JupyterHub.spawner_class = 'dockerspawner.DockerSpawner'
    c.Spawner.pre_spawn_hook = None
    c.Spawner.port = 8888
    c.Spawner.cmd = ['/opt/ros2_notebooks/classroom/container/start_student.sh']
    c.Spawner.notebook_dir = '/home/student/ros2_notebooks'
    c.Spawner.mem_limit, c.Spawner.cpu_limit = '2G', 2
    c.DockerSpawner.image = IMAGE
    c.DockerSpawner.pull_policy = 'never'
    c.DockerSpawner.remove = True
    c.DockerSpawner.volumes = {'ros2_notebooks_{username}': '/home/student'}
    c.DockerSpawner.extra_host_config = {
        'shm_size': '256m',
        'pids_limit': 400,
        # Podman's own are more than some machines allow. `nproc` counts all students together:
        # what each student may have is pids_limit.
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
        HUB_VARIABLE: f'http://{HOST}:{CLASS_PORT}/services/class',
        'TMPDIR': '/home/student/.tmp',  # builds and temporary files go to the student's volume
    }
