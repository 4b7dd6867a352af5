"""JupyterHub for a class on one machine, started by `make hub`. HOSTING.md says how to use it."""

import os
import socket
import sys
from contextlib import suppress
from pathlib import Path

from classroom.handout import ALL, write_lessons
from helpers.checks.classroom import HUB_VARIABLE

ROOT = Path(__file__).resolve().parents[2]
STATE = ROOT / '.jupyter/hub'
STATE.mkdir(mode=0o700, parents=True, exist_ok=True)
# A service ends with the hub, also if that is killed: the next hub needs its port.
WITH_HUB = ['setpriv', '--pdeathsig', 'KILL', sys.executable, '-m']

c = get_config()  # noqa: F821

# --- Everybody who has an account on this machine logs in with its password ----------------------

c.Authenticator.allow_all = True
c.JupyterHub.bind_url = 'http://127.0.0.1:8000'
c.JupyterHub.hub_bind_url = 'http://127.0.0.1:8081'
c.JupyterHub.db_url = f'sqlite:///{STATE}/jupyterhub.sqlite'
c.JupyterHub.cookie_secret_file = str(STATE / 'cookie_secret')
c.JupyterHub.proxy_class = 'classroom.hub.proxy.Proxy'
c.ConfigurableHTTPProxy.pid_file = str(STATE / 'proxy.pid')
c.ConfigurableHTTPProxy.command = (
    f'{sys.prefix}/hub_proxy/node_modules/.bin/configurable-http-proxy'
)

# --- Each student has a server, as that account --------------------------------------------------

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


def own_port(spawner) -> None:
    """Give each student's server a free port of its own, for the same reason."""
    for port in range(20000 + spawner.user.id % 1000, 32768, 1000):
        with suppress(OSError), socket.create_server(('127.0.0.1', port)):
            spawner.port = port
            return


c.Spawner.pre_spawn_hook = own_port
CLASS_URL = 'http://127.0.0.1:8764'
LESSONS = ROOT / '.jupyter/lessons'  # without notes, and with the solutions that SOLUTIONS names
SOLUTIONS = os.environ.get('SOLUTIONS') or ALL
try:
    borrow = os.environ.get('BORROW') != 'no'
    write_lessons(ROOT / 'notebooks', LESSONS, solutions=SOLUTIONS, borrow=borrow)
except ValueError as error:  # SOLUTIONS names no lesson
    sys.exit(str(error))
c.Spawner.environment = {
    HUB_VARIABLE: f'{CLASS_URL}/services/class',
    'LESSONS': str(LESSONS),
}

# --- The class page, and what ends a server that nobody has used for an hour ---------------------

# Not by `url` of the service: then the hub would end if the page needed more than ten seconds to
# start, as it may on a busy machine.
c.Proxy.extra_routes = {'/services/class/': CLASS_URL}
c.JupyterHub.services = [
    {
        'name': 'class',
        'command': [*WITH_HUB, 'classroom.class_page.on_hub'],
        'cwd': str(ROOT),
        'environment': {
            'CLASS_FOLDER': str(STATE),
            'JUPYTERHUB_SERVICE_URL': CLASS_URL,
            'JUPYTERHUB_SERVICE_PREFIX': '/services/class/',
        },
        'oauth_redirect_uri': '/services/class/oauth_callback',
        'oauth_no_confirm': True,
    },
    {'name': 'idle-culler', 'command': [*WITH_HUB, 'jupyterhub_idle_culler', '--timeout=3600']},
]
c.JupyterHub.load_roles = [
    {
        'name': 'idle-culler',
        'services': ['idle-culler'],
        'scopes': ['list:users', 'read:users:activity', 'read:servers', 'delete:servers'],
    }
]

# --- CONTAINERS=yes: each student's server is in a container of the image of `make image` --------

if os.environ.get('CONTAINERS') == 'yes':
    from docker.types import Ulimit

    from classroom.hub.containers import IMAGE, use_service

    host, more_hosts = use_service(SOLUTIONS)
    c.JupyterHub.spawner_class = 'dockerspawner.DockerSpawner'
    c.DockerSpawner.image = IMAGE
    c.DockerSpawner.pull_policy = 'never'
    c.DockerSpawner.remove = True
    c.DockerSpawner.volumes = {'ros2_notebooks_{username}': '/home/student'}
    c.Spawner.cmd = ['/opt/ros2_notebooks/classroom/container/start_student.sh']
    c.Spawner.notebook_dir = '/home/student/ros2_notebooks'
    c.Spawner.pre_spawn_hook, c.Spawner.port = None, 8888
    c.Spawner.mem_limit, c.Spawner.cpu_limit = '2G', 2
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
        'extra_hosts': more_hosts,
    }
    # A container reaches the hub and the class by the name of this machine in its network.
    c.JupyterHub.hub_bind_url = 'http://0.0.0.0:8081'
    c.JupyterHub.hub_connect_url = 'http://127.0.0.1:8081'
    c.Spawner.hub_connect_url = f'http://{host}:8081'
    c.JupyterHub.services[0]['environment']['CLASS_LISTEN'] = '0.0.0.0'
    c.Spawner.environment = {
        HUB_VARIABLE: f'http://{host}:8764/services/class',
        'TMPDIR': '/home/student/.tmp',  # builds and temporary files go to the student's volume
    }
