#!/bin/sh
# Make .venv inside the image: the locked wheels, or, on an image with ROS 2 Jazzy of its own (ARM64), what that one lacks.
set -eu
cd "$(dirname "$0")/../.."
if [ -f /opt/ros/jazzy/setup.sh ]; then
    # Not tried. These are the steps of environment.md, "apt, on Ubuntu 24.04".
    apt-get update
    apt-get install --yes --no-install-recommends pybind11-dev python3-colcon-common-extensions \
        ros-jazzy-domain-coordinator ros-jazzy-ros-base ros-jazzy-test-msgs
    rm -rf /var/lib/apt/lists/*
    python3 -m venv --system-site-packages .venv
    .venv/bin/python -m pip install --no-cache-dir --editable . --editable ros2 'numpy<2' \
        "$(sed -n 's/^\(jupyterhub==[^ ]*\).*/\1/p' classroom/requirements-hub.lock)"
else
    tools/set_up.sh hub
    rm -rf .uv # it has done its work, and is 38 MB
fi
# Students cannot write here: without this each server and each kernel would compile what it imports.
.venv/bin/python -m compileall -q -j 0 -x '/tests?/' .venv/lib > /dev/null || true
rm -rf /root/.cache
