#!/bin/sh
# Make .venv and install requirements.lock and this project into it. Where .venv is up to date,
# this does nothing. After an interruption the next call repairs what the last one left.
# usage: tools/set_up.sh [GROUP]
# The group, `browser`, `site` or `hub`, adds its requirements-GROUP.lock. Later calls keep it up to date.
# usage: tools/set_up.sh --in FOLDER 3.12
# The same in another folder of this checkout, with this Python.
set -eu
cd "$(dirname "$0")/.."
venv=.venv wanted_version=
if [ "${1-}" = --in ]; then
    venv=$2 wanted_version=$3
    shift 3
fi

say() { printf '%s\n' "$*" >&2; }
fail() {
    say "$*"
    exit 1
}

case $venv in *[[:space:]*?[]*) fail "No blank and none of * ? [ may be in the name of the folder: $venv" ;; esac

# On NFS only a file that is open for writing can be locked. Not this script: no second one could
# start meanwhile.
if [ -w pyproject.toml ]; then exec 9<> pyproject.toml; else exec 9< pyproject.toml; fi
! command -v flock > /dev/null || flock 9 # two calls at once: the second waits

locks=requirements.lock groups=
for group in browser site hub; do
    if [ "${1-}" = "$group" ] || [ -f "$venv/with_$group" ]; then
        locks="$locks requirements-$group.lock" groups="$groups $venv/with_$group"
    fi
done

# The stamp is written last. It holds all that .venv depends on, so that a changed lock, a moved
# folder and a Python that went away or became another one are noticed.
stamp=$venv/set_up.stamp
wanted() {
    version=$($venv/bin/python -I -S -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2> /dev/null) || return 0
    printf '%s\n' "Python $version" "$(pwd -P)" \
        "$(cat $locks pyproject.toml tools/set_up.sh tools/jupyterlab_settings.json | cksum)"
}
[ "$(cat "$stamp" 2> /dev/null)" != "$(wanted)" ] || [ ! -f "$stamp" ] || exit 0

# The versions for which every pinned package has a wheel, newest first: tools/lock.sh found them.
versions=$(sed -n 's/^# Every wheel exists for Python //p' requirements.lock)
[ -n "$versions" ] || fail 'requirements.lock does not name its Python versions: get it again with `git checkout requirements.lock`.'
# An archive of `make handout OFFLINE=yes` brings the packages along, for some Pythons.
[ ! -f wheels/pythons ] || versions=$(cat wheels/pythons)
if [ -n "$wanted_version" ]; then
    case " $versions " in
        *" $wanted_version "*) versions=$wanted_version ;;
        *) fail "Not every pinned package has a wheel for Python $wanted_version." ;;
    esac
fi

# --- The package index ---------------------------------------------------------------------------

# Only what says where packages come from is taken over from the environment. The rest (PIP_USER,
# PIP_TARGET, UV_PYTHON, UV_CONSTRAINT, ...) would change what is installed, or where.
for name in $(env | sed -n 's/^\(PIP_[A-Z_]*\)=.*/\1/p; s/^\(UV_[A-Z_]*\)=.*/\1/p'); do
    case $name in
        *_INDEX | *_INDEX_URL | *_FIND_LINKS | *_INDEX_STRATEGY | UV_INDEX_*) ;;
        *CERT* | *_PROXY | *_TRUSTED_HOST | *_INSECURE_HOST | *_TLS | *_KEYRING_PROVIDER) ;;
        *_CACHE_DIR | *_NO_CACHE | *_CONFIG_FILE | *TIMEOUT | *_RETRIES) ;;
        UV_OFFLINE | UV_LINK_MODE | UV_CONCURRENT_* | PIP_DISABLE_PIP_VERSION_CHECK) ;;
        *) unset "$name" ;;
    esac
done

if [ -f wheels/pythons ]; then
    unset UV_DEFAULT_INDEX UV_INDEX_URL UV_INDEX UV_EXTRA_INDEX_URL UV_FIND_LINKS
    export PIP_NO_INDEX=1 PIP_FIND_LINKS=wheels
fi

pip_setting() { # its value, from the environment or a pip.conf; a list is separated by spaces
    for section in :env: install global; do
        value=$(printf '%s\n' "$pip_config" | sed -n "s/^$section\.$1=.\(.*\).\$/\1/p" | sed 's/\\n/ /g')
        [ -z "$value" ] || break
    done
    printf '%s' "$value"
}

uv_reads_pip_settings() { # uv does not read them itself
    pip_config=$($venv/bin/python -I -m pip config list)
    no_index=
    if [ -z "${UV_DEFAULT_INDEX-}${UV_INDEX_URL-}${UV_INDEX-}${UV_EXTRA_INDEX_URL-}${UV_FIND_LINKS-}" ]; then
        index=$(pip_setting index-url) more=$(pip_setting extra-index-url) links=$(pip_setting find-links)
        [ -z "$index" ] || export UV_DEFAULT_INDEX="$index"
        [ -z "$more" ] || export UV_INDEX="$more"
        [ -z "$links" ] || export UV_FIND_LINKS="$(printf '%s' "$links" | tr -s ' ' ',')"
        case $(pip_setting no-index) in 1 | [Tt]rue | yes | on) no_index=--no-index ;; esac
        # As pip: any of the indexes may have the pinned file. Its hash is checked.
        : "${UV_INDEX_STRATEGY:=unsafe-best-match}"
        export UV_INDEX_STRATEGY
    fi
    certificates=$(pip_setting cert) proxy=$(pip_setting proxy) hosts=$(pip_setting trusted-host)
    [ -z "$certificates" ] || export SSL_CERT_FILE="${SSL_CERT_FILE:-$certificates}"
    [ -z "$proxy" ] || export ALL_PROXY="${ALL_PROXY:-$proxy}"
    [ -z "$hosts" ] || export UV_INSECURE_HOST="${UV_INSECURE_HOST:-$hosts}"
}

# --- The environment -----------------------------------------------------------------------------

# An environment that was complete once takes what has changed in the lock. Any other is made anew.
have=$(wanted | head -n 2)
version=$(printf '%s' "$have" | sed -n 's/^Python //p')
case " $versions " in *" ${version:-none} "*) usable=yes ;; *) usable= ;; esac
if [ ! -f "$stamp" ] || [ "$(head -n 2 "$stamp")" != "$have" ] || [ -z "$usable" ]; then
    python=$(tools/find_python.sh "$versions")
    say "Making $venv with $python"
    rm -rf $venv
    "$python" -I -m venv $venv || fail "$python could not make $venv: what it said stands above."
fi
rm -f "$stamp"

# uv comes with its pinned hash from the same lock, and setuptools, with which it builds empy. pip is
# only there to fetch them.
sed -n '/^uv==/,/[^\\]$/p; /^setuptools==/,/[^\\]$/p' requirements.lock > $venv/first.lock
uv_version=$(sed -n 's/^uv==\([^ ]*\).*/\1/p' $venv/first.lock)
case $($venv/bin/uv --version 2> /dev/null) in
    "uv $uv_version" | "uv $uv_version "*) ;;
    *)
        $venv/bin/python -I -m pip install --quiet --disable-pip-version-check --no-user --no-deps \
            --only-binary :all: --require-hashes --requirement $venv/first.lock ||
            fail 'pip could not install uv: check the network, or name your package index with PIP_INDEX_URL, then try again.'
        ;;
esac

uv_reads_pip_settings
quiet=
[ -t 2 ] || quiet=--quiet
# A ROS 2 wheel `ros-rclpy` also holds the metadata of an older format, of a package `rclpy`. uv would
# take that for a package that is not in the lock, and remove rclpy.
rm -rf $venv/lib/python*/site-packages/*.egg-info
# Wheels only, except empy, which has none: one module, from its pinned source. Without isolation uv
# builds it with the setuptools above, and fetches nothing that is not in the lock.
say "Installing $(cat $locks | grep -c '^[a-z].*==') packages, about 190 MB the first time"
$venv/bin/uv pip sync $quiet $no_index --python $venv/bin/python --require-hashes \
    --only-binary :all: --no-binary empy --no-build-isolation $locks ||
    fail 'uv could not install requirements.lock: check the network, or name your package index with UV_DEFAULT_INDEX, then try again.'
$venv/bin/uv pip install --quiet --offline --python $venv/bin/python --no-deps --no-build-isolation --editable .

mkdir -p $venv/share/jupyter/lab/settings
cp tools/jupyterlab_settings.json $venv/share/jupyter/lab/settings/overrides.json
[ -z "$groups" ] || touch $groups
wanted > $venv/set_up.new
mv $venv/set_up.new "$stamp"
