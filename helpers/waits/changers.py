"""Who would set an event, finish a future, change a variable: the code that names it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import FrameType

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.subscription import Subscription

from . import reading
from .blockers import (
    Blocker,
    Ender,
    blockers,
    name_of,
    name_of_activity,
    of_topic,
    place_of,
    server_enders,
    short_name_of,
)
from .snapshot import Activity, Snapshot, callback_of, code_of, done_callbacks, pending

ADDS = {'append', 'appendleft', 'extend', 'add', 'update', 'insert', 'put', 'put_nowait'}
TAKES = {'get', 'get_nowait', 'pop', 'popleft', 'clear', 'remove', 'task_done'}
MOST_CALLERS = 3


@dataclass(frozen=True)
class Change:
    """A line in a function that changes something."""

    filename: str
    function: ast.AST
    line: int

    @property
    def name(self) -> str:
        name = getattr(self.function, 'name', '')
        return f'{name}()' if name else 'a lambda'


def changes(snapshot: Snapshot, name: str, methods: set[str] = frozenset()) -> list[Change]:
    """Return where `name.method()` is called; without methods, where `name` is changed."""
    found = []
    for filename in _files(snapshot):
        for function, thing in _things(filename):
            if _changes(thing, name, methods) and getattr(function, 'name', '') != '__init__':
                found.append(Change(filename, function, thing.lineno))
    return found


def _changes(thing: ast.AST, name: str, methods: set[str]) -> bool:
    match thing:
        case ast.Call(func=ast.Attribute(value=owner, attr=method)):
            return method in (methods or ADDS | TAKES) and reading.last_name(owner) == name
        case ast.Assign(targets=targets) if not methods:
            return any(reading.last_name(target) == name for target in targets)
        case ast.AugAssign(target=target) | ast.AnnAssign(target=target) if not methods:
            return reading.last_name(target) == name
        case ast.NamedExpr(target=target) if not methods:
            return reading.last_name(target) == name
    return False


def _files(snapshot: Snapshot) -> set[str]:
    """Return the files of the learner that are at work."""
    codes = [frame.f_code for activity in snapshot.activities for frame in activity.own]
    codes += [code_of(callback_of(entity)) for _, entity in snapshot.entities()]
    files = {code.co_filename for code in codes if code is not None}
    return {file for file in files if not file.startswith(reading.LIBRARIES)}


def _things(filename: str) -> Iterator[tuple[ast.AST, ast.AST]]:
    """Yield all that stands in the functions of a file, each with its function."""
    tree = reading.tree_of(filename)
    if tree is None:
        return
    functions = [thing for thing in ast.walk(tree) if isinstance(thing, reading.FUNCTIONS)]
    for function in [tree, *functions]:
        for thing in reading.inside(function):
            yield function, thing


def enders(
    snapshot: Snapshot, waiter: Activity, found: list[Change], what: str = 'change it'
) -> list[Ender]:
    """Return who runs the code that would end a wait, and what keeps it from that."""
    result, seen = [], set()
    for change in found:
        if change.function in seen:
            continue
        seen.add(change.function)
        result += _enders_of(snapshot, waiter, change, what, MOST_CALLERS)
    return result


def methods_of(snapshot: Snapshot, thing: object) -> list[Ender]:
    """Return the callbacks that are methods of a thing of Python, such as `heard.append`."""
    return [
        Ender(
            f'{name_of(snapshot, entity)}, would change it',
            _stops(snapshot, node, entity),
            name=short_name_of(entity),
            does='would change it',
        )
        for node, entity in snapshot.entities()
        if thing is not reading.UNKNOWN
        and getattr(callback_of(entity), '__self__', snapshot) is thing
        and code_of(callback_of(entity)) is None
    ]


def _stops(snapshot: Snapshot, node: Node, entity: object) -> tuple[Blocker, ...]:
    stops = blockers(snapshot, entity)
    if isinstance(entity, Subscription):
        stops += of_topic(entity, node)
    return tuple(stops)


def _enders_of(
    snapshot: Snapshot, waiter: Activity, change: Change, what: str, depth: int
) -> list[Ender]:
    does = f'would {what} in line {change.line}'
    result = []
    for node, entity in snapshot.entities():
        if _is(change, code_of(callback_of(entity))):
            stops = _stops(snapshot, node, entity)
            runs = [one for one in snapshot.activities if one.entity is entity]
            name = short_name_of(entity)
            if any(one is waiter for one in runs):
                stops, runs, name = (_itself(waiter, change),), [], f'line {change.line}'
            text = f'{name_of(snapshot, entity)}, {does}'
            # What runs is the work itself: its own wait is all that can keep it.
            ender = _at_work(text, runs[0]) if runs else Ender(text, stops)
            result.append(replace(ender, name=name, does=f'would {what}'))
    result += _done_callbacks(snapshot, change, what)
    for activity in snapshot.activities:
        if activity.entity is not None and result:
            continue  # a callback that was found above
        for frame in activity.own:
            if not _is(change, frame.f_code):
                continue
            if activity is waiter:
                if _comes_after(frame, change):
                    stop = Blocker(
                        'itself',
                        f'line {change.line} comes after line {frame.f_lineno}, where it waits',
                        (waiter,),
                    )
                    text = f'{name_of_activity(activity)} itself, {does}'
                    line = {'name': f'line {change.line}', 'does': f'would {what}'}
                    result.append(Ender(text, (stop,), **line))
                continue
            name = activity.thread.name if activity.thread else 'a coroutine'
            text = f'{change.name} in the thread {name}, {does}'
            result.append(replace(_at_work(text, activity), does=f'would {what}'))
    if result or depth == 0 or not getattr(change.function, 'name', ''):
        return result
    for filename in _files(snapshot):
        for function, thing in _things(filename):
            calls = isinstance(thing, ast.Call) and (
                reading.last_name(thing.func) == change.function.name
            )
            if calls and function is not change.function:
                caller = Change(filename, function, thing.lineno)
                result += _enders_of(snapshot, waiter, caller, f'call {change.name}', depth - 1)
    return result


def _at_work(text: str, activity: Activity) -> Ender:
    place = place_of(activity)
    return Ender(text, (), f'it is at {place}' if place else '', activity)


def _comes_after(frame: FrameType, change: Change) -> bool:
    """Return whether the line of a change comes after the one at which its function stands."""
    loops = reading.loops_around(frame)
    return change.line > frame.f_lineno or any(
        loop.lineno <= change.line <= loop.end_lineno for loop in loops
    )


def _itself(waiter: Activity, change: Change) -> Blocker:
    text = f'it is {name_of_activity(waiter)} itself that waits'
    own = (frame for frame in waiter.own if _is(change, frame.f_code))
    # Another call of it may come to that line, unless this one keeps its group.
    group = getattr(waiter.entity, 'callback_group', None)
    alone = isinstance(group, MutuallyExclusiveCallbackGroup)
    holders = (waiter,) if alone and any(_comes_after(frame, change) for frame in own) else ()
    return Blocker('itself', text, holders)


def _is(change: Change, code) -> bool:
    return (
        code is not None
        and code.co_filename == change.filename
        and isinstance(change.function, reading.FUNCTIONS)
        and reading.is_of(change.function, code)
    ) or (
        code is not None
        and code.co_filename == change.filename
        and isinstance(change.function, ast.Module)
        and code.co_name == '<module>'
    )


def _done_callbacks(snapshot: Snapshot, change: Change, what: str) -> list[Ender]:
    """Return the futures whose done callback is this code."""
    found = []
    for _, client in snapshot.entities():
        if not hasattr(client, 'call_async') and not hasattr(client, 'send_goal_async'):
            continue
        for future in pending(client):
            for callback in done_callbacks(future):
                if _is(change, code_of(callback)):
                    stops = [
                        stop for ender in server_enders(snapshot, client) for stop in ender.blockers
                    ]
                    name = name_of(snapshot, client)
                    found.append(
                        Ender(
                            f'{change.name}, when {name} has an answer, '
                            f'would {what} in line {change.line}',
                            tuple(dict.fromkeys(stops)),
                            name=change.name,
                            does=f'would {what}',
                        )
                    )
    return found
