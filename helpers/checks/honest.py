"""What makes a verdict worth something: nothing equals everything, and nobody changes the judge.

The code of a student runs in the process that judges it, so nothing here is proof against one that
wants to forge a verdict and knows how. It is there so that the simple ways do not pass, and that a
wrong pass is not kept: see also the canary of `classroom/grade`.
"""

from __future__ import annotations

import builtins
import sys
from collections.abc import Iterator
from functools import wraps
from types import FunctionType, ModuleType

from helpers.notebook import is_students

CHANGED = 'your code has changed what judges it: {}'
# Of the modules through which a verdict goes. Those of the lessons are known by `helpers.checks.`
WATCHED = (
    *('builtins', 'multiprocessing.connection', 'IPython.core.display_functions'),
    *('IPython.core.displaypub', 'ipykernel.zmqshell', 'helpers.lesson.lesson'),
)
Item = tuple[str, str]  # a module, and the path of a name in it


# --- What equals everything -----------------------------------------------------------------------


class _Nothing:
    """What no answer can be equal to."""


def refuse_what_equals_everything() -> None:
    """Let no object of the student's classes be equal to all others. Call it in the worker.

    A class may say what is equal to it, and one that says so of everything would pass each test
    that compares. An object of such a class is from now on equal to nothing but itself.
    """
    for cls in _all_classes():
        _mend(cls)
    plain = builtins.__build_class__

    def build_class(*arguments: object, **words: object) -> type:
        cls = plain(*arguments, **words)
        if isinstance(cls, type):
            _mend(cls)
        return cls

    builtins.__build_class__ = build_class


def mend_new_classes() -> None:
    """Do the same for classes that `type(...)` has made meanwhile."""
    for cls in _all_classes():
        _mend(cls)


def _all_classes() -> Iterator[type]:
    """Yield the classes of the student, and those of `unittest.mock`, whose ANY equals all."""
    known, open_ = {object}, [object]
    while open_:
        for cls in type.__subclasses__(open_.pop()):
            if cls not in known:
                known.add(cls)
                open_.append(cls)
    return (cls for cls in known if '__eq__' in vars(cls))


def _mend(cls: type) -> None:
    equal = vars(cls).get('__eq__')
    code = getattr(equal, '__code__', None)
    if code is None or hasattr(equal, 'is_mended'):
        return
    if not is_students(code.co_filename) and cls.__module__ != 'unittest.mock':
        return

    @wraps(equal)
    def __eq__(self: object, other: object) -> object:  # noqa: N807 - it takes its place
        if self is other:
            return True
        answer = equal(self, other)
        if answer is not NotImplemented and answer and equal(self, _Nothing()):
            return False
        return answer

    __eq__.is_mended = True
    hashed = vars(cls).get('__hash__')
    cls.__eq__ = __eq__
    if hashed is not None:
        cls.__hash__ = hashed


# --- What judges ----------------------------------------------------------------------------------


class Untouched:
    """The functions through which a verdict goes, as they were when this was made.

    `look()` returns what has changed since then, in words; nothing is the usual answer.
    """

    def __init__(self) -> None:
        self._known: dict[Item, tuple[object, object]] = {}
        self._modules: set[str] = set()
        self.look()

    def look(self) -> str:
        """Return the name of something that has changed, or an empty text; know new modules."""
        names = [name for name in [*sys.modules] if name.startswith('helpers.checks')]
        for name in (*WATCHED, *names):
            module = sys.modules.get(name)
            if not isinstance(module, ModuleType):
                continue
            now = dict(_functions(module))
            if name not in self._modules:
                self._modules.add(name)
                self._known |= {(name, path): found for path, found in now.items()}
                own = next((path for path, found in now.items() if _is_own(found[0])), '')
                if own:
                    return f'{name}.{own}'
        for (name, path), (value, code) in self._known.items():
            found = _find(sys.modules.get(name), path)
            if found is not value or getattr(found, '__code__', None) is not code:
                return f'{name}.{path}'
        return ''


def _functions(module: ModuleType) -> Iterator[tuple[str, tuple[object, object]]]:
    """Yield the functions of a module and of its classes, with their code."""
    for name, value in [*vars(module).items()]:
        if isinstance(value, FunctionType) or (
            module is builtins and callable(value) and name not in CHANGE_BY_THEMSELVES
        ):
            yield name, (value, getattr(value, '__code__', None))
        elif isinstance(value, type) and value.__module__ == module.__name__:
            for inner, function in [*vars(value).items()]:
                if isinstance(function, FunctionType):
                    yield f'{name}.{inner}', (function, function.__code__)


# IPython and the worker put their own in place of these.
CHANGE_BY_THEMSELVES = {
    *('__build_class__', 'display', 'exit', 'quit', 'get_ipython', 'input', 'print', 'open'),
    *('copyright', 'credits', 'license', 'help', '_', '__import__', '__debugger__'),
}


def _find(module: ModuleType | None, path: str) -> object:
    found: object = module
    for name in path.split('.'):
        found = vars(found).get(name) if found is not None else None
    return found


def _is_own(value: object) -> bool:
    code = getattr(value, '__code__', None)
    return code is not None and is_students(code.co_filename)
