"""The files of interfaces, and the lines of them that `ros2 interface show` prints."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from ros2_command import index
from ros2_command.commands import CommandError

SEPARATOR = '---'


def interface_file(name: str) -> Path:
    """Return the .msg, .srv or .action file of an interface. Raises CommandError."""
    parts = name.split('/')
    if len(parts) != 3 or not all(parts) or '..' in parts:
        raise CommandError(f"Invalid name '{name}'. Expected three parts separated by '/'")
    prefix = index.prefix_of(parts[0], "Unknown package '{}'")
    path = prefix / 'share' / name
    file = path.with_name(f'{path.name}.{parts[1]}')
    if not file.is_file():
        raise CommandError(f"Could not find the interface '{path}.idl'")
    return file


def interface_lines(
    name: str, comments: bool = True, nested_comments: bool = False, depth: int = 0
) -> Iterator[str]:
    """Yield the lines of an interface, each nested message below its field, one tab deeper.

    Of the nested messages the real command hides the comments, and leaves remains of some: a `#`
    after a field, a comment line that is indented or empty. So does this function.
    """
    package = name.split('/')[0]
    for line in interface_file(name).read_text(encoding='utf-8').splitlines():
        text = line.rstrip()
        bare, nested = _read_line(package, text)
        shown = text if comments else bare
        if shown is not None:
            yield '\t' * depth + shown if shown else ''
        if nested:
            yield from interface_lines(nested, nested_comments, nested_comments, depth + 1)


@cache
def _read_line(package: str, text: str) -> tuple[str | None, str | None]:
    """Return a line of an interface without its comment, and the name of what it nests.

    The first is None if the line vanishes. The command reads each line on its own. Where it hides a
    comment, it looks for the text which the parser gives, without `#`, unit and indentation, and
    cuts one character before it.
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
    types = [field.type for field in line.fields if not field.type.is_primitive_type()]
    return bare, f'{types[0].pkg_name}/msg/{types[0].type}' if types else None
