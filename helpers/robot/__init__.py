"""One small robot: a differential drive on a floor with walls and boxes, behind real messages.

    with ros_session() as session:
        robot = Robot(CORRIDOR)
        session.spin(executor)  # of your own nodes
        robot.run(20, until=lambda: robot.stopped or robot.bumps)

`floor` has the floors, `body` how it moves, `sensors` what it measures, `drivers` and `messages`
how it says so, `robot` its node, `record` what it did, and `trip` a drive for filters. How one sees
it and drives it by hand is in `helpers.robot_view`.

It is no physics engine. As on a TurtleBot 3 are topics, types, frames, units, the limits of
acceleration, what each sensor can know, and that it goes on while your program thinks. Not so here:
it does not slide, tip, push or wear; the floor is flat, and walls are along x and y; the errors are
white noise and constant biases, where real ones wander; all beams of a scan are of one moment; two
robots drive through each other. Its drivers are kinder than those of most robots: `drivers` says
how, and has those of a TurtleBot 3.
"""

from helpers.robot.body import MAX_ACCELERATION, MAX_TURN_ACCELERATION, RADIUS_M, RATE_HZ
from helpers.robot.drivers import KIND, TURTLEBOT3, Driver
from helpers.robot.floor import CORRIDOR, EMPTY, FLOORS, ROOMS, Floor, Pose
from helpers.robot.messages import ON_THE_FLOOR, odometry_message
from helpers.robot.record import Command, DriveRecord, Event, Scan
from helpers.robot.robot import Robot, speeds_of
from helpers.robot.sensors import RANGE_MAX, SLIP_SPEED, VARIANCES, without_noise
from helpers.robot.trip import trip

__all__ = [
    'CORRIDOR',
    'EMPTY',
    'FLOORS',
    'KIND',
    'MAX_ACCELERATION',
    'MAX_TURN_ACCELERATION',
    'ON_THE_FLOOR',
    'RADIUS_M',
    'RANGE_MAX',
    'RATE_HZ',
    'ROOMS',
    'SLIP_SPEED',
    'TURTLEBOT3',
    'VARIANCES',
    'Command',
    'DriveRecord',
    'Driver',
    'Event',
    'Floor',
    'Pose',
    'Robot',
    'Scan',
    'odometry_message',
    'speeds_of',
    'trip',
    'without_noise',
]
