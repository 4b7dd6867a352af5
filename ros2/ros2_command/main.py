# PYTHON_ARGCOMPLETE_OK
"""The `ros2` command: finds the verb that was typed, and ends as the real one does."""

from __future__ import annotations

import os
import signal
import sys

if os.path.basename(sys.argv[0]) == 'ros2':  # Ctrl+C while Python still imports
    signal.signal(signal.SIGINT, lambda number, frame: os._exit(number))

import importlib  # noqa: E402
from pathlib import Path  # noqa: E402

from ros2_command.commands import CommandError, Parser, title, what_is_missing  # noqa: E402

VERSION = (
    'ros2 of the ROS 2 notebooks, for an environment of wheels; it follows ros2cli 0.32.2 of '
    'ROS 2 Jazzy'
)
GUARD = '_ROS_WHEELS_BOOTSTRAP_COMPLETE'


def main(argv: list[str] | None = None) -> int:
    """Run a command and return its exit status. Without arguments, those of this process."""
    if argv is None:
        _leave_to_a_real_one()
        signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(number))
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.stdout.reconfigure(line_buffering=True)
    try:
        status = _run(sys.argv[1:] if argv is None else argv)
        sys.stdout.flush()
    except CommandError as error:
        print(error, file=sys.stderr)
        status = error.status
    except ModuleNotFoundError as error:
        print(what_is_missing(error), file=sys.stderr)
        status = 1
    except KeyboardInterrupt:
        status = int(signal.SIGINT)
    except BrokenPipeError:  # `ros2 topic list | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 128 + signal.SIGPIPE
    if argv is None:  # it ends anyway
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return status


def verbs() -> dict[str, str]:
    """Return the name of each verb and its help, the first line of its file."""
    files = sorted((Path(__file__).parent / 'verbs').glob('[!_]*.py'))
    return {file.stem: title(file.read_text(encoding='utf-8').split('"""')[1]) for file in files}


def _run(argv: list[str]) -> int:
    completing = '_ARGCOMPLETE' in os.environ
    words = os.environ.get('COMP_LINE', '').split()[1:] if completing else argv
    parser = Parser(prog='ros2', description='ros2 is an extensible command-line tool for ROS 2.')
    parser.add_argument('--version', action='version', version=VERSION)
    typed = next((word for word in words if not word.startswith('-')), None)
    parsers = parser.add_parsers(verbs())
    if typed in parsers:  # only this one is imported
        parsers[typed].add_commands(importlib.import_module(f'ros2_command.verbs.{typed}'))
    if completing:
        import argcomplete

        argcomplete.autocomplete(parser, exclude=['-h', '--help'])
    args = parser.parse_args(argv)
    return args.run(args) or 0


def _leave_to_a_real_one() -> None:
    """Become the `ros2` of a sourced ROS, if there is one: here it is only hidden by the PATH."""
    if not os.environ.get('ROS_DISTRO'):
        return
    for folder in os.environ.get('PATH', '').split(os.pathsep):
        real = Path(folder, 'ros2')
        if os.access(real, os.X_OK) and real.resolve().parent != Path(sys.argv[0]).resolve().parent:
            environment = {name: value for name, value in os.environ.items() if name != GUARD}
            libraries = environment.get('LD_LIBRARY_PATH', '').split(os.pathsep)
            own = [library for library in libraries if not library.startswith(sys.prefix)]
            environment['LD_LIBRARY_PATH'] = os.pathsep.join(own)
            os.execve(real, [str(real), *sys.argv[1:]], environment)
