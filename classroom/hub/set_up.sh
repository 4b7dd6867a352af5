#!/bin/sh
# Make .venv ready for a class: JupyterHub, its proxy, and what a student who cannot write here needs.
# usage: classroom/hub/set_up.sh. Where it is up to date, this does little.
set -eu
cd "$(dirname "$0")/../.."
tools/set_up.sh hub

proxy=.venv/hub_proxy
if ! cmp -s classroom/hub/package-lock.json "$proxy/package-lock.json"; then
    command -v npm > /dev/null || {
        echo 'JupyterHub needs a proxy that npm installs: run `sudo apt install npm`, then try again.' >&2
        exit 1
    }
    echo "Installing JupyterHub's proxy" >&2
    rm -rf "$proxy" "$proxy.new"
    mkdir -p "$proxy.new"
    cp classroom/hub/package.json classroom/hub/package-lock.json "$proxy.new"
    npm ci --prefix "$proxy.new" --ignore-scripts --no-audit --no-fund --silent || {
        echo 'npm could not install the proxy: check the network, then try again.' >&2
        exit 1
    }
    mv "$proxy.new" "$proxy"
fi

# The first build of a lesson would do this, and the first import, but a student may not write here.
.venv/bin/python -c 'from helpers.workspace import fix_wheels; fix_wheels()'
.venv/bin/python -m compileall -q -j 0 -x '/tests?/' .venv/lib helpers ros2 > /dev/null || true
