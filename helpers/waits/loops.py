"""Loops that ask again and again: what ends them, read from their code."""

from __future__ import annotations

import ast
from types import FrameType

from . import reading
from .snapshot import Activity

PEER_METHODS = ('wait_for_service', 'service_is_ready', 'wait_for_server', 'server_is_ready')


def is_call(thing: object) -> bool:
    return isinstance(thing, ast.Call)


def head(loop: ast.AST) -> str:
    return reading.text_of(loop).splitlines()[0].rstrip(':')


def exits(loop: ast.While) -> list[ast.AST]:
    """Return the conditions that end a loop: its own, and those of its `break` and `return`."""
    found = [loop.test]
    for thing in reading.inside(loop):
        if isinstance(thing, ast.If) and any(
            isinstance(one, ast.Break | ast.Return) for part in thing.body for one in ast.walk(part)
        ):
            found.append(thing.test)
    return found


def is_ok(atom: ast.AST) -> bool:
    return is_call(atom) and reading.text_of(atom.func).endswith('ok')


def has_no_end(loop: ast.AST) -> bool:
    if not isinstance(loop, ast.While):
        return False
    tests = [test for test in exits(loop) if not (isinstance(test, ast.Constant) or is_ok(test))]
    return not tests


def is_endless(activity: Activity) -> ast.AST | None:
    """Return the loop without an end that something is in."""
    loops = (loop for frame in activity.own for loop in reading.loops_around(frame))
    return next((loop for loop in loops if has_no_end(loop)), None)


def may_end_by_itself(atom: ast.AST, frame: FrameType) -> bool:
    """Return whether a condition calls something that is not known, such as a time."""
    if not is_call(atom) or is_ok(atom):
        return False
    if isinstance(atom.func, ast.Attribute):
        known = {'done', 'is_set', 'wait', 'is_alive', 'get_subscription_count', *PEER_METHODS}
        return atom.func.attr not in known
    return reading.last_name(atom.func) not in ('len', 'bool', 'any', 'all', 'not')
