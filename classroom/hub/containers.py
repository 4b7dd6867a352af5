"""Podman or docker, for `make hub CONTAINERS=yes`."""

import os
import subprocess
import sys
from pathlib import Path

import docker

IMAGE = 'localhost/ros2_notebooks'
SERVICES = ('/run/podman/podman.sock', '/var/run/docker.sock')
RUN = Path(__file__).parents[1] / 'container' / 'run.sh'


def use_service(solutions: str) -> tuple[str, dict[str, str]]:
    """Let docker's library speak to podman or docker. Raises SystemExit if a class cannot begin.

    Return the name of this machine in its containers, and the hosts that must be added for it.
    """
    found = next((f'unix://{path}' for path in SERVICES if os.path.exists(path)), '')
    address = os.environ.setdefault('DOCKER_HOST', found)
    if not address:
        sys.exit('There is no service of podman or docker: sudo systemctl start podman.socket')
    client = docker.APIClient(address)
    try:
        labels = client.inspect_image(IMAGE)['Config']['Labels'] or {}
    except docker.errors.ImageNotFound:
        sys.exit('There is no image yet: run `sudo make image`, then try again.')
    except docker.errors.DockerException:
        sys.exit(
            f'{address} does not answer: start podman.socket or docker, then try again as root.'
        )
    said = subprocess.run([RUN, 'label'], check=True, capture_output=True, text=True)
    if labels.get('lessons') != said.stdout.strip():
        sys.exit('The image is not of these lessons: run `sudo make image`, then try again.')
    if labels.get('solutions') != solutions:
        command = f'sudo make image SOLUTIONS="{solutions}"'
        sys.exit(f'The image has the solutions of other lessons: run `{command}` first.')
    # Podman adds this name by itself, and does not know docker's word for the address.
    if any('Podman' in part['Name'] for part in client.version().get('Components', ())):
        return 'host.containers.internal', {}
    return 'host.docker.internal', {'host.docker.internal': 'host-gateway'}
