#!/bin/sh
# Remove the environment, caches and what lessons built, for `make clean`. What somebody wrote stays.
# usage: tools/clean.sh
set -eu
cd "$(dirname "$0")/.."

rm -rf .venv .uv handout site .site .hypothesis .pytest_cache .ruff_cache

# Workspaces. A person's has `.owned` in it, also when it was put aside: only what colcon made goes.
# Any other was left by a run without a person, which would remove it, too.
for lock in scratch/.?*.lock; do
    workspace=${lock#scratch/.}
    workspace=scratch/${workspace%.lock}
    [ -e "$workspace/.owned" ] || rm -rf "$workspace"
    rm -f "$lock"
done
for mark in scratch/*/.owned; do
    workspace=${mark%/.owned}
    rm -rf "$workspace/build" "$workspace/install" "$workspace/log"
done
rmdir scratch 2> /dev/null || true # unless something of a person is in it

# JupyterLab's state. What students on a hub have written stays, a class until its teacher ends it, and
# the progress of the student here.
if [ -d .jupyter ]; then
    find .jupyter -mindepth 1 -maxdepth 1 ! -name hub ! -name class ! -name data -exec rm -rf {} +
fi
if [ -d .jupyter/data ]; then
    find .jupyter/data -mindepth 1 -maxdepth 1 ! -name 'ros2_notebooks_*' -exec rm -rf {} +
fi

find . \( -name .git -o -path ./my_lessons -o -path ./presentation -o -path ./.jupyter/hub \) -prune -o \
    \( -name __pycache__ -o -name .ipynb_checkpoints \) -prune -exec rm -rf {} +
