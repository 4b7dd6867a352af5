#!/bin/sh
# Write tools/locks/requirements.lock: every dependency of pyproject.toml, pinned, with the hashes of its
# files. And for each of its groups a requirements-GROUP.lock: what that needs besides.
# usage: tools/lock.sh [--upgrade]
# Without --upgrade a version that still fits stays as it is.
set -eu
cd "$(dirname "$0")/.."
. tools/uv.sh
. tools/locks/files.sh

temporary=$(mktemp -d)
trap 'rm -rf "$temporary"' EXIT
new=$temporary/requirements.lock

resolve() { # LOCK, and what uv resolves; uv keeps the versions that it finds in the file
    rm -f "$new"
    [ ! -f "$1" ] || cp "$1" "$new"
    shift
    # empy has no wheel: tools/set_up.sh builds its one module.
    "$uv" pip compile --universal --python-version 3.11 \
        --only-binary :all: --no-binary empy --generate-hashes --no-annotate --no-header \
        --no-emit-index-url --no-emit-find-links --output-file "$new" "$@" > /dev/null
}

lock=tools/locks/requirements.lock
resolve "$lock" pyproject.toml --extra ros "$@"

# The lock fits several Pythons, but a package may lack the wheel of one. tools/set_up.sh reads the
# result in the second line, and need not ask the package index.
pythons=
for python in 3.14 3.13 3.12 3.11; do
    if "$uv" pip compile "$new" --python-version "$python" --no-deps --only-binary :all: \
        --no-binary empy --python-platform x86_64-manylinux_2_28 --quiet --output-file "$new.checked" > /dev/null; then
        pythons="$pythons $python"
    else
        echo "Python $python lacks a wheel: left out." >&2
    fi
    rm -f "$new.checked"
done
[ -n "$pythons" ] || fail "No Python has a wheel of every package: $lock stays as it was."
{
    echo '# Made by `make lock` from pyproject.toml. Do not edit.'
    echo "# Every wheel exists for Python$pythons"
    cat "$new"
} > "$lock"
echo "$lock: $(grep -c '^[a-z].*==' "$lock") pins, Python$pythons"

constraints="--constraint $lock"
for group in uv $groups; do
    lock=$(lock_of "$group")
    resolve "$lock" --group "$group" $constraints "$@"
    {
        echo "# Made by \`make lock\` from the group \`$group\` of pyproject.toml. Do not edit."
        cat "$new"
    } > "$lock"
    constraints="$constraints --constraint $lock" # .venv may hold all of them
done
