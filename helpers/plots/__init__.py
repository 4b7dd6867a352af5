"""Pictures of recorded and of predicted runs, of graphs and of drives, all in one style.

Every function takes tables and draws them; it knows no node and no filter. The axes have units, the
legend counts, and no meaning depends on a colour alone. Each picture has an alternative text. A run
that cannot be drawn raises TypeError or ValueError, with one sentence.
"""

from helpers.plots.alt_text import describe, show
from helpers.plots.bags import draw_bag
from helpers.plots.comparisons import bars, sweep
from helpers.plots.drives import error, frame_tree, gate, path, scans
from helpers.plots.explorer import model_with_sliders
from helpers.plots.runs import before_and_after, latency, queue_length, sequence_gaps, timeline

__all__ = [
    'draw_bag',
    'model_with_sliders',
    'bars',
    'before_and_after',
    'describe',
    'error',
    'frame_tree',
    'gate',
    'latency',
    'path',
    'queue_length',
    'scans',
    'sequence_gaps',
    'show',
    'sweep',
    'timeline',
]
