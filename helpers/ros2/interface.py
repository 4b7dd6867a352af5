"""Show information about ROS interfaces."""

from __future__ import annotations

import argparse
import contextlib
import io
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from helpers.ros2 import _index
from helpers.ros2._commands import CommandError, command, flag, option
from helpers.ros2._index import interfaces
from helpers.ros2._values import find_type, to_yaml

HEADINGS = {'msg': 'Messages', 'srv': 'Services', 'action': 'Actions'}
SEPARATOR = '---'
ONLY = tuple(
    flag(f'-{kind[0]} --only-{kind}s', f'Print out only the {heading.lower()}')
    for kind, heading in HEADINGS.items()
)
PACKAGE = option('package_name', 'Name of the ROS package', _index.complete_packages)
TYPE = option('type', "Its name (e.g. 'std_msgs/msg/String')", lambda **kwargs: interfaces())


@command(*ONLY)
def _list(args: argparse.Namespace) -> None:
    """List all interface types available."""
    chosen = [kind for kind in HEADINGS if getattr(args, f'only_{kind}s')]
    for kind in chosen or HEADINGS:
        print(f'{HEADINGS[kind]}:')
        for name in interfaces():
            if name.split('/')[1] == kind:
                print(f'    {name}')


@command(PACKAGE)
def _package(args: argparse.Namespace) -> None:
    """Output a list of available interface types within one package."""
    _index.prefix_of(args.package_name, "Unknown package '{}'")
    for name in interfaces(args.package_name):
        print(name)


@command()
def _packages(args: argparse.Namespace) -> None:
    """Output a list of packages that provide interfaces."""
    for package in sorted({name.split('/')[0] for name in interfaces()}):
        print(package)


@command(TYPE)
def _proto(args: argparse.Namespace) -> None:
    """Output an interface prototype."""
    kind = find(args.type).suffix[1:]
    class_ = find_type(args.type, kind, f"Unknown interface '{args.type}'")
    part = {'srv': 'Request', 'action': 'Goal'}.get(kind)
    print(f'"{to_yaml(getattr(class_, part)() if part else class_())}"')


@command(
    TYPE,
    flag('--all-comments', 'Show all comments, including for nested interface definitions'),
    flag('--no-comments', 'Show no comments or whitespace'),
)
def _show(args: argparse.Namespace) -> None:
    """Output the interface definition."""
    for line in listing(args.type, not args.no_comments, args.all_comments):
        print(line)


def find(name: str) -> Path:
    """Return the .msg, .srv or .action file of an interface. Raises CommandError."""
    parts = name.split('/')
    if len(parts) != 3 or not all(parts) or '..' in parts:
        raise CommandError(f"Invalid name '{name}'. Expected three parts separated by '/'")
    prefix = _index.prefix_of(parts[0], "Unknown package '{}'")
    path = prefix / 'share' / name
    file = path.with_name(f'{path.name}.{parts[1]}')
    if not file.is_file():
        raise CommandError(f"Could not find the interface '{path}.idl'")
    return file


def listing(
    name: str, comments: bool = True, nested_comments: bool = False, depth: int = 0
) -> Iterator[str]:
    """Yield the lines of an interface, each nested message below its field, one tab deeper.

    Of the nested messages the real command hides the comments, and leaves remains of some: a `#`
    after a field, a comment line that is indented or empty. So does this function.
    """
    package = name.split('/')[0]
    for text in map(str.rstrip, find(name).read_text(encoding='utf-8').splitlines()):
        bare, nested = _read_line(package, text)
        shown = text if comments else bare
        if shown is not None:
            yield '\t' * depth + shown if shown else ''
        if nested:
            yield from listing(nested, nested_comments, nested_comments, depth + 1)


@cache
def _read_line(package: str, text: str) -> tuple[str | None, str | None]:
    """A line of an interface without its comment (None: the line vanishes), and what it nests.

    The command reads each line on its own. Where it hides a comment, it looks for the text which
    the parser gives, without `#`, unit and indentation, and cuts one character before it.
    """
    from rosidl_adapter import parser

    if text == SEPARATOR:
        return text, None
    with contextlib.redirect_stderr(io.StringIO()):  # the parser prints errors before it raises
        line: Any = parser.parse_message_string(package, 'Line', text)
    if not text or line.annotations['comment']:
        return None, None
    bare = text
    for element in (*line.fields, *line.constants):
        if comment := element.annotations['comment']:
            bare = text[: text.find(comment[0]) - 1].strip()
    nested = [f.type for f in line.fields if not f.type.is_primitive_type()]
    return bare, f'{nested[0].pkg_name}/msg/{nested[0].type}' if nested else None
