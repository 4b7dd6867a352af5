#!/bin/sh
# Print the path of the newest usable Python on the PATH, or say in one sentence what to install.
# usage: tools/find_python.sh "3.14 3.13 ..."
# uv finds Pythons, too, but comes only with the environment that this Python makes.
set -eu
versions=$1 # newest first

# Prints the version and the path of the interpreter outside any virtual environment, or says in a
# few words why it will not do. -I -S: neither the user's variables nor a site hook take part.
probe='
import platform, sys, sysconfig
version = "%d.%d" % sys.version_info[:2]
if (sys.platform, platform.machine(), sys.maxsize > 2**32) != ("linux", "x86_64", True):
    sys.exit("is not for x86-64 Linux with glibc 2.28 or newer")
libc, release = platform.libc_ver()
if libc != "glibc" or [int(part) for part in release.split(".")] < [2, 28]:
    sys.exit("is not for x86-64 Linux with glibc 2.28 or newer")
if version not in sys.argv[1].split():
    sys.exit("is Python " + version)
released = sys.implementation.name == "cpython" and sys.version_info.releaselevel == "final"
if not released or sysconfig.get_config_var("Py_GIL_DISABLED"):
    sys.exit("is not a release of CPython with the GIL, for which ROS 2 is built")
try:
    import ctypes, ensurepip, ssl, venv, zlib
except ImportError as error:
    sys.exit("has no " + error.name)
print(version, getattr(sys, "_base_executable", None) or sys.executable)
'

found= refused=
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
        # A shim of pyenv or asdf stands for a Python that is not chosen, and says so at length.
        case $answer in 'is '* | 'has no '*) ;; *) answer='does not run' ;; esac
        refused="$refused  $candidate $answer
"
    done
done
for version in $versions; do
    printf '%s' "$found" | sed -n "s/^$version //p" | head -n 1 | grep . && exit
done

[ -z "$refused" ] || printf 'Looked for a Python on the PATH:\n%s' "$refused" >&2
no_venv=$(printf '%s' "$refused" | sed -n 's/^.*\/\(python[0-9.]*\) has no \(ensurepip\|venv\)$/\1/p' | head -n 1)
case $no_venv$refused in
    python*) say="$no_venv cannot make a virtual environment: run \`sudo apt install $no_venv-venv\`, then try again." ;;
    *'is not for x86-64'*) say='The ROS 2 packages are for x86-64 Linux with glibc 2.28 or newer only: environment.md says what to do on other machines.' ;;
    *) say="No usable Python ${versions##* } to ${versions%% *} is on the PATH: install one, for example with \`sudo apt install python3 python3-venv\`, then try again." ;;
esac
printf '%s\n' "$say" >&2
exit 1
