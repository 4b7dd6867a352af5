"""Small mistakes: a statement gone, another operator, another number, a keyword gone."""

from __future__ import annotations

import re
from collections.abc import Iterator

import libcst as cst

from mutants.program import Program, Rule, call_in, expression, name_of, only

Made = Iterator[cst.Module]
SIMPLE: list[Rule] = []
OPERATORS = {
    cst.Add: cst.Subtract, cst.Subtract: cst.Add, cst.Multiply: cst.Divide,
    cst.Divide: cst.Multiply, cst.FloorDivide: cst.Divide, cst.Modulo: cst.FloorDivide,
    cst.Power: cst.Multiply,
    cst.AddAssign: cst.SubtractAssign, cst.SubtractAssign: cst.AddAssign,
}  # fmt: skip
COMPARISONS = {
    '<': ['<=', '>'], '<=': ['<', '>='], '>': ['>=', '<'], '>=': ['>', '<='], '==': ['!='],
    '!=': ['=='], 'is': ['is not'], 'is not': ['is'], 'in': ['not in'], 'not in': ['in'],
}  # fmt: skip
KINDS = (
    ('min', 'max'),
    ('any', 'all'),
    ('sin', 'cos', 'tan'),
    ('degrees', 'radians'),
    ('isnan', 'isinf', 'isfinite'),
    ('True', 'False'),
    ('RELIABLE', 'BEST_EFFORT'),
    ('VOLATILE', 'TRANSIENT_LOCAL'),
    ('KEEP_LAST', 'KEEP_ALL'),
    ('SUCCESS', 'FAILURE', 'ERROR'),
    ('ACCEPT', 'REJECT'),
    ('succeed', 'canceled', 'abort'),
    ('acquire', 'release'),
    ('cancel', 'reset'),
    ('set', 'clear'),
    ('info', 'warning', 'error'),
    ('Int32', 'String', 'Float64'),
    ('linear', 'angular'),
    ('x', 'y', 'z'),
    ('range_min', 'range_max'),
    ('sec', 'nanosec'),
    ('first', 'last'),
)


def rule(function: Rule) -> Rule:
    SIMPLE.append(function)
    return function


@rule
def a_statement_gone(program: Program) -> Made:
    small = cst.Return | cst.AugAssign | cst.Raise | cst.Assert | cst.Del | cst.Break | cst.Continue
    for block, at, one in program.statements():
        # Without its value in __init__ an attribute is missing: an error, and no wrong answer.
        sets = only(one, cst.Assign) and program.method_of(one) not in ('__init__', '')
        large = isinstance(one, cst.If | cst.With | cst.For | cst.While)
        if sets or large or call_in(one) or only(one, small):
            yield program.put(block, at)


@rule
def an_else_gone(program: Program) -> Made:
    for node in program.each(cst.If):
        if node.orelse is not None:
            yield program.changed(node, node.with_changes(orelse=None))


@rule
def another_condition(program: Program) -> Made:
    for node in program.each(cst.If, cst.While, cst.IfExp, cst.CompIf):
        if program.is_written(node.test):
            code = program.code(node.test)
            others = [f'not ({code})', 'True', 'False']
            for other in others[: 1 if isinstance(node, cst.While) else 3]:
                space = cst.SimpleWhitespace(' ')
                name = 'whitespace_before_test'
                changes = {name: space} if hasattr(node, name) else {}
                yield program.changed(
                    node, node.with_changes(test=expression(f'({other})'), **changes)
                )


@rule
def one_half_of_a_condition(program: Program) -> Made:
    for node in program.each(cst.BooleanOperation):
        yield program.changed(node, f'({program.code(node.left)})')
        yield program.changed(node, f'({program.code(node.right)})')
        other = cst.Or if isinstance(node.operator, cst.And) else cst.And
        yield program.changed(node, node.with_changes(operator=other()))


@rule
def another_operator(program: Program) -> Made:
    for node in program.each(cst.BinaryOperation, cst.AugAssign):
        if other := OPERATORS.get(type(node.operator)):
            yield program.changed(node, node.with_changes(operator=other()))
        if isinstance(node, cst.AugAssign):
            assign = f'{program.code(node.target)} = {program.code(node.value)}'
            yield program.changed(node, cst.parse_statement(assign).body[0])
    for node in program.each(cst.UnaryOperation):
        yield program.changed(node, f'({program.code(node.expression)})')


@rule
def another_comparison(program: Program) -> Made:
    for node in program.each(cst.Comparison):
        for at, target in enumerate(node.comparisons):
            parts = [program.code(node.left)]
            for one in node.comparisons:
                parts += [program.code(one.operator).strip(), program.code(one.comparator)]
            for other in COMPARISONS.get(program.code(target.operator).strip(), ()):
                new = [*parts]
                new[1 + 2 * at] = other
                yield program.changed(node, f'({" ".join(new)})')


@rule
def another_number(program: Program) -> Made:
    for node in program.each(cst.Integer, cst.Float):
        value = node.evaluated_value
        others = [value + 1, value - 1] if abs(value) < 3 else [value + 1, value * 2]
        if isinstance(node, cst.Float):
            others = [value * 2, value / 2] if value else [0.1]
        elif value >= 10:
            others = [1, value + 1]
        if _may_be_more(program, node):
            others = [1] if value > 1 else []
        for other in others:
            code = repr(other)
            yield program.changed(node, f'({code})' if code.startswith('-') else code)


def _may_be_more(program: Program, node: cst.CSTNode) -> bool:
    """Return whether more is as good: a number of threads, the depth of a queue."""
    argument, call = program.parent(node), program.above(node, cst.Call)
    if not isinstance(argument, cst.Arg) or call is None:
        return False
    if argument.keyword:
        return argument.keyword.value == 'num_threads'
    return name_of(call.func) in ('create_publisher', 'create_subscription')


@rule
def another_text(program: Program) -> Made:
    for node in program.each(cst.SimpleString):
        value = node.evaluated_value
        if isinstance(program.parent(node), cst.Expr) or not isinstance(value, str):
            continue
        if value and not re.search(r'\s', value):
            is_set = isinstance(program.parent(node), cst.ComparisonTarget) and len(value) > 1
            yield program.changed(node, repr(value[:-1] if is_set else f'{value}_2'))


@rule
def another_name(program: Program) -> Made:
    for node in program.each(cst.Name):
        if program.method_of(node) == node.value:
            continue
        for kind in KINDS:
            if node.value in kind:
                for other in kind:
                    if other != node.value:
                        yield program.changed(node, cst.Name(other))


@rule
def another_argument(program: Program) -> Made:
    """A function gets another of its own arguments, two in the other order, or one fewer."""
    for call in program.each(cst.Call):
        if not program.is_written(call) or name_of(call.func) == 'super':
            continue
        for at, one in enumerate(call.args):
            rest = [*call.args[:at], *call.args[at + 1 :]]
            if one.keyword or (at and at == len(call.args) - 1 and not one.star):
                new = [arg.with_changes(comma=cst.MaybeSentinel.DEFAULT) for arg in rest]
                yield program.changed(call, call.with_changes(args=new))
        of_any_order = name_of(call.func) in ('max', 'min')
        plain = [one for one in call.args if one.keyword is None and not one.star]
        for at, (one, two) in enumerate(zip(plain, plain[1:], strict=False)):
            names = cst.Name | cst.Attribute | cst.Integer | cst.Float
            if isinstance(one.value, names) and isinstance(two.value, names) and not of_any_order:
                args = [*call.args]
                args[at : at + 2] = [
                    one.with_changes(value=two.value),
                    two.with_changes(value=one.value),
                ]
                yield program.changed(call, call.with_changes(args=args))


@rule
def an_element_gone(program: Program) -> Made:
    for node in program.each(cst.List, cst.Dict, cst.Tuple):
        if len(node.elements) < 2 or isinstance(program.parent(node), cst.AssignTarget):
            continue
        for at in range(len(node.elements)):
            rest = [*node.elements[:at], *node.elements[at + 1 :]]
            if isinstance(node, cst.Tuple) and len(rest) == 1:
                continue
            new = [one.with_changes(comma=cst.MaybeSentinel.DEFAULT) for one in rest]
            yield program.changed(node, node.with_changes(elements=new))


@rule
def nothing_to_give_back(program: Program) -> Made:
    for node in program.each(cst.Return):
        if node.value is not None and program.code(node.value) != 'None':
            yield program.changed(node, cst.parse_statement('return None').body[0])


@rule
def a_default_gone(program: Program) -> Made:
    """A parameter of a method with another default."""
    for node in program.each(cst.Param):
        if node.default is not None and program.code(node.default) != 'None':
            yield program.changed(node, node.with_changes(default=cst.Name('None')))
