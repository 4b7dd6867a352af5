"""The names in the code of a cell."""

from __future__ import annotations

import ast
import re
import symtable
from typing import NamedTuple

from IPython.core.inputtransformer2 import TransformerManager

# `NAME =`, `class NAME` or `def NAME` at the beginning of a line:
BEGINS_LINE = re.compile(r'^(?:class +|def +|(?=\w+ *=(?!=)))(\w+)', re.MULTILINE)


class Names(NamedTuple):
    """The names in a cell: those it assigns, those it imports, and those of other cells it uses."""

    given: set[str] = set()
    imported: set[str] = set()
    taken: set[str] = set()


def names_of(source: str) -> Names:
    """Return the names in the source of a cell.

    What is assigned inside a function does not count. Of a cell that Python cannot read, only the
    names are known that it gives at the beginning of a line.
    """
    try:
        plain = TransformerManager().transform_cell(source)  # a magic becomes a call
        top = symtable.symtable(plain, 'cell', 'exec')
    except (SyntaxError, ValueError):
        return Names(set(BEGINS_LINE.findall(source)))
    given = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_assigned()}
    given -= _only_deleted(plain)  # for symtable, `del name` assigns it
    imported, used, tables = set(), set(), [top]
    for table in tables:
        imported |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_imported()}
        used |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global()}
        tables += table.get_children()
    return Names(given, imported, used - given - imported)


def _only_deleted(code: str) -> set[str]:
    names = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Name)]
    stored = {name.id for name in names if isinstance(name.ctx, ast.Store)}
    return {name.id for name in names if isinstance(name.ctx, ast.Del)} - stored
