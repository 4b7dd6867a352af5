"""How a robot's drivers speak: the kind ones of most lessons, and those of a real robot.

    Robot(CORRIDOR, driver=TURTLEBOT3)
    Robot(CORRIDOR, driver=KIND.but(command_timeout_s=None))  # one kindness less

Each field is one habit, and can be changed alone. Those of `TURTLEBOT3` were read in the sources of
a TurtleBot 3 Burger with ROS 2 Jazzy, in November 2026:

    BRINGUP   ROBOTIS-GIT/turtlebot3, turtlebot3_bringup/param/burger.yaml
    NODE      ROBOTIS-GIT/turtlebot3, turtlebot3_node/src
    FIRMWARE  ROBOTIS-GIT/OpenCR, arduino/opencr_arduino/opencr/libraries/turtlebot3_ros2/src
    LASER     ROBOTIS-GIT/ld08_driver, src/lipkg.cpp: the driver of its laser LDS-02
    MANUAL    emanual.robotis.com, TurtleBot3, "LDS-02"

Not simulated of it: its other topics (`joint_states`, `sensor_state`, `magnetic_field`), that its
laser turns while the robot moves, and that the laser stands 32 mm behind its middle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

LASERS = ('half', 'ld08')


@dataclass(frozen=True)
class Driver:
    """The habits of a robot's drivers. Those of the course's own robot are the defaults."""

    name: str = 'kind'

    # `cmd_vel` has TwistStamped, and a Twist is never received (BRINGUP: enable_stamped_cmd_vel).
    stamped_commands: bool = False
    # So long (s) a command counts; None: for as long as the base's own node lives. FIRMWARE,
    # turtlebot3.cpp: the last command is forgotten only if the node's heartbeat is missing for
    # HEARTBEAT_TIMEOUT_MS, and that node does not know whether your program lives.
    command_timeout_s: float | None = 0.5
    # Commands are cut to whole steps of so much (m/s, rad/s), towards 0; 0: they stay as they are
    # (NODE, turtlebot3.cpp: static_cast<int32_t>(msg->twist.linear.x * 100)).
    command_step: float = 0.0
    # The robot says so if somebody uses one of its topics with another type. A real one is silent.
    names_wrong_types: bool = True

    # 'half': 181 beams from -90 to 90 degrees, all in range or inf (REP 117), RELIABLE.
    # 'ld08': all around, from about 0 to 2 pi; the number of beams changes from scan to scan; NaN
    # where nothing comes back; range_min 0, range_max 100; BEST_EFFORT; the stamp is the time of
    # publishing (LASER, ToLaserscan; 160 to 8000 mm: MANUAL).
    laser: str = 'half'

    imu_topic: str = 'imu/data'
    # Covariances of zero: nobody says how good a number is (NODE, odometry.cpp and imu.cpp).
    zero_covariance: bool = False
    # The direction in `odom` is the IMU's (BRINGUP: use_imu), not the wheels'.
    odometry_by_imu: bool = False
    # `percentage` goes from 0 to 100, though BatteryState.msg says 0 to 1 (FIRMWARE:
    # bat_percent * 100; NODE, battery_state.cpp: times 0.01). Charge and current stay 0.
    battery_percent: bool = False
    # So often (Hz) the battery speaks (NODE: in the same timer of 50 ms).
    battery_hz: int = 1
    # So often (Hz) wheels, IMU and /tf speak (NODE: a timer of 50 ms).
    rate_hz: int = 50
    # It says on /tf itself where the robot is in `odom` (BRINGUP: odometry.publish_tf). A filter
    # that says so, too, needs it off: a frame has one parent, and one who publishes it.
    publish_tf: bool = True
    # `ground_truth` has the true pose on the floor, which a simulator knows, and no robot.
    ground_truth: bool = False

    gps: bool = True
    bumper: bool = True
    camera: bool = True

    # FIRMWARE: a wheel of 0.033 m at 61 turns a minute, wheels 0.160 m apart.
    max_speed: float = 1.0  # m/s
    max_turn: float = 1.82  # rad/s
    radius_m: float = 0.11

    def __post_init__(self) -> None:
        if self.laser not in LASERS:
            raise ValueError(f'A laser is one of {", ".join(LASERS)}, not {self.laser!r}.')

    def but(self, **habits: Any) -> Driver:
        """Return the same drivers with some habits changed, as in `but(command_timeout_s=None)`.

        Raises ValueError for a habit that does not exist.
        """
        known = [habit.name for habit in fields(self)]
        for habit in habits:
            if habit not in known:
                raise ValueError(f'A driver has no habit {habit!r}. It has: {", ".join(known)}.')
        return replace(self, **habits)

    def heard(self, command: float) -> float:
        """Return a speed as the base takes it: cut to its steps, towards 0."""
        if not self.command_step or not math.isfinite(command):
            return command
        steps = round(1 / self.command_step)
        return math.trunc(command * steps) / steps

    @property
    def timeout_s(self) -> float:
        return math.inf if self.command_timeout_s is None else self.command_timeout_s


KIND = Driver()
TURTLEBOT3 = Driver(
    name='turtlebot3',
    stamped_commands=True,
    command_timeout_s=None,
    command_step=0.01,
    names_wrong_types=False,
    laser='ld08',
    imu_topic='imu',
    zero_covariance=True,
    odometry_by_imu=True,
    battery_percent=True,
    battery_hz=20,
    rate_hz=20,
    gps=False,
    bumper=False,
    camera=False,
    max_speed=0.21,
    max_turn=2.63,
    radius_m=0.105,
)
DRIVERS: Mapping[str, Driver] = {driver.name: driver for driver in (KIND, TURTLEBOT3)}
