"""What the code of a cell gives away."""

import ast
import re
from collections.abc import Iterator

from IPython.core.inputtransformer2 import TransformerManager

TOO_SHORT = '', 'True', 'False', 'yes', 'no'  # such a word is in many a sentence, and tells nothing


def given_away(source: str, question: str, answer: str) -> Iterator[str]:
    """Yield what in the code of a cell gives away the answer of a guess.

    That is an outcome that was written and not measured, a reason that names the answer, and a
    comparison with it. `answer` is as it was printed; empty, it moves from run to run, and then
    no distance from a number may be written, as in `abs(len(heard) - 20) < 4`.
    """
    try:
        tree = ast.parse(TransformerManager().transform_cell(source))
    except SyntaxError:
        return
    stored = [n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and type(n.ctx) is ast.Store]
    texts = {
        node.targets[0].id: node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and stored.count(node.targets[0].id) == 1
    }
    for node in ast.walk(tree):
        match node:
            case ast.Call(ast.Name('compare_prediction'), [ast.Constant(text), _, outcome, *_]):
                if text != question:
                    continue
                if isinstance(outcome, ast.Name):
                    outcome = texts.get(outcome.id, outcome)
                if _is_written(outcome):
                    yield f'the outcome is written, {ast.unparse(outcome)}'
                for word in node.keywords:
                    reason = texts.get(getattr(word.value, 'id', ''), word.value)
                    if word.arg == 'because' and _is_written(reason):
                        yield 'because= is a text that one reads before, write it below'
                    elif word.arg == 'because' and _names(reason, answer):
                        yield f'because= names {answer}'
            case ast.Compare(_, [ast.Eq()], [value]) if answer not in TOO_SHORT:
                if _is_number(value) and str(value.value) == answer:
                    yield ast.unparse(node)
            case ast.Compare(left, [ast.Lt() | ast.LtE()], [_]) if not answer:
                match left:
                    case ast.Call(ast.Name('abs'), [ast.BinOp(_, ast.Sub(), center)]):
                        if _is_number(center):
                            yield ast.unparse(node)
            case ast.Call(ast.Name('approx') | ast.Attribute(_, 'approx'), [center, *_]):
                if _is_number(center) and str(center.value) == answer:
                    yield ast.unparse(node)


def _is_number(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def _is_written(node: ast.AST) -> bool:
    """Return whether an expression is a value and nothing that was measured."""
    try:
        ast.literal_eval(node)
    except ValueError:
        return False
    return True


def _names(reason: ast.AST, answer: str) -> bool:
    """Return whether a reason that stands in the code has the answer as a word of its own."""
    if answer in TOO_SHORT:
        return False
    parts = [node.value for node in ast.walk(reason) if isinstance(node, ast.Constant)]
    text = ' '.join(part for part in parts if isinstance(part, str))
    return bool(re.search(rf'(?<![\w.]){re.escape(answer)}(?![\w]|\.\d)', text))
