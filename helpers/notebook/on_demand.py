"""Names of a package whose modules are loaded when somebody asks for them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module


def load_on_demand(package: str, names: Mapping[str, Sequence[str]]) -> Callable[[str], object]:
    """Return the `__getattr__` of a package that loads a module when a name of it is wanted.

    `names` has the names of the API by the modules that define them: `{'text': ('wrap',)}`. The
    first `from package import wrap` loads `package.text`, and no other module (PEP 562).
    """
    module_of = {name: module for module, those in names.items() for name in those}

    def load(name: str) -> object:
        if name not in module_of:
            raise AttributeError(f'module {package!r} has no attribute {name!r}')
        value = getattr(import_module(f'{package}.{module_of[name]}'), name)
        setattr(sys.modules[package], name, value)  # the next time nothing is asked
        return value

    return load
