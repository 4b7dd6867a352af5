"""The table of a run, recorded or predicted: one row a message."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from helpers.notebook import check_columns, column_of_numbers

if TYPE_CHECKING:
    import pandas as pd

RUN_COLUMNS = ['seq', 'published_s', 'started_s', 'finished_s', 'thread']


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


def thread_order(thread: str) -> list:
    """Return a sort key of the name of a thread: 'thread 2' comes before 'thread 10'."""
    return [int(part) if part.isdecimal() else part for part in re.split(r'(\d+)', thread)]
