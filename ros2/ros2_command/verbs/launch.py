"""Run a launch file."""

from __future__ import annotations

import argparse
import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from ros2_command import index
from ros2_command.commands import CommandError, command, flag, option
from ros2_command.domain import join_domain
from ros2_command.launch.elements import Element, read
from ros2_command.launch.launcher import launch
from ros2_command.launch.plan import work_out
from ros2_command.launch.substitutions import Scope, share_of


@command(
    flag('-s --show-args --show-arguments', 'Show the arguments of the launch file'),
    flag('-a --show-all-subprocesses-output', 'Show all output, whatever the file says'),
    option('package_name', 'Package, or path of the launch file', index.complete_packages),
    option('launch_file_name', 'Name of the launch file', nargs='?'),
    option('launch_arguments', 'Its arguments', nargs='*', metavar='name:=value'),
)
def _launch(args: argparse.Namespace) -> int:
    """Run a launch file."""
    words = list(args.launch_arguments)
    if os.path.isfile(args.package_name):
        path = Path(args.package_name)
        if args.launch_file_name is not None:  # then it is the first argument
            words.insert(0, args.launch_file_name)
    else:
        path = _find(args.package_name, args.launch_file_name)
    variables = dict(_pair(word) for word in words)
    root = read(path)
    if args.show_args:
        _show_arguments(root)
        return 0
    join_domain()  # the nodes are where this command would look for them
    scope = Scope(root.file, variables, dict(os.environ), [])
    try:
        # All of it is worked out before anything starts: a mistake leaves nothing half done.
        plan = list(work_out(root.children, scope))
        if args.show_all_subprocesses_output:
            for process in plan:
                process.output = 'both'
        return launch(plan)
    finally:
        for file in scope.written:
            Path(file).unlink(missing_ok=True)


def _pair(word: str) -> tuple[str, str]:
    name, separator, value = word.partition(':=')
    if not (name and separator and value):
        raise CommandError(f"malformed launch argument '{word}', expected format '<name>:=<value>'")
    return name, value


def _find(package: str, name: str | None) -> Path:
    """Return the file of this name, in whatever folder of the package's share folder it is."""
    try:
        share = share_of(package)
    except ValueError as error:
        raise CommandError(f'Package \'{package}\' not found: "{error}"') from None
    for file in sorted(share.rglob('*')):
        if file.name == name and file.is_file():
            return file
    raise CommandError(
        f"file '{name}' was not found in the share directory of package '{package}' which is at "
        f"'{share}'"
    )


def _show_arguments(root: Element) -> None:
    declared: dict[str, Element] = {}
    for element in _arguments(root):
        declared.setdefault(element.attributes['name'], element)
    print("Arguments (pass arguments as '<name>:=<value>'):")
    for name, element in declared.items():
        description = element.attributes.get('description', 'no description given')
        print(f"\n    '{name}':\n        {description}")
        if 'default' in element.attributes:
            print(f"        (default: '{element.attributes['default']}')")
    if not declared:
        print('\n  No arguments.')


def _arguments(parent: Element) -> Iterator[Element]:
    """Yield each `arg` below an element, and in the files that it includes."""
    for element in parent.children:
        if element.tag == 'arg':
            yield element
        elif element.tag == 'include':
            # As the real command: what needs an argument to be found is not looked into.
            with contextlib.suppress(CommandError, ValueError, RecursionError):
                scope = Scope(element.file, {}, dict(os.environ), [])
                yield from _arguments(read(Path(scope.text(element.attributes['file']))))
        else:
            yield from _arguments(element)
