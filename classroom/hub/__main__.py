"""Start the JupyterHub of a class: `make hub`.

    python -m classroom.hub --containers -- --debug

With `--containers`, each student is in a container of podman or docker. If a class in containers
cannot begin, one sentence says why, and the exit status is 1.
"""

import argparse
import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def main() -> None:
    """Become the hub."""
    parser = argparse.ArgumentParser(description='Start the JupyterHub of a class.')
    parser.add_argument('--containers', action='store_true', help='each student in a container')
    parser.add_argument('more', nargs='*', help="JupyterHub's own options, after --")
    options = parser.parse_args()
    if options.containers:
        from classroom.hub.service import service  # only this needs docker

        os.environ |= {'DOCKER_HOST': service(), 'CONTAINERS': 'yes'}
    command = [sys.executable, '-m', 'jupyterhub', '--config', str(HERE / 'jupyterhub_config.py')]
    os.execv(sys.executable, [*command, *options.more])


if __name__ == '__main__':
    main()
