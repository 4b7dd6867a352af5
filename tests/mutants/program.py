"""A Python program as a tree that keeps its comments and lines, and what rules need of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeVar

import libcst as cst
from libcst.metadata import MetadataWrapper, ParentNodeProvider, PositionProvider

Kind = TypeVar('Kind', bound=cst.CSTNode)
Block = cst.IndentedBlock | cst.Module
Rule = Callable[['Program'], Iterator[cst.Module]]
LOOPS = (cst.For, cst.While)
DEFINITIONS = (cst.FunctionDef, cst.ClassDef)


class Program:
    """A program, and the numbers of the lines that the learner writes.

    Raises `libcst.ParserSyntaxError` if the source is no Python.
    """

    def __init__(self, source: str, written: set[int]) -> None:
        wrapper = MetadataWrapper(cst.parse_module(source))
        self.module, self.written = wrapper.module, written
        self._positions = wrapper.resolve(PositionProvider)
        self._parents = wrapper.resolve(ParentNodeProvider)
        self._nodes: list[cst.CSTNode] = []
        self.module.visit(_Collector(self._nodes))

    def is_written(self, node: cst.CSTNode) -> bool:
        """Return whether the learner writes a line of this node."""
        place = self._positions[node]
        return not self.written.isdisjoint(range(place.start.line, place.end.line + 1))

    def each(self, *kinds: type[Kind]) -> Iterator[Kind]:
        """Yield the nodes of these kinds that the learner writes, in their order."""
        for node in self._nodes:
            if isinstance(node, kinds) and self.is_written(node):
                yield node

    def line_of(self, node: cst.CSTNode) -> int:
        """Return the number of the line in which a node begins, from 1."""
        return self._positions[node].start.line

    def code(self, node: cst.CSTNode) -> str:
        return self.module.code_for_node(node)

    def parent(self, node: cst.CSTNode) -> cst.CSTNode:
        return self._parents[node]

    def above(self, node: cst.CSTNode, *kinds: type[Kind]) -> Kind | None:
        """Return the nearest node of these kinds around a node."""
        while not isinstance(node, cst.Module):
            node = self._parents[node]
            if isinstance(node, kinds):
                return node
        return None

    def method_of(self, node: cst.CSTNode) -> str:
        """Return the name of the function around a node, empty outside of all."""
        function = self.above(node, cst.FunctionDef)
        return function.name.value if function else ''

    def changed(self, old: cst.CSTNode, new: cst.CSTNode | str) -> cst.Module:
        """Return the program with another node in this place; a text is an expression."""
        return self.module.deep_replace(old, expression(new) if isinstance(new, str) else new)

    def blocks(self) -> Iterator[tuple[Block, list]]:
        """Yield the blocks of the program, and their statements."""
        for node in self._nodes:
            if isinstance(node, Block):
                yield node, [*node.body]

    def statements(self) -> Iterator[tuple[Block, int, cst.CSTNode]]:
        """Yield the statements that the learner writes: their block, their place in it, and them.

        None of them is a definition, a docstring or an import.
        """
        for block, body in self.blocks():
            for at, statement in enumerate(body):
                if self.is_written(statement) and not is_left_alone(statement):
                    yield block, at, statement

    def calls(self, *names: str) -> Iterator[cst.Call]:
        """Yield the calls, that the learner writes, of functions and methods with these names."""
        for call in self.each(cst.Call):
            if name_of(call.func) in names:
                yield call

    def put(self, block: Block, at: int, *new: cst.CSTNode | str, count: int = 1) -> cst.Module:
        """Return the program with other statements in the place of one, or of some."""
        body = [*block.body]
        body[at : at + count] = [statement(one) if isinstance(one, str) else one for one in new]
        return self.changed(block, block.with_changes(body=body or [statement('pass')]))

    def replaced(self, old: cst.CSTNode, *new: cst.CSTNode | str) -> cst.Module:
        """Return the program with other statements in the place of this one."""
        block = self._parents[old]
        return self.put(block, [*block.body].index(old), *new)


class _Collector(cst.CSTVisitor):
    def __init__(self, nodes: list[cst.CSTNode]) -> None:
        super().__init__()
        self._nodes = nodes

    def on_visit(self, node: cst.CSTNode) -> bool:
        self._nodes.append(node)
        return True


def expression(text: str) -> cst.BaseExpression:
    return cst.parse_expression(text)


def statement(text: str) -> cst.CSTNode:
    return cst.parse_statement(text)


def block_of(*statements: cst.CSTNode | str) -> cst.IndentedBlock:
    made = [statement(one) if isinstance(one, str) else one for one in statements]
    return cst.IndentedBlock(body=made or [statement('pass')])


def with_body(
    node: cst.With | cst.If | cst.For | cst.While, *statements: cst.CSTNode
) -> cst.CSTNode:
    """Return a statement with other statements in it; a comment in its first line stays."""
    return node.with_changes(body=node.body.with_changes(body=block_of(*statements).body))


def name_of(node: cst.CSTNode) -> str:
    """Return the last name of `a.b.c`, empty for what has none."""
    if isinstance(node, cst.Attribute):
        return node.attr.value
    return node.value if isinstance(node, cst.Name) else ''


def only(statement: cst.CSTNode, kind: type[Kind]) -> Kind | None:
    """Return what a line consists of, if it is of this kind: `only(line, cst.Return)`."""
    if isinstance(statement, cst.SimpleStatementLine) and len(statement.body) == 1:
        small = statement.body[0]
        return small if isinstance(small, kind) else None
    return None


def call_in(statement: cst.CSTNode) -> cst.Call | None:
    """Return the call that a statement is, None if it is something else."""
    small = only(statement, cst.Expr)
    value = small.value if small else None
    value = value.expression if isinstance(value, cst.Await) else value
    return value if isinstance(value, cst.Call) else None


def is_left_alone(statement: cst.CSTNode) -> bool:
    """Return whether a statement is a definition, an import, a text, or does nothing."""
    if isinstance(statement, DEFINITIONS):
        return True
    if not isinstance(statement, cst.SimpleStatementLine):
        return False
    return all(
        isinstance(small, cst.Import | cst.ImportFrom | cst.Pass | cst.Global | cst.Nonlocal)
        or (
            isinstance(small, cst.Expr)
            and isinstance(small.value, cst.SimpleString | cst.ConcatenatedString | cst.Ellipsis)
        )
        for small in statement.body
    )


def leaves(statement: cst.CSTNode) -> bool:
    """Return whether nothing below this statement of its block runs."""
    return any(only(statement, kind) for kind in (cst.Return, cst.Raise, cst.Break, cst.Continue))


def target_of(statement: cst.CSTNode) -> cst.BaseExpression | None:
    """Return what `x = ...` gives a value, if it is one thing."""
    assign = only(statement, cst.Assign)
    return assign.targets[0].target if assign and len(assign.targets) == 1 else None


def is_attribute_of_self(node: cst.CSTNode | None) -> bool:
    return (
        isinstance(node, cst.Attribute)
        and isinstance(node.value, cst.Name)
        and node.value.value == 'self'
    )
