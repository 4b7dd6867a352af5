"""What the tasks of the lesson "Start here" are judged by."""

from geometry_msgs.msg import Twist

from helpers.checks.bench import Bench
from helpers.checks.points import expect, rows
from helpers.checks.tasks import Tasks
from helpers.robot import Floor, Robot
from helpers.ros import ros_session

tasks = Tasks()
check = tasks.check

HOUSE = Floor.from_text(
    """
####################
#                  #
#      A           #
#####  #############
#                  #
# >                #
#                  #
####################
""",
    name='house',
)
BEHIND_THE_WALL_M = 2.61


@tasks.add
def through_the_door(speed):
    def goes_through():
        if isinstance(speed, bool) or not isinstance(speed, int | float):
            return f'speed is {speed!r}, and that is not a number such as 0.4'
        # In simulated time the drive takes no time, and is the same in each run.
        with ros_session():
            robot = Robot(HOUSE, sim_time=True)
            robot.drive(speed, seconds=3.5)
            robot.drive(0.0, 1.57, seconds=1)
            robot.drive(0.5, seconds=3)
        if robot.bumps:
            return 'it hit a wall'
        is_through = robot.pose.y > BEHIND_THE_WALL_M
        return is_through or 'it does not come to the other side of the wall'

    hint = 'Speed is distance divided by time: 1.75 m in 3.5 s.'
    return [('the robot goes through the door, and hits nothing', goes_through, hint)]


@tasks.add
def a_first_node(HandDriver):
    def publishes(forward, turn):
        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist)
            driver = bench.spin(HandDriver())
            driver.on_key(forward, turn)
            bench.wait(lambda: commands)
        call = f'on_key({forward}, {turn})'
        if not commands:
            return f'{call} published nothing on cmd_vel'
        found = commands[-1].linear.x, commands[-1].angular.z
        return expect(found, (forward, turn), f'{call} published (linear.x, angular.z) =')

    hint = 'command.linear.x = forward, and the same for angular.z: it is turn.'
    return rows(
        publishes,
        hint,
        ('it drives forward', 0.5, 0.0),
        ('it drives back', -0.5, 0.0),
        ('it turns', 0.0, 1.2),
    )
