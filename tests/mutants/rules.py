"""Mistakes of structure, as students make them: each rule yields the program with one of them.

The text of a rule says what the student has done. Most come from a wrong answer that a check took.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from textwrap import indent

import libcst as cst
from libcst import matchers as m

from mutants.program import (
    LOOPS,
    Program,
    Rule,
    block_of,
    call_in,
    expression,
    is_attribute_of_self,
    is_left_alone,
    leaves,
    name_of,
    only,
    statement,
    target_of,
    with_body,
)

Made = Iterator[cst.Module]
RULES: list[Rule] = []
COMPOUND = (cst.With, cst.If, *LOOPS)
ENDS_WORK = {
    'set', 'set_result', 'notify', 'notify_all', 'succeed', 'canceled', 'abort', 'put', 'release',
    'cancel', 'publish', 'publish_feedback', 'append', 'reset', 'clear',
}  # fmt: skip
ONCE_IS_ENOUGH = {
    'set', 'clear', 'cancel', 'notify', 'notify_all', 'join', 'shutdown', 'try_shutdown',
    'add_node', 'spin', 'terminal', 'mend',
}  # fmt: skip
EXECUTORS = ('SingleThreadedExecutor', 'MultiThreadedExecutor')
GROUPS = ('MutuallyExclusiveCallbackGroup', 'ReentrantCallbackGroup')
LIFECYCLE = ('on_configure', 'on_activate', 'on_deactivate', 'on_cleanup', 'on_shutdown')
CLOCKS = {
    'time.monotonic()': ['time.time()'],
    'time.time()': ['time.monotonic()'],
    'time.perf_counter()': ['time.time()'],
    'self.get_clock().now()': ['__import__("rclpy.clock").clock.Clock().now()'],
    'self.get_clock()': ['__import__("rclpy.clock").clock.Clock()'],
    'ClockType.STEADY_TIME': ['ClockType.SYSTEM_TIME', 'ClockType.ROS_TIME'],
    'ClockType.ROS_TIME': ['ClockType.SYSTEM_TIME', 'ClockType.STEADY_TIME'],
    'Clock(clock_type=ClockType.STEADY_TIME)': ['self.get_clock()', 'Clock()'],
}
KEPT_BY_THE_NODE = {
    'create_publisher', 'create_subscription', 'create_timer', 'create_service', 'create_client',
}  # fmt: skip
CONVERSIONS = {
    'radians', 'degrees', 'float', 'int', 'str', 'sorted', 'reversed', 'remainder', 'strip',
}  # fmt: skip
CHANGES = (
    'get_clock', 'monotonic', 'time', 'get_parameter', 'get_subscription_count',
    'get_publisher_count', 'count_publishers', 'count_subscribers', 'is_set', 'done',
    'service_is_ready', 'server_is_ready', 'len',
)  # fmt: skip


def rule(function: Rule) -> Rule:
    RULES.append(function)
    return function


# --- A statement in another place -----------------------------------------------------------------


@rule
def out_of_a_block(program: Program) -> Made:
    """The first statement of a with, a loop or an if stands above it, or the last one below."""
    for outer, at, compound in program.statements():
        if not isinstance(compound, COMPOUND) or not isinstance(compound.body, cst.IndentedBlock):
            continue
        body = [*compound.body.body]
        if len(body) < 2:
            continue
        rest = with_body(compound, *body[1:])
        if program.is_written(body[0]) and not leaves(body[0]):
            yield program.put(outer, at, body[0], rest)
        rest = with_body(compound, *body[:-1])
        if program.is_written(body[-1]) and not only(body[-1], cst.Break):
            yield program.put(outer, at, rest, body[-1])


@rule
def without_its_block(program: Program) -> Made:
    """What stands in a with, a loop or a try stands there without it."""
    for outer, at, compound in program.statements():
        if isinstance(compound, cst.With | cst.For | cst.While | cst.Try) and isinstance(
            compound.body, cst.IndentedBlock
        ):
            if isinstance(compound, cst.For):
                target, values = program.code(compound.target), program.code(compound.iter)
                first = [statement(f'{target} = next(iter({values}))')]
            else:
                first = []
            yield program.put(outer, at, *first, *compound.body.body)


@rule
def behind_the_next_one(program: Program) -> Made:
    """Two statements in the other order."""
    for block, at, first in program.statements():
        body = [*block.body]
        second = body[at + 1] if at + 1 < len(body) else None
        if second is None or is_left_alone(second) or leaves(second):
            continue
        if not _order_says_nothing(program, first, second):
            yield program.put(block, at, second, first, count=2)


def _order_says_nothing(program: Program, first: cst.CSTNode, second: cst.CSTNode) -> bool:
    """Return whether two statements only give names a value, and none with a name of the other.

    Of one that gives a name a new object, the other may do what it wants, if it has not this name.
    """
    assigned = [_assigned(program, one) for one in (first, second)]
    for one, other in ((first, second), (second, first)):
        kept = only(other, cst.Assign)
        if program.code(one).strip().startswith('super().__init__(') and kept:
            return isinstance(kept.value, cst.Name | cst.Integer | cst.Float | cst.SimpleString)
    made = [name_of(call.func) for call in map(call_in, (first, second)) if call]
    if len(made) == 2 and KEPT_BY_THE_NODE.issuperset(made):
        return True
    if _is_taken_above_a_question(program, first, second, assigned[1]):
        return True
    for names, one, other in zip(assigned, (first, second), (second, first), strict=True):
        if names and _is_new(program, one) and not _mentions(program, other, names):
            return True
    if not all(assigned):
        return False
    return not any(
        _mentions(program, other, names)
        for names, other in zip(assigned, (second, first), strict=True)
    )


def _is_taken_above_a_question(
    program: Program, question: cst.CSTNode, value: cst.CSTNode, names: list[str]
) -> bool:
    """Return whether a plain value stands above an if that leaves, and does not ask for it."""
    if not isinstance(question, cst.If) or not names or _mentions(program, question, names):
        return False
    guards = re.search(r'\b(None|not|len)\b', program.code(question.test))
    return (
        leaves(question.body.body[-1])
        and not guards
        and not re.search(r'[(\[/]', program.code(value))
    )


def _mentions(program: Program, one: cst.CSTNode, names: list[str]) -> bool:
    return any(re.search(rf'\b{re.escape(name)}\b', program.code(one)) for name in names)


def _is_new(program: Program, one: cst.CSTNode) -> bool:
    """Return whether a statement gives a name a number, an empty list, or a new object."""
    assign = only(one, cst.Assign)
    value = program.code(assign.value) if assign else 'f()'
    plain = r"[\d.]+|None|True|False|\[\]|\{\}|'\w*'"
    return bool(re.fullmatch(rf'{plain}|(\w+\.)?[A-Z]\w*\(\)', value))


def _assigned(program: Program, one: cst.CSTNode) -> list[str]:
    """Return the last names of what a statement gives a value, none if it does something else."""
    if isinstance(one, cst.If):
        branches = [*one.body.body, *([one.orelse] if isinstance(one.orelse, cst.If) else [])]
        if isinstance(one.orelse, cst.Else):
            branches += one.orelse.body.body
        parts = [_assigned(program, part) for part in branches]
        return [name for part in parts for name in part] if all(parts) else []
    assign = only(one, cst.Assign)
    targets = [program.code(target.target) for target in assign.targets] if assign else []
    return [name.split('.')[-1] for target in targets for name in re.split(r'[ ,]+', target)]


@rule
def before_its_work(program: Program) -> Made:
    """What says that work is done stands above the work: an event is set, a result given."""
    for block, at, one in program.statements():
        call = call_in(one)
        start = 1 if program.method_of(one) == '__init__' else 0
        if call and name_of(call.func) in ENDS_WORK and at >= start + 2:
            others = [*block.body][start:at]
            yield program.put(block, start, one, *others, count=at - start + 1)


@rule
def a_return_too_early(program: Program) -> Made:
    """The return below a loop stands in it, so it runs once."""
    for block, at, one in program.statements():
        before = [*block.body][at - 1] if at else None
        if only(one, cst.Return) and isinstance(before, LOOPS):
            inner = with_body(before, *before.body.body, one)
            yield program.put(block, at - 1, inner, count=2)


# --- Errors and endings ---------------------------------------------------------------------------


@rule
def an_except_in_place_of_finally(program: Program) -> Made:
    """What must always happen happens after one kind of error only."""
    for _, _, one in program.statements():
        if isinstance(one, cst.Try) and one.finalbody and not one.handlers:
            for error in ('KeyboardInterrupt', 'Exception'):
                handler = statement(f'try:\n    pass\nexcept {error}:\n    pass\n').handlers[0]
                handler = handler.with_changes(body=one.finalbody.body)
                yield program.replaced(one, one.with_changes(finalbody=None, handlers=[handler]))


@rule
def behind_the_try(program: Program) -> Made:
    """What must always happen stands below the try, or at the end of it."""
    for _, _, one in program.statements():
        if isinstance(one, cst.Try) and one.finalbody:
            last = [*one.finalbody.body.body]
            body = one.body.with_changes(body=[*one.body.body, *last])
            if one.handlers:
                yield program.replaced(one, one.with_changes(finalbody=None), *last)
                yield program.replaced(one, one.with_changes(finalbody=None, body=body))
            else:
                yield program.replaced(one, *body.body)


@rule
def other_errors(program: Program) -> Made:
    """An except that takes all errors, does nothing, or takes one kind fewer."""
    for handler in program.each(cst.ExceptHandler):
        if handler.type is None or program.code(handler.type) != 'BaseException':
            wide = statement('try:\n    pass\nexcept BaseException:\n    pass\n').handlers[0]
            yield program.changed(handler, wide.with_changes(body=handler.body, name=handler.name))
        if not m.matches(handler.body, m.IndentedBlock([m.SimpleStatementLine([m.Pass()])])):
            yield program.changed(handler, handler.with_changes(body=block_of('pass')))
        if isinstance(handler.type, cst.Tuple) and len(handler.type.elements) > 1:
            for element in handler.type.elements:
                yield program.changed(handler, handler.with_changes(type=element.value))


@rule
def behind_the_finally(program: Program) -> Made:
    """The last statement of a finally stands below it: an error that goes on leaves it out."""
    for block, at, one in program.statements():
        if isinstance(one, cst.Try) and one.finalbody:
            body = [*one.finalbody.body.body]
            if len(body) > 1 and program.is_written(body[-1]):
                rest = one.finalbody.body.with_changes(body=body[:-1])
                kept = one.with_changes(finalbody=one.finalbody.with_changes(body=rest))
                yield program.put(block, at, kept, body[-1])


@rule
def without_super(program: Program) -> Made:
    """A method that does not call the one that it replaces."""
    super_call = m.Call(func=m.Attribute(value=m.Call(func=m.Name('super'))))
    for _, _, one in program.statements():
        call = call_in(one)
        if call and m.matches(call, super_call):
            yield program.replaced(one)
        returned = only(one, cst.Return)
        if returned and returned.value and m.matches(returned.value, super_call):
            name = name_of(returned.value.func)
            value = ' TransitionCallbackReturn.SUCCESS' if name in LIFECYCLE else ''
            yield program.replaced(one, f'return{value}')


# --- Waiting --------------------------------------------------------------------------------------


@rule
def a_loop_in_place_of_a_timer(program: Program) -> Made:
    """A loop with a sleep, in place, or in a thread of its own; or one call in place of a timer."""
    for call in program.calls('create_timer'):
        line = program.above(call, cst.SimpleStatementLine)
        given = [program.code(one.value) for one in call.args if one.keyword is None]
        if line is None or len(given) < 2:
            continue
        period, callback = given[:2]
        target = target_of(line)
        loop = f'for _ in range(50):\n    {callback}()\n    time.sleep({period})\n'
        thread = f'def repeat():\n{indent(loop, "    ")}'
        none = [f'{program.code(target)} = None'] if target is not None else []
        for new in (
            ['import time', loop],
            ['import threading, time', thread, 'threading.Thread(target=repeat).start()'],
            [f'{callback}()'],
        ):
            changed = program.replaced(line, *none, *new)
            yield _without_timer(changed, program.code(target)) if target is not None else changed


def _without_timer(module: cst.Module, timer: str) -> cst.Module:
    """Return a program that does not cancel or reset a timer that it has not."""
    source = re.sub(rf'(?<![\w.]){re.escape(timer)}\.(cancel|reset)\(\)', 'pass', module.code)
    return cst.parse_module(source)


@rule
def a_busy_loop_in_place_of_a_wait(program: Program) -> Made:
    """A loop that asks again and again, where the program should sleep."""
    for _, _, one in program.statements():
        call = call_in(one)
        if call is None:
            continue
        name, code = name_of(call.func), program.code(call.func)
        owner = code.rpartition('.')[0]
        if name == 'sleep' and call.args:
            wait = program.code(call.args[0].value)
            yield program.replaced(
                one, f'end = {owner}.monotonic() + {wait}', f'while {owner}.monotonic() < end: pass'
            )
        elif name == 'wait' and owner:
            yield program.replaced(one, f'while not {owner}.is_set(): pass')
        elif name == 'wait_for_service':
            yield program.replaced(one, f'while not {owner}.service_is_ready(): pass')
        elif name in ('wait_until', 'wait_for') and call.args:
            holds = program.code(call.args[-1 if len(call.args) == 1 else 0].value)
            yield program.replaced(one, f'while not ({holds})(): pass')
    for loop in program.each(cst.While):
        sleeps = [one for one in loop.body.body if _sleeps(one)]
        if sleeps:
            rest = [one for one in loop.body.body if one not in sleeps]
            yield program.changed(loop, with_body(loop, *rest))


@rule
def a_spin_in_place_of_a_loop(program: Program) -> Made:
    """`rclpy.spin(node)`, where the loop also looks at something else."""
    for loop in program.each(cst.While):
        for one in loop.body.body:
            call = call_in(one)
            if call and program.code(call.func).endswith('.spin_once'):
                owner = program.code(call.func).rpartition('.')[0]
                given = [program.code(arg.value) for arg in call.args if arg.keyword is None]
                yield program.replaced(loop, f'{owner}.spin({", ".join(given[:1])})')


def _sleeps(one: cst.CSTNode) -> bool:
    call = call_in(one)
    return bool(call) and name_of(call.func) in ('sleep', 'spin_once')


@rule
def a_sleep_in_place_of_a_wait(program: Program) -> Made:
    """A time that was long enough once, in place of what the program waits for."""
    for call in program.calls(
        'wait', 'wait_for_service', 'wait_for_server', 'wait_until', 'wait_for', 'join',
        'wait_for_all_acked', 'wait_for_subscriber', 'spin_until_future_complete',
    ):  # fmt: skip
        yield program.changed(call, "__import__('time').sleep(0.3)")


@rule
def a_number_of_rounds_in_place_of_a_time(program: Program) -> Made:
    """A loop that counts, where the program should look at a clock."""
    for loop in program.each(cst.While):
        if re.search(r'monotonic|time\(\)|\.now\(\)', program.code(loop.test)):
            counted = statement('for _ in range(20):\n    pass\n').with_changes(body=loop.body)
            yield program.replaced(loop, counted)


# --- Locks ----------------------------------------------------------------------------------------


def _locks(program: Program) -> Iterator[cst.With]:
    for one in program.each(cst.With):
        held = program.code(one.items[0].item)
        if len(one.items) == 1 and re.search(r'lock|guard|mutex|condition', held, re.IGNORECASE):
            yield one


@rule
def a_lock_around_one_half(program: Program) -> Made:
    """Read, then write: each under the lock, but not at once, or only one of them under it."""
    for lock in _locks(program):
        for at, one in enumerate(lock.body.body):
            made = _halves(program, one)
            if made is None:
                continue
            read, write = made
            above, below = lock.body.body[:at], lock.body.body[at + 1 :]
            alone = lock.with_changes(leading_lines=[])
            first = with_body(lock, *above, read)
            second = with_body(alone, write, *below)
            yield program.replaced(lock, first, second)
            yield program.replaced(lock, read, with_body(lock, *above, write, *below))
            if not below:
                yield program.replaced(lock, first, write)


def _halves(program: Program, one: cst.CSTNode) -> tuple[cst.CSTNode, cst.CSTNode] | None:
    """Return what reads and what writes in `x += 1`, `x = f(x)`, `if x: ...`, `return x`."""
    if isinstance(one, cst.If) and one.orelse is None:
        return statement(f'known = {program.code(one.test)}'), one.with_changes(
            test=cst.Name('known'), leading_lines=[]
        )
    if augmented := only(one, cst.AugAssign):
        target = program.code(augmented.target)
        operator = program.code(augmented.operator).strip().removesuffix('=')
        value = program.code(augmented.value)
        return statement(f'known = {target}'), statement(f'{target} = known {operator} {value}')
    target, assign = target_of(one), only(one, cst.Assign)
    if target is not None and not isinstance(target, cst.Tuple):
        name, value = program.code(target), program.code(assign.value)
        if re.search(rf'(?<![\w.]){re.escape(name)}\b', value):
            return statement(f'known = {value}'), statement(f'{name} = known')
    return None


@rule
def a_lock_of_ones_own(program: Program) -> Made:
    """A lock that nobody else has: a new one for each call."""
    for lock in _locks(program):
        kind = 'Condition' if 'condition' in program.code(lock.items[0].item) else 'Lock'
        item = lock.items[0].with_changes(item=expression(f"__import__('threading').{kind}()"))
        if kind == 'Lock':
            yield program.changed(lock, lock.with_changes(items=[item]))


# --- Groups, threads, attributes ------------------------------------------------------------------


@rule
def another_executor(program: Program) -> Made:
    """Another executor, or no number of threads."""
    for call in program.calls(*EXECUTORS):
        other = EXECUTORS[1 - EXECUTORS.index(name_of(call.func))]
        yield program.changed(call, f'{other}()')
        if call.args:
            yield program.changed(call, call.with_changes(args=[]))


@rule
def another_group(program: Program) -> Made:
    """A group of the other kind, one for both, or a new one each time."""
    groups = [*program.calls(*GROUPS)]
    for call in groups:
        other = GROUPS[1 - GROUPS.index(name_of(call.func))]
        yield program.changed(call, f'{other}()')
        yield program.changed(call, 'None')
    named = []
    for call in groups:
        line = program.above(call, cst.SimpleStatementLine)
        if line is not None and target_of(line) is not None:
            named.append((program.code(target_of(line)), call))
    for (first, _), (_, call) in zip(named, named[1:], strict=False):
        yield program.changed(call, first)
    for call in program.each(cst.Call):
        for at, one in enumerate(call.args):
            if (
                one.keyword
                and one.keyword.value == 'callback_group'
                and not isinstance(one.value, cst.Call)
            ):
                args = [*call.args]
                args[at] = one.with_changes(value=expression(f'{GROUPS[0]}()'))
                yield program.changed(call, call.with_changes(args=args))


@rule
def a_local_name(program: Program) -> Made:
    """What must live as long as the node has a local name."""
    for _, _, one in program.statements():
        target = target_of(one)
        if not is_attribute_of_self(target) or program.method_of(one) != '__init__':
            continue
        value = only(one, cst.Assign).value
        if isinstance(value, cst.Call) and name_of(value.func) in KEPT_BY_THE_NODE:
            continue
        uses = len(re.findall(rf'\bself\.{target.attr.value}\b', program.module.code))
        if uses == 1:
            assign = only(one, cst.Assign)
            new = assign.with_changes(targets=[cst.AssignTarget(target=target.attr)])
            yield program.changed(assign, new)


@rule
def an_attribute_of_the_class(program: Program) -> Made:
    """A list, an event or a lock that all objects of the class share."""
    shared = m.List() | m.Dict() | m.Set() | m.Call(func=m.Attribute(value=m.Name('threading')))
    for block, at, one in program.statements():
        target, assign = target_of(one), only(one, cst.Assign)
        owner = program.above(one, cst.ClassDef)
        if (
            owner is None
            or not is_attribute_of_self(target)
            or program.method_of(one) != '__init__'
        ):
            continue
        if m.matches(assign.value, shared):
            line = f'{target.attr.value} = {program.code(assign.value)}'
            module = program.put(block, at)
            found = (
                next(
                    two
                    for two in module.body
                    if isinstance(two, cst.ClassDef) and two.name.value == owner.name.value
                )
                if owner in program.module.body
                else None
            )
            if found is not None:
                body = found.body.with_changes(body=[statement(line), *found.body.body])
                yield module.deep_replace(found, found.with_changes(body=body))


# --- How often, and which -------------------------------------------------------------------------


@rule
def twice(program: Program) -> Made:
    """What should happen once happens twice."""
    for block, at, one in program.statements():
        call = call_in(one)
        name = name_of(call.func) if call else ''
        again = call and name not in ONCE_IS_ENOUGH and not name.startswith(('wait', '__'))
        if again or only(one, cst.AugAssign):
            yield program.put(block, at, one, one.with_changes(leading_lines=[]))


@rule
def the_first_only(program: Program) -> Made:
    """A loop that looks at the first, or not at the last; a while that is an if."""
    for loop in program.each(cst.For):
        values = program.code(loop.iter)
        for part in ('[:1]', '[:-1]', '[1:]'):
            yield program.changed(loop, loop.with_changes(iter=expression(f'list({values}){part}')))
    for loop in program.each(cst.CompFor):
        values = program.code(loop.iter)
        for part in ('[:1]', '[1:]'):
            yield program.changed(loop, loop.with_changes(iter=expression(f'list({values}){part}')))
    for loop in program.each(cst.While):
        if loop.orelse is None and program.code(loop.test) != 'True':
            branch = statement('if x:\n    pass\n').with_changes(test=loop.test, body=loop.body)
            if not any(only(one, cst.Break | cst.Continue) for one in loop.body.body):
                yield program.replaced(loop, branch)


@rule
def the_other_end(program: Program) -> Made:
    """The first in place of the newest, or the other way round."""
    for node in program.each(cst.Subscript):
        code = program.code(node)
        for old, new in (('[-1]', '[0]'), ('[0]', '[-1]')):
            if code.endswith(old):
                yield program.changed(node, code.removesuffix(old) + new)
    for call in program.calls('pop', 'append', 'appendleft', 'popleft'):
        name, args = name_of(call.func), [program.code(one) for one in call.args]
        owner = program.code(call.func).rpartition('.')[0]
        if name == 'pop' and len(args) < 2:
            yield program.changed(call, f'{owner}.pop({"" if args == ["0"] else "0"})')
        elif name == 'append' and isinstance(program.parent(call), cst.Expr):
            yield program.changed(call, f'{owner}.insert(0, {args[0]})')
            line = program.above(call, cst.SimpleStatementLine)
            yield program.replaced(line, f'{owner}[:] = [{args[0]}]')
        elif name in ('appendleft', 'popleft'):
            other = {'appendleft': 'append', 'popleft': 'pop'}[name]
            yield program.changed(call, f'{owner}.{other}({", ".join(args)})')


@rule
def keeps_the_first(program: Program) -> Made:
    """An attribute that keeps the first value, where the newest is wanted."""
    for _, _, one in program.statements():
        target = target_of(one)
        if is_attribute_of_self(target) and program.method_of(one) not in ('__init__', ''):
            first = block_of(one.with_changes(leading_lines=[]))
            name = target.attr.value
            branch = statement(f"if not getattr(self, '{name}', None):\n    pass\n")
            yield program.replaced(one, branch.with_changes(body=first))


@rule
def stays_in_the_method(program: Program) -> Made:
    """What a method computes for later stays in the method."""
    for _, _, one in program.statements():
        target, assign = target_of(one), only(one, cst.Assign)
        if is_attribute_of_self(target) and program.method_of(one) not in ('__init__', ''):
            yield program.changed(
                assign, assign.with_changes(targets=[cst.AssignTarget(target=target.attr)])
            )


@rule
def a_timer_that_repeats(program: Program) -> Made:
    """The callback keeps the newest message, and a timer does the work, again and again."""
    for call in program.calls('create_subscription'):
        line = program.above(call, cst.SimpleStatementLine)
        callback = program.code(call.args[2].value) if len(call.args) > 2 else ''
        if line is None or not re.fullmatch(r'self\.\w+', callback):
            continue
        args = [*call.args]
        args[2] = args[2].with_changes(
            value=expression("lambda message: setattr(self, 'newest_message', message)")
        )
        timer = (
            f'self.create_timer(0.05, lambda: {callback}(self.newest_message) '
            "if hasattr(self, 'newest_message') else None)"
        )
        yield program.replaced(line, line.deep_replace(call, call.with_changes(args=args)), timer)


# --- Clocks and values ----------------------------------------------------------------------------


@rule
def another_clock(program: Program) -> Made:
    """A time of another clock."""
    for node in program.each(cst.Call, cst.Attribute):
        code = program.code(node)
        for other in CLOCKS.get(code, ()):
            yield program.changed(node, other)
        if code.endswith('.header.stamp') and not _is_target(program, node):
            owner = 'self' if program.above(node, cst.ClassDef) else 'node'
            yield program.changed(node, f'{owner}.get_clock().now().to_msg()')


def _is_target(program: Program, node: cst.CSTNode) -> bool:
    return isinstance(program.parent(node), cst.AssignTarget)


@rule
def whole_seconds(program: Program) -> Made:
    """A time without its fraction, or a value that is cut to a whole number."""
    for node in program.each(cst.BinaryOperation):
        if isinstance(node.operator, cst.Divide):
            if re.fullmatch(
                r'1e9|10\s*\*\*\s*9|1_000_000_000|1000000000', program.code(node.right)
            ):
                yield program.changed(node, f'int({program.code(node)})')
        elif isinstance(node.operator, cst.Add) and 'nanosec' in program.code(node.right):
            yield program.changed(node, node.left)
    for call in program.calls('ceil', 'floor', 'round', 'int'):
        owner = program.code(call.func).rpartition('.')[0] or "__import__('math')"
        rest = ', '.join(program.code(one) for one in call.args)
        for other in (f'{owner}.ceil', f'{owner}.floor', 'round', 'int'):
            if not other.endswith(name_of(call.func)) and len(call.args) == 1:
                yield program.changed(call, f'{other}({rest})')


@rule
def a_value_that_is_kept(program: Program) -> Made:
    """A value that changes is read once, and then kept."""
    for call in program.each(cst.Call):
        name = name_of(call.func)
        parent = program.parent(call)
        if name not in CHANGES or isinstance(parent, cst.Expr) or program.method_of(call) == '':
            continue
        value = parent if isinstance(parent, cst.Attribute) and name == 'get_parameter' else call
        if name == 'get_clock':
            value = program.above(call, cst.Call) or call
        if program.method_of(call) == '__init__' or isinstance(value, cst.Lambda):
            continue
        if isinstance(program.parent(value), cst.Expr):  # the new call would still be made
            continue
        owner = 'self' if program.above(call, cst.ClassDef) else program.method_of(call)
        key = f'_kept_{name}'
        yield program.changed(value, f"vars({owner}).setdefault('{key}', {program.code(value)})")


@rule
def the_text_in_place_of_the_flag(program: Program) -> Made:
    """The text of an answer is looked at, and not what it says for programs."""
    for node in program.each(cst.Attribute):
        text = {'success': 'message', 'successful': 'reason', 'accepted': 'status'}
        if node.attr.value in text and not _is_target(program, node):
            yield program.changed(node, f'bool({program.code(node.value)}.{text[node.attr.value]})')
            yield program.changed(node, 'True')


@rule
def a_sign_that_is_lost(program: Program) -> Made:
    """`abs` in place of `max(0, ...)`, or one of the two alone; no `abs` where there was one."""
    for call in program.calls('max', 'min', 'abs'):
        args = [program.code(one.value) for one in call.args if one.keyword is None]
        if name_of(call.func) == 'abs' and args:
            yield program.changed(call, f'({args[0]})')
        elif len(args) == 2:
            for one, other in (args, args[::-1]):
                yield program.changed(call, f'({one})')
                if other in ('0', '0.0'):
                    yield program.changed(call, f'abs({one})')


@rule
def one_side_of_a_range(program: Program) -> Made:
    """Of `a <= x <= b` one side only."""
    for node in program.each(cst.Comparison):
        if len(node.comparisons) == 2:
            left, middle = program.code(node.left), node.comparisons[0]
            right = node.comparisons[1]
            between = program.code(middle.comparator)
            first, second = (program.code(one.operator).strip() for one in (middle, right))
            yield program.changed(node, f'({left} {first} {between})')
            yield program.changed(node, f'({between} {second} {program.code(right.comparator)})')


@rule
def what_is_not_a_number(program: Program) -> Made:
    """`not x >= y` made `x < y`: what is not a number passes."""
    opposite = {'>=': '<', '<=': '>', '>': '<=', '<': '>='}
    for node in program.each(cst.UnaryOperation, cst.Comparison):
        compared = node.expression if isinstance(node, cst.UnaryOperation) else node
        if not isinstance(compared, cst.Comparison) or len(compared.comparisons) != 1:
            continue
        operator = program.code(compared.comparisons[0].operator).strip()
        if operator not in opposite:
            continue
        left, right = program.code(compared.left), program.code(compared.comparisons[0].comparator)
        if '.' in right and right.split('.')[-1].isupper():  # of a message: a whole number
            continue
        if re.search(r'\b(\w+_)?(ns|nanoseconds|count|number|size)\b|\blen\(', f'{left} {right}'):
            continue
        if isinstance(node, cst.UnaryOperation) and isinstance(node.operator, cst.Not):
            yield program.changed(node, f'({left} {opposite[operator]} {right})')
        elif isinstance(node, cst.Comparison) and not isinstance(
            program.parent(node), cst.UnaryOperation
        ):
            yield program.changed(node, f'(not {left} {opposite[operator]} {right})')


@rule
def no_copy(program: Program) -> Made:
    """The same object handed out, in place of a copy."""
    for call in program.calls('list', 'dict', 'set', 'copy', 'deepcopy', 'array'):
        args = [program.code(one.value) for one in call.args]
        if name_of(call.func) == 'copy' and not args:
            yield program.changed(call, call.func.value)
        elif len(args) == 1:
            yield program.changed(call, args[0])


@rule
def not_called(program: Program) -> Made:
    """A method that is named and not called: it counts as true."""
    for call in program.each(cst.Call):
        if not call.args and isinstance(
            program.parent(call),
            cst.If | cst.While | cst.IfExp | cst.UnaryOperation | cst.BooleanOperation,
        ):
            yield program.changed(call, call.func)


@rule
def not_awaited(program: Program) -> Made:
    """An answer that nobody waits for."""
    for node in program.each(cst.Await):
        yield program.changed(node, node.expression)


@rule
def logged_once(program: Program) -> Made:
    """A line that the logger prints the first time only."""
    for call in program.calls('info', 'warning', 'warn', 'error'):
        if 'logger' in program.code(call.func).lower():
            args = [program.code(one).rstrip(' ,') for one in call.args]
            yield program.changed(
                call, f'{program.code(call.func)}({", ".join([*args, "once=True"])})'
            )


@rule
def a_depth_for_a_profile(program: Program) -> Made:
    """A depth in place of a whole QoS profile."""
    for call in program.calls('QoSProfile'):
        yield program.changed(call, '10')
    for call in program.calls('create_publisher', 'create_subscription'):
        for one in call.args:
            name = one.value.value if isinstance(one.value, cst.Name) else ''
            if name.isupper() and 'DEPTH' not in name:
                yield program.changed(one.value, '10')


@rule
def a_conversion_gone(program: Program) -> Made:
    """Degrees for radians, a number that is still a text, an angle that goes on round and round."""
    for call in program.calls(*CONVERSIONS):
        args = [program.code(one.value) for one in call.args if one.keyword is None]
        if args and not isinstance(program.parent(call), cst.Expr):
            yield program.changed(call, f'({args[0]})')


@rule
def a_function_gone(program: Program) -> Made:
    """A function that others call, or a method that replaces another, is not there."""
    for block, body in program.blocks():
        for at, one in enumerate(body):
            if isinstance(one, cst.FunctionDef) and program.is_written(one):
                name = one.name.value
                is_private = name.startswith('_') and name != '__init__'
                if len(body) > 1 and not is_private:
                    yield program.put(block, at)


@rule
def forgets_to_give_back(program: Program) -> Made:
    """A value that is computed and not returned."""
    for _, _, one in program.statements():
        returned = only(one, cst.Return)
        if returned and returned.value:
            yield program.replaced(one, f'{program.code(returned.value)}')
