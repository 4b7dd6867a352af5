"""The data of the artists are tested, not pixels: nbval never compares pictures."""

import subprocess
import sys
from itertools import combinations

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.patches import Ellipse
from matplotlib.text import Text

from helpers import plots

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
    return pd.DataFrame(
        {
            'seq': range(len(started)),
            'published_s': published,
            'started_s': started,
            'finished_s': started + callback_s,
            'thread': [
                None if np.isnan(s) else f'worker {t % threads + 1}'
                for s, t in zip(started, turn, strict=True)
            ],
        }
    )


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
    return [text.get_text() for text in ax.texts]


def bars_of(ax):
    return {
        container.get_label(): [
            (bar.get_x(), bar.get_x() + bar.get_width(), bar.get_y() + bar.get_height() / 2)
            for bar in container
        ]
        for container in ax.containers
    }


DRAW = {
    'sequence_gaps': plots.sequence_gaps,
    'timeline': plots.timeline,
    'queue_length': lambda table, **options: plots.queue_length(table, 10, **options),
    'latency': lambda table, **options: plots.latency(table, PERIOD_S, **options),
}
each_plot = pytest.mark.parametrize('draw', DRAW.values(), ids=DRAW)


class TestEveryPlot:
    @each_plot
    def test_makes_one_figure_with_titles_and_units(self, slow, draw):
        ax = draw(slow)
        assert len(plt.get_fignums()) == 1
        assert ax.get_title(loc='left')
        assert ax.get_xlabel().endswith('(s)')
        assert ax.get_ylabel()

    @each_plot
    def test_takes_a_title_and_axes(self, slow, draw):
        _, ax = plt.subplots()
        assert draw(slow, title='Mine', ax=ax) is ax
        assert ax.get_title(loc='left') == 'Mine'
        assert len(plt.get_fignums()) == 1

    @each_plot
    @pytest.mark.parametrize('own_axes', [False, True])
    def test_is_readable_on_a_projector(self, slow, draw, own_axes):
        with mpl.rc_context({'font.size': 6}):
            ax = draw(slow, ax=plt.subplots()[1] if own_axes else None)
            ax.figure.canvas.draw()
            written = [t for t in ax.figure.findobj(Text) if t.get_text() and t.get_visible()]
        assert len(written) > 8
        assert min(t.get_fontsize() for t in written) >= 12

    @each_plot
    def test_does_not_change_the_table_nor_the_settings(self, slow, draw):
        before, settings = slow.copy(), mpl.rcParams.copy()
        draw(slow)
        pd.testing.assert_frame_equal(slow, before)
        assert mpl.rcParams == settings

    @each_plot
    def test_order_of_rows_and_extra_columns_do_not_matter(self, slow, draw):
        shuffled = slow.sample(frac=1, random_state=1).assign(extra=1)
        one, other = draw(slow), draw(shuffled)
        for a, b in zip(one.collections, other.collections, strict=True):
            np.testing.assert_array_equal(a.get_offsets(), b.get_offsets())
        for a, b in zip(one.lines, other.lines, strict=True):
            np.testing.assert_array_equal(a.get_xydata(), b.get_xydata())
        assert bars_of(one) == bars_of(other)
        assert words_of(one) == words_of(other)

    @each_plot
    def test_draws_a_run_in_which_nothing_was_heard(self, draw):
        ax = draw(table_of(np.full(12, np.nan)))
        ax.figure.canvas.draw()
        assert all(np.isfinite([*ax.get_xlim(), *ax.get_ylim()]))

    @each_plot
    def test_draws_one_message(self, draw):
        draw(table_of([0.001])).figure.canvas.draw()

    @each_plot
    @pytest.mark.parametrize(
        ('spoil', 'error'),
        [
            (lambda t: t.drop(columns='started_s'), ValueError),
            (lambda t: pd.concat([t, t[['thread']]], axis=1), ValueError),
            (lambda t: t.iloc[:0], ValueError),
            (lambda t: t.assign(seq=7), ValueError),
            (lambda t: t.to_dict('list'), TypeError),
            (lambda t: None, TypeError),
        ],
        ids=['missing', 'duplicate', 'empty', 'same seq', 'lists', 'none'],
    )
    def test_bad_table_gets_one_sentence_and_draws_nothing(self, slow, draw, spoil, error):
        with pytest.raises(error, match=r'^[A-Z].*[.]$') as raised:
            draw(spoil(slow))
        assert '\n' not in str(raised.value)
        assert plt.get_fignums() == []
        with pytest.raises(error):
            plots.before_and_after(slow, spoil(slow))
        assert plt.get_fignums() == []


class TestSequenceGaps:
    def test_marks_stand_where_the_table_says(self, slow):
        points = points_of(plots.sequence_gaps(slow))
        lost = slow[slow.started_s.isna()]
        heard = slow[slow.started_s.notna()]
        assert list(points) == ['published 41', 'heard 20', 'lost 21']
        np.testing.assert_allclose(points['published 41'], slow[['published_s', 'seq']])
        np.testing.assert_allclose(points['heard 20'], heard[['started_s', 'seq']])
        np.testing.assert_allclose(points['lost 21'], lost[['published_s', 'seq']])

    def test_line_of_each_heard_message_is_its_wait(self, slow):
        ax = plots.sequence_gaps(slow)
        segments = ax.collections[0].get_segments()
        heard = slow[slow.started_s.notna()]
        expected = [[(p, q), (s, q)] for q, p, s, *_ in heard.itertuples(index=False)]
        np.testing.assert_allclose(segments, expected)

    def test_legend_and_title_count(self, slow, parallel):
        ax = plots.sequence_gaps(slow)
        assert legend_of(ax) == ['published 41', 'heard 20', 'lost 21']
        assert ax.get_title(loc='left') == 'Messages: 21 of 41 lost'
        assert plots.sequence_gaps(parallel).get_title(loc='left') == 'Messages: none lost'

    def test_lost_differ_in_colour_and_in_shape(self, slow):
        _, published, heard, lost = plots.sequence_gaps(slow).collections
        colours = {to_hex(c.get_edgecolor()[0]) for c in (published, heard, lost)}
        assert len(colours) == 3
        shapes = [c.get_paths()[0].vertices.tolist() for c in (published, heard, lost)]
        assert shapes[0] == shapes[1] != shapes[2]
        assert heard.get_sizes()[0] > 3 * published.get_sizes()[0]

    def test_heard_numbers_and_gaps_can_be_read(self, slow):
        words = words_of(plots.sequence_gaps(slow))
        assert words == [str(seq) for seq in HEARD] + 7 * ['3 lost']

    def test_gap_label_stands_in_the_middle_of_its_gap(self, slow):
        ax = plots.sequence_gaps(slow)
        first = next(text for text in ax.texts if text.get_text() == '3 lost')
        assert first.xy == pytest.approx((5 * PERIOD_S, 5))

    def test_gaps_at_the_start_and_the_end_are_counted(self):
        nan = np.nan
        words = words_of(plots.sequence_gaps(table_of([nan, nan, 0.2, 0.4, nan, nan, nan])))
        assert [word for word in words if 'lost' in word] == ['2 lost', '3 lost']

    def test_many_marks_are_not_labelled(self, parallel):
        assert words_of(plots.sequence_gaps(parallel)) == []
        every_second = np.where(np.arange(80) % 2, np.nan, np.arange(80) * PERIOD_S)
        assert words_of(plots.sequence_gaps(table_of(every_second))) == []

    @pytest.mark.parametrize('published', [None, np.arange(50) * 1e-5])
    def test_labels_neither_overlap_nor_leave_the_axes_on_the_left(self, published):
        started = np.full(50, np.nan)
        started[40:] = 3 + np.arange(10) * 0.01
        ax = plots.sequence_gaps(table_of(started, published))
        ax.figure.canvas.draw()
        boxes = [text.get_window_extent() for text in ax.texts]
        assert '40 lost' in words_of(ax)
        assert len(boxes) > 1
        assert all(box.x0 >= ax.bbox.x0 for box in boxes)
        assert not any(box.count_overlaps(boxes[:i]) for i, box in enumerate(boxes))

    @pytest.mark.parametrize(('next_heard_s', 'said'), [(0.03, []), (0.3, ['3 lost'])])
    def test_labels_cover_no_heard_message(self, next_heard_s, said):
        started = [0, np.nan, np.nan, np.nan, next_heard_s, *np.linspace(0.4, 1, 36)]
        ax = plots.sequence_gaps(table_of(started, published=np.arange(41) * 1e-5))
        assert words_of(ax) == said

    def test_legend_hides_no_data(self, slow):
        ax = plots.sequence_gaps(slow)
        ax.figure.canvas.draw()
        legend = ax.get_legend().get_window_extent()
        (title,) = ax.findobj(lambda a: isinstance(a, Text) and a.get_text().startswith('Messages'))
        assert legend.y0 >= ax.bbox.y1 - 1
        assert title.get_window_extent().y0 >= legend.y1 - 1


class TestBeforeAndAfter:
    def test_titles_say_what_was_lost(self, slow, parallel):
        left, right = plots.before_and_after(slow, parallel).axes
        assert left.get_title(loc='left') == 'before: 21 of 41 lost'
        assert right.get_title(loc='left') == 'after: none lost'
        assert legend_of(left) == ['published 41', 'heard 20', 'lost 21']
        assert legend_of(right) == ['published 41', 'heard 41', 'lost 0']

    def test_axes_are_the_same(self, slow, parallel):
        left, right = plots.before_and_after(slow, parallel.iloc[:15]).axes
        assert left.get_xlim() == right.get_xlim()
        assert left.get_ylim() == right.get_ylim()
        assert len(points_of(left)['heard 20']) == 20
        assert len(points_of(right)['heard 15']) == 15

    def test_labels(self, slow, parallel):
        figure = plots.before_and_after(slow, parallel, labels=('one thread', 'four threads'))
        assert figure.axes[1].get_title(loc='left') == 'four threads: none lost'

    @pytest.mark.parametrize('labels', ['ab', ('before',), ('a', 'b', 'c')])
    def test_bad_labels(self, slow, parallel, labels):
        with pytest.raises(ValueError, match='^labels must be two names'):
            plots.before_and_after(slow, parallel, labels=labels)
        assert plt.get_fignums() == []

    def test_titles_and_legends_do_not_overlap(self, slow, parallel):
        figure = plots.before_and_after(slow, parallel)
        figure.canvas.draw()
        left, right = (ax.get_legend().get_window_extent() for ax in figure.axes)
        assert left.x1 < right.x0
        assert right.x1 < figure.bbox.x1


class TestTimeline:
    def test_bars_are_the_callbacks(self, parallel):
        (bars,) = bars_of(plots.timeline(parallel)).values()
        lanes = parallel.thread.str[-1].astype(int) - 1
        expected = np.column_stack([parallel.started_s, parallel.finished_s, lanes])
        np.testing.assert_allclose(bars, expected)

    def test_lanes_are_in_natural_order_from_the_top(self):
        ax = plots.timeline(table_of(np.arange(24) * PERIOD_S, threads=12))
        names = [label.get_text() for label in ax.get_yticklabels()]
        assert names == [f'worker {n}' for n in range(1, 13)]
        bottom, top = ax.get_ylim()
        bars = [bar for container in ax.containers for bar in container]
        assert top < min(bar.get_y() for bar in bars)
        assert bottom > max(bar.get_y() + bar.get_height() for bar in bars)

    def test_wide_bars_carry_their_number_and_narrow_ones_do_not(self, slow):
        assert words_of(plots.timeline(slow)) == [str(seq) for seq in HEARD]
        assert words_of(plots.timeline(slow.assign(finished_s=slow.started_s + 0.001))) == []

    def test_every_number_fits_its_bar(self):
        # In this picture a bar has room for one digit, not for two.
        ax = plots.timeline(table_of(np.arange(60) * PERIOD_S, callback_s=0.045))
        ax.figure.canvas.draw()
        assert words_of(ax) == [str(seq) for seq in range(10)]
        for text in ax.texts:
            box, centre = text.get_window_extent(), text.get_position()[0]
            ends = ax.transData.transform([(centre - 0.0225, 0), (centre + 0.0225, 0)])[:, 0]
            assert ends[0] <= box.x0 < box.x1 <= ends[1]

    def test_groups_differ_in_colour_and_in_hatch(self, slow, parallel):
        groups = {f'group {n}': slow.assign(thread=f'worker {n}') for n in range(5)}
        ax = plots.timeline(groups)
        assert legend_of(ax) == list(groups)
        first_bars = [container[0] for container in ax.containers]
        assert len({to_hex(bar.get_facecolor()) for bar in first_bars}) == 5
        assert len({bar.get_hatch() for bar in first_bars}) == 5
        for bar, patch in zip(first_bars, ax.get_legend().get_patches(), strict=True):
            assert bar.get_facecolor() == patch.get_facecolor()
            assert bar.get_hatch() == patch.get_hatch()

    def test_groups_share_the_lane_of_a_thread(self, slow):
        bars = bars_of(plots.timeline({'timer': slow, 'subscription': slow}))
        assert {lane for _, _, lane in bars['timer'] + bars['subscription']} == {0}

    def test_one_table_needs_no_legend(self, slow):
        assert plots.timeline(slow).get_legend() is None

    def test_span_shows_a_part(self, slow):
        ax = plots.timeline(slow, span_s=(0.3, 0.9))
        assert ax.get_xlim() == (0.3, 0.9)
        assert words_of(ax) == ['1', '2', '3', '7']

    def test_a_callback_that_still_runs_goes_to_the_end(self):
        table = table_of([0.0, 0.3])
        table.loc[0, 'finished_s'] = np.nan
        (bars,) = bars_of(plots.timeline(table)).values()
        assert bars[0][:2] == pytest.approx((0.0, 0.5))

    def test_a_callback_of_an_unknown_thread_has_no_lane(self, slow):
        slow['thread'] = None  # as in a table made from the output of processes
        plots.sequence_gaps(slow)
        with pytest.raises(ValueError, match='^It is not known which thread .* message 0[.]$'):
            plots.timeline(slow)

    def test_no_callback_is_said(self):
        assert words_of(plots.timeline(table_of([np.nan]))) == ['no callback was called']

    @pytest.mark.parametrize('span', [(1, 1), (2, 1), (0, np.inf), (None, 1), 3, (1, 2, 3), 'ab'])
    def test_bad_span(self, slow, span):
        with pytest.raises(ValueError, match='^span_s must be two times in seconds'):
            plots.timeline(slow, span_s=span)
        assert plt.get_fignums() == []

    @pytest.mark.parametrize('count', [0, 6])
    def test_bad_number_of_groups(self, slow, count):
        with pytest.raises(ValueError, match=f'1 to 5 callback groups, not {count}[.]$'):
            plots.timeline({str(n): slow for n in range(count)})
        assert plt.get_fignums() == []

    def test_a_bad_table_among_groups(self, slow):
        with pytest.raises(ValueError, match='seq'):
            plots.timeline({'good': slow, 'bad': slow.drop(columns='seq')})
        assert plt.get_fignums() == []


class TestQueueLength:
    @staticmethod
    def steps(table, depth):
        ax = plots.queue_length(table, depth)
        return ax, dict(ax.lines[0].get_xydata())

    def test_steps_by_hand(self):
        # Depth 2. 0 starts at once. 1 and 2 wait, 3 pushes out 1, 2 starts, then 3.
        table = table_of([0.0, np.nan, 0.5, 0.7], published=[0.0, 0.1, 0.2, 0.3])
        ax, steps = self.steps(table, 2)
        assert steps == {0.0: 0, 0.1: 1, 0.2: 2, 0.3: 2, 0.5: 1, 0.7: 0}
        assert points_of(ax)['pushed out: 1'].tolist() == [[0.3, 2]]

    def test_a_slow_subscriber_fills_it_to_the_limit_and_empties_it(self, slow):
        _, steps = self.steps(slow, 10)
        lengths = list(steps.values())
        assert max(lengths) == 10
        assert min(lengths) == 0
        assert lengths[-1] == 0

    @pytest.mark.parametrize('depth', [1, 3, 10])
    def test_never_above_the_depth_nor_below_zero(self, slow, depth):
        # Also where the record is late: a newer message came between a take and its callback.
        late = slow.assign(started_s=slow.started_s + 0.07)
        _, steps = self.steps(late, depth)
        assert min(steps.values()) >= 0
        assert max(steps.values()) == depth

    def test_a_callback_recorded_before_its_publish_call_does_not_count(self):
        _, steps = self.steps(table_of([-0.001, 0.049]), 10)
        assert set(steps.values()) == {0}

    def test_messages_that_nobody_takes_stay(self):
        ax, steps = self.steps(table_of(np.full(12, np.nan)), 10)
        assert list(steps.values()) == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 10, 10]
        assert len(points_of(ax)['pushed out: 2']) == 2

    def test_limit_line(self, slow, parallel):
        ax = plots.queue_length(slow, 10)
        assert set(ax.lines[1].get_ydata()) == {10}
        assert ax.lines[1].get_linestyle() != ax.lines[0].get_linestyle()
        assert legend_of(ax) == ['messages waiting', 'depth 10', 'pushed out: 21']
        assert legend_of(plots.queue_length(parallel, 10)) == legend_of(ax)[:2]

    @pytest.mark.parametrize('depth', [0, -1, 2.5, True, '10', None])
    def test_bad_depth(self, slow, depth):
        with pytest.raises(ValueError, match='^depth must be a whole number of at least 1'):
            plots.queue_length(slow, depth)
        assert plt.get_fignums() == []


class TestLatency:
    def test_milliseconds_over_time_of_publishing(self, slow):
        ax = plots.latency(slow)
        heard = slow[slow.started_s.notna()]
        expected = np.column_stack(
            [heard.published_s, 1000 * (heard.started_s - heard.published_s)]
        )
        np.testing.assert_allclose(ax.lines[0].get_xydata(), expected)
        assert ax.get_ylabel() == 'latency (ms)'
        assert legend_of(ax) == ['heard 20', 'lost 21']
        assert ax.child_axes == []

    def test_lost_are_marked_below_where_they_were_published(self, slow):
        x, y = points_of(plots.latency(slow))['lost 21'].T
        np.testing.assert_allclose(x, slow.published_s[slow.started_s.isna()])
        assert max(y) < 0

    def test_second_axis_counts_periods(self, slow):
        ax = plots.latency(slow, period_s=PERIOD_S)
        ax.figure.canvas.draw()
        (right,) = ax.child_axes
        assert right.get_ylabel() == 'latency (periods)'
        np.testing.assert_allclose(right.get_ylim(), np.array(ax.get_ylim()) / 50)

    @pytest.mark.parametrize('period', [0, -0.1, np.nan, np.inf, True, '0.5'])
    def test_bad_period(self, slow, period):
        with pytest.raises(ValueError, match='^period_s must be a number of seconds above 0'):
            plots.latency(slow, period_s=period)
        assert plt.get_fignums() == []


def test_colours_are_those_of_okabe_and_ito():
    okabe_ito = {'#E69F00', '#56B4E9', '#009E73', '#F0E442', '#0072B2', '#D55E00', '#CC79A7'}
    assert {plots.HEARD, plots.LOST, *plots.GROUP_COLOURS} <= okabe_ito


@pytest.mark.parametrize('colour', plots.GROUP_COLOURS)
def test_black_numbers_stand_out_on_every_group_colour(colour):
    channels = np.array(to_rgba(colour)[:3])
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    assert (linear @ [0.2126, 0.7152, 0.0722] + 0.05) / 0.05 >= 4.5  # contrast as WCAG 2 defines it


def test_import_changes_no_setting_and_needs_no_rclpy():
    code = (
        'import sys, matplotlib as mpl\n'
        'before, backend = mpl.rcParams.copy(), mpl.get_backend(auto_select=False)\n'
        'sys.modules["rclpy"] = None\n'
        'import helpers.plots\n'
        'assert mpl.get_backend(auto_select=False) == backend\n'
        'assert {k: v for k, v in mpl.rcParams.items() if k != "backend"} '
        '== {k: v for k, v in before.items() if k != "backend"}\n'
    )
    subprocess.run([sys.executable, '-c', code], check=True, timeout=60)


# --- interface_tree ---

TREE = pd.DataFrame(
    [
        (0, 'Shot', 'camera/msg/Shot', 'camera', ''),
        (1, 'header', 'std_msgs/msg/Header', 'std_msgs', ''),
        (2, 'frame_id', 'string', '', ''),
        (1, 'data', 'uint8', '', '[<=9]'),
    ],
    columns=['depth', 'field', 'type', 'package', 'array'],
)


def test_interface_tree():
    ax = plots.interface_tree(TREE)
    texts = [text.get_text() for text in ax.texts]
    assert texts == [
        'Shot', 'camera/msg/Shot', 'header', 'std_msgs/msg/Header', 'frame_id', 'string', 'data',
        'uint8[<=9]',
    ]  # fmt: skip
    # A mark a row at its depth, and from each but the first a line to the row it belongs to.
    marks = [line.get_xydata().tolist() for line in ax.lines if len(line.get_xdata()) == 1]
    assert marks == [[[0, 0]], [[1, 1]], [[2, 2]], [[1, 3]]]
    branches = [line.get_xydata().tolist() for line in ax.lines if len(line.get_xdata()) == 3]
    assert branches == [
        [[0, 0], [0, 1], [1, 1]],
        [[1, 1], [1, 2], [2, 2]],
        [[0, 0], [0, 3], [1, 3]],
    ]
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ['camera', 'std_msgs', 'primitive']
    looks = {
        (line.get_marker(), line.get_color()) for line in ax.lines if len(line.get_xdata()) == 1
    }
    assert len({marker for marker, _ in looks}) == len(looks) == 3  # told by shape, not by colour


def test_interface_tree_fits_its_figure():
    names = [f'a_field_with_a_long_name_{n}' for n in range(30)]
    types = [f'a_long_package_name_{n}/msg/ALongMessageName' for n in range(30)]
    deep = pd.DataFrame(
        {'depth': [0, *[1, 2, 3] * 9, 1, 2], 'field': names, 'type': types,
         'package': [t.split('/')[0] for t in types], 'array': ''}
    )  # fmt: skip
    for table in (TREE, deep):
        ax = plots.interface_tree(table)
        ax.figure.draw_without_rendering()
        rows = {round(text.get_window_extent().y0) for text in ax.texts}
        assert len(rows) == len(table)
        names = [text.get_window_extent() for text in ax.texts[::2]]
        assert (
            max(box.y1 - box.y0 for box in names) < 1.2 * np.diff(sorted(b.y0 for b in names)).min()
        )


@pytest.mark.parametrize(
    ('tree', 'error', 'words'),
    [
        (None, TypeError, 'must be a DataFrame'),
        (TREE.drop(columns='array'), ValueError, 'The tree lacks the column.* array'),
        (TREE.iloc[:0], ValueError, 'The tree is empty'),
        (TREE.iloc[1:], ValueError, 'must start with the interface'),
        (TREE.assign(depth=[0, 2, 1, 1]), ValueError, 'at most one deeper'),
    ],
)
def test_bad_trees(tree, error, words):
    with pytest.raises(error, match=words):
        plots.interface_tree(tree)


def test_bars_have_the_values():
    ax = plots.bars(pd.Series({'default': 104.6, 'cured': 0.123}), 'CPU (%)')
    assert [patch.get_width() for patch in ax.patches] == [104.6, 0.123]
    assert [label.get_text() for label in ax.get_yticklabels()] == ['default', 'cured']
    assert [text.get_text() for text in ax.texts] == ['105', '0.12']
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


ENDPOINTS = pd.DataFrame(
    [
        ('talker', 'publisher', '/topic', 'std_msgs/msg/String', 'RELIABLE, depth 10'),
        ('listener', 'subscription', '/topic', 'std_msgs/msg/String', 'BEST_EFFORT, depth 5'),
        ('doubler', 'publisher', '/doubled', 'std_msgs/msg/Int32', 'RELIABLE, depth 1'),
    ],
    columns=['node', 'role', 'topic', 'type', 'qos'],
)


def test_topic_graph_has_boxes_and_arrows():
    ax = plots.topic_graph(ENDPOINTS)
    boxes = {text.get_text() for text in ax.texts if text.get_text()}
    assert boxes == {
        '/topic\nstd_msgs/msg/String',
        '/doubled\nstd_msgs/msg/Int32',
        'talker\nRELIABLE, depth 10',
        'listener\nBEST_EFFORT, depth 5',
        'doubler\nRELIABLE, depth 1',
    }
    arrows = [text.arrow_patch for text in ax.texts if getattr(text, 'arrow_patch', None)]
    assert [arrow.get_linestyle() for arrow in arrows] == ['-', '--', '-']  # nobody hears doubler


@pytest.mark.parametrize('thread_free', [True, False])
@pytest.mark.parametrize('group_free', [True, False])
def test_who_waits_closes_a_circle_where_something_is_held(thread_free, group_free):
    ax = plots.who_waits('timer', 'the answer', thread_free, group_free)
    words = words_of(ax)
    assert f'a thread\n{"free" if thread_free else "held"}' in words
    assert f"the client's group\n{'free' if group_free else 'held'}" in words
    held = 2 - thread_free - group_free
    assert words.count('is held by') == held
    assert words.count('needs') == 2
    arrows = [text.arrow_patch for text in ax.texts if getattr(text, 'arrow_patch', None)]
    solid = [arrow for arrow in arrows if arrow.get_linestyle() != '--']
    assert len(arrows) == 3 + held
    assert len(solid) == (1 + 2 * held if held else 0)  # `waits for`, and two a thing that is held
    assert ax.get_title('left').startswith('A circle' if held else 'No circle')


def test_timeline_of_callbacks_that_no_message_called(slow):
    ax = plots.timeline({'timer': slow}, time_label='time since the first callback (s)')
    assert ax.get_xlabel() == 'time since the first callback (s)'


@pytest.mark.parametrize(
    'draw',
    [
        lambda: plots.bars(pd.Series(dtype=float), 'count'),
        lambda: plots.sweep(pd.DataFrame()),
        lambda: plots.topic_graph(ENDPOINTS.drop(columns='qos')),
        lambda: plots.topic_graph(ENDPOINTS.assign(role='server')),
    ],
)
def test_nothing_to_draw_is_one_sentence(draw):
    before = plt.get_fignums()
    with pytest.raises(ValueError, match=r'^[^\n]+\.$'):
        draw()
    assert plt.get_fignums() == before


# --- Drives ---

T = np.arange(0.0, 10.0, 0.5)
DRIVE = pd.DataFrame(
    {'t': T, 'x': T, 'y': 0.1 * T, 'distance': 0.2 * T, 'var_x': 4.0, 'cov_x_y': 0.0, 'var_y': 1.0}
)


def test_path_has_the_truth_the_estimates_and_ellipses_of_3_sigma():
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
    assert {(e.width, e.height, e.angle % 180) for e in ellipses[:2]} <= {
        (12.0, 6.0, 0.0), (6.0, 12.0, 90.0)
    }  # fmt: skip
    assert ax.get_aspect() == 1
    assert (ax.get_xlabel(), ax.get_ylabel()) == ('x (m)', 'y (m)')


def test_ellipses_turn_with_the_covariance():
    turned = DRIVE.assign(var_x=2.5, var_y=2.5, cov_x_y=1.5)  # variances 4 and 1, turned by 45 deg
    ax = plots.path(turned, {'a': turned}, ellipses_s=100)
    assert not ax.patches
    (ellipse,) = plots.path(turned, {'a': turned}, ellipses_s=6).patches
    long = ellipse.angle if ellipse.width > ellipse.height else ellipse.angle + 90
    assert long % 180 == pytest.approx(45)
    assert sorted([ellipse.width, ellipse.height]) == pytest.approx([6, 12])


def test_error_has_a_line_each_and_shaded_times():
    ax = plots.error({'a': DRIVE, 'b': DRIVE}, spans_s={'no GPS': (4, 8)}, ylabel='late (m)')
    assert legend_of(ax) == ['a', 'b', 'no GPS']
    assert [line.get_ydata().tolist() for line in ax.lines] == [DRIVE.distance.tolist()] * 2
    (span,) = ax.patches
    assert (span.get_x(), span.get_width()) == (4, 4)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ('time (s)', 'late (m)')
    assert ax.get_yscale() == 'linear'
    assert plots.error({'a': DRIVE}, log=True).get_yscale() == 'log'


def test_innovation_has_its_band_and_crosses_for_what_was_kept_out():
    table = pd.DataFrame(
        {
            't': [1, 2, 3],
            'innovation': [0.1, 9, -0.2],
            'sigma': 0.5,
            'accepted': [True, False, True],
        }
    )
    ax = plots.innovation(table)
    assert legend_of(ax) == ['3 sigma', 'used 2', 'kept out 1']
    points = points_of(ax)
    assert points['kept out 1'].tolist() == [[2, 9]]
    low, high, zero, used = ax.lines
    assert set(low.get_ydata()) == {-1.5}
    assert set(high.get_ydata()) == {1.5}
    assert used.get_xydata().tolist() == [[1, 0.1], [3, -0.2]]
    assert legend_of(plots.innovation(table.assign(accepted=True))) == ['3 sigma', 'used 3']


FRAMES = pd.DataFrame(
    [('odom', 'base', 'filter'), ('base', 'imu', 'robot'), ('base', 'gps', 'robot'),
     ('map', 'odom', 'map filter')],
    columns=['parent', 'child', 'publisher'],
)  # fmt: skip


def test_frame_tree_places_each_frame_right_of_its_parent():
    ax = plots.frame_tree(FRAMES)
    places = {text.get_text(): text.get_position() for text in ax.texts}
    assert list(places) == ['map', 'odom', 'base', 'imu', 'gps']
    for row in FRAMES.itertuples():
        assert places[row.parent][0] < places[row.child][0]
    assert places['imu'][1] > places['gps'][1]
    assert places['base'][1] == (places['imu'][1] + places['gps'][1]) / 2
    assert legend_of(ax) == ['filter', 'robot', 'map filter']
    ax.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert not any(a.count_overlaps([b]) for a, b in combinations(boxes, 2))


@pytest.mark.parametrize(
    ('draw', 'error', 'words'),
    [
        (lambda: plots.path(None, {'a': DRIVE}), TypeError, 'truth must be a DataFrame'),
        (lambda: plots.path(DRIVE, DRIVE), TypeError, 'Give each estimate a name'),
        (lambda: plots.path(DRIVE, [DRIVE]), TypeError, 'Give each estimate a name'),
        (lambda: plots.path(DRIVE, {}), ValueError, '1 to 4 estimates, not 0'),
        (lambda: plots.path(DRIVE, {'a': DRIVE[['t']]}), ValueError, "estimate 'a' lacks the"),
        (lambda: plots.path(DRIVE, {'a': DRIVE}, ellipses_s=0), ValueError, 'ellipses_s must be'),
        (lambda: plots.path(DRIVE, {'a': DRIVE}, DRIVE), ValueError, 'fixes lacks the column'),
        (lambda: plots.error(dict.fromkeys('abcde', DRIVE)), ValueError, '1 to 4 errors, not 5'),
        (lambda: plots.error({'a': DRIVE}, {'x': (2, 1)}), ValueError, 'span_s must be two'),
        (lambda: plots.innovation(DRIVE), ValueError, 'innovations lacks the column'),
        (lambda: plots.frame_tree(FRAMES.iloc[:0]), ValueError, 'transforms is empty'),
        (lambda: plots.frame_tree(FRAMES.iloc[[0, 0]]), ValueError, 'base has two parents'),
        (lambda: plots.frame_tree(FRAMES.iloc[1:]), ValueError, 'these transforms have 2'),
        (
            lambda: plots.frame_tree(FRAMES.replace('map', 'imu')),
            ValueError,
            'these transforms have 0',
        ),
        (
            lambda: plots.frame_tree(FRAMES.assign(child=['base', 'imu', 'map', 'odom'])),
            ValueError,
            'these transforms have 0',
        ),
    ],
)
def test_bad_drives(draw, error, words):
    before = plt.get_fignums()
    with pytest.raises(error, match=words):
        draw()
    assert plt.get_fignums() == before


def test_a_circle_beside_a_tree_is_no_tree():
    loop = pd.DataFrame([('a', 'b', 'n'), ('b', 'a', 'n')], columns=FRAMES.columns)
    with pytest.raises(ValueError, match='a circle'):
        plots.frame_tree(pd.concat([FRAMES, loop]))
