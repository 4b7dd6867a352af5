#!/bin/sh
# Sourced by tools/set_up.sh and tools/uv.sh: what they say if something fails, one sentence that says what to do.

say() { printf '%s\n' "$*" >&2; }
fail() {
    trap - EXIT
    say "$*"
    exit 1
}

cannot_be_written() { # PATH, in this folder: another user may have made it, or the same user as root
    if [ ! -w . ] || [ -O "$1" ]; then
        echo "The folder $PWD cannot be written: copy it to one of your own, then try again."
    else
        echo "$PWD/$1 is another user's: take it with \`sudo chown -R \"\$(id -u)\" \"$PWD\"\`, then try again."
    fi
}

cache=${UV_CACHE_DIR:-${XDG_CACHE_HOME:-${HOME-}/.cache}/uv}

has_room() { # FOLDER: for a download, of which nothing is left once it has failed
    free=$(df -Pm "$1" 2> /dev/null | sed -n '2s/^.* \([0-9][0-9]*\)  *[0-9][0-9]*%.*/\1/p')
    [ "${free:-1000}" -ge 300 ] || return 1
    # A quota shows only if one takes the room.
    file=$(mktemp "$1/.room.XXXXXX" 2> /dev/null) || return 0
    said=$(LC_ALL=C fallocate -l 300000000 "$file" 2>&1) || :
    rm -f "$file"
    case $said in *quota*) return 1 ;; esac
}

no_room() { # says so; fails if there is room
    for folder in "$PWD" "${TMPDIR:-/tmp}" "$cache"; do
        if ! has_room "$folder"; then
            echo "there is no room for 300 MB in $folder: make room for 1 GB, then try again."
            return 0
        fi
    done
    return 1
}

what_to_check() { # VARIABLE: what to do if packages do not come; VARIABLE names their index
    ! no_room || return 0
    proxy=${HTTPS_PROXY:-${https_proxy:-${ALL_PROXY:-${all_proxy:-$(setting proxy)}}}}
    proxy=$(echo "$proxy" | sed 's|//[^/]*@|//|') # without its password
    echo "check the network${proxy:+ and the proxy $proxy}, or name your package index with $1, then try again."
}
