"""The robot is a node beside others: on time, the same in each run, and gone with its session."""

import contextlib
import math
import signal
import time

import numpy as np
import pymap3d
import pytest
import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros2_command.api import command_of
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Trigger
from support.nodes import LIMIT_S, Gate, spin
from support.processes import running, traces
from support.waits import wait_for

from helpers.machine import build_environment
from helpers.robot import CORRIDOR, EMPTY, KIND, ROOMS, Pose, Robot
from helpers.robot.body import MAX_ACCELERATION, RADIUS_M, Body
from helpers.robot.messages import DATUM, SKY
from helpers.robot.robot import topics_of
from helpers.ros import graph_environment, ros_session, yaw_of
from helpers.workspace import Process

TOPICS = topics_of(KIND)


class Wanderer(Node):
    """Hears all that a robot says, and drives it around in the time of its clock."""

    def __init__(self):
        use_sim_time = Parameter('use_sim_time', value=True)
        super().__init__('wanderer', parameter_overrides=[use_sim_time])
        self.heard = {topic: [] for topic in TOPICS}
        for topic, kind in TOPICS.items():
            self.create_subscription(kind, topic, self.heard[topic].append, 10)
        self.publisher = self.create_publisher(Twist, 'cmd_vel', 10)
        self.create_timer(0.1, self.on_timer)

    def on_timer(self):
        message = Twist()
        near = self.heard['scan'] and min(self.heard['scan'][-1].ranges[60:121]) < 0.6
        message.linear.x, message.angular.z = (0.0, 1.0) if near else (0.5, 0.2)
        self.publisher.publish(message)


@pytest.fixture(autouse=True)
def nothing_left_behind():
    with ros_session():  # what a process starts only once
        Robot()
    before = traces()
    yield
    assert not rclpy.ok()
    wait_for(lambda: traces() <= before)


def wander(seconds=4.0, **options):
    """Drive in sim time, and return the robot and the node that drove it."""
    with ros_session():
        robot, node = Robot(ROOMS, sim_time=True, **options), Wanderer()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        robot.run(seconds, executor)
    return robot, node


# --- What it says


def test_messages_have_the_frames_and_units_of_the_reps():
    robot, node = wander(noise=False)
    odom, imu, scan, battery, fix, image, _ = (node.heard[topic][-1] for topic in TOPICS)
    true, seen = robot.record.poses[-1], robot.record.scans[-1]
    frames = [message.header.frame_id for message in (odom, imu, fix, scan, image)]
    assert frames == ['odom', 'imu_link', 'gps_link', 'base_scan', 'camera_optical_frame']
    place, twist = odom.pose.pose.position, odom.twist.twist
    assert odom.child_frame_id == 'base_footprint'  # where the speeds are measured
    assert (twist.linear.x, twist.angular.z) == (true.v, true.w)
    start = ROOMS.start  # the wheels count from there
    assert (place.x, place.y) == pytest.approx((true.x - start.x, true.y - start.y), abs=1e-6)
    assert imu.linear_acceleration.z == 9.81  # REP 145: gravity is felt upwards
    assert yaw_of(imu.orientation) == pytest.approx(true.yaw)
    assert (scan.angle_min, scan.angle_max) == pytest.approx((-math.pi / 2, math.pi / 2))
    assert scan.header.stamp.sec * 10**9 + scan.header.stamp.nanosec == seen.stamp_ns
    np.testing.assert_array_equal(scan.ranges, seen.ranges)
    east, north, _ = pymap3d.geodetic2enu(fix.latitude, fix.longitude, fix.altitude, *DATUM)
    assert (east, north) == pytest.approx((true.x, true.y), abs=1e-6)
    assert 0.9 < battery.percentage < 1 < battery.voltage
    assert (image.encoding, image.step, len(image.data)) == ('rgb8', 3 * 64, 3 * 64 * 48)
    # In four seconds; the first was said before anybody listened.
    counts = [len(node.heard[topic]) for topic in TOPICS]
    assert counts == [200, 200, 40, 4, 4, 20, 40]


def test_the_camera_turns_to_what_is_there():
    with ros_session() as session:
        robot, node = Robot(CORRIDOR), Node('looks')
        client = node.create_client(Trigger, 'camera/turn_left')
        spin(session, node)
        for angle in (45, 90):
            answer = client.call(Trigger.Request())
            assert answer.message == f'The camera looks {angle} degrees to the left.'
        side, ahead = (np.reshape(robot.turn_camera(turn).data, (48, 64, 3)) for turn in (0, -90))
    # The wall beside it is near, and as high as the picture; there is sky above the one ahead.
    assert (ahead[0, 24:40] == SKY).all()
    assert not (side == SKY).all(axis=2).any()


# --- Time


def test_real_time_is_the_path_of_its_commands_bit_for_bit():
    with ros_session():
        robot = Robot(ROOMS)
        robot.drive(0.5, 0.4, seconds=1.0)
        record = robot.record
    body, commands, poses = Body(ROOMS), list(record.commands), list(record.poses)
    for step in poses[1:]:
        due = [command for command in commands if command.t_s <= body.t_s]
        commands = commands[len(due) :]
        body.step(due)
        assert (body.t_s, *body.pose, body.v, body.w) == step
    assert not commands


def test_the_robot_goes_on_while_a_callback_waits():
    gate = Gate()
    with ros_session() as session:
        robot, node = Robot(), Node('slow')
        node.create_subscription(LaserScan, 'scan', gate, 10)
        spin(session, node)
        session.wait_until(lambda: gate.inside, LIMIT_S)
        robot.drive(0.5, seconds=0.5)
        assert robot.pose.x - EMPTY.start.x > 0.2
        gate.open()


def test_ten_runs_in_sim_time_are_equal_idle_and_busy():
    runs = []
    with contextlib.ExitStack() as busy:
        for number in range(10):
            if number == 5:
                for _ in range(2):
                    busy.enter_context(running('while True: pass'))
            robot, node = wander(1.0, seed=1)
            runs.append(repr((robot.record.poses, robot.record.commands, node.heard)))
    assert robot.record.commands
    assert len(set(runs)) == 1


# --- The brake


@pytest.mark.parametrize(('depth', 'hits'), [(10, True), (1, False)])
def test_the_brake_is_a_law(depth, hits):
    """At 0.5 m/s it stops below 0.5 m, and then works for 0.2 s: in time on fresh scans alone.

    Scans come every 0.1 s, and one in 0.2 s is heard, so the first below the limit is up to 0.1 m
    below it. It is old by then, and a robot that is told to stop drives v^2 / 2a more.
    - Depth 1: a scan waits for 0.1 s at most.
    - Depth 10: of ten scans a second five are heard, so the queue is full after 2 s. Then the
      oldest of ten is heard, which is 0.9 s old or more.
    What a busy machine loses makes the second worse still. Of the first it may lose 0.19 s in each
    callback, which counts twice: before the scan is heard, and in its age. A node that works first,
    and stops then, is later by 0.2 s, and needs a limit of 0.6 m for the same.
    """
    v, limit, work = 0.5, 0.5, 0.2
    to_go = limit - RADIUS_M - v**2 / 2 / MAX_ACCELERATION  # from the limit, in time to brake
    assert (to_go - v * work - v * 0.1) / (2 * v) > 0.18
    assert (v * 0.9 - to_go) / v > 0.2
    assert CORRIDOR.size_m[0] - 0.5 - CORRIDOR.start.x - limit > 2 * v * 10 / (10 - 1 / work)
    with ros_session() as session:
        robot, node = Robot(CORRIDOR), Node('brake')
        publisher = node.create_publisher(Twist, 'cmd_vel', 10)
        seen = []

        def on_scan(scan):
            seen.append(min(scan.ranges))
            message = Twist()
            message.linear.x = v if min(seen) >= limit else 0.0
            publisher.publish(message)
            time.sleep(work)

        node.create_subscription(LaserScan, 'scan', on_scan, depth)
        spin(session, node)
        robot.run(30, until=lambda: robot.bumps or (robot.stopped and min(seen) < limit))
        assert bool(robot.bumps) == hits


# --- Its life


def test_a_robot_in_another_process_is_heard_and_ends(tmp_path):
    """Also in a folder with a file that has the name of one of Python's own modules."""
    (tmp_path / 'copy.py').write_text('raise RuntimeError')
    with ros_session() as session:
        node = Node('listener')
        heard = []
        node.create_subscription(LaserScan, '/far/scan', heard.append, 10)
        spin(session, node)
        with robot_process(tmp_path, 'corridor', '--ros-args', '-r', '__ns:=/far') as process:
            process.wait_for('drives', LIMIT_S)
            session.wait_until(lambda: heard, LIMIT_S)
            assert heard[0].header.frame_id == 'far/base_scan'
        assert process.wait() == 0
        gone = pytest.raises(RuntimeError, match='No such file.*nowhere.txt')
        with robot_process(tmp_path, 'nowhere.txt') as process, gone:
            process.wait_for('drives', LIMIT_S)


def robot_process(folder, floor, *arguments):
    """Start the robot as a launch file does: as a package that is installed beside ROS 2."""
    environment = build_environment()
    command = [*command_of('simulated_robot', 'robot', environment), '--floor', floor, *arguments]
    return Process('robot', command, environment | graph_environment(), folder)


def test_an_interrupt_ends_the_robot():
    with pytest.raises(KeyboardInterrupt), ros_session():
        Robot().run(LIMIT_S, until=lambda: signal.raise_signal(signal.SIGINT))


# --- Bad input


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf])
def test_speeds_that_are_no_numbers_are_ignored(bad, capsys):
    with ros_session():
        robot = Robot()
        robot.drive(0.5, seconds=0.3)
        for _ in range(3):
            robot.command(bad)
            robot.command(0.0, bad)
        robot.run(LIMIT_S, until=lambda: len(robot.record.events) == 6)
        assert robot.stopped
    assert {command.v for command in robot.record.commands} == {0.5, 0.0}
    assert capsys.readouterr().out == (
        '[WARN] [robot]: A command was ignored: its speeds must be finite numbers.\n'
    )


def test_what_cannot_be_gets_one_sentence():
    with pytest.raises(RuntimeError, match='No session is open'):
        Robot()
    with ros_session():
        robot = Robot(ROOMS)
        with pytest.raises(TypeError, match='needs a floor, such as CORRIDOR'):
            Robot('rooms')
        with pytest.raises(ValueError, match='There is a node robot already: give'):
            Robot(ROOMS)
        with pytest.raises(ValueError, match='would start in a wall'):
            Robot(ROOMS, 'other', start=Pose(0, 0, 0))
        with pytest.raises(RuntimeError, match='A robot spins itself: add only your own'):
            SingleThreadedExecutor().add_node(robot)
        with pytest.raises(ValueError, match='with session.spin'):
            robot.run(1, SingleThreadedExecutor())
        with pytest.raises(TypeError, match='give SingleThreadedExecutor'):
            Robot(name='two', sim_time=True).run(1, MultiThreadedExecutor())
        other = Node('stamped')
        other.create_publisher(TwistStamped, '/three/cmd_vel', 10)
        with pytest.raises(ValueError, match='type geometry_msgs/msg/TwistStamped, and nothing'):
            Robot(namespace='three')
