"""What an answer names that no answer needs: read as text and as a syntax tree, nothing runs.

It is no proof. A teacher reads the answers that are named.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator

# What forges a verdict, or finds an answer, would use: in any text, of a shell as well.
TEXT = re.compile(
    r'helpers\.checks|helpers/checks|ros2_notebooks|sys\.modules|get_ipython|gc\.get_|_getframe'
    r'|ctypes|/proc/|\.ipynb|tests/answers|__globals__|__closure__|__code__|inspect\.|importlib'
    r'|ipykernel|multiprocessing|builtins|settrace|setprofile|mock|%borrow|find / |\bgdb\b'
)
MODULES = {
    *('gc', 'ctypes', 'inspect', 'importlib', 'ipykernel', 'IPython', 'multiprocessing', 'types'),
    *('builtins', 'runpy', 'code', 'marshal', 'pickle', 'mmap', 'jupyter_client', 'zmq', 'mock'),
    *('nbformat', 'psutil', 'unittest', 'zipimport', 'pkgutil', 'cffi', 'tracemalloc', 'helpers'),
    *('classroom', 'tools', 'base64', 'codecs', 'socket', 'atexit', 'faulthandler', 'site'),
}
CALLS = {
    *('exec', 'eval', 'compile', '__import__', 'globals', 'locals', 'vars', 'setattr', 'delattr'),
    *('get_ipython', 'breakpoint', '__builtins__', '__loader__', '__spec__', 'In', '_ih'),
}
ATTRIBUTES = {
    *('tb_frame', 'f_back', 'f_globals', 'f_locals', 'gi_frame', 'cr_frame', 'cell_contents'),
    *('user_ns', 'addaudithook', 'audit', 'meta_path', 'path_hooks', 'settrace', 'setprofile'),
    *('_getframe', '_current_frames', 'modules', 'memfd_create'),
}
USUAL = {
    *('__init__', '__name__', '__enter__', '__exit__', '__class__', '__doc__', '__file__'),
    *('__len__', '__iter__', '__next__', '__call__', '__str__', '__repr__', '__main__'),
}


def reaches_for(source: str, taught: Iterable[str]) -> list[str]:
    """Return what a source names that judges it or knows answers, and that the lesson does not."""
    taught = '\n'.join(taught)
    found = {*TEXT.findall(source)} - {*TEXT.findall(taught)}
    return sorted(found | {*_in_tree(source)} - {*_in_tree(taught)})


def _in_tree(source: str) -> Iterator[str]:
    """Yield it for the parts of a source that are Python; a magic is a line that is left out."""
    lines = [line for line in source.splitlines() if not line.lstrip().startswith(('%', '!'))]
    try:
        tree = ast.parse('\n'.join(lines))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return
    imported = set()
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.Import):
            names = [one.name for one in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f'{node.module or ""}.{one.name}' for one in node.names]
        if isinstance(node, ast.Import | ast.ImportFrom):
            imported |= {(one.asname or one.name).partition('.')[0] for one in node.names}
        yield from (name.partition('.')[0] for name in names if name.partition('.')[0] in MODULES)
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in CALLS:
            yield node.id
        elif isinstance(node, ast.Attribute):
            dunder = re.fullmatch(r'__\w+__', node.attr) and node.attr not in USUAL
            if dunder or node.attr in ATTRIBUTES:
                yield node.attr
            if isinstance(node.ctx, ast.Store | ast.Del) and _root(node) in imported:
                yield f'{ast.unparse(node)[:40]} ='
        elif isinstance(node, ast.Call) and _root(node.func) == 'getattr':
            yield from ('getattr' for one in node.args[1:2] if not isinstance(one, ast.Constant))


def _root(node: ast.AST) -> str:
    while isinstance(node, ast.Attribute | ast.Subscript | ast.Call):
        node = node.func if isinstance(node, ast.Call) else node.value
    return node.id if isinstance(node, ast.Name) else ''
