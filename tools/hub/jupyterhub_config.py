"""JupyterHub for a class on one machine, started by `make hub`. teaching.md says how to use it.

Everybody who has an account on this machine may log in, with its password.
"""

import sys
from pathlib import Path

from helpers.classroom import HUB_VARIABLE

ROOT = Path(__file__).resolve().parent.parent.parent
STATE = ROOT / '.jupyter/hub'
FIRST_PORT = 20000

STATE.mkdir(mode=0o700, parents=True, exist_ok=True)
c = get_config()  # noqa: F821

c.JupyterHub.bind_url = 'http://127.0.0.1:8000'
c.JupyterHub.db_url = f'sqlite:///{STATE}/jupyterhub.sqlite'
c.JupyterHub.cookie_secret_file = str(STATE / 'cookie_secret')
c.ConfigurableHTTPProxy.pid_file = str(STATE / 'proxy.pid')
c.ConfigurableHTTPProxy.command = (
    f'{sys.prefix}/hub_proxy/node_modules/.bin/configurable-http-proxy'
)
c.Authenticator.allow_all = True

c.Spawner.cmd = [str(ROOT / 'tools/container/start_student.sh')]
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
        'command': [sys.executable, '-m', 'tools.hub.class_service'],
        'cwd': str(ROOT),
        'environment': {'CLASS_FOLDER': str(STATE)},
        'oauth_no_confirm': True,
        'timeout': 180,  # the hub ends where a service takes longer to start
    }
]
c.Spawner.environment = {HUB_VARIABLE: f'{CLASS_URL}/services/class'}
