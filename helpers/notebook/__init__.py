"""What a cell of a notebook needs before ROS comes: interrupts, a bar, lines, letters, colours.

Each kernel and each program of ours loads this package when it starts, so a name loads only the
module that defines it: pandas, which `tables` needs, IPython, which `names` needs, or Jupyter's
server, which `fresh` needs, take up to a second.
"""

from helpers.notebook.on_demand import load_on_demand

MODULES = {
    'fresh': ('AS_SAVED', 'MARK'),
    'interrupts': ('PatientInterrupt', 'at_each_signal', 'run_command', 'uninterrupted'),
    'kernel': ('can_ask', 'hear_while_a_cell_runs'),
    'look': ('LOOK', 'LOOK_CSS'),
    'names': ('names_of',),
    'on_demand': ('load_on_demand',),
    'own_code': ('is_students', 'own_line', 'places'),
    'progress_bar': ('BEGIN_EMPTY', 'ProgressBar', 'somebody_watches'),
    'tables': ('check_columns', 'column_of_numbers'),
    'text': ('table', 'wrap'),
    'threads': ('frames',),
    'values': ('check_count', 'chosen', 'shown'),
}

__all__ = [name for names in MODULES.values() for name in names]
__getattr__ = load_on_demand(__name__, MODULES)
