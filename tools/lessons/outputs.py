"""Which saved outputs stay when a lesson runs again, and what they were made from.

Replays and pictures differ from run to run, and no diff of them can be read. So a cell keeps all
its outputs if nbval finds the new ones equal, and if what makes them is the same. A notebook says
itself what made its outputs, in its metadata `ros2_notebooks_made_from`:

    cells           a digest of the source of each code cell, in their order
    outputs         a digest of the outputs of each: those of a run in JupyterLab do not count
    helpers/replay  a digest of the code of this package, and so on for each one that the cells
                    import, also through others and through the judges of the lesson
    versions        of the packages that run and draw, from the lock

If one of these has changed, the replays and pictures below the change are new. What only texts
come from is here as well, so that the lesson is run, but it changes no picture: `helpers/checks`,
`ros2` and `other versions`.

It is in the notebook, because a file beside it could be forgotten in a commit, and because git's
history does not say which code was there when a lesson was run. Comments and docstrings of Python
do not count in helpers. In a cell they do: `%%write` and a traceback show them.
"""

import ast
import hashlib
import json
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import nbformat
from nbformat import NotebookNode

from helpers.lesson import called, tags
from tools.lessons.clean import MADE_FROM
from tools.lessons.comparison import compared
from tools.lessons.new import judges_of

CHECKS, COMMAND, OTHERS = 'helpers/checks', 'ros2', 'other versions'
TEXT_ONLY = {CHECKS, COMMAND, OTHERS}
# A replay or a picture shows what these did. Of all others, lessons print at most a text.
RUN_AND_DRAW = {
    *('matplotlib', 'numpy', 'pandas', 'pillow', 'quickjs-ng', 'rjsmin'),
    *('ros-fastrtps', 'ros-rcl', 'ros-rclpy', 'ros-rmw-fastrtps-cpp'),
}
IMPORT = re.compile(r'^\s*(?:from|import) helpers\.(\w+)', re.MULTILINE)
IMPORTS = re.compile(r'^\s*from helpers import (\([^)]*\)|[^\n#]*)', re.MULTILINE)
JUDGES = re.compile(r'\bhelpers\.checks\.lessons\.(\w+)')
VERSION = re.compile(r'^([\w.-]+)==(\S+)', re.MULTILINE)
Digests = dict[str, str]


def code_cells(notebook: NotebookNode) -> list[NotebookNode]:
    return [cell for cell in notebook.cells if cell.cell_type == 'code']


def made_from(notebook: NotebookNode, root: Path) -> Digests:
    """Return what makes the outputs of a notebook in this checkout, a digest by each name."""
    cells = code_cells(notebook)
    return {
        'cells': ' '.join(_digests_of_sources(cells)),
        **(_helpers(cells, root) | _versions(root) if cells else {}),
    }


def saved(path: Path, notebook: NotebookNode, now: Digests) -> NotebookNode | None:
    """Return the notebook whose outputs may stay: this one, or the one of the last commit.

    JupyterLab may have saved others since, or none; the last commit may still have those of
    `make notebooks`. None if neither says what made its outputs.
    """
    known = [notebook] if MADE_FROM in notebook.metadata else []
    if not known or same_cells(notebook, now) < len(code_cells(notebook)):
        known += _committed(path)
    return max(known, key=lambda old: same_cells(old, now), default=None)


def _committed(path: Path) -> list[NotebookNode]:
    try:
        text = subprocess.run(
            ['git', 'show', f'HEAD:./{path.name}'],
            cwd=path.parent,
            capture_output=True,
            check=True,
            encoding='utf-8',
        ).stdout
        notebook = nbformat.reads(text, as_version=4)
    except (OSError, subprocess.CalledProcessError, ValueError, nbformat.ValidationError):
        return []  # no git, not committed, or no notebook
    return [notebook] if MADE_FROM in notebook.metadata else []


def changed_parts(old: NotebookNode, now: Digests) -> list[str]:
    """Return what has changed of that which made the outputs of `old`, but for its cells."""
    says = old.metadata[MADE_FROM]
    names = sorted({*says, *now} - {'cells', 'outputs'})
    return [name for name in names if says.get(name) != now.get(name)]


def same_cells(old: NotebookNode, now: Digests) -> int:
    """Return how many code cells have the same source as `old`, and there the outputs as saved.

    They stand before the first one that differs: what is below it may depend on it.
    """
    says, cells = old.metadata[MADE_FROM], code_cells(old)
    sources, outputs = says['cells'].split(), says['outputs'].split()
    return min(
        _equal_before(sources, now['cells'].split()),
        _equal_before(sources, _digests_of_sources(cells)),
        _equal_before(outputs, _digests_of_outputs(cells)),
        _equal_before([*range(1, len(cells) + 1)], [cell.execution_count for cell in cells]),
    )


def _equal_before(some: list, others: list) -> int:
    """Return how many items of two lists are equal before the first two that differ."""
    pairs = enumerate(zip(some, others, strict=False))
    return next((i for i, (one, other) in pairs if one != other), min(len(some), len(others)))


def is_made_from(old: NotebookNode, now: Digests) -> bool:
    """Whether the outputs of `old` come from what is there now, so that no run is needed.

    Then every code cell was run, and in order.
    """
    count = len(now['cells'].split())
    return (
        not changed_parts(old, now)
        and same_cells(old, now) == count
        and len(code_cells(old)) == count
    )


def stamp(notebook: NotebookNode, now: Digests) -> None:
    """Let a notebook say that its outputs come from this."""
    outputs = ' '.join(_digests_of_outputs(code_cells(notebook)))
    notebook.metadata[MADE_FROM] = nbformat.from_dict(now | {'outputs': outputs})


def take_outputs(notebook: NotebookNode, old: NotebookNode) -> None:
    """Give a notebook the outputs of another one that has the same code cells."""
    for cell, before in zip(code_cells(notebook), code_cells(old), strict=True):
        cell.outputs, cell.execution_count = before.outputs, before.execution_count


def keep(new: NotebookNode, old: NotebookNode, now: Digests) -> Iterator[str]:
    """Let the cells of a notebook that was run keep what they can of its old outputs.

    It yields a sentence for each cell whose outputs are new: which one, and why.
    """
    parts = [part for part in changed_parts(old, now) if part not in TEXT_ONLY]
    same, by_id = same_cells(old, now), {cell.id: cell for cell in code_cells(old)}
    cells, above = code_cells(new), code_cells(old)[:same]
    for place, cell in enumerate(cells):
        before = above[place] if place < same else by_id.get(cell.id)
        is_equal = before is not None and _is_equal(cell, before)
        if is_equal and place < same and not parts:
            cell.outputs, cell.execution_count = before.outputs, before.execution_count
        elif not is_equal:
            yield f'new outputs of {called(cell)}: text'
        elif _without_counts(cell) != _without_counts(before):
            kind = 'picture' if any('data' in output for output in cell.outputs) else 'log'
            why = _why(parts, cells[same] if place >= same else None, old, now)
            yield f'new outputs of {called(cell)}: {kind}: {why}'


def _why(parts: list[str], first: NotebookNode | None, old: NotebookNode, now: Digests) -> str:
    """Return why a picture is new: parts that have changed, or the first cell that differs."""
    if parts:
        return f'{" and ".join(parts)} {"have" if len(parts) > 1 else "has"} changed'
    place = same_cells(old, now)
    sources = old.metadata[MADE_FROM]['cells'].split()
    if sources[place : place + 1] == now['cells'].split()[place : place + 1]:
        return f'the outputs that were saved from {called(first)} on are of another run'
    return f'the code has changed at {called(first)}'


def _is_equal(cell: NotebookNode, before: NotebookNode) -> bool:
    """Whether nbval finds the outputs of two cells equal, and the verdicts are."""
    if 'nbval-ignore-output' in tags(cell):
        return True
    return compared(cell.outputs) == compared(before.outputs)


def _without_counts(cell: NotebookNode) -> list[dict]:
    return [{**output, 'execution_count': None} for output in cell.outputs]


def _helpers(cells: list[NotebookNode], root: Path) -> Digests:
    code = '\n'.join(cell.source for cell in cells)
    checks = root / 'helpers' / 'checks'
    judges = [file for name in sorted({*JUDGES.findall(code)}) for file in judges_of(name, root)]
    found: set[str] = set()
    # What the judges import counts, because lessons take from them more than `check`. What the rest
    # of helpers/checks imports makes no output.
    wanted = _imported('\n'.join([code, *(judge.read_text('utf-8') for judge in judges)]))
    while wanted:
        name = wanted.pop()
        found.add(name)
        if name != checks.name:
            files = (root / 'helpers' / name).rglob('*.py')
            wanted |= _imported('\n'.join(f.read_text('utf-8') for f in files)) - found
    digests = {
        f'helpers/{name}': _digest_of_files(_files(folder))
        for name in sorted(found - {checks.name})
        if (folder := root / 'helpers' / name).is_dir()
    }
    if checks.name in found and checks.is_dir():
        lessons = checks / 'lessons'
        shared = [file for file in _files(checks) if lessons not in file.parents]
        digests[CHECKS] = _digest_of_files([*shared, *judges])
    if (command := root / 'ros2' / 'ros2_command').is_dir():
        digests[COMMAND] = _digest_of_files(_files(command))
    return digests


def _imported(code: str) -> set[str]:
    """Return the packages of helpers that a text imports, which may be a cell with a magic."""
    return {*IMPORT.findall(code), *re.findall(r'\w+', ' '.join(IMPORTS.findall(code)))}


def _versions(root: Path) -> Digests:
    lock = root / 'tools' / 'locks' / 'requirements.lock'
    if not lock.exists():
        return {}
    pinned = sorted(VERSION.findall(lock.read_text('utf-8')))
    return {
        'versions': _digest(*(str(pin) for pin in pinned if pin[0] in RUN_AND_DRAW)),
        OTHERS: _digest(*(str(pin) for pin in pinned if pin[0] not in RUN_AND_DRAW)),
    }


def _files(folder: Path) -> list[Path]:
    """Return the files of a package, without what Python, editors and systems leave there."""
    return sorted(
        file
        for file in folder.rglob('*')
        if file.is_file()
        and not file.name.endswith(('~', '.pyc', '.tmp'))
        and not any(part.startswith('.') for part in file.relative_to(folder).parts)
    )


def _digest_of_files(files: list[Path]) -> str:
    return _digest(*(f'{file.name}\n{_content(file)}' for file in files))


def _content(file: Path) -> str:
    text = file.read_bytes().decode(errors='surrogateescape')
    if file.suffix != '.py':
        return text
    try:
        return json.dumps(_code(ast.parse(text)))
    except SyntaxError:  # a file with a fault, which a lesson shows
        return text


def _code(node: object) -> object:
    """Return what Python reads of a syntax tree, the same in each version of Python.

    Docstrings and places are left out, and empty fields, which newer versions add.
    """
    if isinstance(node, list):
        return [_code(item) for item in node]
    if not isinstance(node, ast.AST):
        return repr(node)
    if isinstance(node, ast.JoinedStr):  # Python 3.12 ends some f-strings with an empty text
        node.values = [part for part in node.values if getattr(part, 'value', None) != '']
    body = getattr(node, 'body', None)
    is_documented = isinstance(
        node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    ) and ast.get_docstring(node, clean=False)
    fields = {
        name: _code(body[1:] if name == 'body' and is_documented else value)
        for name, value in ast.iter_fields(node)
        if value not in (None, [])
    }
    return [type(node).__name__, fields]


def _digests_of_sources(cells: list[NotebookNode]) -> list[str]:
    return [_digest(cell.source) for cell in cells]


def _digests_of_outputs(cells: list[NotebookNode]) -> list[str]:
    return [_digest(json.dumps(cell.outputs, sort_keys=True)) for cell in cells]


def _digest(*texts: str) -> str:
    """Return eight hexadecimal digits: nobody forges them, and two changes a year are no crowd."""
    whole = hashlib.sha256()
    for text in texts:
        whole.update(f'{len(text)} {text}'.encode(errors='surrogateescape'))
    return whole.hexdigest()[:8]
