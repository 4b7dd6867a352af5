"""What the code of a cell says."""

import ast
import symtable
from typing import NamedTuple

from IPython.core.inputtransformer2 import TransformerManager
from nbformat import NotebookNode

from tools.lessons.lesson import tags


def guess_of(cell: NotebookNode) -> tuple[str, str, object] | None:
    """Return the variable, the question and the value of a predict cell, None for other cells.

    It ends in `my_guess = guess('How many are heard?', 41)`.
    """
    if 'predict' not in tags(cell):
        return None
    try:
        plain = TransformerManager().transform_cell(cell.source)  # a magic becomes a call
        match ast.parse(plain).body:
            case [
                *_,
                ast.Assign(
                    [ast.Name(variable)],
                    ast.Call(ast.Name('guess'), [ast.Constant(str(question)), value]),
                ),
            ]:
                return variable, question, ast.literal_eval(value)
    except (SyntaxError, ValueError):  # of a lesson that is being written
        pass
    return None


class Names(NamedTuple):
    """The names in a cell: those it assigns, those it imports, and those of other cells it uses."""

    given: set[str] = set()
    imported: set[str] = set()
    taken: set[str] = set()


def names_of(source: str) -> Names:
    """Return the names in the source of a cell; none of a lesson that is being written."""
    try:
        plain = TransformerManager().transform_cell(source)
        top = symtable.symtable(plain, 'cell', 'exec')
    except SyntaxError:
        return Names()
    given = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_assigned()}
    imported, used, tables = set(), set(), [top]
    for table in tables:
        imported |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_imported()}
        used |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global()}
        tables += table.get_children()
    return Names(given, imported, used - given - imported)
