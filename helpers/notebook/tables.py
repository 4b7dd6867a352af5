"""A table that is given to a function: does it have the columns that are needed?"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


def check_columns(table: pd.DataFrame, names: Iterable[str]) -> None:
    """Raise TypeError unless it is a DataFrame, ValueError if a column or all rows are missing."""
    import pandas as pd  # loaded when a table is made: it takes 0.2 s

    if not isinstance(table, pd.DataFrame):
        raise TypeError(f'The table must be a DataFrame, not {type(table).__name__}.')
    missing = [name for name in names if name not in table.columns]
    if missing:
        raise ValueError(f'The table lacks the column(s) {", ".join(missing)}.')
    if table.empty:
        raise ValueError('The table is empty: it needs at least one row.')


def column_of_numbers(table: pd.DataFrame, name: str) -> np.ndarray:
    """Return a column as floats, NaN for a missing value. Raises TypeError for anything else."""
    try:
        return table[name].to_numpy(float, na_value=np.nan)
    except (TypeError, ValueError):
        raise TypeError(f'The column {name} must hold numbers.') from None
