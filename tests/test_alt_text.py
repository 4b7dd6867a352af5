"""What is said about a figure. nbval compares what each picture of a lesson says.

tools/test_run.py shows figures in a real kernel.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from helpers import plots
from helpers.alt_text import alt_text, describe


@pytest.fixture(autouse=True)
def close_figures():
    plt.switch_backend('agg')
    yield
    plt.close('all')


def run(lost=(), delay_s=0.01, overlap=False):
    """Return the table of a run of 12 messages, one each 0.1 s; a callback takes 0.05 s or 0.15."""
    table = pd.DataFrame({'seq': range(12), 'published_s': 0.1 * np.arange(12)})
    started = table.published_s + delay_s
    return table.assign(
        started_s=started.mask(table.seq.isin(lost)),
        finished_s=(started + (0.15 if overlap else 0.05)).mask(table.seq.isin(lost)),
        thread=[None if n in lost else f'thread {n % 2 + 1}' for n in range(12)],
    )


DRAW = {
    'sequence_gaps': lambda table: plots.sequence_gaps(table, depth=3),
    'before_and_after': lambda table: plots.before_and_after(table, table, ('a', 'b')),
    'timeline': lambda table: plots.timeline(table, depth=3),
    'queue_length': lambda table: plots.queue_length(table, 3),
    'latency': lambda table: plots.latency(table, 0.1),
}
each_plot = pytest.mark.parametrize('draw', DRAW.values(), ids=DRAW)


def said(draw, *arguments):
    drawn = draw(*arguments)
    text = alt_text(getattr(drawn, 'figure', drawn))
    plt.close('all')
    return text


def test_title_description_and_axes_of_a_figure():
    assert alt_text(plt.figure()) == 'A figure without a title.'
    figure, ax = plt.subplots()
    ax.set(title='A drive', xlabel='x (m)', ylabel='y (m)')
    assert alt_text(figure) == 'A drive. Horizontal axis: x (m). Vertical axis: y (m).'
    describe(ax, 'A circle, twice.')
    assert alt_text(figure).startswith('A drive. A circle, twice. Horizontal')
    describe(ax, 'One circle.', title='Moves')
    assert alt_text(figure).startswith('Moves. One circle. Horizontal')


def test_each_of_several_axes_has_its_turn():
    figure, (left, right) = plt.subplots(1, 2)
    figure.suptitle('Two\nruns')
    right.set_title('Which one?', loc='left')
    describe(left, 'A line.')
    assert alt_text(figure) == 'Two runs. Picture 1 of 2. A line. Picture 2 of 2. Which one?'


@each_plot
def test_the_result_of_a_run_is_said_and_not_what_moves_from_run_to_run(draw):
    text = said(draw, run(lost=[4, 5, 6]))
    assert said(draw, run(lost=[5, 6, 7, 9], delay_s=0.02)) == text
    assert said(draw, run(overlap=True)) != text


def test_what_no_lesson_shows_in_words():
    assert 'None was heard: crosses.' in said(plots.sequence_gaps, run(lost=range(12)))
    assert 'No two callbacks overlap.' in said(plots.timeline, run(lost=range(12)))
    assert 'None is pushed out.' in said(plots.queue_length, run(), 3)
