"""One small robot: a differential drive on a floor with walls and boxes, behind real messages.

    with ros_session() as session:
        robot = Robot(CORRIDOR)
        session.spin(executor)  # of your own nodes
        robot.run(20, until=lambda: robot.stopped or robot.bumps)

`floor` has the floors, `body` how it moves, `sensors` what it measures, `messages` how it says so,
`robot` its node, and `record` what it did.

It is no physics engine. As on a TurtleBot 3 are topics, types, frames, units, the limits of
acceleration, what each sensor can know, and that it goes on while your program thinks. Not so here:
it does not slide, tip, push or wear; the floor is flat, and walls are along x and y; the errors are
white noise and constant biases, where real ones wander; all beams of a scan are of one moment; two
robots drive through each other; it is faster (1 m/s), it looks at the front half only, and it hears
Twist, where newer TurtleBots want TwistStamped.
"""

from helpers.robot.floor import CORRIDOR, EMPTY, FLOORS, ROOMS, Floor, Pose
from helpers.robot.process import start_robot
from helpers.robot.record import DriveRecord
from helpers.robot.robot import Robot

__all__ = [
    'CORRIDOR',
    'EMPTY',
    'FLOORS',
    'ROOMS',
    'DriveRecord',
    'Floor',
    'Pose',
    'Robot',
    'start_robot',
]
