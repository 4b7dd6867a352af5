"""The nodes that lesson 14 imports are those that lesson 13 writes, which nbval runs."""

import ast
import inspect

import nbformat
import pytest

from helpers.fusion import nodes
from tools.lessons.lesson import FOLDER


class WithoutDocstrings(ast.NodeTransformer):
    def visit_Expr(self, node):  # noqa: N802
        is_text = isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        return None if is_text else node


def statements(source):
    """Return the source of what a module or a cell defines, by its first line or its name."""
    found = {}
    for node in WithoutDocstrings().visit(ast.parse(source)).body:
        if isinstance(node, ast.Assign | ast.FunctionDef | ast.ClassDef):
            text = ast.unparse(node)
            found[getattr(node, 'name', text.partition(' = ')[0])] = text
    return found


@pytest.fixture(scope='module')
def lesson():
    (path,) = FOLDER.glob('*_fuse_odometry_imu_and_gps.ipynb')
    found = {}
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == 'code':
            found |= statements(cell.source)
    return found


MODULE = statements(inspect.getsource(nodes))


@pytest.mark.parametrize('name', MODULE)
def test_the_lesson_writes_it_so(name, lesson):
    assert lesson.get(name) == MODULE[name]
