"""The programs of the lessons, taken from the notebooks as they are now."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from helpers.lesson import (
    ROOT,
    Lesson,
    code_of_solution,
    magic_of,
    path_and_part,
    paths,
    read,
    tags,
)
from helpers.workspace import Workspace, why_it_failed

HERE = Path(__file__).parent
PROGRAMS, INSIDE = HERE / 'programs.yaml', HERE / 'inside'
NOT_RUN = {'exercise', 'check', 'predict'}
OF_LESSONS = ('helpers.checks', 'helpers.plots')  # what a program does not need
PUBLISHES = re.compile(r'create_publisher\b[^)]*cmd_vel')


@cache
def declared() -> dict[str, dict[str, Any]]:
    """Return what programs.yaml says of each program."""
    found = yaml.safe_load(PROGRAMS.read_text(encoding='utf-8'))
    return {name: found['all'] | one for name, one in found['programs'].items()}


def nodes_of(declared: dict[str, Any]) -> list[str]:
    """Return the calls that make the nodes of a program: `Driver(0.5, 0.0)`."""
    return [one['node'] for one in declared['processes'].values() if 'node' in one]


@cache
def left_out() -> dict[str, dict[str, str]]:
    """Return which programs are not tried, by lesson and name, and why."""
    return yaml.safe_load(PROGRAMS.read_text(encoding='utf-8'))['left_out']


@cache
def lesson(name: str) -> Lesson:
    """Return the lesson of a name. Raises KeyError if there is none."""
    for path in paths():
        if path.stem[3:] == name:
            return read(path.read_text(encoding='utf-8'), path.name)
    raise KeyError(f'No lesson is called {name!r}.')


def shown(lesson: Lesson) -> Iterator[tuple[str, str]]:
    """Yield id and code of each cell that a lesson runs where all solutions are used."""
    for cell in lesson.code_cells():
        if not NOT_RUN.intersection(tags(cell)):
            yield cell.id, code_of_solution(cell.source)


def publishers(lesson: Lesson) -> Iterator[tuple[str, str]]:
    """Yield id and name of what publishes on cmd_vel: a class of a cell, or a file that one writes.

    A class that only inherits its publisher is not found.
    """
    for cell, code in shown(lesson):
        magic = magic_of(code)
        if magic.file and PUBLISHES.search(code):
            yield cell, magic.file
        for statement in [] if magic.name else statements(code):
            if isinstance(statement, ast.ClassDef) and PUBLISHES.search(ast.unparse(statement)):
                yield cell, statement.name


# --- Nodes of cells


def module_of(lesson: Lesson, wanted: set[str]) -> str:
    """Return a module with the classes of these names, and all that they use of their lesson.

    Where a name is given twice, the last one counts that stands before its use; else the first.
    """
    found = [
        (names_of(statement), statement)
        for _, code in shown(lesson)
        for statement in statements(code)
    ]
    taken: dict[int, ast.stmt] = {}

    def take(names: set[str], before: int) -> None:
        for name in names:
            places = [i for i, (given, _) in enumerate(found) if name in given]
            earlier = [i for i in places if i < before] or places[:1]
            if not earlier or earlier[-1] in taken:
                continue
            place = earlier[-1]
            taken[place] = statement = found[place][1]
            used = {node.id for node in ast.walk(statement) if isinstance(node, ast.Name)}
            take(used - {name}, place)
            if name in used and name in names_of(statement):  # `Brake` of an earlier `Brake`
                take({name}, place)

    take(wanted, len(found))
    lines = [ast.unparse(taken[place]) for place in sorted(taken)]
    missing = wanted - {name for place in taken for name in found[place][0]}
    if missing:
        raise KeyError(f'{lesson.file} defines no {", ".join(sorted(missing))}.')
    return '\n\n\n'.join(lines) + '\n'


def statements(code: str) -> list[ast.stmt]:
    """Return the definitions, imports and constants of a cell, none for a cell with a magic."""
    try:
        body = ast.parse(code).body
    except SyntaxError:
        return []
    return [statement for statement in body if names_of(statement)]


def names_of(statement: ast.stmt) -> set[str]:
    """Return the names that a statement gives to a module."""
    match statement:
        case ast.ClassDef(name) | ast.FunctionDef(name):
            return {name}
        case ast.ImportFrom(module=str(module)) if module.startswith(OF_LESSONS):
            return set()
        case ast.Import(names) | ast.ImportFrom(names=names):
            return {(one.asname or one.name).split('.')[0] for one in names}
        case ast.Assign(targets=targets):
            names = [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
            return {name for name in names if name.isupper()}
    return set()


# --- Files and packages


def fill(lesson: Lesson, workspace: Workspace, also: dict[str, str | None]) -> None:
    """Write the files of a lesson into a workspace, and run the cells that make its packages.

    These are the cells with `ros2 pkg create`, and those with an id in `also`, each with a line
    that is run after it.
    """
    names: dict[str, Any] = {'workspace': workspace, 'shutil': shutil, 're': re}
    left = {*also}
    for cell, code in shown(lesson):
        magic, line, body = magic_of(code)
        if magic == 'write':
            path, part = path_and_part(line)
            if not path.startswith('overlay/') or cell in also:
                workspace.write(path, body, part)
        elif magic and (cell in also or ('pkg create' in body and not line)):
            workspace.terminal(body)
        elif cell in also and not magic:
            kept = [one for one in ast.parse(code).body if not _opens_or_checks(one)]
            exec(compile(ast.Module(kept, []), cell, 'exec'), names)
        if cell in also:
            left.discard(cell)
            if also[cell]:
                exec(also[cell], names)
    if left:
        raise KeyError(f'{lesson.file} has no cell {", ".join(sorted(left))}.')


def _opens_or_checks(statement: ast.stmt) -> bool:
    match statement:
        case ast.ImportFrom(module=str(module)):
            return module.startswith(OF_LESSONS)
        case ast.Assign(targets=[ast.Name('workspace')]):
            return True
    return False


class Prepared:
    """A program that is ready to be started: its files are written, and its packages built.

    Raises KeyError if its lesson lacks a name or a cell, RuntimeError if a package does not build.
    """

    def __init__(self, name: str) -> None:
        self.name, self.declared = name, declared()[name]
        self.lesson = lesson(self.declared['lesson'])
        self.workspace = Workspace(f'ordeal_{name}')
        self.folder = self.workspace.path
        self.environment = dict(os.environ)
        shutil.copy(INSIDE / 'node.py', self.folder / 'node.py')
        self.clock = self.folder / 'clock.so'
        build_clock = ['cc', '-shared', '-fPIC', '-O1', '-o', self.clock, INSIDE / 'clock.c']
        subprocess.run(build_clock, check=True)
        self._write_packages()
        if self.declared['build']:
            result = self.workspace.build(*self.declared['build'])
            if not result.ok:
                raise RuntimeError(f'{name}: {why_it_failed(result)}')
            self.environment = self.workspace.environment()
        self._write_nodes()

    def _write_packages(self) -> None:
        say = self.declared
        if 'package' in say:
            shutil.copytree(ROOT / say['package'], self.workspace.file(f'src/{say["as"]}'))
        elif say['writes']:
            if earlier := say.get('goes_on_from'):
                fill(lesson(earlier['lesson']), self.workspace, earlier['also'])
            fill(self.lesson, self.workspace, say['also'])
        for path, text in say['files'].items():
            self.workspace.write(path, text)

    def _write_nodes(self) -> None:
        wanted = {call.split('(')[0] for call in nodes_of(self.declared)}
        if self.declared['floor'].isupper():
            wanted.add(self.declared['floor'])
        if wanted:
            text = module_of(self.lesson, wanted)
            (self.folder / 'lesson.py').write_text(text, encoding='utf-8')

    def commands(self) -> dict[str, list[str]]:
        """Return the command of each process, by its name."""
        found = {}
        for name, one in self.declared['processes'].items():
            words = (one.get('args') or '').split()
            match one:
                case {'node': call}:
                    threads = str(one.get('threads', 1))
                    found[name] = [sys.executable, 'node.py', 'lesson', call, threads, *words]
                case {'file': file}:
                    found[name] = [sys.executable, file, *words]
                case {'run': run}:
                    package, executable = run.split()
                    path = self.folder / 'install' / package / 'lib' / package / executable
                    found[name] = [str(path), *words]
                case {'launch': launch}:
                    found[name] = ['ros2', 'launch', *launch.split(), *words]
        return found

    def on(self, base: str) -> dict[str, Any]:
        """Return what is declared of it on a base."""
        return self.declared | self.declared.get(base, {})

    def close(self) -> None:
        """End what runs in its workspace."""
        self.workspace.close()
