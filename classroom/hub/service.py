"""The service of podman or docker, and the hub's address, for `make hub CONTAINERS=yes`."""

import os
import subprocess
import sys
from pathlib import Path

import docker

IMAGE = 'localhost/ros2_notebooks'
SERVICES = ('/run/podman/podman.sock', '/var/run/docker.sock')
# Where the containers reach the hub and the class. RFC 3927: routers do not forward these.
HUB = '169.254.20.81'


def service() -> str:
    """Return its address. Raises SystemExit with a sentence if a class cannot begin."""
    if os.geteuid():
        sys.exit('A class in containers needs root, for the disks: sudo make hub CONTAINERS=yes')
    found = next((f'unix://{path}' for path in SERVICES if os.path.exists(path)), None)
    address = os.environ.get('DOCKER_HOST', found)
    if address is None:
        sys.exit('There is no service of podman or docker: sudo systemctl start podman.socket')
    try:
        image = docker.APIClient(address).inspect_image(IMAGE)
    except docker.errors.ImageNotFound:
        sys.exit('There is no image yet: run `sudo make image`, then try again.')
    except docker.errors.DockerException:
        sys.exit(f'{address} does not answer: start podman.socket or docker, then try again.')
    label = [Path(__file__).parents[1] / 'container' / 'run.sh', 'label']
    lessons = subprocess.run(label, check=True, capture_output=True, text=True).stdout.strip()
    if (image['Config']['Labels'] or {}).get('lessons') != lessons:
        sys.exit('The image is not of these lessons: run `sudo make image`, then try again.')
    return address


def take_address() -> None:
    """Give this machine the address of the hub. Raises SystemExit with a sentence."""
    command = ['ip', 'address', 'replace', f'{HUB}/32', 'dev', 'lo']
    try:
        subprocess.run(command, check=True, capture_output=True, text=True)
    except FileNotFoundError:
        sys.exit('There is no command ip: run `sudo apt install iproute2`, then try again.')
    except subprocess.CalledProcessError as problem:
        sys.exit(f'This machine cannot have the address {HUB}: {problem.stderr.strip()}')
