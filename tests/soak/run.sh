#!/bin/sh
# Run the notebooks in hard conditions, for `make soak`; conftest.py beside this says what they are.
# Each condition has a /dev/shm, a table of processes and a record of kernels of its own: whatever is
# there afterwards was left behind. Only root may mount them.
# usage: tests/soak/run.sh CONDITIONS LESSONS, such as "idle kill" "02 03"; an empty text takes all
set -eu
cd "$(dirname "$0")/../.."
[ "$(id -u)" = 0 ] || {
    echo 'Each run has a /dev/shm of its own, which only root can mount: use `sudo make soak`.' >&2
    exit 1
}
failed=0
for condition in ${1:-idle busy twice interrupt kill}; do
    echo "--- $condition"
    # The shell stays the first process: it waits for those whose parents have ended.
    unshare --mount --pid --fork --kill-child --mount-proc sh -c '
        mount -t tmpfs tmpfs /dev/shm
        .venv/bin/python -m pytest tests/soak notebooks --soak "$1" --lesson "$2" -p no:cacheprovider \
            -o faulthandler_timeout=1800
        exit $?
    ' soak "$condition" "${2-}" || failed=1
done
exit $failed
