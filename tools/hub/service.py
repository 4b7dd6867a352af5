"""Print the address of podman's or docker's service, for `make hub CONTAINERS=yes`.

Where a class in containers cannot begin, it prints one sentence instead, and its status is 1.
"""

import os
import sys

import docker

IMAGE = 'localhost/ros2_notebooks'
SERVICES = ('/run/podman/podman.sock', '/var/run/docker.sock')


def service() -> str:
    """Return the address. Raises SystemExit with a sentence."""
    if os.geteuid():
        sys.exit('A class in containers needs root, for the disks: sudo make hub CONTAINERS=yes')
    found = next((f'unix://{path}' for path in SERVICES if os.path.exists(path)), None)
    address = os.environ.get('DOCKER_HOST', found)
    if address is None:
        sys.exit('There is no service of podman or docker: sudo systemctl start podman.socket')
    try:
        docker.APIClient(address).inspect_image(IMAGE)
    except docker.errors.ImageNotFound:
        sys.exit('There is no image yet: run `sudo make image`, then try again.')
    except docker.errors.DockerException:
        sys.exit(f'{address} does not answer: start podman.socket or docker, then try again.')
    return address


if __name__ == '__main__':
    print(service())
