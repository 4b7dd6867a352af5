"""Numbers beside each other: one quantity that was varied, or a few values."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from helpers.plots.alt_text import describe
from helpers.plots.style import (
    DPI,
    HEARD,
    INK,
    LARGE,
    NORMAL,
    SMALL,
    WIDE,
    in_words,
    label_axes,
    new_axes,
)


def sweep(results: pd.DataFrame, limit: float, limit_label: str, title: str) -> Figure:
    """Draw one panel a column of `results` over its index, for a quantity that was varied.

    Names are the axis labels: that of the index below, those of the columns (with their unit) above
    each panel. `limit` marks a value of the index with a line, `limit_label` says what it is.
    """
    figure = plt.figure(figsize=WIDE, dpi=DPI, layout='constrained')
    figure.suptitle(title, fontsize=LARGE, x=0.01, ha='left')
    panels = figure.subplots(1, results.shape[1], squeeze=False)[0]
    for ax, (name, values) in zip(panels, results.items(), strict=True):
        ax.plot(results.index, values, 'o-', color=HEARD, lw=2, ms=8)
        ax.set_ylim(bottom=0, top=1.15 * max(values.max(), 1e-9))
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        label_axes(ax, name, results.index.name or '', '')
        ax.title.set_fontsize(NORMAL)
        line = ax.axvline(limit, color=INK, ls='--', lw=1.8, label=limit_label)
        describe(
            ax,
            f'One dot for each of {in_words(f"{value:g}" for value in results.index)}, joined by a '
            f'line. A dashed line marks {limit}: {limit_label}.',
        )
    figure.legend(handles=[line], loc='upper right', fontsize=SMALL, frameon=False)
    return figure


def bars(values: pd.Series, xlabel: str) -> Axes:
    """Draw one horizontal bar a row of `values`, from the top, each with its value."""
    ax = new_axes(height=1.3 + 0.6 * len(values))
    names = values.index.astype(str)
    drawn = ax.barh(names, values.to_numpy(float), color=HEARD, height=0.6)
    texts = [f'{value:.0f}' if value >= 10 else f'{value:.2g}' for value in values]
    ax.bar_label(drawn, texts, padding=5, fontsize=NORMAL)
    ax.invert_yaxis()
    ax.margins(x=0.12)
    label_axes(ax, '', xlabel, '', grid='x')
    describe(ax, f'One horizontal bar, with its value, for each of: {in_words(names)}.')
    return ax
