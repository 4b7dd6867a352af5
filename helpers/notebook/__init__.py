"""What a cell of a notebook needs before ROS comes: interrupts, a bar, lines, letters, colours.

Each kernel loads this room when it starts, and whatever comes through this door loads only its own
module: pandas, which `values` needs, or Jupyter's server, which `fresh` needs, take a second.
"""

from importlib import import_module

MODULES = {
    'fresh': ('AS_SAVED', 'MARK'),
    'interrupts': ('at_each_signal', 'uninterrupted'),
    'kernel': ('can_ask', 'hear_while_a_cell_runs'),
    'look': ('LOOK', 'LOOK_CSS', 'LOOK_FILE'),
    'names': ('names_of',),
    'own_code': ('is_students', 'own_line', 'places'),
    'progress_bar': ('ProgressBar', 'somebody_watches'),
    'text': ('table', 'wrap'),
    'threads': ('frames',),
    'values': (
        'RUN_COLUMNS',
        'check_columns',
        'check_count',
        'check_table',
        'chosen',
        'column_of_numbers',
        'natural',
        'shown',
    ),
}
MODULE_OF = {name: module for module, names in MODULES.items() for name in names}

__all__ = list(MODULE_OF)


def __getattr__(name: str) -> object:
    """Return what a module of this room has, when it is asked for the first time (PEP 562)."""
    if name not in MODULE_OF:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(import_module(f'{__name__}.{MODULE_OF[name]}'), name)
    globals()[name] = value
    return value
