"""Read the code of a frame: whose it is, at which expression it stands, what blocks it is in."""

from __future__ import annotations

import ast
import dis
import linecache
import sysconfig
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from types import CodeType, FrameType, ModuleType

import rclpy

HERE = Path(__file__).resolve().parent
# What a learner did not write. A package of a workspace is in a `site-packages`, too, but in the
# one of the workspace.
LIBRARIES = (
    *(f'{sysconfig.get_path(name)}/' for name in ('stdlib', 'purelib', 'platlib')),
    f'{Path(rclpy.__file__).resolve().parents[1]}/',
    f'{HERE.parent if (HERE.parent / "__init__.py").exists() else HERE}/',
    *('/opt/ros/', '/usr/lib/python3/', '<frozen '),
)
UNKNOWN = object()
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda


def is_own(frame: FrameType) -> bool:
    """Return whether a frame runs code that is of no library."""
    return not frame.f_code.co_filename.startswith(LIBRARIES)


def line_of(frame: FrameType) -> str:
    """Return the line at which a frame stands."""
    return linecache.getline(frame.f_code.co_filename, frame.f_lineno).strip()


@lru_cache(maxsize=256)
def _parse(text: str) -> ast.Module | None:
    try:
        return ast.parse(text)
    except SyntaxError:
        return None


def tree_of(filename: str) -> ast.Module | None:
    """Return the syntax of a file or a cell, None if there is no source."""
    text = ''.join(linecache.getlines(filename))
    return _parse(text) if text else None


def first_line(function: ast.AST) -> int:
    decorators = getattr(function, 'decorator_list', [])
    return decorators[0].lineno if decorators else function.lineno


def is_of(function: ast.AST, code: CodeType) -> bool:
    """Return whether this is the syntax of this code."""
    name = getattr(function, 'name', '<lambda>')
    return name == code.co_name and first_line(function) == code.co_firstlineno


def function_of(code: CodeType) -> ast.AST | None:
    """Return the syntax of a function, of a whole module for its code."""
    tree = tree_of(code.co_filename)
    if tree is None or code.co_name == '<module>' or code.co_name.startswith('<cell line'):
        return tree
    found = (thing for thing in ast.walk(tree) if isinstance(thing, FUNCTIONS))
    return next((function for function in found if is_of(function, code)), None)


def inside(function: ast.AST) -> Iterator[ast.AST]:
    """Yield what stands in a function, without the functions and classes in it."""
    for child in ast.iter_child_nodes(function):
        if isinstance(child, FUNCTIONS | ast.ClassDef):
            continue
        yield child
        yield from inside(child)


def _position(frame: FrameType) -> tuple:
    places = list(frame.f_code.co_positions())
    line, end, column, end_column = places[frame.f_lasti // 2]
    return line, column, end, end_column


def expression_at(frame: FrameType) -> ast.AST | None:
    """Return the expression that a frame is about: a call, or what a `with` enters."""
    function = function_of(frame.f_code)
    if function is None or frame.f_lasti < 0:
        return None
    here = _position(frame)
    for thing in inside(function):
        if not isinstance(thing, ast.expr | ast.With) or _span(thing) != here:
            continue
        return thing if isinstance(thing, ast.expr) else _item(thing, frame)
    return None


def _span(thing: ast.AST) -> tuple:
    return thing.lineno, thing.col_offset, thing.end_lineno, thing.end_col_offset


def _item(block: ast.With, frame: FrameType) -> ast.AST | None:
    """Return which part of a `with` is entered: Python 3.11 names the whole block as the place."""
    before = [
        step
        for step in dis.get_instructions(frame.f_code)
        if step.opname == 'BEFORE_WITH'
        and step.offset <= frame.f_lasti
        and (step.positions.lineno, step.positions.col_offset) == _span(block)[:2]
    ]
    entering = before and before[-1].offset == frame.f_lasti
    return block.items[len(before) - 1].context_expr if entering else None


def loops_around(frame: FrameType) -> list[ast.AST]:
    """Return the loops that a frame is in, the innermost first."""
    return list(_around(frame, ast.While | ast.For | ast.AsyncFor))[::-1]


def _around(frame: FrameType, kinds: type) -> Iterator[ast.AST]:
    function = function_of(frame.f_code)
    if function is None:
        return
    for thing in inside(function):
        if isinstance(thing, kinds) and thing.lineno <= frame.f_lineno <= thing.end_lineno:
            yield thing


def entered(frame: FrameType) -> Iterator[object]:
    """Yield what the `with` blocks that a frame is in have entered, if that can be said."""
    here = expression_at(frame)
    for block in _around(frame, ast.With):
        items = [item.context_expr for item in block.items]
        if here in items:
            items = items[: items.index(here)]
        elif not block.body[0].lineno <= frame.f_lineno <= block.body[-1].end_lineno:
            continue
        elif block.body[0].lineno == block.lineno and here is None:
            continue  # all in one line: it cannot be said
        yield from (evaluate(item, frame) for item in items)


def evaluate(expression: ast.AST | None, frame: FrameType) -> object:
    """Return the value of a name or of an attribute in a frame. No code of the learner runs."""
    match expression:
        case ast.Name(id=name):
            for names in (frame.f_locals, frame.f_globals, frame.f_builtins):
                if name in names:
                    return names[name]
        case ast.Constant(value=value):
            return value
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=value)):
            return -value
        case ast.Attribute(value=owner, attr=name):
            return member(evaluate(owner, frame), name)
        case ast.Subscript(value=owner, slice=ast.Constant(value=key)):
            owner = evaluate(owner, frame)
            if type(owner) in (dict, list, tuple):
                try:
                    return owner[key]
                except (KeyError, IndexError):
                    return UNKNOWN
    return UNKNOWN


def member(owner: object, name: str) -> object:
    """Return an attribute without running code for it: no property, no `__getattr__`."""
    if owner is UNKNOWN:
        return UNKNOWN
    if isinstance(owner, ModuleType):
        return vars(owner).get(name, UNKNOWN)
    own = getattr(owner, '__dict__', None)
    if isinstance(own, dict) and name in own:
        return own[name]
    for kind in type(owner).__mro__ if not isinstance(owner, type) else owner.__mro__:
        if name in vars(kind):
            value = vars(kind)[name]
            return UNKNOWN if hasattr(type(value), '__get__') else value
    return UNKNOWN


def last_name(expression: ast.AST | None) -> str:
    """Return `done` of `done`, of `self.done` and of `self.node.done`, '' of anything else."""
    match expression:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
        case ast.Subscript(value=owner):
            return last_name(owner)
    return ''


def text_of(expression: ast.AST) -> str:
    return ast.unparse(expression)
