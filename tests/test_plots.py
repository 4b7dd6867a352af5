"""What the pictures show: the data of the artists, not pixels, which nbval never compares.

It compares what is said about them. tests/tools/test_run.py shows figures in a real kernel.
"""

from itertools import combinations

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PathCollection
from matplotlib.patches import Ellipse
from matplotlib.text import Text

from helpers import plots
from helpers.plots.alt_text import alt_text
from helpers.plots.runs import _remove_overlaps

HEARD = [0, 1, 2, 3, 7, 11, 15, 19, 23, 27, *range(31, 41)]  # the slow subscriber of lesson 02
PERIOD_S, CALLBACK_S = 0.05, 0.2


@pytest.fixture(autouse=True)
def close_figures():
    plt.switch_backend('agg')
    yield
    plt.close('all')


def table_of(started, published=None, callback_s=CALLBACK_S, threads=1):
    """Build a table from the start of each callback: one number a message, NaN for a lost one."""
    started = np.array(started, dtype=float)
    if published is None:
        published = np.arange(len(started)) * PERIOD_S
    turn = np.cumsum(~np.isnan(started)) - 1
    thread = np.where(np.isnan(started), None, [f'thread {t % threads + 1}' for t in turn])
    columns = {'published_s': published, 'started_s': started, 'finished_s': started + callback_s}
    return pd.DataFrame({'seq': range(len(started)), **columns, 'thread': thread})


@pytest.fixture
def slow():
    """41 messages, one thread: 20 heard, 21 lost."""
    started = np.full(41, np.nan)
    started[HEARD] = np.arange(len(HEARD)) * CALLBACK_S
    return table_of(started)


@pytest.fixture
def parallel():
    """The same messages and four threads: none lost."""
    return table_of(np.arange(41) * PERIOD_S + 0.0005, threads=4)


def legend_of(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def points_of(ax):
    """Return {legend label: rows of (x, y)} of all scatters of the axes."""
    scatters = [c for c in ax.collections if isinstance(c, PathCollection)]
    return {scatter.get_label(): scatter.get_offsets().data for scatter in scatters}


def words_of(ax):
    return [text.get_text() for text in ax.texts if text.get_text()]


def bars_of(ax):
    """Return {label: [(start, end, lane), ...]}."""
    return {
        container.get_label(): [
            (bar.get_x(), bar.get_x() + bar.get_width(), bar.get_y() + bar.get_height() / 2)
            for bar in container
        ]
        for container in ax.containers
    }


def said(draw, *arguments):
    return alt_text(draw(*arguments).figure)


def overlap(texts):
    boxes = [text.get_window_extent() for text in texts]
    return any(a.count_overlaps([b]) for a, b in combinations(boxes, 2))


# --- Every picture of a run ---

DRAW = {
    'sequence_gaps': plots.sequence_gaps,
    'timeline': plots.timeline,
    'timeline with depth': lambda table: plots.timeline(table, depth=10),
    'queue_length': lambda table: plots.queue_length(table, 10),
    'latency': lambda table: plots.latency(table, PERIOD_S),
    'before_and_after': lambda table: plots.before_and_after(table, table, ('a', 'b')).axes[0],
}
each_plot = pytest.mark.parametrize('draw', DRAW.values(), ids=DRAW)


@each_plot
def test_texts_are_readable_on_a_projector(slow, draw):
    with mpl.rc_context({'font.size': 6}):
        ax = draw(slow)
        ax.figure.canvas.draw()
        written = [t for t in ax.figure.findobj(Text) if t.get_text() and t.get_visible()]
    assert min(t.get_fontsize() for t in written) >= 12
    assert ax.get_title(loc='left')
    assert ax.get_xlabel().endswith('(s)')
    assert ax.get_ylabel()
    assert len(plt.get_fignums()) == 1


# --- What is said about a figure ---


@each_plot
def test_descriptions_do_not_move_between_runs(slow, parallel, draw):
    started = slow.started_s
    text = said(draw, table_of(started, callback_s=0.15))
    other = table_of(started.mask(slow.seq == 7) + 0.01, callback_s=0.15)
    assert said(draw, other) == text
    assert said(draw, parallel) != text


def test_what_no_lesson_shows_in_words(parallel):
    unheard = table_of([np.nan] * 12)
    assert 'None was received: a cross marks when' in said(plots.sequence_gaps, unheard)
    assert 'No two callbacks overlap.' in said(plots.timeline, unheard)
    assert 'None is pushed out.' in said(plots.queue_length, parallel, 10)


# --- Sequence gaps ---


def test_marks_stand_where_the_table_says(slow, parallel):
    ax = plots.sequence_gaps(slow)
    lost, heard = slow[slow.started_s.isna()], slow[slow.started_s.notna()]
    points = points_of(ax)
    assert legend_of(ax) == list(points) == ['published 41', 'received 20', 'lost 21']
    np.testing.assert_allclose(points['published 41'], slow[['published_s', 'seq']])
    np.testing.assert_allclose(points['received 20'], heard[['started_s', 'seq']])
    pushed_out_s = slow.published_s.shift(-10)[lost.index]
    np.testing.assert_allclose(points['lost 21'], np.column_stack([pushed_out_s, lost.seq]))
    waits = [[(p, q), (s, q)] for q, p, s, *_ in heard.itertuples(index=False)]
    np.testing.assert_allclose(ax.collections[0].get_segments(), waits)
    assert ax.get_title(loc='left') == 'Messages: 21 of 41 lost'
    assert plots.sequence_gaps(parallel).get_title(loc='left') == 'Messages: none lost'


def test_crosses_are_where_a_message_was_pushed_out():
    nan = np.nan  # depth 2: 3 pushes out 1, 4 pushes out 2; 5 and 6 still wait at the end
    table = table_of([0.0, nan, nan, 0.2, 0.3, nan, nan])
    ax = plots.sequence_gaps(table, depth=2)
    p = PERIOD_S
    np.testing.assert_allclose(points_of(ax)['lost 4'][:2], [(3 * p, 1), (4 * p, 2)])
    waits, lost_waits, joined = (lines.get_segments() for lines in ax.collections[:3])
    assert len(waits) == 3
    np.testing.assert_allclose(lost_waits[:2], [[(p, 1), (3 * p, 1)], [(2 * p, 2), (4 * p, 2)]])
    np.testing.assert_allclose(joined[:2], [[(3 * p, 1), (3 * p, 3)], [(4 * p, 2), (4 * p, 4)]])
    # Those that still wait were not pushed out. Their cross is at their publishing.
    np.testing.assert_allclose(points_of(ax)['lost 4'][2:], [(5 * p, 5), (6 * p, 6)])


@pytest.mark.parametrize('published', [None, np.arange(50) * 1e-5])
def test_labels_neither_overlap_nor_leave_the_axes(published):
    started = np.full(50, np.nan)
    started[40:] = 3 + np.arange(10) * 0.01
    ax = plots.sequence_gaps(table_of(started, published))
    ax.figure.canvas.draw()
    assert '40 lost' in words_of(ax)
    assert len(ax.texts) > 1
    assert all(text.get_window_extent().x0 >= ax.bbox.x0 for text in ax.texts)
    assert not overlap(ax.texts)


def test_a_text_is_left_out_if_it_covers_any_earlier_one():
    _, ax = plt.subplots()
    texts = [ax.annotate('lost', (place, 0.5)) for place in (0.2, 0.6, 0.2)]
    _remove_overlaps(ax, texts, np.empty((0, 2)))
    assert list(ax.texts) == texts[:2]


def test_two_runs_beside_each_other(slow, parallel):
    figure = plots.before_and_after(slow, parallel.iloc[:15], labels=('one thread', 'four'))
    left, right = figure.axes
    assert left.get_title(loc='left') == 'one thread: 21 of 41 lost'
    assert right.get_title(loc='left') == 'four: none lost'
    assert legend_of(right) == ['published 15', 'received 15', 'lost 0']
    assert len(points_of(left)['received 20']) == 20
    assert left.get_xlim() == right.get_xlim()
    assert left.get_ylim() == right.get_ylim()
    figure.canvas.draw()
    legends = [ax.get_legend().get_window_extent() for ax in figure.axes]
    assert legends[0].y0 >= left.bbox.y1 - 1  # it hides no data
    assert legends[0].x1 < legends[1].x0
    assert legends[1].x1 < figure.bbox.x1


# --- Timelines ---


def test_bars_of_a_timeline_are_the_callbacks(parallel):
    ax = plots.timeline(parallel)
    (bars,) = bars_of(ax).values()
    lanes = parallel.thread.str[-1].astype(int) - 1
    expected = np.column_stack([parallel.started_s, parallel.finished_s, lanes])
    np.testing.assert_allclose(bars, expected)
    assert ax.get_legend() is None


def test_with_depth_a_timeline_shows_waiting_messages(slow):
    ax = plots.timeline({'exclusive': slow}, depth=10)
    assert [label.get_text() for label in ax.get_yticklabels()] == ['thread 1', 'waiting']
    callbacks, waits = ax.containers
    assert callbacks.get_label() == 'exclusive'
    bars = [(b.get_y(), b.get_x(), b.get_x() + b.get_width()) for b in waits]
    left_s = slow.started_s.fillna(slow.published_s.shift(-10))
    np.testing.assert_allclose([bar[1:] for bar in bars], np.array([slow.published_s, left_s]).T)
    lanes = pd.DataFrame(sorted(bars), columns=['lane', 'entered', 'left'])
    assert lanes.lane.nunique() == 10
    for _, lane in lanes.groupby('lane'):  # in each place one after the other
        assert (lane.entered[1:].to_numpy() >= lane.left[:-1] - 1e-9).all()
    (crosses,) = points_of(ax).values()
    np.testing.assert_allclose(sorted(crosses[:, 0]), sorted(left_s[slow.started_s.isna()]))
    assert min(lanes.lane) > callbacks[0].get_y() + callbacks[0].get_height()
    assert ax.get_ylim()[0] > max(lanes.lane)


# --- How full the queue is ---


def steps_of(table, depth):
    return dict(plots.queue_length(table, depth).lines[0].get_xydata())


def test_steps_by_hand():
    # Depth 2. 0 starts at once. 1 and 2 wait, 3 pushes out 1, 2 starts, then 3.
    table = table_of([0.0, np.nan, 0.5, 0.7], published=[0.0, 0.1, 0.2, 0.3])
    assert steps_of(table, 2) == {0.0: 0, 0.1: 1, 0.2: 2, 0.3: 2, 0.5: 1, 0.7: 0}
    ax = plots.queue_length(table, 2)
    assert points_of(ax)['pushed out: 1'].tolist() == [[0.3, 2]]
    assert legend_of(ax) == ['messages waiting', 'depth 2', 'pushed out: 1']
    waiting, limit = ax.lines
    assert set(limit.get_ydata()) == {2}
    assert waiting.get_linestyle() != limit.get_linestyle()


# --- Latency ---


def test_latency_in_milliseconds_and_in_periods(slow):
    ax = plots.latency(slow, PERIOD_S)
    ax.figure.canvas.draw()
    heard, lost = slow[slow.started_s.notna()], slow[slow.started_s.isna()]
    waits_s = heard.started_s - heard.published_s
    dots = np.vstack([line.get_xydata() for line in ax.lines])
    np.testing.assert_allclose(dots[:, 0], heard.published_s)
    # What a reader finds on the axis with this name, at the height of each dot.
    for name, expected in (('(ms)', 1000 * waits_s), ('(periods)', waits_s / PERIOD_S)):
        (axis,) = (axis for axis in (ax, *ax.child_axes) if name in axis.get_ylabel())
        read = axis.transData.inverted().transform(ax.transData.transform(dots))[:, 1]
        np.testing.assert_allclose(read, expected, atol=1e-9)
    ((label, crosses),) = points_of(ax).items()
    assert str(len(lost)) in label
    np.testing.assert_allclose(crosses[:, 0], lost.published_s)
    assert max(crosses[:, 1]) < min(dots[:, 1])


# --- Values beside each other ---


def test_bars_have_the_values():
    ax = plots.bars(pd.Series({'default': 104.6, 'cured': 0.123}), 'CPU (%)')
    assert [patch.get_width() for patch in ax.patches] == [104.6, 0.123]
    assert [label.get_text() for label in ax.get_yticklabels()] == ['default', 'cured']
    assert words_of(ax) == ['105', '0.12']
    assert ax.get_xlabel() == 'CPU (%)'
    assert ax.yaxis_inverted()  # the first one on top


def test_sweep_has_a_panel_for_each_column():
    threads = pd.Index([1, 2, 4], name='threads')
    results = pd.DataFrame({'lost (%)': [50, 25, 0], 'CPU (%)': [3, 4, 5]}, index=threads)
    figure = plots.sweep(results, 3, 'the limit', title='A sweep')
    assert [ax.get_title(loc='left') for ax in figure.axes] == ['lost (%)', 'CPU (%)']
    for ax, (_, values) in zip(figure.axes, results.items(), strict=True):
        measured, limit = ax.lines
        assert measured.get_xdata().tolist() == [1, 2, 4]
        assert measured.get_ydata().tolist() == values.tolist()
        assert list(limit.get_xdata()) == [3, 3]
        assert ax.get_xlabel() == 'threads'
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ['the limit']


# --- Graphs ---

FRAMES = pd.DataFrame(
    [
        ('odom', 'base', 'filter'),
        ('base', 'imu', 'robot'),
        ('base', 'gps', 'robot'),
        ('map', 'odom', 'map filter'),
    ],
    columns=['parent', 'child', 'publisher'],
)


def test_frame_tree_grows_to_the_right():
    ax = plots.frame_tree(FRAMES)
    places = {text.get_text(): text.get_position() for text in ax.texts}
    assert list(places) == ['map', 'odom', 'base', 'imu', 'gps']
    for row in FRAMES.itertuples():
        assert places[row.parent][0] < places[row.child][0]
    assert places['imu'][1] > places['gps'][1]
    assert places['base'][1] == (places['imu'][1] + places['gps'][1]) / 2
    assert legend_of(ax) == ['filter', 'robot', 'map filter']
    ax.figure.draw_without_rendering()
    assert not overlap(ax.texts)


# --- Drives ---

T = np.arange(0.0, 10.0, 0.5)
DRIVE = pd.DataFrame(
    {'t': T, 'x': T, 'y': 0.1 * T, 'distance': 0.2 * T, 'var_x': 4.0, 'cov_x_y': 0.0, 'var_y': 1.0}
)


def test_path_has_truth_estimates_and_ellipses():
    fixes = pd.DataFrame({'gps_x': [0.3, np.nan, 2.1], 'gps_y': [0.1, np.nan, 0.2]})
    ax = plots.path(DRIVE, {'a': DRIVE, 'b': DRIVE + 1}, fixes, ellipses_s=4)
    assert legend_of(ax) == ['truth', 'GPS', 'a', 'b', 'start']
    truth, gps, a, b = ax.lines
    assert a.get_xydata().tolist() == truth.get_xydata().tolist()
    assert b.get_xydata().tolist() == (truth.get_xydata() + 1).tolist()
    assert gps.get_marker() == '+'
    assert a.get_linestyle() != b.get_linestyle()
    # At the first row past 4 s and 8 s; `b` is one second and one metre further.
    ellipses = [e for e in ax.patches if isinstance(e, Ellipse)]
    assert np.allclose([e.get_center() for e in ellipses], [(4, 0.4), (8, 0.8), (4, 1.3), (8, 1.7)])
    upright = {(12.0, 6.0, 0.0), (6.0, 12.0, 90.0)}
    assert {(e.width, e.height, e.angle % 180) for e in ellipses[:2]} <= upright
    assert ax.get_aspect() == 1
    assert (ax.get_xlabel(), ax.get_ylabel()) == ('x (m)', 'y (m)')


def test_ellipses_turn_with_the_covariance():
    turned = DRIVE.assign(var_x=2.5, var_y=2.5, cov_x_y=1.5)  # variances 4 and 1, turned by 45 deg
    assert not plots.path(turned, {'a': turned}, ellipses_s=100).patches
    (ellipse,) = plots.path(turned, {'a': turned}, ellipses_s=6).patches
    long = ellipse.angle if ellipse.width > ellipse.height else ellipse.angle + 90
    assert long % 180 == pytest.approx(45)
    assert sorted([ellipse.width, ellipse.height]) == pytest.approx([6, 12])


def test_error_has_a_line_each_and_shaded_times():
    ax = plots.error({'a': DRIVE, 'b': DRIVE}, spans_s={'no GPS': (4, 8)})
    assert legend_of(ax) == ['a', 'b', 'no GPS']
    assert [line.get_ydata().tolist() for line in ax.lines] == [DRIVE.distance.tolist()] * 2
    (span,) = ax.patches
    assert (span.get_x(), span.get_width()) == (4, 4)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ('time (s)', 'distance from the truth (m)')


RUN = table_of([0.0])
CIRCLE = pd.DataFrame({'parent': ['a', 'b'], 'child': ['b', 'a'], 'publisher': 'robot'})


@pytest.mark.parametrize(
    ('draw', 'words'),
    [
        (lambda: plots.latency(RUN.iloc[:0], PERIOD_S), 'The table is empty'),
        (lambda: plots.timeline({'a': RUN.drop(columns='seq')}), 'lacks .* seq'),
        (lambda: plots.error(dict.fromkeys('abcde', DRIVE)), '1 to 4 errors, not 5'),
        (lambda: plots.frame_tree(FRAMES.iloc[[0, 0]]), 'make no tree'),
        (lambda: plots.frame_tree(FRAMES.iloc[1:]), 'make no tree'),
        (lambda: plots.frame_tree(pd.concat([FRAMES, CIRCLE])), 'make no tree'),
    ],
)
def test_what_cannot_be_drawn_gets_one_sentence(draw, words):
    with pytest.raises((TypeError, ValueError), match=rf'^[^\n]*{words}[^\n]*[.]$'):
        draw()
    assert plt.get_fignums() == []
