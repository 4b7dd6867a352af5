"""What is given to a function: how a sentence shows it, how it is sorted, is it a good table?"""

from __future__ import annotations

import numbers
import re
from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

RUN_COLUMNS = ['seq', 'published_s', 'started_s', 'finished_s', 'thread']  # of the table of a run
LONGEST = 200  # characters of a value that a sentence can hold


def shown(value: object) -> str:
    """Return how a value looks, for a sentence: its repr, or its type if that is long."""
    text = repr(value)
    return f'this {type(value).__name__}' if '\n' in text or len(text) > LONGEST else text


def check_count(name: str, value: int) -> None:
    """Raise ValueError unless the value is a whole number from 1 up."""
    if not isinstance(value, numbers.Integral) or value < 1:
        raise ValueError(f'{name} must be a whole number from 1 up, not {shown(value)}.')


def chosen(name: str, given: Mapping | None, allowed: Iterable[str]) -> dict:
    """Return a dict (None: an empty one) whose keys are all allowed."""
    if not isinstance(given, Mapping | None):
        raise TypeError(f'{name} must be a dict, not {shown(given)}.')
    for key in given or {}:
        if key not in allowed:
            raise ValueError(f'{name} can name {", ".join(allowed)}, not {shown(key)}.')
    return dict(given or {})


def natural(name: str) -> list:
    """Sort key that puts 'thread 2' before 'thread 10'."""
    return [int(part) if part.isdecimal() else part for part in re.split(r'(\d+)', name)]


def check_columns(table: pd.DataFrame, names: Iterable[str]) -> None:
    """Raise TypeError unless it is a DataFrame, ValueError if a column or all rows are missing."""
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


def check_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a recording in the order of their sequence numbers.

    `seq` is then int, the times are float, and `thread` is a str, or None.

    Raises TypeError or ValueError, with one clear sentence, if `table` is not a recording.
    """
    check_columns(table, RUN_COLUMNS)
    seq = column_of_numbers(table, 'seq')
    if not (seq % 1 == 0).all():  # NaN is none
        raise ValueError('The column seq must hold whole numbers.')
    times = {name: column_of_numbers(table, name) for name in RUN_COLUMNS[1:4]}
    thread = table['thread'].astype(object)
    thread = thread.where(thread.notna(), None)
    table = table.assign(seq=seq.astype(int), thread=thread, **times)
    unknown = table.loc[table['published_s'].isna(), 'seq']
    if len(unknown):
        raise ValueError(f'It is not known when message {unknown.iloc[0]} was published.')
    return table.sort_values('seq', ignore_index=True)
