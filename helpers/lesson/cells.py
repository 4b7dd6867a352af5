"""The cells of a notebook, also of one that somebody has changed or broken."""

from __future__ import annotations

import base64
import json
import re
import zlib
from typing import NamedTuple

LONGEST_NAME = 40  # letters of a cell's first line that are enough to find it
FOLD = {'jupyter': {'source_hidden': True}}  # the metadata of a cell that JupyterLab folds
KEPT = 'ros2_notebooks_lends'  # in the metadata of a check: what it lends
QUESTION = '### Question '
MAGIC = re.compile(r'\s*%%(\w+)[ \t]*(.*)\n?')
FILE = re.compile(r'(.*?)(?: part (\d+))?')
FOR_INSTRUCTORS = r'## \d+\. For instructors'


class Node(dict):
    """A part of a notebook whose keys are attributes too, as nbformat's are.

    To read a notebook with nbformat, which validates it, takes six times as long.
    """

    def __getattr__(self, name: str) -> object:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(name) from None

    def __setattr__(self, name: str, value: object) -> None:
        self[name] = value


def cells_of(data: bytes | str) -> list[Node]:
    """Return the cells of a notebook. What is no cell is left out, and no cell lacks a part.

    Raises ValueError with the end of a sentence if the data are no notebook.
    """
    if not data.strip():
        raise ValueError('it is empty')
    try:
        notebook = json.loads(data, object_hook=Node)
    except (ValueError, RecursionError):
        raise ValueError(_why_no_json(data)) from None
    cells = notebook.get('cells') if isinstance(notebook, dict) else None
    if not isinstance(cells, list):
        raise ValueError('it is no notebook: it has no cells')
    return [_whole(cell) for cell in cells if isinstance(cell, dict)]


def _whole(cell: Node) -> Node:
    """Give a cell a type, a source, an id, metadata and tags of the right kinds."""
    source = cell.get('source', '')
    if isinstance(source, list):
        source = ''.join(line for line in source if isinstance(line, str))
    source = source if isinstance(source, str) else ''
    # Half of a pair of UTF-16, which JSON may name, is no text.
    cell.source = source.encode('utf-8', 'replace').decode()
    cell.cell_type, cell.id = str(cell.get('cell_type')), str(cell.get('id', ''))
    metadata = cell.get('metadata')
    cell.metadata = metadata if isinstance(metadata, dict) else Node()
    named = cell.metadata.get('tags')
    named = named if isinstance(named, list) else []
    cell.metadata['tags'] = [tag for tag in named if isinstance(tag, str)]
    return cell


def _why_no_json(data: bytes | str) -> str:
    data = data.encode('utf-8', 'replace') if isinstance(data, str) else data
    start = data.lstrip()[:1000].lower()
    if start.startswith((b'<!doctype', b'<html')):
        return 'it is a web page, no notebook'
    if re.search(rb'^(<{7}|>{7}) ', data, re.MULTILINE):
        return 'it is broken: git has left its marks of a conflict in it'
    return 'it is broken: it is no JSON'


def tags(cell: Node) -> set[str]:
    """Return the tags of a cell."""
    return set(cell.metadata.get('tags', []))


def is_folded(cell: Node) -> bool:
    """Return whether JupyterLab shows only the first line of a cell."""
    return bool(cell.metadata.get('jupyter', {}).get('source_hidden'))


class Magic(NamedTuple):
    """A cell as IPython reads it: `%%NAME LINE`, and a body. The name of other cells is empty."""

    name: str
    line: str
    body: str

    @property
    def file(self) -> str:
        """The file that `%%write` makes, or a part of it; empty for other cells."""
        return path_and_part(self.line)[0] if self.name == 'write' else ''


def magic_of(source: str) -> Magic:
    """Return the magic with which a cell begins, its line, and the rest of the cell."""
    if not (found := MAGIC.match(source)):
        return Magic('', '', source)
    return Magic(found[1], found[2].strip(), source[found.end() :])


def path_and_part(line: str) -> tuple[str, int | None]:
    """Return the file that a line of `%%write` names, and which part of it, None for all of it."""
    path, part = FILE.fullmatch(line.strip()).groups()
    return path.strip('\'"'), part and int(part)


def keep_solution(cell: Node, source: str) -> None:
    """Keep the code of a solution in a check, in a form that nobody reads by chance.

    In an edition without solutions a student can borrow it, and go on. It is in the notebook, as
    that is all that a student has for certain: on a hub, in an update, in a folder of one's own. It
    is no secret: with it a student could solve the task, as with the solution of a friend.
    """
    cell.metadata[KEPT] = base64.b85encode(zlib.compress(source.encode(), 9)).decode()


def kept_solution(cell: Node) -> str:
    """Return the code of the solution that a check keeps, empty if it keeps none."""
    try:
        return zlib.decompress(base64.b85decode(cell.metadata.get(KEPT, ''))).decode()
    except (ValueError, zlib.error, TypeError):
        return ''


def called(cell: Node) -> str:
    """Return how a cell is called: by its first words, and by its id.

    JupyterLab finds the words with Ctrl+F, and the id at the end of its address, such as
    02_lose_messages.ipynb#cell-id=check-02-1.
    """
    words = next((line.strip() for line in cell.source.splitlines() if line.strip()), '')
    return f'"{words[:LONGEST_NAME]}" ({cell.id})'


def has_heading(cell: Node, form: str) -> bool:
    """Return whether a cell of text begins with a heading of this form, a regular expression."""
    return cell.cell_type == 'markdown' and bool(re.match(form, cell.source))


def is_for_instructors(cell: Node) -> bool:
    """Return whether a cell of text is for teachers, who have more than a student's edition."""
    return has_heading(cell, FOR_INSTRUCTORS)


def is_question(cell: Node) -> bool:
    """Return whether a cell is a question of the quiz."""
    return has_heading(cell, QUESTION)


def first_heading(text: str) -> str:
    """Return the first line of a text without the signs of a heading."""
    return text.splitlines()[0].lstrip('# ')
