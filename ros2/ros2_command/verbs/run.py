"""Run a package specific executable."""

from __future__ import annotations

import argparse
import shlex
import signal
import subprocess

from ros2_command import index
from ros2_command.commands import CommandError, command, option
from ros2_command.domain import join_domain


@command(
    option('--prefix', "Command before the executable, as in --prefix 'gdb -ex run --args'"),
    option('package_name', 'Name of the ROS package', index.complete_packages),
    option('executable_name', 'Name of the executable'),
    option('argv', 'Arguments of the executable', nargs=argparse.REMAINDER),
)
def _run(args: argparse.Namespace) -> int:
    """Run a package specific executable."""
    words = index.command_of(args.package_name, args.executable_name)
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
