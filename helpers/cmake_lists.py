"""What the CMakeLists.txt of an interface package says, read without running CMake."""

from __future__ import annotations

import re
from collections.abc import Iterator

GENERATE = 'rosidl_generate_interfaces'
QUOTED = r'"(?:\\.|[^"\\])*"'
COMMENT = re.compile(rf'({QUOTED})|#[^\n]*', re.DOTALL)
COMMAND = re.compile(rf'(\w+)\s*\(((?:{QUOTED}|[^()"])*)\)', re.DOTALL)
ARGUMENT = re.compile(rf'{QUOTED}|[^\s;"]+', re.DOTALL)


class CMakeLists:
    """What a CMakeLists.txt says, if each of its commands is executed once.

    `project` is the name of its project (empty without one), `commands` the names of the commands
    that it calls, `found` the packages that find_package() names before the first
    rosidl_generate_interfaces(). `files` and `dependencies` are what that command is given. A name
    with `$` is one that only a build knows.

    Raises ValueError where a parenthesis is not closed, or closes nothing.
    """

    def __init__(self, text: str):
        self.project = ''
        self.commands: set[str] = set()
        self.found: set[str] = set()
        self.files: list[str] = []
        self.dependencies: list[str] = []
        self._variables: dict[str, list[str]] = {}
        text = COMMENT.sub(lambda match: match[1] or '', text)
        unquoted = re.sub(QUOTED, '', text, flags=re.DOTALL)
        if unquoted.count('(') != unquoted.count(')'):
            raise ValueError("A parenthesis is not closed, or there is a ')' too many.")
        for command, arguments in COMMAND.findall(text):
            self._execute(command.lower(), list(self._expand(arguments)))

    def _execute(self, command: str, arguments: list[str]) -> None:
        first, *rest = arguments or ['']
        if command == 'project':
            self.project = first
            self._variables['PROJECT_NAME'] = [first]
        elif command == 'set':
            self._variables[first] = rest
        elif command == 'list' and first == 'APPEND' and rest:
            self._variables[rest[0]] = [*self._variables.get(rest[0], []), *rest[1:]]
        elif command == 'find_package' and GENERATE not in self.commands:
            self.found.add(first)
        elif command == GENERATE:
            into = self.files
            for argument in rest:
                if argument in ('DEPENDENCIES', 'LIBRARY_NAME'):
                    into = self.dependencies if argument == 'DEPENDENCIES' else []
                elif argument.startswith(('ADD_LINTER', 'SKIP_')):
                    into = self.files  # an option ends the list before it
                else:
                    into.append(argument)
        self.commands.add(command)

    def _expand(self, arguments: str) -> Iterator[str]:
        """The arguments, with the values of those that are variables, as far as they are known."""
        for argument in ARGUMENT.findall(arguments):
            argument = argument.strip('"')
            variable = re.fullmatch(r'\$\{(\w+)\}', argument)
            yield from self._variables.get(variable[1], [argument]) if variable else [argument]
