"""Each habit of a robot's drivers, alone, as a program of a student meets it."""

import math
from contextlib import contextmanager

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import BatteryState, Imu, LaserScan
from support.waits import wait_for

from helpers.robot import CORRIDOR, EMPTY, KIND, TURTLEBOT3, Robot
from helpers.robot.robot import command_type
from helpers.robot_view.picture import fan
from helpers.ros import ros_session, yaw_of


class Listener:
    """A node that keeps what it receives, and says commands of a type."""

    def __init__(self, session, *topics, command=Twist):
        self.node, self.received = session.node, {topic: [] for topic, _ in topics}
        for topic, kind in topics:
            append = self.received[topic].append
            self.node.create_subscription(kind, topic, append, qos_profile_sensor_data)
        self.commands, self.kind = self.node.create_publisher(command, 'cmd_vel', 1), command
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)

    def say(self, v, w=0.0):
        message = self.kind()
        twist = getattr(message, 'twist', message)
        twist.linear.x, twist.angular.z = v, w
        self.commands.publish(message)


@contextmanager
def ended(context):
    """Shut a context down at the end of the block."""
    try:
        yield context
    finally:
        context.try_shutdown()


def run(driver, *topics, command=Twist, v=0.2, seconds=2.0, floor=EMPTY, during=None, **options):
    """Say one command to a robot, let it run, and return it and what was received."""
    with ros_session() as session:
        robot = Robot(floor, driver=driver, sim_time=True, **options)
        listener = Listener(session, *topics, command=command)
        session.wait_until(lambda: listener.commands.get_subscription_count() == 1)
        robot.run(0.1, listener.executor)
        listener.say(v)
        if during is not None:
            during(robot)
        robot.run(seconds, listener.executor)
        listener.executor.remove_node(listener.node)
        return robot, listener.received


@pytest.mark.parametrize(
    ('driver', 'command', 'drives'),
    [
        (KIND, Twist, True),
        (KIND.but(stamped_commands=True, names_wrong_types=False), Twist, False),
        (KIND.but(stamped_commands=True), TwistStamped, True),
        (TURTLEBOT3, TwistStamped, True),
        (TURTLEBOT3, Twist, False),
    ],
)
def test_a_command_of_the_other_type_is_never_received(driver, command, drives):
    # From another participant: one alone cannot use a topic with two types.
    with ros_session() as session, ended(rclpy.Context()) as other:
        other.init(domain_id=int(session.environment['ROS_DOMAIN_ID']))
        robot = Robot(driver=driver, sim_time=True)
        node = rclpy.create_node('remote', context=other)
        publisher = node.create_publisher(command, 'cmd_vel', 10)
        message = command()
        getattr(message, 'twist', message).linear.x = 0.2
        session.wait_until(lambda: 'remote' in session.node.get_node_names())
        wait_for(lambda: publisher.get_subscription_count() == drives)
        publisher.publish(message)
        if drives:
            publisher.wait_for_all_acked()
        robot.run(0.5)
        assert (robot.pose.x > EMPTY.start.x) == drives
        node.destroy_node()


def test_without_a_timeout_the_last_command_counts_for_ever():
    kind, _ = run(KIND, seconds=5.0)
    goes_on, _ = run(KIND.but(command_timeout_s=None), seconds=5.0)
    assert kind.stopped
    assert not goes_on.stopped
    assert goes_on.pose.x - EMPTY.start.x == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ('said', 'heard'), [(0.129, 0.12), (-0.129, -0.12), (0.009, 0.0), (5, 0.21)]
)
def test_commands_are_cut_to_steps_and_to_the_greatest_speed(said, heard):
    robot, _ = run(TURTLEBOT3, command=TwistStamped, v=float(said), seconds=1.0)
    assert robot.record.poses[-1].v == pytest.approx(heard)


def test_the_laser_of_a_turtlebot_is_as_its_driver_has_it():
    _, received = run(TURTLEBOT3, ('scan', LaserScan), floor=CORRIDOR, command=TwistStamped, v=0.0)
    scans = received['scan']
    assert len({len(scan.ranges) for scan in scans}) > 1
    for scan in scans:
        assert (scan.range_min, scan.range_max) == (0.0, 100.0)
        assert 0 <= scan.angle_min < 0.1
        assert math.tau - 0.1 < scan.angle_max < math.tau + 1e-6
        assert np.isnan(scan.ranges).any()
        ahead = np.nanmin([scan.ranges[0], scan.ranges[1], scan.ranges[-1]])
        assert ahead == pytest.approx(3.25, abs=0.05)
        left = scan.ranges[len(scan.ranges) // 4 - 3 : len(scan.ranges) // 4 + 3]
        assert np.nanmin(left) == pytest.approx(0.75, abs=0.05)


def test_where_nothing_is_a_turtlebot_sees_nothing_and_the_kind_robot_infinity():
    _, real = run(TURTLEBOT3, ('scan', LaserScan), command=TwistStamped)
    _, kind = run(KIND, ('scan', LaserScan))
    assert np.isnan(real['scan'][-1].ranges).all()
    assert np.isinf(kind['scan'][-1].ranges).all()


@pytest.mark.parametrize('driver', [KIND, TURTLEBOT3])
def test_a_laser_goes_blind_and_can_be_drawn(driver):
    def blinded(robot):
        robot.blind = True

    robot, received = run(
        driver,
        ('scan', LaserScan),
        command=command_type(driver),
        floor=CORRIDOR,
        during=blinded,
    )
    assert np.isnan(received['scan'][-1].ranges).all()
    assert not np.isnan(received['scan'][0].ranges).all()
    assert 'nan' not in fan(robot.pose, robot.record.scans[-1])
    assert 'nan' not in fan(robot.pose, robot.record.scans[0])


def test_a_clock_runs_ahead():
    def ahead(robot):
        robot.clock_ahead_s = 5.0

    robot, received = run(KIND, ('scan', LaserScan), ('odom', Odometry), during=ahead)
    for topic, messages in received.items():
        stamps = [message.header.stamp.sec for message in messages]
        assert stamps[-1] - stamps[0] >= 5, topic
    assert robot.record.scans[-1].stamp_ns // 10**9 == received['scan'][-1].header.stamp.sec


def test_a_battery_of_100_and_covariances_of_zero():
    topics = [('battery_state', BatteryState), ('odom', Odometry), ('imu', Imu)]
    _, received = run(TURTLEBOT3, *topics, command=TwistStamped)
    assert 99 < received['battery_state'][-1].percentage <= 100
    assert not received['odom'][-1].pose.covariance.any()
    assert not received['odom'][-1].twist.covariance.any()
    assert not received['imu'][-1].orientation_covariance.any()
    assert received['odom'][-1].child_frame_id == 'base_footprint'
    assert 18 <= len(received['odom']) / 2.1 <= 21
    _, received = run(KIND, ('battery_state', BatteryState), ('odom', Odometry))
    assert 0.99 < received['battery_state'][-1].percentage <= 1
    assert received['odom'][-1].pose.covariance.any()


def test_a_turtlebot_has_no_topics_beyond_its_own():
    with ros_session():
        robot = Robot(driver=TURTLEBOT3)
        names = {publisher.topic_name for publisher in robot.publishers}
        (laser,) = [topic for topic in robot.publishers if topic.topic_name == '/scan']
        assert laser.qos_profile.reliability == QoSReliabilityPolicy.BEST_EFFORT
    assert {'/scan', '/odom', '/imu', '/battery_state'} <= names
    assert not {'/gps/fix', '/bumper', '/camera/image_raw', '/imu/data'} & names


def test_an_unknown_habit_is_one_sentence():
    with pytest.raises(ValueError, match=r"no habit 'timeout'\. It has: .*command_timeout_s"):
        KIND.but(timeout=1)
    with pytest.raises(ValueError, match='half, ld08'):
        KIND.but(laser='lds')
    with ros_session(), pytest.raises(TypeError, match='KIND or TURTLEBOT3'):
        Robot(driver='turtlebot3')


def test_a_simulator_tells_the_true_pose():
    with ros_session() as session:
        robot = Robot(CORRIDOR, sim_time=True, driver=KIND.but(ground_truth=True))
        listener = Listener(session, ('ground_truth', Odometry))
        robot.command(0.5, 0.2)
        robot.run(0.5, listener.executor)
        pose = listener.received['ground_truth'][-1].pose.pose
    assert (pose.position.x, pose.position.y) == (robot.pose.x, robot.pose.y)
    assert yaw_of(pose.orientation) == pytest.approx(robot.pose.yaw)
