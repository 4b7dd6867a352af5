"""What the CMakeLists.txt of an interface package says, read without running CMake."""

from __future__ import annotations

import re
from typing import NamedTuple

GENERATE = 'rosidl_generate_interfaces'
QUOTED = r'"(?:\\.|[^"\\])*"'
COMMENT = re.compile(rf'({QUOTED})|#[^\n]*', re.DOTALL)
COMMAND = re.compile(rf'(\w+)\s*\(((?:{QUOTED}|[^()"])*)\)', re.DOTALL)
ARGUMENT = re.compile(rf'{QUOTED}|[^\s;"]+', re.DOTALL)
VARIABLE = re.compile(r'\$\{(\w+)\}')


class CMakeLists(NamedTuple):
    """What a CMakeLists.txt says, if each of its commands is executed once.

    `commands` are the names of the commands that it calls, `found` the packages that
    find_package() names before rosidl_generate_interfaces(), `files` and `dependencies` what that
    command is given.
    """

    commands: set[str]
    found: set[str]
    files: list[str]
    dependencies: list[str]


def read_cmake_lists(text: str) -> CMakeLists:
    """Read the text of a CMakeLists.txt. Of its variables, only those of set() are followed.

    Raises ValueError where there are not as many closing parentheses as opening ones.
    """
    text = COMMENT.sub(lambda match: match[1] or '', text)
    unquoted = re.sub(QUOTED, '', text, flags=re.DOTALL)
    if unquoted.count('(') != unquoted.count(')'):
        raise ValueError("A parenthesis is not closed, or there is a ')' too many.")
    read = CMakeLists(set(), set(), [], [])
    values: dict[str, list[str]] = {}
    for name, arguments in COMMAND.findall(text):
        command = name.lower()
        words = []
        for word in (argument.strip('"') for argument in ARGUMENT.findall(arguments)):
            variable = VARIABLE.fullmatch(word)
            words += values.get(variable[1], [word]) if variable else [word]
        if command == 'set' and words:
            values[words[0]] = words[1:]
        elif command == 'find_package' and GENERATE not in read.commands:
            read.found.update(words[:1])
        elif command == GENERATE:
            end = words.index('DEPENDENCIES') if 'DEPENDENCIES' in words else len(words)
            read.files.extend(words[1:end])
            read.dependencies.extend(words[end + 1 :])
        read.commands.add(command)
    return read
