#!/bin/sh
# Run `make test` in another distribution: on a fresh clone of this checkout, inside a folder with
# the files of that distribution. What it installs stays in the folder.
# usage, as root: tools/test_in.sh FOLDER [ARGUMENT OF make...]
set -eu

say() {
    echo "$1" >&2
    exit 2
}
[ $# -gt 0 ] || say 'Say where the distribution is: tools/test_in.sh FOLDER'
folder=$(realpath "$1")
shift
[ "$(id -u)" = 0 ] || say 'Only root may change the root folder: run it with sudo.'
[ -x "$folder/bin/sh" ] || say "There is no distribution in $folder: CONTRIBUTING.md says how to make one."

checkout=$(realpath "$(dirname "$0")/..")
# A namespace of mounts, which ends with the command. Not chroot: the tests make namespaces of their
# own, and those begin at the root of this one.
exec unshare --mount --pid --fork --propagation private sh -euc '
    cd "$1"
    mount --rbind . .
    cd "$1"
    mount -t proc proc proc
    mount --rbind /sys sys
    mount --rbind /dev dev
    mount -t tmpfs tmpfs dev/shm
    mkdir -p mnt/checkout mnt/before
    mount --bind "$2" mnt/checkout
    cp /etc/resolv.conf /etc/hosts etc
    shift 2
    pivot_root . mnt/before
    cd /
    umount --lazy /mnt/before
    for tool in git make c++; do
        command -v "$tool" > /dev/null || { echo "This distribution has no $tool: install it there." >&2; exit 2; }
    done
    rm -rf ros2_notebooks
    git -c safe.directory=* clone --quiet /mnt/checkout ros2_notebooks
    cd ros2_notebooks
    HOME=/root LC_ALL=C.UTF-8 exec make test "$@"
' sh "$folder" "$checkout" "$@"
