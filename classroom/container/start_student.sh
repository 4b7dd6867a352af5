#!/bin/sh
# JupyterHub, or a container, starts this as the student: their own copy of the notebooks, with what is
# newer and with what they have written, then their server.
set -eu
root=$(dirname "$0")/../..
mine=$HOME/ros2_notebooks
mkdir -p "$mine" "${TMPDIR:-/tmp}"
# On a hub, others on this machine must not read what a student writes. A volume belongs to nobody else.
[ -z "${JUPYTERHUB_API_TOKEN-}" ] || chmod go-rwx "$HOME" 2> /dev/null || true
# Without newer lessons, too, a student can work.
(cd "$root" && exec .venv/bin/python -m classroom.update "${LESSONS:-notebooks}" --to "$mine") || true

# The path of a socket file is limited to 107 bytes, and a home folder may have a long name.
JUPYTER_RUNTIME_DIR=${TMPDIR:-/tmp}/jupyter-$(id -u)
mkdir -m 700 "$JUPYTER_RUNTIME_DIR" 2> /dev/null || [ -O "$JUPYTER_RUNTIME_DIR" ] || {
    echo "$JUPYTER_RUNTIME_DIR belongs to somebody else: remove it." >&2
    exit 1
}
PATH=$(cd "$root" && pwd)/.venv/bin:$PATH # a terminal finds `ros2`, `colcon` and this Python
export JUPYTER_RUNTIME_DIR PATH
# How the lessons look: among others, the notes for the instructor are hidden.
style=$HOME/.jupyter/custom/custom.css
[ -e "$style" ] || { mkdir -p "${style%/*}" && cp "$root/tools/lab.css" "$style"; }
set -- --LabApp.custom_css=True "$@"
[ -z "${JUPYTERHUB_API_TOKEN-}" ] || exec "$root/.venv/bin/jupyterhub-singleuser" "$@"
# No hub: a container of `make lab-container`.
exec "$root/.venv/bin/python" -m jupyterlab --no-browser --ip=0.0.0.0 --ServerApp.port_retries=0 \
    --ServerApp.custom_display_url="http://127.0.0.1:${JUPYTER_PORT:-8888}" \
    --ServerApp.root_dir="$mine" --LabApp.default_url=/lab/tree/00_start_here.ipynb "$@"
