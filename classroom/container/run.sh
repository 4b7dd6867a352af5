#!/bin/sh
# The lessons in a container, for `make image` and `make lab-container`. It runs on Linux and macOS.
# usage: classroom/container/run.sh image|lab|label
# CONTAINER is podman or docker, with options if it needs some; IMAGE_ARGS and RUN_ARGS are added to
# its build and its run; BASE, PORT and LESSONS are those of the Makefile.
set -eu
cd "$(dirname "$0")/../.."
image=localhost/ros2_notebooks

fail() {
    printf '%s\n' "$*" >&2
    exit 1
}

# Which lessons and packages an image holds: its label is the checksum of what went into it.
inside=$(find LICENSE pyproject.toml helpers notebooks tools classroom -type f \
    ! -path "classroom/hub/*" ! -path "classroom/tests/*" ! -path '*/__pycache__/*' ! -path '*/.ipynb_checkpoints/*' -exec cksum {} + | LC_ALL=C sort | cksum | tr ' ' -)
[ "${1-}" != label ] || exec echo "$inside"

container=${CONTAINER:-$(command -v podman || command -v docker || true)}
[ -n "$container" ] ||
    fail 'There is neither podman nor docker: install one, for example with `sudo apt install podman`, then try again.'
command -v "${container%% *}" > /dev/null || fail "There is no command ${container%% *}, which CONTAINER names: install it, or leave CONTAINER out."
name=${container%% *}
$container version > /dev/null 2>&1 ||
    fail "${name##*/} does not answer: start it (podman machine start, Docker Desktop, or sudo systemctl start docker), then try again."

make_image() {
    set -- --file classroom/container/Containerfile --tag "$image" --label "lessons=$inside" ${BASE:+--build-arg "BASE=$BASE"}
    # The wheels of ROS 2 are for x86-64; a base with ROS 2 is for the machine that it is on.
    case ${BASE-} in *ros:*) ;; *) [ "$(uname -m)" = x86_64 ] || set -- "$@" --platform linux/amd64 ;; esac
    # Podman's own format of images has no health check.
    case $($container --version) in *podman*) set -- "$@" --format docker ;; esac
    $container build "$@" ${IMAGE_ARGS-} .
}

run_lab() {
    port=${PORT:-8888} lessons=${LESSONS:-my_lessons}
    has=$($container image inspect --format '{{index .Config.Labels "lessons"}}' "$image" 2> /dev/null) ||
        fail 'There is no image yet: run `make image`, then try again.'
    [ "$has" = "$inside" ] || fail 'The image is not of these lessons: run `make image`, then try again.'
    mkdir -p "$lessons"
    lessons=$(cd "$lessons" && pwd)

    # The server runs as you: the files that it writes are yours. Root is nobody in the container.
    user=$(id -u) group=$(id -g)
    set --
    if [ "$user" = 0 ]; then
        user=${SUDO_UID:-1000} group=${SUDO_GID:-1000}
        [ ! -O "$lessons" ] || chown "$user:$group" "$lessons"
    else
        case $($container --version) in *podman*) set -- --userns=keep-id ;; esac
    fi
    [ ! -t 0 ] || set -- "$@" --interactive --tty
    $container run --rm "$@" --user "$user:$group" --shm-size=256m \
        --publish "127.0.0.1:$port:$port" --env "JUPYTER_PORT=$port" \
        --volume "$lessons:/home/student" ${RUN_ARGS-} "$image"
}

case ${1-} in
    image) make_image ;;
    lab) run_lab ;;
    *) fail 'usage: classroom/container/run.sh image|lab|label' ;;
esac
