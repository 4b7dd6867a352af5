"""Whatever is given to a function, it answers, or says in one sentence of its own what is wrong."""

import math
import os
import re
import tempfile
import traceback
import warnings
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from hypothesis import event, example, given
from hypothesis import strategies as st
from test_queue_law import tries

from helpers import fusion, interfaces, plots
from helpers.cmake_lists import CMakeLists, CMakeListsError
from helpers.queue_model import explain, predict
from helpers.recording import check_table

HELPERS = str(Path(interfaces.__file__).parent)


def answer(function, *arguments, **options):
    """Return what a function answers, or None where it refuses: in one sentence of ours."""
    with warnings.catch_warnings(action='error'):
        warnings.simplefilter('ignore', DeprecationWarning)  # between libraries
        warnings.filterwarnings('ignore', 'Glyph')  # a letter that no font has
        try:
            result = function(*arguments, **options)
            event('answered')
            return result
        except (TypeError, ValueError) as error:
            refusal = error
    said = traceback.extract_tb(refusal.__traceback__)[-1]
    assert said.filename.startswith(HELPERS), ''.join(traceback.format_exception(refusal))
    assert re.fullmatch(r'\S.*[.?]', str(refusal)), str(refusal)
    assert str(refusal).encode(), 'can be printed'
    return None


# Values that are no number, or none that anybody measures

NUMBERS = [
    *(0, -1, 1, 0.5, -0.0, 5e-324, 1e9, 1e300, 10**30, 10**400, -(10**400), 2**63, 2**64),
    *(np.nan, np.inf, -np.inf, True, np.float32(1e38), np.int8(-3), np.float64('nan')),
    *(Fraction(1, 3), Decimal(1), 1j, np.array(1.0), np.array([1.0, 2.0])),
]
OTHERS = [
    *(None, '', 'fast', '1', 'a $ b', '\ud800', b'1', [1], (1, 2), {}, {'x': 1}, object, ...),
    *(
        pd.NA,
        pd.NaT,
        pd.Timestamp('2026-01-01', tz='UTC'),
        pd.Timedelta('1s'),
        np.datetime64('NaT', 'ns'),
    ),
    *(pd.DataFrame(), pd.Series([1.0]), float, lambda: 0),
]
anything = st.sampled_from(NUMBERS + OTHERS)
cells = anything.filter(lambda value: not isinstance(value, (pd.DataFrame, pd.Series, np.ndarray)))
texts = st.text(max_size=12) | st.sampled_from(['a $x^ b', '$', 'worker 2', '\x00', '_', '²3'])
measured = st.sampled_from([0, 1, 2, -1, 0.05, math.nan]) | st.floats(-1e12, 1e12)
DTYPES = ['object', 'string', 'category', 'Int64', 'Float64', 'float32', 'int8', 'uint64', 'bool',
          'complex', 'timedelta64[ns]', 'datetime64[ns, UTC]', 'Sparse[float]', 'str']  # fmt: skip


DAMAGES = [
    *(['number'] * 6 + ['cell', 'dtype', 'index', 'order'] * 2),
    *('column', 'rows', 'drop', 'twice', 'rename', 'none'),
]


def mostly(right):
    """One of ten is anything."""
    return st.integers(0, 9).flatmap(lambda n: anything if n == 9 else right)


@st.composite
def damaged(draw, table):
    """The table, with up to three things wrong in it."""
    table = table.copy()
    for _ in range(draw(st.sampled_from([0, 1, 1, 1, 2, 3]))):
        kind = draw(st.sampled_from(DAMAGES))
        at = draw(st.integers(0, max(0, table.shape[1] - 1)))
        if kind == 'rows':
            some = st.lists(st.integers(0, max(0, len(table) - 1)), max_size=12)
            table = table.iloc[draw(some) if len(table) else []]
        elif kind == 'index':
            table.index = draw(st.sampled_from([[0] * len(table), [*map(str, range(len(table)))]]))
        elif kind == 'order':
            table = table.iloc[draw(st.permutations(range(len(table))))]
        elif kind == 'none':
            table = table.iloc[:0]
        elif table.shape[1] == 0:
            continue
        elif kind == 'cell' and len(table):
            column = table.iloc[:, at].astype(object).tolist()
            column[draw(st.integers(0, len(table) - 1))] = draw(cells)
            table = with_column(table, at, pd.Series(column, dtype=object))
            if draw(st.booleans()):
                table = table.infer_objects()
        elif kind == 'number' and len(table):
            column = table.iloc[:, at].tolist()
            for row in draw(st.lists(st.integers(0, len(table) - 1), min_size=1, max_size=3)):
                column[row] = draw(measured)
            table = with_column(table, at, pd.Series(column).infer_objects())
        elif kind == 'column':
            column = draw(st.lists(cells | texts, min_size=len(table), max_size=len(table)))
            table = with_column(table, at, pd.Series(column, dtype=object).infer_objects())
        elif kind == 'dtype':
            try:
                with warnings.catch_warnings(action='ignore'):
                    column = table.iloc[:, at].astype(draw(st.sampled_from(DTYPES)))
            except (TypeError, ValueError, OverflowError, NotImplementedError):
                continue
            table = with_column(table, at, column)
        elif kind == 'drop':
            table = table.drop(columns=table.columns[at])
        elif kind == 'twice':
            table = pd.concat([table, table.iloc[:, [at]]], axis=1)
        else:
            names = list(table.columns)
            names[at] = draw(st.sampled_from(['x', 'X', '', 0, None, ('t', 'x')]))
            table.columns = pd.Index(names, dtype=object, tupleize_cols=False)
    return table


def with_column(table, at, column):
    columns = [table.iloc[:, i] for i in range(table.shape[1])]
    columns[at] = column.set_axis(table.index)
    return pd.concat(columns, axis=1).set_axis(table.columns, axis=1)


RUN = predict(0.05, 0.2, depth=3, threads=2, messages=12)
# Some look at a run before its callbacks have ended.
messages = mostly(damaged(RUN) | damaged(RUN.assign(finished_s=math.nan)))
counts = mostly(st.sampled_from([1, 2, 10, 10**18, 10**30]))
seconds = mostly(st.sampled_from([0, 0.05, 1, 1e9, np.float32(0.1), Fraction(1, 3)]))


@tries(100)
@given(messages)
def test_check_table(table):
    checked = answer(check_table, table)
    if checked is not None:
        assert checked['seq'].is_monotonic_increasing
        pd.testing.assert_frame_equal(check_table(checked), checked)


@tries(150)
@given(messages, counts, counts, seconds)
def test_explain(table, depth, threads, delay_s):
    explanation = answer(explain, table, depth, threads, delay_s)
    assert explanation is None or str(explanation)


@tries(100)
@given(seconds, seconds, counts, counts, counts)
def test_predict(period_s, callback_s, depth, threads, messages):
    table = answer(predict, period_s, callback_s, depth, threads, messages)
    assert table is None or len(table) == messages


ESTIMATE = fusion.fuse(fusion.simulate(1, 1.0, rate=10.0).measurements)
DRIVE = fusion.simulate(1, 1.0, rate=10.0)
TREE = interfaces.dependencies('std_msgs/msg/Header')
FRAMES = pd.DataFrame(
    {'parent': ['map', 'odom', 'base'], 'child': ['odom', 'base', 'imu'], 'publisher': list('abb')}
)
ENDPOINTS = pd.DataFrame(
    [['a', 'publisher', '/t', 'T', 'r'], ['b', 'subscription', '/t', 'T', 'r']],
    columns=['node', 'role', 'topic', 'type', 'qos'],
)
INNOVATIONS = fusion.innovations(DRIVE.measurements)
ERRORS = fusion.errors(ESTIMATE, DRIVE.truth)
some = mostly(st.none() | measured)
spans = mostly(st.none() | st.tuples(measured, measured))
PICTURES = {
    plots.sequence_gaps: st.tuples(messages),
    plots.timeline: st.tuples(
        messages | st.dictionaries(texts, messages, min_size=1, max_size=2), spans
    ),
    plots.queue_length: st.tuples(messages, counts),
    plots.latency: st.tuples(messages, some),
    plots.before_and_after: st.tuples(messages, messages, mostly(st.just(('a', 'b')))),
    plots.sweep: st.tuples(mostly(damaged(RUN[['published_s', 'started_s']])), some),
    plots.bars: st.tuples(mostly(st.lists(measured | cells, max_size=3).map(pd.Series)), texts),
    plots.topic_graph: st.tuples(mostly(damaged(ENDPOINTS))),
    plots.interface_tree: st.tuples(mostly(damaged(TREE))),
    plots.frame_tree: st.tuples(mostly(damaged(FRAMES))),
    plots.innovation: st.tuples(mostly(damaged(INNOVATIONS))),
    plots.path: st.tuples(
        mostly(damaged(DRIVE.truth)),
        mostly(st.dictionaries(texts, damaged(ESTIMATE), min_size=1, max_size=2)),
        mostly(st.none() | damaged(DRIVE.measurements)),
        mostly(st.sampled_from([None, 0.1, 0.5])),
    ),
    plots.error: st.tuples(
        mostly(st.dictionaries(texts, damaged(ERRORS), min_size=1, max_size=2)),
        mostly(st.none() | st.dictionaries(texts, spans, max_size=2)),
    ),
}


@pytest.mark.parametrize('draw', PICTURES, ids=lambda draw: draw.__name__)
def test_pictures(draw):
    plt.switch_backend('agg')

    @tries(12)
    @given(PICTURES[draw])
    def no_picture_fails(arguments):
        try:
            picture = answer(draw, *arguments)
            assert picture is not None or not plt.get_fignums(), 'bad input raises before drawing'
            if picture is not None:
                answer(getattr(picture, 'figure', picture).draw_without_rendering)
        finally:
            plt.close('all')

    no_picture_fails()


drives = mostly(damaged(DRIVE.measurements))


variances = st.lists(measured, min_size=8, max_size=8)
SETTINGS = {
    'sensors': mostly(st.lists(st.sampled_from(fusion.SENSORS), max_size=3)),
    'process_noise': mostly(variances | st.dictionaries(st.sampled_from(fusion.STATE), measured)),
    'variances': mostly(st.dictionaries(st.sampled_from([*fusion.VARIANCES]), measured)),
    'config': mostly(st.dictionaries(st.sampled_from(fusion.SENSORS), mostly(st.just(['vx'])))),
    'gate': mostly(measured | st.dictionaries(st.sampled_from(fusion.SENSORS), mostly(measured))),
    'initial_state': mostly(variances),
    'initial_covariance': mostly(variances),
}
changes = st.lists(st.sampled_from([*SETTINGS]), max_size=2, unique=True)


@tries(60)
@given(
    drives, changes.flatmap(lambda names: st.fixed_dictionaries({n: SETTINGS[n] for n in names}))
)
def test_fuse(measurements, changed):
    estimate = answer(fusion.fuse, measurements, **changed)
    assert estimate is None or np.isfinite(estimate.dropna()).all(axis=None)
    answer(fusion.innovations, measurements, **changed)


@tries(60)
@given(mostly(damaged(ESTIMATE)), mostly(damaged(DRIVE.truth)), anything)
def test_errors_of_an_estimate(estimate, truth, names):
    answer(fusion.errors, estimate, truth)
    answer(fusion.rmse, estimate, truth)
    answer(fusion.nees, estimate, truth)
    answer(fusion.nees, ESTIMATE, DRIVE.truth, names)
    answer(fusion.covariances, estimate, names)


@tries(60)
@given(
    st.dictionaries(
        st.sampled_from([*fusion.simulate.__kwdefaults__, 'seed', 'seconds']),
        mostly(measured | st.integers(0, 9) | st.tuples(measured, measured)),
        min_size=1,
        max_size=2,
    )
)
def test_simulate(changed):
    answer(fusion.simulate, **({'seed': 1, 'seconds': 1.0} | changed))


# Names of interfaces

names = (
    anything
    | st.text(max_size=30)
    | st.sampled_from(['std_msgs/msg/String', 'sensor_msgs/msg/Image', 'std_srvs/srv/SetBool'])
    | st.from_regex(r'[a-z_]{1,9}(/(msg|srv|action|é|\.\.))?/[A-Za-z_]{1,9}', fullmatch=True)
)


@tries(100)
@given(names, anything)
@example('a' * 300 + '/msg/Image', 'default')
@example('std_msgs/msg/' + 'A' * 300, 'default')
def test_names_of_interfaces(name, comments):
    for function in (interfaces.dependencies, interfaces.needed_packages, interfaces.show):
        answer(function, name)
    answer(interfaces.show, 'std_msgs/msg/Empty', comments)
    answer(interfaces.list_interfaces, name)


# Packages

FILES = {
    'package.xml': b"""<?xml version="1.0"?>
<package format="3">
  <name>custom_interfaces</name>
  <version>0.0.1</version>
  <description>A camera that turns \xc3\xa9</description>
  <maintainer email="a@b.example">A</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend condition="$ROS_VERSION == 2">sensor_msgs</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
""",
    'CMakeLists.txt': b"""cmake_minimum_required(VERSION 3.8)
project(custom_interfaces)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(sensor_msgs REQUIRED) # a comment
set(files "srv/TurnCamera.srv" "msg/Shot.msg")
list(APPEND files action/Turn.action)
if(BUILD_TESTING)
  message(STATUS [[a bracket]])
endif()
rosidl_generate_interfaces(${PROJECT_NAME}
  ${files}
  DEPENDENCIES sensor_msgs
)
ament_package()
""",
    'srv/TurnCamera.srv': b'# turn\nfloat32 deg_turn 1.5\n---\nsensor_msgs/Image image\n',
    'msg/Shot.msg': b'uint8[<=3] pixels [1, 2]\nstring<=5 name "a"\nint32 MOST=3\nbool on\n',
    'action/Turn.action': b'float64 to\n---\nbool done\n---\nShot last\n',
}
ENTITIES = b"""<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"> <!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;"> <!ENTITY d "&c;&c;&c;&c;&c;&c;&c;&c;&c;">
<!ENTITY e "&d;&d;&d;&d;&d;&d;&d;&d;&d;"> <!ENTITY f "&e;&e;&e;&e;&e;&e;&e;&e;&e;">
<!ENTITY g SYSTEM "file:///etc/hostname"> ]>"""
PIECES = [
    *(b'(', b')', b'"', b'${', b'}', b'[[', b']]', b'[=[', b'<', b'/>', b'\\', b'---\n', b'\n'),
    *(
        b'\x00',
        b'\xff',
        b'\xc3',
        b'#',
        b';',
        b'=',
        b',',
        b'$',
        b'..',
        b'/',
        b'&f;',
        b'&g;',
        b'msg/',
    ),
    *(
        b'<a>' * 2000,
        b'<![CDATA[',
        b'<!--',
        b'x' * 300,
        b'\r',
        b' ' * 3000,
        b'()' * 500,
        b'#[[' * 99,
    ),
    *(
        b'if(',
        b'endif()',
        b'set(',
        b'DEPENDENCIES',
        b'$ROS_DISTRO == ',
        b'9' * 30,
        b'<=',
        b'string',
    ),
]


@st.composite
def damaged_text(draw, text):
    """A text with lines and pieces added, taken away, exchanged, or in another encoding."""
    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.sampled_from(
            ['delete', 'double', 'swap', 'cut', 'insert', 'bytes', 'crlf', 'bom', 'utf-16', 'dtd',
             'empty', 'other']
        ))  # fmt: skip
        lines = text.splitlines(keepends=True) or [b'']
        one, other = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
        at = draw(st.integers(0, len(text)))
        if kind == 'delete':
            text = b''.join(lines[:one] + lines[one + 1 :])
        elif kind == 'double':
            text = b''.join(lines[: one + 1] + lines[one:])
        elif kind == 'swap':
            lines[one], lines[other] = lines[other], lines[one]
            text = b''.join(lines)
        elif kind == 'cut':
            text = text[:at]
        elif kind == 'insert':
            text = text[:at] + draw(st.sampled_from(PIECES)) + text[at + draw(st.integers(0, 9)) :]
        elif kind == 'bytes':
            text = text[:at] + draw(st.binary(max_size=6)) + text[at + draw(st.integers(0, 9)) :]
        elif kind == 'crlf':
            text = text.replace(b'\n', b'\r\n')
        elif kind == 'bom':
            text = b'\xef\xbb\xbf' + text
        elif kind == 'utf-16':
            text = text.decode('latin-1').encode('utf-16')
        elif kind == 'dtd':
            text = text.replace(b'?>', b'?>' + ENTITIES).replace(b'camera', b'&f; &g;')
        else:
            text = b'' if kind == 'empty' else draw(st.sampled_from([*FILES.values()]))
    return text


@st.composite
def packages(draw):
    """Up to three files of a right package are damaged, gone, or no files at all."""
    files = dict(FILES)
    for name in draw(st.lists(st.sampled_from([*FILES]), min_size=1, max_size=3)):
        files[name] = draw(
            damaged_text(FILES[name]) | st.sampled_from([None, 'folder', 'link', 'loop', *NAMES])
        )
    return files


NAMES = ['srv/a b.srv', 'srv/\udcff.srv', 'msg/Two\nLines.msg', 'msg/.msg', 'action/$.action']


def write(root, files):
    for name, content in files.items():
        if content is None:
            continue
        path = root / (content if content in NAMES else name)
        path.parent.mkdir(exist_ok=True)
        if content == 'folder':
            path.mkdir()
        elif content in ('link', 'loop'):
            path.symlink_to('nowhere' if content == 'link' else path.name)
        else:
            path.write_bytes(FILES[name] if content in NAMES else content)


@tries(80)
@given(packages())
def test_packages(files):
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder), files)
        findings = answer(interfaces.check_package, folder)
        if findings is not None:
            assert all(isinstance(part, str) and part for found in findings for part in found)
            assert repr(findings).encode(), 'can be printed'


def test_the_right_package_lacks_nothing(tmp_path):
    write(tmp_path, FILES)
    assert interfaces.check_package(tmp_path) == ()


@tries(50)
@given(anything | st.text(max_size=20))
@example('a' * 5000)
@example('a/' * 3000)
def test_folders(path):
    if not (isinstance(path, str) and os.path.isdir(path)):
        answer(interfaces.check_package, path)


words = st.sampled_from(PIECES).map(lambda piece: piece.decode('latin-1')) | st.sampled_from(
    ['set(a b)', 'list(APPEND a ${a} c)', '${a}', '\n', ' ', 'rosidl_generate_interfaces(',
     'project(', 'a', '"${a}${b}"', 'else()', 'foreach(x)', 'endforeach()', '#[[', ']=]', '"a\nb"',
     '${PROJECT_SOURCE_DIR}:a;b', 'LIBRARY_NAME', 'find_package()']
)  # fmt: skip


@tries(200)
@given(
    st.lists(words | st.text(max_size=5), max_size=20).map(''.join)
    | damaged_text(FILES['CMakeLists.txt']).map(lambda text: text.decode('utf-8', 'replace'))
)
def test_cmake_lists(text):
    try:
        with warnings.catch_warnings(action='error'):
            CMakeLists(text)
    except CMakeListsError as error:
        missing, said = error.args
        assert missing
        assert said.startswith('CMake stops')
