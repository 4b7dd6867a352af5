"""What the code of a cell says."""

import ast

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
