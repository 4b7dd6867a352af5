"""Run a package specific executable."""

from __future__ import annotations

import argparse
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Mapping

from helpers.ros2 import _index
from helpers.ros2._commands import CommandError, command, option
from helpers.ros2._graph import join_domain


def command_of(
    package: str, executable: str, environment: Mapping[str, str] = os.environ
) -> list[str]:
    """Return the command of an executable. Raises CommandError as `ros2 run` does."""
    found = [file for file in _index.executables(package, environment) if file.name == executable]
    if not found:
        raise CommandError('No executable found')
    if len(found) > 1:
        raise CommandError('\n- '.join(['Multiple executables found:', *map(str, found)]))
    with found[0].open('rb') as file:
        first_line = file.readline()
    # The first line of a script cannot name an interpreter whose path has a space.
    named = first_line.startswith(b'#!') and os.fsencode(sys.executable) in first_line
    return [sys.executable, str(found[0])] if named and ' ' in sys.executable else [str(found[0])]


@command(
    option('--prefix', "Command before the executable, as in --prefix 'gdb -ex run --args'"),
    option('package_name', 'Name of the ROS package', _index.complete_packages),
    option('executable_name', 'Name of the executable'),
    option('argv', 'Arguments of the executable', nargs=argparse.REMAINDER),
)
def _run(args: argparse.Namespace) -> int:
    """Run a package specific executable."""
    words = command_of(args.package_name, args.executable_name)
    join_domain()
    try:
        process = subprocess.Popen([*shlex.split(args.prefix or ''), *words, *args.argv])
    except OSError as error:
        raise CommandError(f'{args.executable_name} cannot be started: {error}') from None
    while process.returncode is None:
        try:
            process.wait()
        except KeyboardInterrupt:  # the process has it, too
            continue
    status = process.returncode
    if status < 0:
        print(f'[ros2run]: {signal.strsignal(-status)}')
    elif status:
        print(f'[ros2run]: Process exited with failure {status}')
    return status
