"""The substitutions of a launch file: `$(var NAME)`, `$(eval EXPRESSION)` and so on."""

from __future__ import annotations

import ast
import operator
import re
import shlex
import subprocess
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ros2_command import index
from ros2_command.launch.elements import Element

# What a mark stands for that splits no words, and that nobody types.
MARK = '\ue000'


@dataclass
class Scope:
    """What is known at a place of a launch file."""

    file: str
    variables: dict[str, str]
    environment: dict[str, str]
    written: list[str]  # files of parameters, of all scopes
    namespace: str | None = None

    def text(self, text: str) -> str:
        """Return a text with its substitutions performed. Raises ValueError if one fails."""
        return _Reader(text, self).read_until('')

    def texts(self, elements: Iterable[Element], *names: str) -> list[tuple[str, ...]]:
        """Return these attributes of elements, with their substitutions performed."""
        return [
            tuple(self.text(element.attributes[name]) for name in names) for element in elements
        ]

    def words(self, text: str) -> list[str]:
        """Split a command at its spaces, but not in quotes, nor where a substitution has some."""
        values: list[str] = []

        def mark(value: str) -> str:
            values.append(value)
            return MARK

        marked = _Reader(text, self).read_until('', mark)
        in_order = iter(values)
        return [re.sub(MARK, lambda _: next(in_order), word) for word in shlex.split(marked)]


class _Reader:
    """Reads a text from left to right, and performs its substitutions."""

    def __init__(self, text: str, scope: Scope) -> None:
        self._text, self._scope = text, scope
        self._at = 0  # the position of the next character

    def read_until(self, stop: str, shown: Callable[[str], str] = str) -> str:
        """Return what comes before one of the characters `stop`, or the whole rest.

        `shown` makes of the value of each substitution what is put in its place.
        """
        result = ''
        while self._at < len(self._text) and self._text[self._at] not in stop:
            if self._take('$('):
                result += shown(self._substitution())
                continue
            if self._text[self._at] == '\\' and self._at + 1 < len(self._text):
                self._at += 1  # the next character stands for itself
            result += self._text[self._at]
            self._at += 1
        return result

    def _substitution(self) -> str:
        """Return the value of the substitution whose name comes next."""
        name = re.compile(r'[\w-]*').match(self._text, self._at)[0]
        if name not in SUBSTITUTIONS:
            raise ValueError(f'there is no $({name}) here; there is {", ".join(SUBSTITUTIONS)}')
        self._at += len(name)
        arguments = []
        while self._take(' '):
            arguments.append(self._argument())
        if not self._take(')'):
            raise ValueError(f'$({name} is not closed: quote an argument with spaces or brackets')
        try:
            return SUBSTITUTIONS[name](self._scope, *arguments)
        except TypeError:
            raise ValueError(
                f'$({name}) does not take {len(arguments)} arguments: quote one that has spaces'
            ) from None

    def _argument(self) -> str:
        for quote in ('"', "'"):
            if self._take(quote):
                argument = self.read_until(quote)
                self._take(quote)
                return argument
        return self.read_until(' ()"\'')

    def _take(self, text: str) -> bool:
        """Go on behind a text if it comes next. Return whether it does."""
        is_next = self._text.startswith(text, self._at)
        if is_next:
            self._at += len(text)
        return is_next


def is_true(text: str) -> bool:
    """Return whether a text is true. Raises ValueError if it is neither true nor false."""
    word = text.strip().lower()
    if word not in ('true', 'false', '1', '0'):
        raise ValueError(f"'{text}' is neither true nor false")
    return word in ('true', '1')


def share_of(package: str) -> Path:
    """Return the share folder of a package. Raises ValueError if it is not installed."""
    packages = index.packages()
    if package not in packages:
        searched = [str(prefix) for prefix in index.prefixes()]
        raise ValueError(f"package '{package}' not found, searching: {searched}")
    return packages[package] / 'share' / package


# --- $(eval) ---

# A launch file computes with small numbers. Without a bound, `9**9**9**9` would never end.
LONGEST_BITS = 10_000  # of a power
LONGEST_SEQUENCE = 100_000  # of a text or a list that is repeated


def _power(base: Any, exponent: Any) -> Any:
    are_whole = isinstance(base, int) and isinstance(exponent, int)
    if are_whole and base.bit_length() * abs(exponent) > LONGEST_BITS:
        raise ValueError(f'in $(eval), a power has at most {LONGEST_BITS} bits')
    return base**exponent


def _shift_left(number: Any, bits: Any) -> Any:
    if isinstance(bits, int) and bits > LONGEST_BITS:
        raise ValueError(f'in $(eval), a number is shifted by at most {LONGEST_BITS} bits')
    return number << bits


def _multiply(first: Any, second: Any) -> Any:
    for sequence, count in ((first, second), (second, first)):
        is_repeated = hasattr(sequence, '__len__') and isinstance(count, int)
        if is_repeated and len(sequence) * count > LONGEST_SEQUENCE:
            raise ValueError(f'in $(eval), a text has at most {LONGEST_SEQUENCE} characters')
    return first * second


def _remainder(first: Any, second: Any) -> Any:
    if isinstance(first, str | bytes):  # `'%999999999d' % 1`
        raise ValueError('in $(eval), % is for numbers')
    return first % second


OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: _multiply,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: _remainder,
    ast.Pow: _power,
    ast.MatMult: operator.matmul,
    ast.LShift: _shift_left,
    ast.RShift: operator.rshift,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
    ast.BitAnd: operator.and_,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Invert: operator.invert,
    ast.Not: operator.not_,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
    ast.In: lambda item, container: item in container,
    ast.NotIn: lambda item, container: item not in container,
}
# What an expression may be made of, so that a launch file runs no Python.
ALLOWED = (
    *(ast.Expression, ast.Constant, ast.List, ast.Tuple, ast.Load),
    *(ast.Compare, ast.cmpop, ast.BoolOp, ast.boolop),
    *(ast.UnaryOp, ast.unaryop, ast.BinOp, ast.operator),
)


def evaluate(expression: str) -> str:
    """Return the value of an expression as a text.

    It may have constants, comparisons, logic and arithmetic. Raises ValueError for anything else,
    and for a value that would be too large.
    """
    try:
        tree = ast.parse(expression.strip(), mode='eval')
        for node in ast.walk(tree):
            if not isinstance(node, ALLOWED):
                raise ValueError(
                    f"'{ast.unparse(node)}' in $(eval) is no comparison, logic or arithmetic of "
                    'values: a text needs quotes'
                )
        return str(_value_of(tree.body))
    except (SyntaxError, TypeError, ArithmeticError) as error:
        raise ValueError(f"$(eval '{expression}') has no value: {error}") from None


def _value_of(node: ast.AST) -> Any:
    match node:
        case ast.Constant():
            return node.value
        case ast.List():
            return [_value_of(element) for element in node.elts]
        case ast.Tuple():
            return tuple(_value_of(element) for element in node.elts)
        case ast.UnaryOp():
            return OPERATORS[type(node.op)](_value_of(node.operand))
        case ast.BinOp():
            return OPERATORS[type(node.op)](_value_of(node.left), _value_of(node.right))
        case ast.BoolOp():
            for operand in node.values:
                value = _value_of(operand)
                if bool(value) == isinstance(node.op, ast.Or):
                    break  # the rest does not count
            return value
        case ast.Compare():
            left, result = _value_of(node.left), True
            for comparison, operand in zip(node.ops, node.comparators, strict=True):
                right = _value_of(operand)
                result = OPERATORS[type(comparison)](left, right)
                if not result:
                    break
                left = right
            return result
    raise TypeError(f'{type(node).__name__} is not known')


# --- the names ---


def _look_up(kind: str, known: dict[str, str], name: str, *default: str) -> str:
    if name not in known and not default:
        raise ValueError(f"{kind} '{name}' does not exist")
    return known.get(name, *default)


def _variable(scope: Scope, name: str, *default: str) -> str:
    return _look_up('launch configuration', scope.variables, name, *default)


def _environment_variable(scope: Scope, name: str, *default: str) -> str:
    return _look_up('environment variable', scope.environment, name, *default)


def _output_of_command(scope: Scope, command: str) -> str:
    """Return what a command prints, as $(command) does if no second argument allows stderr."""
    words = shlex.split(command)
    try:
        done = subprocess.run(
            words, env=scope.environment, capture_output=True, text=True, check=False
        )
    except (OSError, IndexError) as error:
        raise ValueError(f"the command '{command}' cannot be executed: {error}") from None
    if done.returncode or done.stderr:
        said = done.stderr.strip() or f'it returns {done.returncode}'
        raise ValueError(f"the command '{command}' fails: {said}")
    return done.stdout


SUBSTITUTIONS: dict[str, Callable[..., str]] = {
    'var': _variable,
    'env': _environment_variable,
    'find-pkg-share': lambda scope, package: str(share_of(package)),
    'command': _output_of_command,
    'dirname': lambda scope: str(Path(scope.file).absolute().parent),
    'eval': lambda scope, expression: evaluate(expression),
}
