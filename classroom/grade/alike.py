"""Whose answers are alike, also with other names of variables? That is no proof: ask, and listen.

An answer is compared by its statements, in a form in which the names that a student has chosen, the
texts, the comments and the annotations do not count. What the starter or the solution has, and what
a third of the class has, is nobody's own, and is left out.
"""

from __future__ import annotations

import ast
import copy
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import SequenceMatcher
from itertools import combinations

from classroom.grade.answers import Answers, Handed
from classroom.grade.source import code_only
from helpers.lesson import Task, code_of_solution

LEAST_LETTERS = 80  # of one's own statements: shorter answers are equal by themselves
LEAST_STATEMENTS = 6  # for a likeness in parts
NEAR = 0.8  # of the statements
COMMON = 3  # what one in three students has is nobody's own,
FEW = 5  # if at least so many have it
DEFINES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
SAME, RENAMED = 'the same', 'the same but for names and texts'


@dataclass(frozen=True)
class Likeness:
    """Answers to a task that are alike: `how`, and how many statements they have of their own."""

    task: str
    students: tuple[str, ...]
    how: str
    statements: int


def statements(source: str) -> list[str]:
    """Return the statements of a source in a form without chosen names; else its lines."""
    lines = [line for line in source.splitlines() if not line.lstrip().startswith(('%', '!'))]
    try:
        tree = ast.parse('\n'.join(lines))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return [' '.join(line.split()) for line in code_only(source).splitlines() if line.strip()]
    chosen = _chosen(tree)
    found = []
    for node in ast.walk(tree):
        # In the order of the text, whatever the order of the walk.
        if isinstance(node, ast.stmt) and not _is_docstring(node):
            found.append((node.lineno, node.col_offset, _plain(node, chosen)))
    return [text for *_, text in sorted(found)]


def _chosen(tree: ast.AST) -> set[str]:
    """Return the names that a source gives a value, of variables, arguments and attributes."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            names.add(node.id if isinstance(node, ast.Name) else node.attr)
        elif isinstance(node, ast.arg):
            names.add(node.arg)
        elif isinstance(node, (*DEFINES, ast.ExceptHandler)):
            names.add(node.name or '')
    return {name for name in names if not name.startswith('__')} - {'self'}


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _plain(node: ast.stmt, chosen: set[str]) -> str:
    """Return the head of a statement: what it has inside is a statement of its own."""
    head = copy.copy(node)
    for part in ('body', 'orelse', 'finalbody'):
        if isinstance(getattr(head, part, None), list):
            setattr(head, part, [ast.Pass()] if part == 'body' else [])
    if isinstance(head, ast.Try):
        head.handlers = [ast.ExceptHandler(None, None, [ast.Pass()])]
    if isinstance(head, ast.Match):
        head.cases = head.cases[:1]
    return ast.unparse(_Rename(chosen).visit(copy.deepcopy(head)))


class _Rename(ast.NodeTransformer):
    """Gives the chosen names of a statement new ones, in their order in it."""

    def __init__(self, chosen: set[str]) -> None:
        self._chosen, self._names = chosen, {}

    def _new(self, name: str) -> str:
        if name not in self._chosen:
            return name
        return self._names.setdefault(name, f'v{len(self._names)}')

    def visit_Name(self, node: ast.Name) -> ast.AST:  # noqa: N802
        return ast.Name(self._new(node.id), node.ctx)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:  # noqa: N802
        value = self.visit(node.value)
        return ast.Attribute(value, self._new(node.attr), node.ctx)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        return ast.arg(self._new(node.arg), None)

    def visit_keyword(self, node: ast.keyword) -> ast.AST:
        return ast.keyword(node.arg and self._new(node.arg), self.visit(node.value))

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:  # noqa: N802
        if node.value is None:
            return ast.Pass()
        plain = ast.Assign([node.target], node.value, lineno=node.lineno)
        return self.generic_visit(plain)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:  # noqa: N802
        node.name, node.returns = self._new(node.name), None
        return self.generic_visit(node)

    visit_AsyncFunctionDef = visit_FunctionDef  # noqa: N815

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:  # noqa: N802
        node.name = self._new(node.name)
        return self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> ast.AST:  # noqa: N802
        return ast.Constant('text') if isinstance(node.value, str) else node

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:  # noqa: N802
        return ast.Constant('text')


def _of_task(task: Task, answers: Answers) -> str:
    return '\n'.join(answers.sources.get(cell.id, '') for cell in task.exercises)


def _own(task: Task, written: dict[str, str]) -> dict[str, list[str]]:
    """Return the own statements of the students who have enough of them."""
    given: Counter[str] = Counter()
    for cell in (*task.exercises, *task.solutions):
        given.update(statements(code_of_solution(cell.source)))
    found = {name: statements(source) for name, source in written.items()}
    has = Counter(one for own in found.values() for one in {*own})
    common = {one for one, count in has.items() if count >= max(FEW, len(found) / COMMON)}
    own = {name: [one for one in all_ if one not in given] for name, all_ in found.items()}
    # A whole answer that many share is told all the same: then they have it from one place.
    rare = {name: [one for one in those if one not in common] for name, those in own.items()}
    return {
        name: those
        for name, those in own.items()
        if len('\n'.join(those)) >= LEAST_LETTERS and (rare[name] or _is_long(those))
    }


def _is_long(those: list[str]) -> bool:
    return len(those) >= 2 * LEAST_STATEMENTS


def alike(handed: Handed, students: Iterable[tuple[str, Answers]]) -> list[Likeness]:
    """Return the answers of a lesson that are alike, those that are the same first."""
    students, found = list(students), []
    for name, task in handed.tasks.items():
        written = {who: _of_task(task, a) for who, a in students if a.changed(task)}
        own = _own(task, written)
        groups: dict[tuple[str, ...], list[str]] = defaultdict(list)
        for who, those in own.items():
            groups[tuple(those)].append(who)
        for those, names in groups.items():
            if len(names) > 1:
                how = SAME if len({code_only(written[who]) for who in names}) == 1 else RENAMED
                found.append(Likeness(name, tuple(names), how, len(those)))
        for (one, first), (other, second) in combinations(groups.items(), 2):
            if count := _shared(one, other):
                how = f'{count} of {max(len(one), len(other))} statements'
                found.append(Likeness(name, (*first, *second), how, max(len(one), len(other))))
    return found


def _shared(one: tuple[str, ...], other: tuple[str, ...]) -> int:
    """Return how many statements two answers share in their order, 0 if these are few."""
    longer = max(len(one), len(other))
    if min(len(one), len(other)) < LEAST_STATEMENTS:
        return 0
    if (Counter(one) & Counter(other)).total() < NEAR * longer:
        return 0
    matcher = SequenceMatcher(None, one, other, autojunk=False)
    count = sum(block.size for block in matcher.get_matching_blocks())
    return count if count >= NEAR * longer else 0
