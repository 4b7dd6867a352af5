#!/bin/sh
# Run uv: the one on the PATH, or the pinned one, which pip fetches into .uv. Packages come from where
# pip gets them.
# usage: tools/uv.sh ARGUMENT...   or, in a script in the root of this checkout: . tools/uv.sh; "$uv" ARGUMENT...
set -eu
case $0 in */uv.sh) cd "$(dirname "$0")/.." ;; esac

command -v what_to_check > /dev/null || . tools/troubles.sh
# tools/set_up.sh may go on with what is there.
command -v give_up > /dev/null || give_up() { fail "$1"; }

# Only what says where packages come from is taken over from the environment. The rest (PIP_USER,
# PIP_TARGET, UV_PYTHON, UV_CONSTRAINT, ...) would change what is installed, or where.
for name in $(env | sed -n 's/^\(PIP_[A-Z_]*\)=.*/\1/p; s/^\(UV_[A-Z_]*\)=.*/\1/p'); do
    case $name in
        *_INDEX | *_INDEX_URL | *_FIND_LINKS | *_INDEX_STRATEGY | UV_INDEX_*) ;;
        *CERT* | *_PROXY | *_TRUSTED_HOST | *_INSECURE_HOST | *_TLS | *_KEYRING_PROVIDER) ;;
        *_CACHE_DIR | *_NO_CACHE | *_CONFIG_FILE | *TIMEOUT | *_RETRIES) ;;
        UV_OFFLINE | UV_LINK_MODE | UV_CONCURRENT_* | UV_PYTHON_INSTALL_* | PIP_DISABLE_PIP_VERSION_CHECK) ;;
        *) unset "$name" ;;
    esac
done
# A home may be read-only, and a cache root's after `sudo make lab`: uv would end.
if ! mkdir -p "$cache" 2> /dev/null || [ -n "$(find "$cache" -maxdepth 1 ! -writable 2> /dev/null)" ]; then
    export UV_NO_CACHE=1
fi
# An archive of `make handout OFFLINE=yes` brings the packages along.
if [ -f wheels/pythons ]; then
    unset UV_DEFAULT_INDEX UV_INDEX_URL UV_INDEX UV_EXTRA_INDEX_URL UV_FIND_LINKS
    export PIP_NO_INDEX=1 PIP_FIND_LINKS=wheels
fi

# Any Python with a pip will do. One that does not run (a shim of pyenv) or has none is passed over.
any_python= without_pip= pip_config=
for name in python3 python3.14 python3.13 python3.12 python3.11 python; do
    command -v "$name" > /dev/null || continue
    if pip_config=$("$name" -I tools/pip.py config list 2> /dev/null); then any_python=$name && break; fi
    ! "$name" -I -S -c '' 2> /dev/null || without_pip=${without_pip:-$name}
done

setting() { # NAME: the value in pip's variables or files; a list is separated by spaces
    for section in :env: install global; do
        value=$(printf '%s\n' "$pip_config" | sed -n "s/^$section\.$1=.\(.*\).\$/\1/p" | sed 's/\\n/ /g')
        [ -z "$value" ] || break
    done
    printf '%s' "$value"
}

# --- uv ------------------------------------------------------------------------------------------

uv_pin=$(sed -n 's/^uv==\([^ ]*\).*/\1/p' tools/locks/requirements-uv.lock)
# One that is too old does not understand [tool.uv] of pyproject.toml, and says so.
if uv=$(command -v uv) && said=$("$uv" python dir 2>&1 > /dev/null) && [ -z "$said" ]; then
    :
else
    uv=$PWD/.uv/bin/uv
    case $("$uv" --version 2> /dev/null) in
        "uv $uv_pin" | "uv $uv_pin "*) ;;
        *)
            [ -n "$any_python" ] || [ -z "$without_pip" ] ||
                give_up "$without_pip has no pip and no venv: run \`sudo apt install python3-venv\`, then try again."
            [ -n "$any_python" ] ||
                give_up 'No Python is on the PATH: install one, for example with `sudo apt install python3 python3-venv`, then try again.'
            rm -rf .uv.new
            PIP_ROOT_USER_ACTION=ignore "$any_python" -I tools/pip.py install --quiet --disable-pip-version-check --no-user --no-deps --no-compile --target .uv.new \
                --only-binary :all: --require-hashes --requirement tools/locks/requirements-uv.lock ||
                give_up "pip could not install uv: $(what_to_check PIP_INDEX_URL)"
            rm -rf .uv
            mv .uv.new .uv
            ;;
    esac
fi

# --- The package index ---------------------------------------------------------------------------

take() { # VARIABLE VALUE: unless the variable is set, or there is no value
    eval "[ -n \"\${$1-}\" ]" || [ -z "$2" ] || export "$1=$2"
}
no_index= # an option, because no variable says it to uv
if [ -z "${UV_DEFAULT_INDEX-}${UV_INDEX_URL-}${UV_INDEX-}${UV_EXTRA_INDEX_URL-}${UV_FIND_LINKS-}" ]; then
    take UV_DEFAULT_INDEX "$(setting index-url)"
    take UV_INDEX "$(setting extra-index-url)"
    take UV_FIND_LINKS "$(setting find-links | tr -s ' ' ',')"
    case $(setting no-index) in 1 | [Tt]rue | yes | on) no_index=--no-index ;; esac
    take UV_INDEX_STRATEGY unsafe-best-match # as pip: any index may have the pinned file
fi
take SSL_CERT_FILE "$(setting cert)"
take ALL_PROXY "$(setting proxy)"
take UV_INSECURE_HOST "$(setting trusted-host)"

case $0 in */uv.sh) exec "$uv" "$@" ;; esac
