"""Which files of the course does a verdict of a lesson depend on? Their digest.

A verdict is kept until something changes that it depends on: the modules that the lesson and its
checks import, and those that these import, also at their first use; the files beside them that are
no Python; and the `ros2` command. Comments, docstrings, and the hints of a check do not count: a
hint that was mended judges nobody anew.
"""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from helpers.lesson import code_of_solution

LEFT_OUT = {'__pycache__', '.ipynb_checkpoints'}  # copies, by Python and JupyterLab
# Packages and modules that draw, ask and remember: no verdict depends on them.
SHOW_ONLY = (
    *('helpers.replay', 'helpers.robot_view', 'helpers.plots', 'helpers.guesses'),
    *('helpers.waits_view', 'helpers.checks.other_robots', 'helpers.checks.memory'),
    *('helpers.checks.guesses', 'helpers.checks.classroom', 'helpers.checks.progress'),
)
LOOKS_ONLY = {'.css', '.js', '.svg', '.png', '.md'}
IMPORTS = re.compile(r'^\s*(?:from|import) +helpers\b.*', re.MULTILINE)


def digest_of_uses(root: Path, module: str, sources: Iterable[str]) -> str:
    """Return what changes if a file does that verdicts of a lesson depend on.

    `module` is the name of its checks, `sources` are those of its code cells.
    """
    code = '\n'.join(map(code_of_solution, sources))
    lines = '\n'.join(line.strip() for line in IMPORTS.findall(code))
    return _digest(root, module, lines)


@cache  # for a run: a hundred students need it
def _digest(root: Path, module: str, lines: str) -> str:
    found = hashlib.sha256()
    for path in files_used(root, module, lines):
        found.update(f'{path.relative_to(root)} '.encode() + _content(path) + b'\n')
    return found.hexdigest()


def files_used(root: Path, module: str, lines: str) -> list[Path]:
    """Return the files, in order."""
    open_ = [f'helpers.checks.lessons.{module}', 'helpers.checks.tasks', 'helpers.kernel']
    open_ += _imported(_parsed(lines))
    modules: set[Path] = set()
    while open_:
        name = open_.pop()
        if not name or name.startswith(SHOW_ONLY):
            continue
        path = _file_of(root, name) or _on_demand(root, name)
        if path is None or path in modules:
            continue
        modules.add(path)
        open_.append(name.rpartition('.')[0])  # its package is imported first
        whole = path.with_suffix('') if path.name != '__init__.py' else path.parent
        package = '.'.join(whole.relative_to(root).parts)
        open_ += _imported(_parsed(path.read_text(encoding='utf-8')))
        # What a package loads at the first use of a name is imported by a name of its modules.
        if path.name == '__init__.py' and path.parent.parent.name == 'lessons':
            open_ += [f'{package}.{one.stem}' for one in path.parent.glob('*.py')]
    folders = {path.parent for path in modules}
    for folder in (*folders, root / 'ros2'):
        for path in folder.rglob('*') if folder.exists() else ():
            is_below = not (path.parent / '__init__.py').exists() or folder.name == 'ros2'
            is_data = path.suffix != '.py' or is_below
            shows = '.'.join(path.relative_to(root).parts).startswith(SHOW_ONLY)
            if path.is_file() and is_data and not shows and path.suffix not in LOOKS_ONLY:
                modules.add(path)
    return sorted(path for path in modules if LEFT_OUT.isdisjoint(path.parts))


def _file_of(root: Path, name: str) -> Path | None:
    path = root.joinpath(*name.split('.'))
    for one in (path / '__init__.py', path.with_name(f'{path.name}.py')):
        if one.is_file():
            return one
    return None


def _on_demand(root: Path, name: str) -> Path | None:
    """Return the module that has a name which its package loads at the first use."""
    package, _, name = name.rpartition('.')
    path = _file_of(root, package)
    if path is None or path.name != '__init__.py':
        return None
    for node in _parsed(path.read_text(encoding='utf-8')).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], 'id', '') == 'MODULES':
            for module, names in ast.literal_eval(node.value).items():
                if name in names:
                    return _file_of(root, f'{package}.{module}')
    return None


@cache
def _parsed(text: str) -> ast.Module:
    try:
        return ast.parse(text)
    except (SyntaxError, ValueError):
        return ast.Module([], [])


def _imported(tree: ast.Module) -> Iterator[str]:
    """Yield the modules, and the names in them, that a module imports, wherever it does."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f'{node.module}.{one.name}' for one in node.names)


def _content(path: Path) -> bytes:
    data = path.read_bytes()
    if path.suffix == '.py':
        try:
            tree = _Plain().visit(ast.parse(data))
            data = ast.dump(tree, annotate_fields=False).encode()
        except (SyntaxError, ValueError):
            pass
    return hashlib.sha256(data).hexdigest().encode()


class _Plain(ast.NodeTransformer):
    """Takes docstrings and the texts of hints out of a tree."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST:  # noqa: N802
        return ast.Pass() if _is_text(node.value) else self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> ast.AST:  # noqa: N802
        name = getattr(node.targets[0], 'id', '').lower()
        if 'hint' in name and _is_text(node.value):
            node.value = ast.Constant('')
        return self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> ast.AST:
        if node.arg == 'hint' and _is_text(node.value):
            node.value = ast.Constant('')
        return self.generic_visit(node)

    def visit_Tuple(self, node: ast.Tuple) -> ast.AST:  # noqa: N802
        # A point: what is right, a test, and a hint.
        tests = (ast.Lambda, ast.Name, ast.Call, ast.Attribute)
        is_test = any(isinstance(one, tests) for one in node.elts[1:2])
        if len(node.elts) == 3 and is_test and _is_text(node.elts[2]):
            node.elts[2] = ast.Constant('')
        return self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:  # noqa: N802
        if getattr(node.func, 'id', '') == 'rows' and len(node.args) > 1 and _is_text(node.args[1]):
            node.args[1] = ast.Constant('')
        return self.generic_visit(node)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)
