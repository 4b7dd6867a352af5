#!/bin/sh
# Make .venv and install tools/locks/requirements.lock into it, this project, and its `ros2` command. If
# .venv is up to date, this does nothing. After an interruption the next call repairs what the last
# one left.
# usage: tools/set_up.sh [--python 3.12] [GROUP...]
# A group of pyproject.toml adds its lock. Later calls keep it up to date.
set -eu
cd "$(dirname "$0")/.."
wanted_version=
if [ "${1-}" = --python ]; then
    wanted_version=$2
    shift 2
fi

# On NFS only a file that is open for writing can be locked. Not this script: no second one could
# start meanwhile.
if [ -w pyproject.toml ]; then exec 9<> pyproject.toml; else exec 9< pyproject.toml; fi
! command -v flock > /dev/null || flock 9 # two calls at once: the second waits

. tools/locks/files.sh
learners=tools/locks/requirements.lock
locks=$learners with=
for group in $groups; do
    case " $* " in
        *" $group "*) ;;
        *) [ -f ".venv/with_$group" ] || continue ;;
    esac
    locks="$locks $(lock_of "$group")" with="$with .venv/with_$group"
done

# The stamp is written last. It holds all that .venv depends on, so that a changed lock, a moved
# folder and a Python that went away or became another one are noticed.
wanted() {
    version=$(.venv/bin/python -I -S -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2> /dev/null) || return 0
    printf '%s\n' "Python $version" "$(pwd -P)" \
        "$(cat $locks pyproject.toml ros2/pyproject.toml tools/set_up.sh tools/jupyter/* helpers/robot/prefix/*/*/* 2> /dev/null | cksum)"
}
stamp=.venv/set_up.stamp
have=$(wanted)
[ -z "$have" ] || [ "$have" != "$(cat $stamp 2> /dev/null)" ] || exit 0

case $(uname -sm)-$(getconf GNU_LIBC_VERSION 2> /dev/null) in
    'Linux x86_64-glibc 2.'[3-9][0-9]* | 'Linux x86_64-glibc 2.2'[89]*) ;;
    *)
        echo 'The ROS 2 packages are for x86-64 Linux with glibc 2.28 or newer only: environment.md says what to do on other machines.' >&2
        exit 1
        ;;
esac
. tools/uv.sh

# The versions for which every pinned package has a wheel, newest first: tools/lock.sh found them.
versions=$(sed -n 's/^# Every wheel exists for Python //p' "$learners")
[ -n "$versions" ] || fail "$learners does not name its Python versions: get it again with \`git checkout $learners\`."
[ ! -f wheels/pythons ] || versions=$(cat wheels/pythons)
case " $versions " in
    *" ${wanted_version:-${versions%% *}} "*) versions=${wanted_version:-$versions} ;;
    *) fail "Not every pinned package has a wheel for Python $wanted_version." ;;
esac

# An environment that was complete once takes what has changed in the lock. Any other is made anew.
kept=$(printf '%s\n' "$have" | head -n 2)
version=$(printf '%s\n' "$kept" | sed -n 's/^Python //p')
case " $versions " in *" ${version:-none} "*) ;; *) kept= ;; esac
if [ -z "$kept" ] || [ "$(head -n 2 $stamp 2> /dev/null)" != "$kept" ]; then
    # The newest release of CPython on the machine. Without one uv fetches it.
    python=
    list=$("$uv" python list --only-installed 2> /dev/null) || :
    for version in $versions; do
        python=$(printf '%s\n' "$list" | sed -n "s/^cpython-$version\.[0-9]*-linux-x86_64-gnu  *//p" | sed 's/ -> .*//; q')
        [ -z "$python" ] || break
    done
    echo "Making .venv with ${python:=${versions%% *}}" >&2
    rm -rf .venv
    "$uv" venv --quiet --no-project --python "$python" .venv ||
        fail "No usable Python ${versions##* } to ${versions%% *} is on the PATH, and uv could not fetch one: install it, for example with \`sudo apt install python3\`, then try again."
fi
rm -f $stamp

# A ROS 2 wheel `ros-rclpy` also holds the metadata of an older format, of a package `rclpy`. uv would
# take that for a package that is not in the lock, and remove rclpy.
rm -rf .venv/lib/python*/site-packages/*.egg-info
quiet=
[ -t 2 ] || quiet=--quiet
echo "Installing $(sed -n 's/^\([a-z].*\)==.*/\1/p' $locks | sort -u | wc -l) packages, about 215 MB the first time" >&2
# Wheels only, except empy, which has none: one module, from its pinned source, by the pinned setuptools.
"$uv" pip sync $quiet $no_index --python .venv/bin/python --require-hashes --build-constraints "$learners" \
    --only-binary :all: --no-binary empy $locks ||
    fail 'uv could not install requirements.lock: check the network, or name your package index with UV_DEFAULT_INDEX, then try again.'
"$uv" pip install --quiet --offline --python .venv/bin/python --no-deps --editable . --editable ros2

# The wheel of googletest for Python 3.13 holds no sources (ros-gtest-vendor 1.14.9000). That for 3.12
# holds them, and they are the same for all.
if [ ! -e .venv/src/gtest_vendor ]; then
    sed -n '/^ros-gtest-vendor==/,/[^\\]$/p' "$learners" > .venv/gtest.lock
    mkdir -p .venv/src
    {
        "$uv" pip sync --quiet $no_index --target .venv/gtest --python-version 3.12 \
            --python-platform x86_64-manylinux_2_28 --only-binary :all: --require-hashes \
            .venv/gtest.lock && mv .venv/gtest/src/gtest_vendor .venv/src
    } || echo 'The sources of googletest are not there: one test of share_code_in_a_cpp_library needs `sudo apt install libgtest-dev`.' >&2
    rm -rf .venv/gtest .venv/gtest.lock
fi

mkdir -p .venv/share/jupyter/lab/settings
mkdir -p .venv/etc/jupyter .venv/etc/ipython
cp tools/jupyter/overrides.json .venv/share/jupyter/lab/settings
cp tools/jupyter/bashrc .venv/etc/jupyter
sed "s|VENV|$PWD/.venv|" tools/jupyter/jupyter_server_config.json > .venv/etc/jupyter/jupyter_server_config.json
cp tools/jupyter/ipython_config.json .venv/etc/ipython
[ -z "$with" ] || touch $with
wanted > .venv/set_up.new
mv .venv/set_up.new $stamp
