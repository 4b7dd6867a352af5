"""The service of podman or docker, for `make hub CONTAINERS=yes`."""

import os
import subprocess
import sys
from pathlib import Path

import docker

IMAGE = 'localhost/ros2_notebooks'
SERVICES = ('/run/podman/podman.sock', '/var/run/docker.sock')
NETWORKS = ('bridge', 'podman')  # the ones of docker and podman where nobody names another


def service() -> str:
    """Return its address. Raises SystemExit with a sentence if a class cannot begin."""
    found = next((f'unix://{path}' for path in SERVICES if os.path.exists(path)), None)
    address = os.environ.get('DOCKER_HOST', found)
    if address is None:
        sys.exit('There is no service of podman or docker: sudo systemctl start podman.socket')
    try:
        image = docker.APIClient(address).inspect_image(IMAGE)
    except docker.errors.ImageNotFound:
        sys.exit('There is no image yet: run `sudo make image`, then try again.')
    except docker.errors.DockerException:
        sys.exit(
            f'{address} does not answer: start podman.socket or docker, then try again as root.'
        )
    label = [Path(__file__).parents[1] / 'container' / 'run.sh', 'label']
    lessons = subprocess.run(label, check=True, capture_output=True, text=True).stdout.strip()
    if (image['Config']['Labels'] or {}).get('lessons') != lessons:
        sys.exit('The image is not of these lessons: run `sudo make image`, then try again.')
    return address


def gateway(address: str) -> str:
    """Return where the containers of a service find this machine."""
    known = {network['Name']: network for network in docker.APIClient(address).networks()}
    network = next(known[name] for name in NETWORKS if name in known)
    return network['IPAM']['Config'][0]['Gateway']
