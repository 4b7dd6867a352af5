"""The robot, seen: its pictures in Python, its replay in a JavaScript engine, both in a kernel."""

import json
import math
import re
import threading
from html import unescape
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import quickjs
from geometry_msgs.msg import Twist
from jupyter_client.manager import run_kernel
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Imu, LaserScan

from helpers import robot_view
from helpers.replay import source
from helpers.robot import CORRIDOR, EMPTY, ROOMS, DriveRecord, Pose, Robot
from helpers.robot.body import Body
from helpers.robot.record import Command, Event, Scan, Step
from helpers.robot.sensors import Sensors
from helpers.robot_view import Place, drive_by_hand, replay_drive, watch
from helpers.robot_view.by_hand import Tour
from helpers.robot_view.live import LiveView
from helpers.robot_view.scans import ScanRecording
from helpers.ros import ros_session, spun

MOST_BYTES = 61_000


def html(shown):
    return shown._repr_mimebundle_()['text/html']


def record_of(shown, index=0):
    """What the page gets of a run."""
    data = re.search("data-record='([^']*)'", html(shown))[1]
    return json.loads(unescape(data))['runs'][index]


@pytest.fixture
def script():
    """Return a function that looks at a drive as the page does, at these milliseconds."""
    context = quickjs.Context()
    context.eval(source(Path(robot_view.__file__).with_name('drive.js')))
    context.eval("""function looked(record, times) {
        const run = drive(record);
        return { seen: times.map(run.look), told: run.told, times: run.times,
            says: run.told.flatMap((told, i) => (told ? [run.says(i + 1)] : [])) };
    }""")

    def looked(record, times):
        return json.loads(
            context.eval(f'JSON.stringify(looked({json.dumps(record)}, {json.dumps(times)}))')
        )

    return looked


@pytest.fixture(scope='module')
def long_drive():
    """Return the record of three minutes, from wall to wall."""
    body, record = Body(ROOMS), DriveRecord(ROOMS)
    sensors = Sensors(0, True, None)
    for step in range(9000):
        before = body.bumps
        command = Command(
            body.t_s, -0.3 if step % 150 < 50 else 1.0, 1.3 if step % 150 < 50 else 0.1
        )
        body.step([command])
        record.poses.append(Step(body.t_s, *body.pose, body.v, body.w))
        if step % 5 == 0:
            record.commands.append(command)
            record.scans.append(Scan(len(record.scans), body.t_s, 0, *sensors.scan(body)))
        if body.bumps > before:
            record.events.append(Event(body.t_s, 'bump', f'It hit something in step {step}.'))
    return record


def test_a_long_drive_is_small_and_keeps_its_bumps(long_drive):
    shown = replay_drive(long_drive)
    bumps = [event for event in long_drive.events if event.kind == 'bump']
    assert len(bumps) > 20
    assert str(shown) == 'Replay: A drive on the floor rooms. The robot hit something.'
    assert len(html(shown).encode()) < MOST_BYTES
    kept = record_of(shown)['events']
    assert [[round(1000 * bump.t_s), bump.text] for bump in bumps][: len(kept)] == kept
    assert len(record_of(shown)['bumps']) == min(len(bumps), 50)


def test_the_page_shows_where_the_robot_was(script, long_drive):
    rows = [row for row in long_drive.poses if row.t_s < 38]
    early = DriveRecord(ROOMS, poses=rows)
    record = record_of(replay_drive(early))
    seen = script(record, [1000 * row.t_s for row in rows])['seen']
    for row, at in zip(rows, seen, strict=True):
        # Ten poses a second are kept: at 1 m/s a wall is noticed 5 cm too early or too late.
        assert math.dist((row.x, row.y), (at['x'], at['y'])) < 0.06
        assert abs(math.remainder(row.yaw - at['yaw'], math.tau)) < 0.05


def made_drive(*rows, bumps=()):
    """Return a drive in the corridor, (t, x, v) of each step, and the times of its bumps."""
    poses = [Step(t_s, x, 1.25, 0.0, v, 0.0) for t_s, x, v in rows]
    events = [Event(t_s, 'bump', 'It hit something.') for t_s in bumps]
    return DriveRecord(CORRIDOR, poses=poses, events=events)


@pytest.mark.parametrize(
    ('record', 'says'),
    [
        (made_drive((0, 1, 0.5), (2, 2, 0.5), bumps=[1.24]), 'The robot hit the wall after 1.2 s.'),
        (made_drive((0, 1, 0.5), (2, 4.08, 0)), 'The robot stands, 0.42 m before the wall.'),
        (made_drive((0, 1, 0.5), (2, 2, 0.5)), 'Nothing was hit.'),
        (made_drive((0, 1, 0.5), (2, 1, 0)), 'Nothing was hit.'),
        (made_drive((0, 1, 0), (2, 1, 0)), 'The robot did not move.'),
    ],
)
def test_how_a_drive_ended_is_a_sentence(record, says):
    shown = replay_drive(record)
    assert record_of(shown)['outcome'] == says
    assert not re.search(r'\d', str(shown))  # that is compared, and times differ from run to run


def test_a_picture_without_scripts_is_at_the_bump():
    record = made_drive((0, 1, 0.5), (2, 2, 0.5), (4, 1, -0.5), bumps=[2])
    assert (
        'class="robot" transform="translate(2.000 1.250)"' in replay_drive(record).runs[0].picture()
    )
    at_end = replay_drive(record, opens='end')
    assert 'class="robot" transform="translate(1.000 1.250)"' in at_end.runs[0].picture()
    assert '"opens":"end"' in unescape(html(at_end))


def live_record(view):
    return json.loads(unescape(re.search("data-live='([^']*)'", view.html())[1]))


def test_the_live_laser_belongs_to_its_pose(script):
    # The scan was made at x 1, and the robot has driven on.
    record = made_drive(*((t / 50, 1 + t / 100, 0.5) for t in range(101)))
    ranges = np.full(181, 0.5, np.float32)
    record.scans.append(Scan(0, 0.0, 0, ranges, -math.pi / 2, math.pi / 180))
    [seen] = script(live_record(LiveView(SimpleNamespace(record=record), None)), [2000])['seen']
    assert seen['fan'].startswith('M1 1.25L')
    assert (seen['x'], seen['y']) == (2, 1.25)


def test_a_telling_that_was_lost_is_no_harm():
    record = made_drive((0, 1, 0.5))
    view = LiveView(SimpleNamespace(record=record), None)
    shown = live_record(view)['poses']
    for step in range(1, 400):
        record.poses.append(Step(step / 50, 1 + step / 100, 1.25, 0.0, 0.5, 0.0))
        if step % 4:
            continue
        news = view.news()['rows']['poses']
        if step % 100:  # else it is lost
            shown[news['from'] :] = news['added']
        assert len(news['added']) <= 30
    assert [row[0] for row in shown] == [round(row.x, 3) for row in record.poses[::5]]


def test_a_robot_that_leaves_its_strip_is_seen_on_the_floor():
    record = made_drive((0, 1, 0.5))
    view = LiveView(SimpleNamespace(record=record), None)
    assert 'strip' in live_record(view)
    record.poses.append(Step(0.02, 1, 2.0, 1.6, 0.5, 0.0))
    assert 'strip' not in live_record(LiveView(SimpleNamespace(record=record), None))


# Beside the queue


class Brake(Node):
    """Drives until it sees a wall."""

    def __init__(self):
        super().__init__('brake')
        self.recording, self.worked_on = None, []  # what the live picture shows
        self.commands = self.create_publisher(Twist, 'cmd_vel', 10)
        self.scans = self.create_subscription(LaserScan, 'scan', self.look, 50)

    def look(self, scan):
        if self.recording is not None:
            self.worked_on.append(list(self.recording.now(50)[0]))
        command = Twist()
        command.linear.x = 0.5 if scan.ranges[90] > 0.6 else 0.0
        self.commands.publish(command)


def test_one_sees_which_scan_it_acted_on(script, capsys):
    with ros_session() as session:
        robot = Robot(CORRIDOR, start=Pose(3.3, 1.25, 0.0))
        brake = Brake()
        recording = brake.recording = watch(robot, brake.scans)
        executor = SingleThreadedExecutor()
        executor.add_node(brake)
        session.spin(executor)
        robot.run(20, until=lambda: robot.stopped)
    # The last scan may have come when the brake was ended: it waits, and nobody has heard it.
    heard = recording.table().dropna(subset='started_s')['seq'].tolist()
    assert [seq for seqs in brake.worked_on for seq in seqs] == heard
    shown = replay_drive(robot.record, recording)
    said = 'The robot hit nothing. Depth 50, one thread. None was lost.'
    assert str(shown) == f'Replay: A drive on the floor corridor. {said}'
    assert str(shown) in capsys.readouterr().out  # nobody watches: at the end, and nothing else
    assert len(html(shown).encode()) < MOST_BYTES
    record = record_of(shown)
    # Each callback sends one command, so they come in the order of the scans that were heard.
    assert [one[3] for one in record['commands']] == [
        scan for scan, _ in zip(recording.table()['seq'], record['commands'], strict=False)
    ]
    for at_ms, _, _, seq, age_ms in record['commands']:
        assert at_ms - age_ms == pytest.approx(1000 * robot.record.scans[seq].t_s, abs=1)
    says = script(record, [])['says']
    assert re.fullmatch(
        r'The robot is told to stop\. The callback of message \d+ says so, which is [\d.]+ s old\.',
        says[-1],
    )
    # One slider for both: the page gets the queue as the second run.
    assert record_of(shown, 1)['setup']['callbacks'][0]['depth'] == 50


def test_a_scan_of_just_before_the_recording_has_the_time_of_the_robot():
    with ros_session() as session:
        robot, node = Robot(CORRIDOR), Node('listener')
        scans = node.create_subscription(LaserScan, 'scan', lambda scan: None, 50)
        session.wait_until(lambda: len(robot.record.scans) > 3)  # they wait: nobody spins
        recording = ScanRecording(robot, scans)
        session.spin(spun(node))
        session.wait_until(lambda: recording.heard > 5 and recording.published > 1)
    table = recording.table().dropna(subset='started_s')
    begun_s = recording.started_s - robot.record.started_s
    first = robot.record.scans[table['seq'].iloc[0]]
    assert begun_s == pytest.approx(first.t_s)
    assert (table['published_s'] <= table['started_s']).all()
    assert recording.table().equals(recording.table())


def test_a_callback_that_does_not_return_is_why_it_hit_the_wall(script):
    held = threading.Event()
    with ros_session() as session:
        robot, node = Robot(CORRIDOR, start=Pose(3.9, 1.25, 0.0)), Node('brake')
        scans = node.create_subscription(LaserScan, 'scan', lambda scan: held.wait(60), 1)
        recording = ScanRecording(robot, scans)
        session.spin(spun(node))
        session.wait_until(lambda: recording.heard == 1)
        robot.drive(0.25, 0.0, 5.0)
        held.set()
    shown = replay_drive(robot.record, recording)
    [run, _] = shown.runs
    assert re.fullmatch(
        r'The robot hit the wall: the callback had not returned for \d\.\d s\.', run.headline
    )
    ended = run.ended(Place(CORRIDOR))
    assert re.fullmatch(
        r'The callback had not returned for ([\d.]+) s: \1 s × 0.25 m/s = [\d.]+ m\.',
        ended['cause'],
    )
    # So one sees which scan it works on, and how old that is.
    record = record_of(shown)
    [[began, seq, made], *_] = record['works']
    bump = record['bumps'][0]
    [seen] = script(record, [bump])['seen']
    assert seen['age'] == pytest.approx((bump - made) / 1000)
    assert made == pytest.approx(1000 * robot.record.scans[seq].t_s, abs=1)
    assert began < bump


# In a kernel

CELL = """
from helpers.robot import EMPTY, Robot
from helpers.robot_view import drive_by_hand, watch
from helpers.ros import ros_session
import threading
with ros_session():
    robot = Robot(EMPTY)
    watch(robot)
    robot.drive(0.5, 0.0, 0.5)
    {then}
print([thread.name for thread in threading.enumerate() if thread.name == 'robot view'])
"""
SAID = 'Replay: A drive on the floor empty. The robot hit nothing.'


@pytest.mark.parametrize('watched', [True, False])
def test_the_replay_takes_the_place_of_the_pictures(watched):
    found = []

    def show(message):
        kind, content = message['msg_type'], message['content']
        if kind.endswith('display_data'):
            found.append((kind, content['data']))
        elif kind in ('stream', 'error'):
            found.append((kind, content.get('text', content.get('evalue'))))

    cell = CELL.format(then='' if watched else 'drive_by_hand(robot)')
    with run_kernel(kernel_name='python3') as kernel:
        kernel.execute_interactive(cell, allow_stdin=watched, output_hook=show, timeout=60)
    assert found.pop() == ('stream', '[]\n')
    pictures, (kind, data) = found[:-1], found[-1]
    assert data['text/plain'] == SAID
    assert kind == ('update_display_data' if watched else 'display_data')
    assert bool(pictures) == watched
    if watched:
        picture, *feed, over = [data['text/html'] for _, data in pictures]
        assert 'robot-live' in picture
        assert all("CustomEvent('drive'" in telling for telling in feed)
        assert over == ''  # nothing of it is saved


def test_a_tour_by_hand_says_what_is_done():
    tour = Tour({'A': (1.0, 0.0), 'B': (5.0, 0.0), 'C': (9.0, 0.0)})
    assert tour.sentence(3.0) == ''
    assert [x for x in range(7) if tour.comes_by(x, 0.1)] == [1, 5]
    assert tour.sentence() == 'A and B done, C to go.'
    assert tour.sentence(20.0, bumps=1) == 'You came to A and B, with one bump.'
    assert tour.comes_by(9.2, 0.0)
    assert tour.is_over
    said = 'A, B and C in 24.3 s, without a bump. Run the cell again to be faster.'
    assert tour.sentence(24.26) == said


def test_bad_input_is_one_sentence():
    with pytest.raises(RuntimeError, match='No session is open'), ros_session():
        robot = Robot(EMPTY, sim_time=True)
        node = Node('node')
        wrong = node.create_subscription(Imu, 'imu/data', print, 10)
        with pytest.raises(TypeError, match='Only a robot can be watched'):
            watch(node)
        with pytest.raises(TypeError, match='Only a robot can be driven'):
            drive_by_hand(node)
        with pytest.raises(TypeError, match=r'a method on_key\(forward, turn\)'):
            drive_by_hand(robot, driver=node)
        with pytest.raises(ValueError, match='hears /imu/data: give one that hears /scan'):
            watch(robot, wrong)
        with pytest.raises(TypeError, match='give its subscription'):
            watch(robot, node)
        with pytest.raises(TypeError, match='replayed from robot.record'):
            replay_drive(robot)
        session_is_over = robot
        raise RuntimeError('No session is open')
    with pytest.raises(RuntimeError, match='No session is open'):
        watch(session_is_over)
