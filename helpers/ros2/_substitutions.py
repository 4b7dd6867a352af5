"""The substitutions of launch files, such as `$(var name)`: read from a text, and performed."""

from __future__ import annotations

import ast
import math
import operator
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

from helpers.ros2 import _index
from helpers.ros2.run import command_of

# Of a text: plain texts, and substitutions as (name, arguments), each argument a list of parts.
Part = str | tuple[str, list]


def parse(text: str) -> list[Part]:
    """Split a text into plain texts and substitutions. Raises ValueError if it is malformed."""
    return _parts(text, 0, '', '')[0]


def perform(parts: list[Part], scope: Any) -> str:
    """The text of parts in a scope. Raises ValueError if a substitution fails."""
    return ''.join(
        part
        if isinstance(part, str)
        else SUBSTITUTIONS[part[0]][2](scope, *(perform(argument, scope) for argument in part[1]))
        for part in parts
    )


def describe(parts: list[Part]) -> str:
    """Parts as `ros2 launch --show-args` prints a default value."""
    return ' + '.join(
        f"'{part}'"
        if isinstance(part, str)
        else f'{DESCRIBED.get(part[0], part[0])}({", ".join(map(describe, part[1]))})'
        for part in parts or ['']
    )


def words(parts: list[Part]) -> list[list[Part]]:
    """Split a command at its spaces, but not within quotes, nor within substitutions."""
    split: list[list[Part]] = [[]]
    for part in parts:
        if not isinstance(part, str):
            split[-1].append(part)
            continue
        split += [[]] * part[0].isspace()
        for number, word in enumerate(shlex.split(part)):
            split += [[]] * (number > 0)
            split[-1] = [*split[-1], word]
        split += [[]] * part[-1].isspace()
    return [word for word in split if word]


def _parts(text: str, at: int, stop: str, quote: str) -> tuple[list[Part], int]:
    """The parts from a position to one of the characters `stop`, and where that is."""
    parts: list[Part] = []
    while at < len(text) and text[at] not in stop:
        if text.startswith('$(', at):
            part, at = _call(text, at + 2, quote)
        else:
            at += text[at] == '\\' and at + 1 < len(text)
            part, at = text[at], at + 1
        if isinstance(part, str) and parts and isinstance(parts[-1], str):
            parts[-1] += part
        else:
            parts.append(part)
    return parts, at


def _call(text: str, at: int, quote: str) -> tuple[tuple[str, list], int]:
    """The substitution whose name begins at a position, and where the text goes on."""
    name = re.compile(r'[\w-]*').match(text, at)[0]
    if name not in SUBSTITUTIONS:
        raise ValueError(f'there is no $({name}); there is {", ".join(SUBSTITUTIONS)}')
    at += len(name)
    arguments = []
    while text.startswith(' ', at):
        first = text[at + 1 : at + 2]
        if first in ('"', "'") and not quote:
            parts, at = _parts(text, at + 2, first, first)
            at += 1
        else:
            parts, at = _parts(text, at + 1, ' ()' + (quote or '"\''), quote)
            if not parts:
                raise ValueError(f'$({name}) has an empty argument: one space is between two')
        arguments.append(parts)
    if not text.startswith(')', at):
        raise ValueError(f'$({name} is not closed: quote an argument with spaces or brackets')
    least, most, _ = SUBSTITUTIONS[name]
    if not least <= len(arguments) <= most:
        number = least if least == most else f'{least} to {most}'
        raise ValueError(
            f'$({name}) takes {number} arguments, not {len(arguments)}: quote one that has spaces'
        )
    return (name, arguments), at + 1


def is_true(text: str) -> bool:
    """Whether a text is true. Raises ValueError if it is neither true nor false."""
    word = text.strip().lower()
    if word not in ('true', 'false', '1', '0'):
        raise ValueError(f"'{text}' is neither true nor false")
    return word in ('true', '1')


def prefix_of(package: str) -> Path:
    """The folder where a package is installed. Raises ValueError if it is in none."""
    found = _index.packages()
    if package not in found:
        searched = [str(prefix) for prefix in _index.prefixes()]
        raise ValueError(f"package '{package}' not found, searching: {searched}")
    return found[package]


def executable(name: str, package: str) -> list[str]:
    """The command of an executable of a package. Raises ValueError if there is none."""
    folder = prefix_of(package) / 'lib' / package
    if not any(file.name == name for file in _index.executables(package)):
        raise ValueError(f"executable '{name}' not found on the libexec directory '{folder}'")
    return command_of(package, name)


def _look_up(kind: str, known: dict[str, str], name: str, *default: str) -> str:
    if name not in known and not default:
        raise ValueError(f"{kind} '{name}' does not exist")
    return known.get(name, *default)


def _run(command: str, on_stderr: str = 'fail') -> str:
    done = subprocess.run(shlex.split(command), capture_output=True, text=True)
    if done.returncode or (done.stderr and on_stderr == 'fail'):
        raise ValueError(f"the command '{command}' failed: {done.stderr.strip()}")
    return done.stdout


def _equals(left: str, right: str) -> bool:
    for convert in (float, is_true):
        try:
            return math.isclose(convert(left), convert(right))
        except ValueError:
            pass
    return left == right


# fmt: off
OPERATORS = {
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le,
    ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Not: operator.not_, ast.USub: operator.neg,
    ast.In: lambda a, b: a in b, ast.NotIn: lambda a, b: a not in b,
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Mod: operator.mod,
    ast.Div: operator.truediv, ast.FloorDiv: operator.floordiv,
}
# fmt: on


def evaluate(expression: str) -> str:
    """The value of an expression of constants, comparisons, logic and arithmetic, as a text.

    Raises ValueError for anything else: a launch file runs no Python.
    """

    def value(node: ast.AST) -> Any:
        match node:
            case ast.Constant():
                return node.value
            case ast.List() | ast.Tuple():
                return [value(item) for item in node.elts]
            case ast.BoolOp():
                for item in node.values:
                    result = value(item)
                    if bool(result) == isinstance(node.op, ast.Or):
                        break
                return result
            case ast.UnaryOp() if type(node.op) in OPERATORS:
                return OPERATORS[type(node.op)](value(node.operand))
            case ast.BinOp() if type(node.op) in OPERATORS:
                return OPERATORS[type(node.op)](value(node.left), value(node.right))
            case ast.Compare() if {*map(type, node.ops)} <= OPERATORS.keys():
                operands = [value(item) for item in (node.left, *node.comparators)]
                pairs = zip(node.ops, operands, operands[1:], strict=False)
                return all(OPERATORS[type(op)](left, right) for op, left, right in pairs)
            case ast.IfExp():
                return value(node.body if value(node.test) else node.orelse)
        raise ValueError(
            f"'{ast.unparse(node)}' in $(eval) is no comparison, logic or arithmetic of values: "
            'a text needs quotes'
        )

    try:
        return str(value(ast.parse(expression.strip(), mode='eval').body))
    except (SyntaxError, TypeError, ArithmeticError) as error:
        raise ValueError(f"$(eval '{expression}') has no value: {error}") from None


def _word(value: bool) -> str:
    return str(value).lower()


# By name: the least and the most arguments, and the text from the scope and the arguments.
SUBSTITUTIONS: dict[str, tuple[int, float, Callable[..., str]]] = {
    'var': (1, 2, lambda scope, *a: _look_up('launch configuration', scope.variables, *a)),
    'env': (1, 2, lambda scope, *a: _look_up('environment variable', scope.environment, *a)),
    'find-pkg-share': (1, 1, lambda scope, name: str(prefix_of(name) / 'share' / name)),
    'find-pkg-prefix': (1, 1, lambda scope, name: str(prefix_of(name))),
    'exec-in-pkg': (2, 2, lambda scope, name, package: executable(name, package)[-1]),
    'find-exec': (1, 1, lambda scope, name: shutil.which(name) or _look_up('program', {}, name)),
    'dirname': (0, 0, lambda scope: str(Path(scope.file).absolute().parent)),
    'filename': (0, 0, lambda scope: str(Path(scope.file).absolute())),
    'eval': (1, 1, lambda scope, expression: evaluate(expression)),
    'command': (1, 2, lambda scope, *a: _run(*a)),
    'not': (1, 1, lambda scope, a: _word(not is_true(a))),
    'and': (2, 2, lambda scope, *a: _word(min(map(is_true, a)))),
    'or': (2, 2, lambda scope, *a: _word(max(map(is_true, a)))),
    'all': (1, math.inf, lambda scope, *a: _word(min(map(is_true, a)))),
    'any': (1, math.inf, lambda scope, *a: _word(max(map(is_true, a)))),
    'equals': (2, 2, lambda scope, a, b: _word(_equals(a, b))),
    'not-equals': (2, 2, lambda scope, a, b: _word(not _equals(a, b))),
    'if': (2, 3, lambda scope, test, a, b='': a if is_true(test) else b),
}
DESCRIBED = {'var': 'LaunchConfig', 'env': 'EnvVar', 'eval': 'PythonExpr', 'command': 'Command'}
