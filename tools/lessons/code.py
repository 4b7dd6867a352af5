"""What the code of a cell says."""

import ast
import symtable

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


def names_of(cell: NotebookNode) -> tuple[set[str], set[str]]:
    """Return the names that a cell gives, and those that it takes from other cells."""
    try:
        plain = TransformerManager().transform_cell(cell.source)
        top = symtable.symtable(plain, 'cell', 'exec')
    except SyntaxError:  # of a lesson that is being written
        return set(), set()
    given = {symbol.get_name() for symbol in top.get_symbols() if symbol.is_assigned()}
    taken, inside = set(), [top]
    for table in inside:
        taken |= {symbol.get_name() for symbol in table.get_symbols() if symbol.is_global()}
        inside += table.get_children()
    return given, taken - given
