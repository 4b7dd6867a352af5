#!/bin/sh
# Print the path of the newest usable Python on the PATH, or say in one sentence what to install.
# usage: tools/find_python.sh "3.14 3.13 ..."
set -eu
versions=$1 # newest first

# Prints the version and the path of the interpreter outside any virtual environment, or says in a
# few words why it will not do. -I -S: neither the user's variables nor a site hook take part.
probe='
import os, platform, sys, sysconfig
version = "%d.%d" % sys.version_info[:2]
try:
    libc = os.confstr("CS_GNU_LIBC_VERSION") or ""
except (AttributeError, OSError, ValueError):
    libc = ""
glibc = [int(part) for part in libc.replace("glibc ", "").split(".") if part.isdigit()]
if (sys.platform, platform.machine(), sys.maxsize > 2**32) != ("linux", "x86_64", True) or glibc < [2, 28]:
    sys.exit("is not for x86-64 Linux with glibc 2.28 or newer")
if version not in sys.argv[1].split():
    sys.exit("is Python " + version)
if sys.implementation.name != "cpython":
    sys.exit("is not CPython")
if sysconfig.get_config_var("Py_GIL_DISABLED"):
    sys.exit("is a free-threaded Python, for which ROS 2 is not built")
if sys.version_info.releaselevel != "final":
    sys.exit("is a test release")
try:
    import ctypes, ensurepip, ssl, venv, zlib
except ImportError as error:
    sys.exit("has no " + error.name)
print(version, getattr(sys, "_base_executable", None) or sys.executable)
'

found= refused= no_venv= wrong_machine=
set -f # a folder on the PATH is a name, not a pattern
IFS=:
for folder in $PATH; do
    unset IFS
    for name in $(printf 'python%s ' $versions) python3; do
        candidate=${folder:-.}/$name
        [ -x "$candidate" ] && [ ! -d "$candidate" ] || continue
        if answer=$("$candidate" -I -S -c "$probe" "$versions" 2>&1 < /dev/null); then
            found="$found$answer
"
            continue
        fi
        case $answer in
            'has no ensurepip' | 'has no venv') no_venv=${no_venv:-$name} ;;
            'is not for x86-64'*) wrong_machine=yes ;;
            'is '* | 'has no '*) ;;
            # A shim of pyenv or asdf stands for a Python that is not chosen, and says so at length.
            *) answer='does not run' ;;
        esac
        refused="$refused  $candidate $answer
"
    done
done

for version in $versions; do
    python=$(printf '%s' "$found" | sed -n "s/^$version //p" | head -n 1)
    if [ -n "$python" ]; then
        printf '%s\n' "$python"
        exit
    fi
done

{
    [ -z "$refused" ] || printf 'Looked for a Python on the PATH:\n%s' "$refused"
    if [ -n "$no_venv" ]; then
        echo "$no_venv cannot make a virtual environment: run \`sudo apt install $no_venv-venv\`, then try again."
    elif [ -n "$wrong_machine" ]; then
        echo 'The ROS 2 packages are for x86-64 Linux with glibc 2.28 or newer only: environment.md says what to do on other machines.'
    else
        echo "No usable Python ${versions##* } to ${versions%% *} is on the PATH: install one, for example with \`sudo apt install python3 python3-venv\`, then try again."
    fi
} >&2
exit 1
