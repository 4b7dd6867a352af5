"""Sliders for the model of a queue."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib.pyplot as plt

from helpers.plots.runs import queue_length, sequence_gaps
from helpers.recording import predict

if TYPE_CHECKING:
    from ipywidgets import VBox


def model_with_sliders() -> VBox:
    """Return sliders for the model of a queue, and two pictures of it."""
    import ipywidgets as widgets  # slow to load, and one lesson needs it

    def draw(period_ms, callback_ms, depth, threads):
        model = predict(period_ms / 1000, callback_ms / 1000, depth, threads, messages=100)
        figure, panels = plt.subplots(1, 2, figsize=(11, 4.2), dpi=90, layout='constrained')
        sequence_gaps(model, depth=depth, ax=panels[0])
        queue_length(model, depth, ax=panels[1])
        plt.show()

    ranges = {
        'period_ms': (50, 5, 200),
        'callback_ms': (200, 5, 500),
        'depth': (10, 1, 50),
        'threads': (1, 1, 8),
    }
    sliders = {
        name: widgets.IntSlider(*numbers, description=name, continuous_update=False)
        for name, numbers in ranges.items()
    }
    return widgets.VBox([*sliders.values(), widgets.interactive_output(draw, sliders)])
