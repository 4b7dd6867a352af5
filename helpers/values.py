"""What is given to a function: is it a number, and does a column hold numbers?"""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Real

import numpy as np
import pandas as pd
from pandas.api.types import is_complex_dtype, is_numeric_dtype

# No number of seconds or metres here is greater: a clock that counts from 1970 is at 1.8e9.
MOST = 1e12
LONGEST = 200  # characters of a value that a sentence can hold


def shown(value: object) -> str:
    """Return how a value looks, for a sentence: its repr, or its type where that is long."""
    try:
        text = repr(value)
    except Exception:  # of whatever was given: an int of 5000 digits has none
        text = '\n'
    return f'this {type(value).__name__}' if '\n' in text or len(text) > LONGEST else text


def items(value: object) -> list | None:
    """Return what a list, a tuple or the like holds, or None for a value that holds nothing."""
    try:
        return list(value)
    except TypeError:
        return None


def is_number(value: object) -> bool:
    """Return whether a value is a number, neither NaN nor beyond MOST. True and False are none."""
    return isinstance(value, Real) and not isinstance(value, bool) and bool(abs(value) <= MOST)


def check_columns(table: pd.DataFrame, names: Iterable[str], what: str = 'The table') -> None:
    """Raise TypeError unless `table` is a DataFrame, ValueError unless it has each column once."""
    if not isinstance(table, pd.DataFrame):
        raise TypeError(f'{what} must be a DataFrame, not {type(table).__name__}.')
    columns = list(table.columns)
    missing = [name for name in names if name not in columns]
    if missing:
        raise ValueError(f'{what} lacks the column(s) {", ".join(missing)}.')
    twice = [name for name in names if columns.count(name) > 1]
    if twice:
        raise ValueError(f'{what} has the column(s) {", ".join(twice)} more than once.')


def column_of_numbers(table: pd.DataFrame, name: str) -> np.ndarray:
    """Return a column as floats, with NaN where it has no value.

    Raises TypeError for a column of anything else, ValueError for a number beyond MOST.
    """
    column = table[name].infer_objects()
    if column.isna().all():
        return np.full(len(column), np.nan)
    if not is_numeric_dtype(column) or is_complex_dtype(column):
        raise TypeError(f'The column {name} must hold numbers.')
    values = column.to_numpy(float, na_value=np.nan)
    if np.isinf(values).any():
        raise ValueError(f'The column {name} must be finite, or NaN where it has no value.')
    if (np.abs(values) > MOST).any():
        raise ValueError(f'The column {name} must hold numbers of at most {MOST:g}.')
    return values


def column_of_whole_numbers(table: pd.DataFrame, name: str) -> np.ndarray:
    """Return a column as ints. Raises TypeError or ValueError for anything else."""
    values = column_of_numbers(table, name)
    if not (values == np.floor(values)).all():
        raise ValueError(f'The column {name} must hold whole numbers.')
    return values.astype(int)


def column_of_text(table: pd.DataFrame, name: str) -> list[str]:
    """Return a column as a list of str. Raises TypeError for anything else."""
    values = table[name].tolist()
    if not all(isinstance(value, str) for value in values):
        raise TypeError(f'The column {name} must hold text.')
    return values
