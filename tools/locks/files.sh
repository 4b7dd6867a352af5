# Sourced by tools/set_up.sh and tools/lock.sh: which locks there are, beside tools/locks/requirements.lock,
# which has what a learner needs. Each belongs to a group of pyproject.toml.
groups='test browser site hub logins licences'
hub_lock=classroom/requirements-hub.lock

lock_of() { # GROUP
    case $1 in
        hub) echo "$hub_lock" ;;
        *) echo "tools/locks/requirements-$1.lock" ;;
    esac
}
