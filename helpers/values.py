"""What is given to a function: how a sentence shows it, and does a table hold numbers?"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

LONGEST = 200  # characters of a value that a sentence can hold


def shown(value: object) -> str:
    """Return how a value looks, for a sentence: its repr, or its type where that is long."""
    text = repr(value)
    return f'this {type(value).__name__}' if '\n' in text or len(text) > LONGEST else text


def check_columns(table: pd.DataFrame, names: Iterable[str]) -> None:
    """Raise TypeError unless `table` is a DataFrame, ValueError where a column or all rows lack."""
    if not isinstance(table, pd.DataFrame):
        raise TypeError(f'The table must be a DataFrame, not {type(table).__name__}.')
    missing = [name for name in names if name not in table.columns]
    if missing:
        raise ValueError(f'The table lacks the column(s) {", ".join(missing)}.')
    if table.empty:
        raise ValueError('The table is empty: it needs at least one row.')


def column_of_numbers(table: pd.DataFrame, name: str) -> np.ndarray:
    """Return a column as floats, NaN where it has no value. Raises TypeError for anything else."""
    try:
        return table[name].to_numpy(float, na_value=np.nan)
    except (TypeError, ValueError):
        raise TypeError(f'The column {name} must hold numbers.') from None
