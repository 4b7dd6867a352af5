#!/bin/sh
# Install requirements-GROUP.lock into .venv, beside the packages of the lessons.
# usage: tools/add_group.sh GROUP, after tools/set_up.sh. Where it is up to date, this does nothing.
set -eu
cd "$(dirname "$0")/.."
lock=requirements-$1.lock

# tools/set_up.sh takes the packages out when it installs a changed requirements.lock.
stamp=.venv/$1.stamp
wanted() { cat .venv/set_up.stamp "$lock" | cksum; }
[ "$(cat "$stamp" 2> /dev/null)" != "$(wanted)" ] || exit 0

. tools/package_index.sh
uv_reads_pip_settings
printf '%s\n' "Installing $(grep -c '^[a-z].*==' "$lock") packages for the $1" >&2
.venv/bin/uv pip install --quiet $no_index --python .venv/bin/python --require-hashes --no-deps \
    --only-binary :all: --requirement "$lock" || {
    echo "uv could not install $lock: check the network, or name your package index with UV_DEFAULT_INDEX, then try again." >&2
    exit 1
}
wanted > "$stamp"
