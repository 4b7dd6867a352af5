#!/bin/sh
# The lessons in a container, for `make image`, `make lab-container` and `make grade`. It runs on Linux
# and macOS.
# usage: classroom/container/run.sh image|lab|label|ready|judge NAME|end NAME
# CONTAINER is podman or docker, with options if it needs some; IMAGE_ARGS and RUN_ARGS are added to
# its build and its run; SOLUTIONS, BASE, PORT and LESSONS are those of the Makefile.
set -eu
cd "$(dirname "$0")/../.."
image=localhost/ros2_notebooks

fail() {
    printf '%s\n' "$*" >&2
    exit 1
}

# Which lessons and packages an image holds: its label is the checksum of what went into it.
inside=$(find LICENSE pyproject.toml helpers ros2 notebooks tools classroom -type f \
    ! -path "ros2/tests/*" ! -path "classroom/hub/*" ! -path "classroom/tests/*" ! -path '*/__pycache__/*' ! -path '*/.ipynb_checkpoints/*' -exec cksum {} + | LC_ALL=C sort | cksum | tr ' ' -)
[ "${1-}" != label ] || exec echo "$inside"

container=${CONTAINER:-$(command -v podman || command -v docker || true)}
[ -n "$container" ] ||
    fail 'There is neither podman nor docker: install one, for example with `sudo apt install podman`, then try again.'
command -v "${container%% *}" > /dev/null || fail "There is no command ${container%% *}, which CONTAINER names: install it, or leave CONTAINER out."
name=${container%% *}
$container version > /dev/null 2>&1 ||
    fail "${name##*/} does not answer: start it (podman machine start, Docker Desktop, or sudo systemctl start docker), then try again."

make_image() {
    set -- --file classroom/container/Containerfile --tag "$image" --label "lessons=$inside" \
        --label "solutions=${SOLUTIONS:-yes}" --build-arg "SOLUTIONS=${SOLUTIONS:-yes}" \
        --build-arg "BORROW=${BORROW:-yes}" ${BASE:+--build-arg "BASE=$BASE"}
    # The wheels of ROS 2 are for x86-64; a base with ROS 2 is for the machine that it is on.
    case ${BASE-} in *ros:*) ;; *) [ "$(uname -m)" = x86_64 ] || set -- "$@" --platform linux/amd64 ;; esac
    # Podman's own format of images has no health check.
    case $($container --version) in *podman*) set -- "$@" --format docker ;; esac
    $container build "$@" ${IMAGE_ARGS-} .
}

ready() {
    has=$($container image inspect --format '{{index .Config.Labels "lessons"}}' "$image" 2> /dev/null) ||
        fail 'There is no image yet: run `make image`, then try again.'
    [ "$has" = "$inside" ] || fail 'The image is not of these lessons: run `make image`, then try again.'
}

run_lab() {
    ready
    port=${PORT:-8888} lessons=${LESSONS:-my_lessons}
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

# Run a command as the code of a student, for classroom/grade: with a name, or without one.
# No network, no file of this machine, and nothing that can be written but /tmp, in memory. Of the
# lessons, whose solutions are in the image, it sees nothing: the job brings the one that is judged.
as_student() {
    name=$1 run=$2
    set -- --cpus "${CPUS:-2}"
    # Podman without root limits the CPUs only if systemd lets it.
    case $($container info --format '{{.Host.Security.Rootless}} {{.Host.CgroupControllers}}' 2> /dev/null) in
        true*cpu\ * | true*cpu] | false*) ;;
        true*) set -- ;;
    esac
    [ -z "$name" ] || set -- "$@" --name "$name"
    # Podman would copy what the image has there, which is more than a file system of 1 MB takes.
    empty=ro,size=1m
    case $($container --version) in *podman*) empty=$empty,notmpcopyup ;; esac
    exec $container run --rm --interactive "$@" --network none --read-only \
        --tmpfs "/opt/ros2_notebooks/notebooks:$empty" --tmpfs "/home/student:$empty" \
        --tmpfs /tmp:rw,exec,nosuid,nodev,size=1g,mode=1777 --shm-size=256m \
        --memory 3g --memory-swap 3g --pids-limit 400 \
        --cap-drop ALL --security-opt no-new-privileges \
        --env HOME=/tmp --env TMPDIR=/tmp --workdir /tmp --no-healthcheck \
        ${RUN_ARGS-} "$image" $run
}

# Said once, before the first student is judged.
try() {
    said=$(as_student '' true 2>&1 < /dev/null) ||
        fail "No container can run here ($(printf %s "$said" | tr '\n' ' ' | cut -c1-300)): RUN_ARGS= adds options."
}

case ${1-} in
    image) make_image ;;
    lab) run_lab ;;
    ready) ready && try ;;
    # The job comes on stdin, and what it says goes to stdout.
    judge) as_student "$2" 'python -m classroom.grade.judge' ;;
    end) $container kill "$2" ;;
    *) fail 'usage: classroom/container/run.sh image|lab|label|ready|judge NAME|end NAME' ;;
esac
