"""What a CMakeLists.txt says about its package, read without running CMake."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

GENERATE = 'rosidl_generate_interfaces'
PARSE_ERROR = 'CMake stops with "Parse error.'
BLOCKS = ('if', 'foreach', 'while', 'function', 'macro', 'block')
TOKEN = re.compile(
    r"""
      (?P<space> \s+ | \#\[(=*)\[ .*? \]\2\] | \#[^\n]* )
    | (?P<bracket> \[(?P<equals>=*)\[ .*? \](?P=equals)\] )
    | (?P<quoted> "(?: \\. | [^"\\] )*" )
    | (?P<paren> [()] )
    | (?P<word> (?: \\. | \$\{[^}\s]*\} | "(?:\\.|[^"\\\s])*" | [^\s()\#"\\] )+ )
    """,
    re.VERBOSE | re.DOTALL,
)


class CMakeListsError(Exception):
    """CMake cannot read the file. Arguments: what is missing, and the error."""


class Generate(NamedTuple):
    """One call of rosidl_generate_interfaces(). A name with `$` is one that only a build knows."""

    line: int
    files: list[str]
    dependencies: list[str]


class CMakeLists:
    """What a CMakeLists.txt says about its package, if each of its commands is executed once.

    `project` is the name of its project (None without one), `generate` the calls of
    rosidl_generate_interfaces(), `lines` the line of the first call of each command, and `found`
    the line of the first find_package() of each package.

    Raises CMakeListsError for a text that CMake cannot read.
    """

    def __init__(self, text: str):
        self.project: str | None = None
        self.generate: list[Generate] = []
        self.lines: dict[str, int] = {}
        self.found: dict[str, int] = {}
        self._variables: dict[str, list[str]] = {}
        for line, command, arguments in _commands(text):
            self.lines.setdefault(command, line)
            self._execute(line, command, [a for pair in arguments for a in self._expand(*pair)])

    @property
    def dependencies(self) -> list[str]:
        """The packages behind DEPENDENCIES."""
        return [d for call in self.generate for d in call.dependencies]

    def _execute(self, line: int, command: str, arguments: list[str]) -> None:
        first, *rest = arguments or ['']
        if command == 'project':
            self.project = first
            self._variables['PROJECT_NAME'] = self._variables['CMAKE_PROJECT_NAME'] = [first]
        elif command == 'set':
            self._variables[first] = [a for a in rest if a not in ('PARENT_SCOPE', 'CACHE')]
        elif command == 'list' and first == 'APPEND' and rest:
            self._variables[rest[0]] = [*self._variables.get(rest[0], []), *rest[1:]]
        elif command == 'find_package':
            self.found.setdefault(first, line)
        elif command == GENERATE:
            part = {'files': [], 'DEPENDENCIES': [], 'LIBRARY_NAME': []}
            into = 'files'
            for argument in rest:
                if argument in part:
                    into = argument
                elif argument.startswith(('ADD_LINTER', 'SKIP_')):
                    into = 'files'  # an option ends the list before it
                else:
                    part[into].append(argument)
            self.generate.append(Generate(line, part['files'], part['DEPENDENCIES']))
        else:
            for argument in arguments:  # any other command may write a variable
                self._variables.pop(argument, None)

    def _expand(self, text: str, quoted: bool) -> list[str]:
        """An argument with the values of its variables. One that is not known stays as `${it}`."""
        whole = re.fullmatch(r'\$\{([^{}$]+)\}', text)
        if whole and whole[1] in self._variables and not quoted:
            return self._variables[whole[1]]
        text = re.sub(r'^\$\{(CMAKE_CURRENT|CMAKE|PROJECT)_SOURCE_DIR\}:', '', text)
        text = re.sub(
            r'\$\{([^{}$]+)\}',
            lambda match: ';'.join(self._variables.get(match[1], [match[0]])),
            text,
        )
        return [text] if quoted else [part for part in text.split(';') if part]


def _commands(text: str) -> Iterator[tuple[int, str, list[tuple[str, bool]]]]:
    """Each command with its line, its name in lower case, and its (argument, quoted) pairs."""
    blocks: list[tuple[str, int]] = []
    name, start, depth, arguments = None, 0, 0, []
    for line, kind, token in [*_tokens(text), (0, 'end', '')]:
        if depth:
            if kind == 'end':
                error = f'{PARSE_ERROR} Function missing ending ")". End of file reached"'
                raise CMakeListsError(f"a ')' that closes {name}( of line {start}", error)
            if kind == 'paren':
                depth += 1 if token == '(' else -1
            else:
                quotes = {'quoted': 1, 'bracket': token.find('[', 1) + 1}.get(kind, 0)
                arguments.append((token[quotes : len(token) - quotes], kind != 'word'))
            if not depth:
                _match_blocks(blocks, name.lower(), start)
                yield start, name.lower(), arguments
                name, arguments = None, []
        elif name and token == '(':
            depth = 1
        elif name:
            error = f'{PARSE_ERROR} Expected "(", got ..."'
            raise CMakeListsError(f"a '(' after {name} in line {start}", error)
        elif kind == 'word' and re.fullmatch(r'\w+', token):
            name, start = token, line
        elif kind != 'end':
            what = f'a command before {token} in line {line}, such as {GENERATE}('
            raise CMakeListsError(what, f'{PARSE_ERROR} Expected a command name, got ... {token}"')
    if blocks:
        _nesting(f'end{blocks[-1][0]}() for {blocks[-1][0]}() of line {blocks[-1][1]}')


def _match_blocks(blocks: list[tuple[str, int]], command: str, line: int) -> None:
    if command in BLOCKS:
        blocks.append((command, line))
    elif command.startswith('end') and command[3:] in BLOCKS:
        if not blocks:
            _nesting(f'{command[3:]}(...) before {command}() of line {line}')
        if blocks[-1][0] != command[3:]:
            _nesting(f'end{blocks[-1][0]}() for {blocks[-1][0]}() of line {blocks[-1][1]}')
        blocks.pop()
    elif command in ('else', 'elseif') and (not blocks or blocks[-1][0] != 'if'):
        _nesting(f'if(...) before {command}() of line {line}')


def _nesting(missing: str) -> None:
    error = 'CMake stops with "Flow control statements are not properly nested."'
    raise CMakeListsError(missing, error)


def _tokens(text: str) -> Iterator[tuple[int, str, str]]:
    position, line = 0, 1
    while position < len(text):
        match = TOKEN.match(text, position)
        if not match:
            error = f'{PARSE_ERROR} Function missing ending ")". End of file reached"'
            raise CMakeListsError(f'what closes {text[position]} of line {line}', error)
        if match.lastgroup != 'space' and not match['space']:
            kind = next(k for k in ('bracket', 'quoted', 'paren', 'word') if match[k] is not None)
            yield line, kind, match[0]
        line += text.count('\n', position, match.end())
        position = match.end()
