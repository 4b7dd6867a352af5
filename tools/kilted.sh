#!/bin/sh
# Run the lessons with the wheels of ROS 2 Kilted, in an environment of its own, .kilted, and list the cells
# that print something else there. Such a cell is no failure: it says what a move to Kilted would change.
# usage: tools/kilted.sh [LESSON...]
set -eu
cd "$(dirname "$0")/.."
tools/set_up.sh test
. tools/uv.sh

temporary=$(mktemp -d)
trap 'rm -rf "$temporary"' EXIT
# What has no wheel of Kilted: pure Python, and the same in both.
both='domain-coordinator|python-cmake-module'
jazzy=$(sed -n "s/^ *'\(ros-jazzy-[^']*\)'.*/\1/p" pyproject.toml)
printf '%s\n' "$jazzy" | grep -E "$both" > "$temporary/ros.txt"
printf '%s\n' "$jazzy" | grep -vE "$both" | sed 's/ros-jazzy-/ros-kilted-/; s/==.*//' >> "$temporary/ros.txt"
# All other packages in the versions of the lock.
cat tools/locks/requirements.lock tools/locks/requirements-test.lock |
    sed -n 's/^\([a-z].*==.*[^ ]\) *\\$/\1/p' | grep -v '^ros-' | sort -u > "$temporary/pins.txt"

rm -rf .kilted
"$uv" venv --quiet --no-project --python .venv/bin/python .kilted
"$uv" pip install --quiet --python .kilted/bin/python --no-binary empy \
    -r "$temporary/pins.txt" -r "$temporary/ros.txt"
"$uv" pip install --quiet --python .kilted/bin/python --no-deps --editable . --editable ros2
"$uv" pip list --python .kilted/bin/python 2> /dev/null | grep -E '^ros-(kilted-)?rclpy '

.kilted/bin/python -m pytest -n 2 --dist loadscope -q --tb=no ${1+--lesson "$*"} notebooks > "$temporary/run.txt" 2>&1 || :
echo 'These cells print something else, or do not run:'
grep -E '^(FAILED|ERROR)' "$temporary/run.txt" | cut -c1-120 || echo 'none'
tail -n 1 "$temporary/run.txt"
