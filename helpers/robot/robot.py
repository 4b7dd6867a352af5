"""The robot: a ROS node that drives on a floor. See `helpers.robot`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from itertools import cycle

import numpy as np
from builtin_interfaces.msg import Time as Stamp
from geometry_msgs.msg import TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import Executor, SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import BatteryState, Image, Imu, LaserScan, NavSatFix
from std_msgs.msg import Bool, Header
from std_srvs.srv import Trigger

from helpers.notebook import uninterrupted
from helpers.robot import messages
from helpers.robot.body import RATE_HZ, Body, wrapped
from helpers.robot.drivers import KIND, Driver
from helpers.robot.floor import EMPTY, Floor, Pose
from helpers.robot.record import Command, DriveRecord, Event, Scan, Step
from helpers.robot.sensors import Sensors
from helpers.ros import START_NS, current_session, quaternion

GPS, CAMERA, BUMPER = 'gps/fix', 'camera/image_raw', 'bumper'
TRUTH = 'ground_truth'
SCAN_EVERY, PICTURE_EVERY = RATE_HZ // 10, RATE_HZ // 5  # steps
CAMERA_FRAME = 'camera_optical_frame'


class Robot(Node):
    """A small robot on a floor. It lives beside your program, as another machine would.

    It hears `cmd_vel`, and publishes `odom`, `imu/data`, `gps/fix`, `scan`, `battery_state`,
    `camera/image_raw` and `bumper`, as `driver` has them (see `helpers.robot.drivers`). Its
    executor and its thread are its own, so a slow node of yours does not slow it; the session ends
    them. `start` replaces the start of the floor. The `seed` decides the errors of the sensors;
    with `noise=False` they have none. The wheels slip during `slip` (from, to in s). `mounting`
    says which sensors are turned, and by which yaw (rad): `{'imu_link': 0.3, 'base_scan': -0.5}`;
    their messages are in their own frames, as they are.

    With `sim_time=True` time passes in `run` alone, as fast as the program, and `/clock` says it.
    With `spin=False` the caller spins it, and no session is needed.

    `blind = True` takes the laser's sight away: all its ranges are NaN from then on. With
    `silent = True` the laser publishes no scan. `clock_ahead_s` is by how much (s) the stamps are
    ahead of the time.

    Raises RuntimeError where no session is open, TypeError for a floor that is none, and ValueError
    for a start in a wall and for a name that another node has.
    """

    stands_alone = True  # for helpers.ros.connections: not everything that it says needs a listener
    _own_executor: Executor | None = None

    def __init__(
        self,
        floor: Floor = EMPTY,
        name: str = 'robot',
        namespace: str = '',
        *,
        start: Pose | None = None,
        seed: int = 0,
        noise: bool = True,
        slip: tuple[float, float] | None = None,
        mounting: Mapping[str, float] | None = None,
        driver: Driver = KIND,
        sim_time: bool = False,
        spin: bool = True,
    ) -> None:
        if not isinstance(floor, Floor):
            raise TypeError(f'A robot needs a floor, such as CORRIDOR, not {floor!r}.')
        if not isinstance(driver, Driver):
            raise TypeError(f'A robot needs drivers, such as KIND or TURTLEBOT3, not {driver!r}.')
        self.driver = driver
        self._body = Body(floor, start, driver)
        self._sensors = Sensors(seed, noise, slip, mounting, driver)
        # What can go wrong: a laser that measures or says nothing, and a clock that is ahead.
        self.blind, self.silent, self.clock_ahead_s = False, False, 0.0
        if spin:
            session = current_session()
            check_names(session.node, name, namespace.strip('/'), driver)
        super().__init__(name, namespace=namespace)
        self.floor, self.sim_time, self.record = floor, sim_time, DriveRecord(floor)
        self._arrived: list[Command] = []
        self._camera_yaw, self._moved, self._warned = 0.0, False, set()
        self._stamp = Stamp()  # of the last step
        namespace = self.get_namespace().strip('/')
        self._prefix = f'{namespace}/' if namespace else ''  # of frames, as a TurtleBot 3 has it
        self._make_topics()
        if not sim_time:
            self.record.started_s = time.monotonic()
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self.create_timer(1 / RATE_HZ, self._catch_up, clock=steady)
        self._look()
        if spin:
            with uninterrupted():
                executor = SingleThreadedExecutor()
                executor.add_node(self)
                self._own_executor = executor
                if not sim_time:
                    session.spin(executor)

    @property
    def executor(self) -> Executor | None:
        """The executor that it spins in: its own, unless it was made with `spin=False`."""
        return Node.executor.fget(self)

    @executor.setter
    def executor(self, executor: Executor | None) -> None:
        if self._own_executor is not None and executor is not None:
            raise RuntimeError('A robot spins itself: add only your own nodes to an executor.')
        Node.executor.fset(self, executor)

    def _make_topics(self) -> None:
        events = SubscriptionEventCallbacks(use_default_callbacks=False)
        kind = command_type(self.driver)
        self.create_subscription(kind, 'cmd_vel', self._on_command, 10, event_callbacks=events)
        if self.driver.camera:
            self.create_service(Trigger, 'camera/turn_left', self._on_turn_left)
        self._topics = {
            topic: self._publisher(kind, topic) for topic, kind in topics_of(self.driver).items()
        }
        self._clock_topic = self._publisher(ClockMessage, '/clock') if self.sim_time else None
        self._remote = None
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:  # the wheels lack it: see provide_tf2_msgs of helpers.workspace
            return
        if not self.driver.publish_tf:
            return
        # Where its parts are on it, a robot_state_publisher knows from the URDF.
        self._topics['/tf'] = self._publisher(TFMessage, '/tf')

    def _publisher(self, kind: type, topic: str) -> Publisher:
        # The default callbacks of events would double the time of each look for work.
        events = PublisherEventCallbacks(use_default_callbacks=False)
        # RELIABLE, which both kinds of subscriptions hear, as a TurtleBot 3 in Gazebo has it. The
        # drivers of its real lasers are BEST_EFFORT.
        qos = QoSProfile(depth=10)
        if kind is LaserScan and self.driver.laser == 'ld08':
            qos = qos_profile_sensor_data
        return self.create_publisher(kind, topic, qos, event_callbacks=events)

    # --- What one can ask

    @property
    def pose(self) -> Pose:
        """Where the robot truly is on the floor: x, y (m), yaw (rad)."""
        return self._body.pose

    @property
    def t_s(self) -> float:
        """How long it has lived (s)."""
        return self._body.t_s

    @property
    def bumps(self) -> int:
        """How often it has hit a wall or a box."""
        return self._body.bumps

    @property
    def stopped(self) -> bool:
        """Whether it has moved, and is at rest now."""
        return self._moved and self._body.v == 0 == self._body.w

    # --- What one can do

    def run(
        self, seconds: float, *executors: Executor, until: Callable[[], bool] = lambda: False
    ) -> bool:
        """Let the robot go on for some seconds of its time, or until `until()` holds.

        In sim time it spins the single-threaded executors that it is given, and nobody else may:
        after each step of 0.02 s, all that is ready in them is done before the next. So a run is
        the same each time, however slow the machine is. A callback takes no time, so it must not
        wait for the robot.

        Returns whether `until` held. Raises the exception of a callback, TypeError for another
        executor, and ValueError for executors without sim time.
        """
        end = self._body.step_number + round(seconds * RATE_HZ)
        held = False

        def over() -> bool:
            nonlocal held
            held = bool(until())
            return held or self._body.step_number >= end

        if not self.sim_time:
            if executors:
                raise ValueError('Without sim time, spin the executors with session.spin.')
            current_session().wait_until(over, math.inf)
            return held
        for executor in executors:
            if not isinstance(executor, SingleThreadedExecutor):
                raise TypeError(
                    'In sim time, give SingleThreadedExecutor(): in no other one the order of the '
                    f'callbacks is fixed, also not in {executor!r}.'
                )
        work(self._own_executor, *executors)
        while not over():
            self._step()
            work(self._own_executor, *executors)
        return held

    def command(self, v: float, w: float = 0.0) -> None:
        """Send a command (m/s, rad/s) to the topic `cmd_vel`, as a remote control does."""
        kind = command_type(self.driver)
        self._remote = self._remote or self._publisher(kind, 'cmd_vel')
        message = kind()
        twist = speeds_of(message)
        twist.linear.x, twist.angular.z = float(v), float(w)
        self._remote.publish(message)

    def drive(self, v: float, w: float = 0.0, seconds: float = 1.0) -> None:
        """Drive by remote control: ten commands a second, and a stop at the end."""
        start_s = self.t_s
        for tenth in range(1, round(seconds * 10) + 1):
            self.command(v, w)
            self.run(start_s + tenth / 10 - self.t_s)
        self.command(0.0)
        self.run(1.0, until=lambda: self.stopped)

    def turn_camera(self, degrees: float) -> Image:
        """Turn the camera to the left, and return what it sees then (rgb8, 64 by 48)."""
        self._camera_yaw = wrapped(self._camera_yaw + math.radians(degrees))
        angle = math.degrees(self._camera_yaw)
        self._event('camera', f'The camera looks {angle:.0f} degrees to the left.')
        return self._picture()

    # --- What happens

    def _on_command(self, message: Twist | TwistStamped) -> None:
        twist = speeds_of(message)
        command = Command(self._now_s(), twist.linear.x, twist.angular.z)
        if math.isfinite(command.v) and math.isfinite(command.w):
            self.record.commands.append(command)
            self._arrived.append(command)
            return
        self._event('ignored', f'The command {command.v:g} m/s, {command.w:g} rad/s was ignored.')
        self._warn('ignored', 'A command was ignored: its speeds must be finite numbers.')

    def _on_turn_left(self, request, response):
        self.turn_camera(45.0)
        response.success, response.message = True, self.record.events[-1].text
        return response

    def _now_s(self) -> float:
        return self.t_s if self.sim_time else time.monotonic() - self.record.started_s

    def _catch_up(self) -> None:
        """Do the steps that are due: 50 for each second of the clock, however late this is."""
        due = math.floor(self._now_s() * RATE_HZ + 0.5)
        while self._body.step_number < due:
            self._step()

    def _step(self) -> None:
        body, arrived = self._body, self._arrived
        bumps, watched, due = body.bumps, body.watched, []
        while arrived and arrived[0].t_s <= body.t_s:
            due.append(arrived.pop(0))
        body.step(due)
        self._moved = self._moved or body.v != 0 or body.w != 0
        if body.bumps > bumps:
            self._event('bump', f'It hit something at {body.pose.x:.2f}, {body.pose.y:.2f} m.')
        if body.watched and not watched and (body.command.v or body.command.w):
            timeout_s = self.driver.timeout_s
            self._event('watchdog', f'No command came for {timeout_s:g} s: it stops.')
        self._look()

    def _look(self) -> None:
        """Read the sensors after a step, and publish what somebody hears."""
        body, number, record = self._body, self._body.step_number, self.record
        if self.sim_time:
            stamp_ns = START_NS + number * (10**9 // RATE_HZ)
        else:
            late_s = self._now_s() - body.t_s
            stamp_ns = self.get_clock().now().nanoseconds - round(late_s * 1e9)
        now = Time(nanoseconds=stamp_ns).to_msg()
        stamp_ns += round(self.clock_ahead_s * 1e9)
        self._stamp = Time(nanoseconds=stamp_ns).to_msg()
        record.poses.append(Step(body.t_s, *body.pose, body.v, body.w))
        readings = self._sensors.read(body)
        if self.sim_time:
            self._clock_topic.publish(ClockMessage(clock=now))
        driver = self.driver
        if is_due(driver.rate_hz, number):
            self._say(
                'odom',
                lambda: messages.odometry(
                    self._header('odom'),
                    f'{self._prefix}base_footprint',
                    self._sensors.odometry,
                    readings,
                    driver,
                ),
            )
            self._say(
                driver.imu_topic, lambda: messages.imu(self._header('imu_link'), readings, driver)
            )
            self._say('/tf', self._moving_frame)
            self._say(TRUTH, self._truth)
        if is_due(driver.battery_hz, number):
            self._say('battery_state', lambda: messages.battery(self._header(''), body.t_s, driver))
        if number % SCAN_EVERY == 0 and not self.silent:
            ranges, first, step = self._sensors.scan(body)
            if self.blind:
                ranges = np.full_like(ranges, np.nan)
            scan = Scan(len(record.scans), body.t_s, stamp_ns, ranges, first, step)
            record.scans.append(scan)
            self._say('scan', lambda: messages.laser_scan(self._header('base_scan'), scan, driver))
        if number % SCAN_EVERY == 0:
            self._say(BUMPER, lambda: Bool(data=body.touching))
        if number % PICTURE_EVERY == 0:
            self._say(CAMERA, self._picture)
        if number % RATE_HZ == 0:
            self._say(GPS, lambda: messages.fix(self._header('gps_link'), readings))
            for topic, sentence in other_types(self, self.get_namespace().strip('/'), driver):
                self._warn(topic, sentence)

    def _say(self, topic: str, message: Callable) -> None:
        """Publish what `message()` returns, if somebody hears it."""
        publisher = self._topics.get(topic)
        if publisher is not None and publisher.get_subscription_count():
            publisher.publish(message())

    def _picture(self) -> Image:
        x, y, yaw = self.pose
        looks = Pose(x, y, yaw + self._camera_yaw)
        return messages.picture(self._header(CAMERA_FRAME), self.floor, looks)

    def _moving_frame(self):
        stamped = TransformStamped(header=self._header('odom'))
        stamped.child_frame_id = f'{self._prefix}base_footprint'
        place, (x, y, yaw) = stamped.transform, self._sensors.odometry
        place.translation.x, place.translation.y, place.rotation = x, y, quaternion(0, 0, yaw)
        return self._topics['/tf'].msg_type(transforms=[stamped])

    def _truth(self) -> Odometry:
        body = self._body
        state = *body.pose, body.v, 0.0, body.w
        exact = np.zeros((3, 3))
        message = messages.odometry_message(0.0, 'map', state, exact, exact)
        message.header = self._header('map')
        return message

    # --- Small things

    def _header(self, frame: str) -> Header:
        return Header(stamp=self._stamp, frame_id=self._prefix + frame)

    def _event(self, kind: str, text: str) -> None:
        self.record.events.append(Event(self.t_s, kind, text))

    def _warn(self, topic: str, text: str) -> None:
        if topic not in self._warned:
            self._warned.add(topic)
            self.get_logger().warning(text)


def is_due(rate_hz: int, step_number: int) -> bool:
    """Return whether what is said so often is said after this step."""
    return step_number * rate_hz // RATE_HZ != (step_number - 1) * rate_hz // RATE_HZ


def topics_of(driver: Driver) -> dict[str, type]:
    """Return the topics that a robot with these drivers publishes, with their types."""
    topics = {'odom': Odometry, driver.imu_topic: Imu, 'scan': LaserScan}
    topics['battery_state'] = BatteryState
    choices = [(driver.gps, GPS, NavSatFix), (driver.camera, CAMERA, Image)]
    choices += [(driver.bumper, BUMPER, Bool), (driver.ground_truth, TRUTH, Odometry)]
    return topics | {topic: kind for has, topic, kind in choices if has}


def command_type(driver: Driver) -> type:
    return TwistStamped if driver.stamped_commands else Twist


def speeds_of(message: Twist | TwistStamped) -> Twist:
    """Return the speeds (m/s, rad/s) of a command, with or without a stamp."""
    return message.twist if isinstance(message, TwistStamped) else message


def check_names(node: Node, name: str, namespace: str, driver: Driver) -> None:
    """Raise ValueError for names that are taken, before a robot spoils those of another.

    `node` is asked which there are.
    """
    if (name, f'/{namespace}') in node.get_node_names_and_namespaces():
        raise ValueError(
            f'There is a node {name} already: give this robot another name and namespace, '
            "as in Robot(name='robot_2', namespace='two')."
        )
    for _, sentence in other_types(node, namespace, driver):
        raise ValueError(sentence)


def other_types(node: Node, namespace: str, driver: Driver) -> Iterator[tuple[str, str]]:
    """Yield the topics of a robot that others use with other types, and what to do.

    There is none for drivers that do not look.
    """
    if not driver.names_wrong_types:
        return
    start = f'/{namespace}/' if namespace else '/'
    own = {start + topic: type_name(kind) for topic, kind in topics_of(driver).items()}
    own[f'{start}cmd_vel'] = type_name(command_type(driver))
    for topic, types in node.get_topic_names_and_types():
        for other in types:
            if other != own.get(topic, other):
                yield (
                    topic,
                    f'Somebody uses {topic} with the type {other}, and nothing arrives: the type '
                    f'of the robot is {own[topic]}.',
                )


def type_name(kind: type) -> str:
    """Return the name of a type of messages, as in `std_msgs/msg/Bool`."""
    return f'{kind.__module__.partition(".")[0]}/msg/{kind.__name__}'


def work(*executors: Executor) -> None:
    """Do all that is ready in the executors, in their order, until nothing is."""
    done = 0  # so many, one after the other, have nothing to do
    for executor in cycle(executors):
        if work_alone(executor):
            done = 0
        done += 1
        if done == len(executors):
            return


def work_alone(executor: Executor) -> bool:
    """Do all that is ready in an executor. Return whether there was something."""
    worked = False
    while True:
        try:
            handler, _, _ = executor.wait_for_ready_callbacks(timeout_sec=0)
        except TimeoutException:
            return worked
        handler()
        handler.result()
        worked = True
