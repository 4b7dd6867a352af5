"""Of the project: a node that drives, a program that ends, a wall."""

import contextlib
import os
import signal

import numpy as np

from helpers.checks.lessons.build_a_robot_program.shared import (
    one_command_a_scan,
    tasks,
)
from helpers.checks.tasks import once
from helpers.patrol import (
    SIM,
    drive,
    module,
)
from helpers.robot import CORRIDOR, EMPTY, KIND, Floor, Pose, Robot
from helpers.ros import ros_session


@tasks.add(1)
def a_node_that_drives(workspace):
    def moves():
        robot = drive(CORRIDOR, module(workspace, 'patrol').Patrol, 3)
        way = robot.pose.x - CORRIDOR.start.x
        speeds = {(command.v, command.w) for command in robot.record.commands}
        if not speeds:
            return 'no command came in 3 s'
        if speeds != {(0.3, 0.0)}:
            return f'it commands (linear.x, angular.z) = {sorted(speeds)[0]}'
        return 0.7 < way < 0.9 or f'in 3 s it drove {way:.1f} m'

    def one_for_each_scan():
        return one_command_a_scan(drive(EMPTY, module(workspace, 'patrol').Patrol, 2))

    def has_methods():
        with ros_session():
            robot = Robot(EMPTY, sim_time=True)
            node = module(workspace, 'patrol').Patrol(parameter_overrides=SIM)
            robot.run(0.1)
            node.command(0.1, 0.5)
            robot.run(0.1)
            node.stop()
            robot.run(0.1)
            commands = [(command.v, command.w) for command in robot.record.commands]
        right = [(0.1, 0.5), (0.0, 0.0)]
        return commands == right or (
            f'command(0.1, 0.5) and stop() published {commands or "nothing"}'
        )

    def hears_any_laser():
        driver = KIND.but(laser='ld08')
        robot = drive(CORRIDOR, module(workspace, 'patrol').Patrol, 1, driver=driver)
        return bool(robot.record.commands) or 'it receives nothing from a laser that is BEST_EFFORT'

    return [
        ('the robot drives at 0.3 m/s', moves, 'on_scan(self, scan): self.command(0.3, 0.0)'),
        ('one command for each scan', one_for_each_scan, 'Publish in the callback of the scan.'),
        ('command(v, w), stop()', has_methods, 'twist.linear.x and twist.angular.z'),
        ('the scans of a BEST_EFFORT laser', hears_any_laser, 'create_subscription(..., LASER)'),
    ]


FAILS = """from patrol_pkg import main, patrol
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan


class Fails(patrol.Patrol):
    def __init__(self, **options):
        super().__init__(**options)
        self.scans = 0
        self.create_subscription(LaserScan, 'scan', self.fail, qos_profile_sensor_data)

    def fail(self, scan):
        self.scans += 1
        if self.scans > 15:
            raise RuntimeError('planted')


main.run(Fails)
"""
WITH_INTERFACES = '[ -f install/setup.bash ] && source install/setup.bash\n'
MAIN_ENDS = {'interrupted': signal.SIGINT, 'terminated': signal.SIGTERM, 'failed': None}


def how_it_ended(robot, drove, program, by_itself):
    """Return what the program printed if the robot stands after it, or else what is wrong."""
    lines = program.lines
    if not drove:
        return f'the robot stands, and main() says: {(lines or ["nothing"])[-1]}'
    if by_itself:
        return 'it ends by itself'
    if program.running:
        return 'it does not end'
    if not robot.stopped:
        last = robot.record.commands[-1]
        return f'it ends, and the robot drives on: the last command is {last.v:g} m/s'
    return lines


@tasks.add(2, limit_s=120, cpu_s=20)
def a_program(workspace):
    @once
    def run_all():
        """Run main() three times, each beside a base that keeps its last command, and end it."""
        workspace.write('.start.py', 'from patrol_pkg.main import main\nmain()\n')
        workspace.write('.fails.py', FAILS)
        start = WITH_INTERFACES + 'PYTHONPATH=src/patrol_pkg:$PYTHONPATH exec python -B '
        robots, programs = {}, {}
        with ros_session() as session, contextlib.ExitStack() as stack:
            for end in MAIN_ENDS:
                driver = KIND.but(command_timeout_s=None)
                robots[end] = Robot(EMPTY, namespace=end, driver=driver)
                file = '.start.py' if MAIN_ENDS[end] else '.fails.py'
                command = f'{start}{file} --ros-args -r __ns:=/{end}'
                programs[end] = stack.enter_context(workspace.start(command, end))

            def drives(end):
                return robots[end].pose.x > EMPTY.start.x + 0.05

            def each(condition, limit_s):
                with contextlib.suppress(TimeoutError):
                    session.wait_until(lambda: all(condition(end) for end in MAIN_ENDS), limit_s)

            each(lambda end: drives(end) or not programs[end].running, 30)
            ended = {end: not program.running for end, program in programs.items()}
            for end, number in MAIN_ENDS.items():
                if number is not None and drives(end) and not ended[end]:
                    os.kill(programs[end].pid, number)
            each(lambda end: not drives(end) or not programs[end].running, 30)
            each(lambda end: not drives(end) or robots[end].stopped, 1)
            return {
                end: how_it_ended(
                    robots[end],
                    drives(end),
                    programs[end],
                    by_itself=ended[end] and number is not None,
                )
                for end, number in MAIN_ENDS.items()
            }

    def stands(end):
        return lambda: True if isinstance(run_all()[end], list) else run_all()[end]

    def ends_quietly():
        lines = run_all()['interrupted']
        if not isinstance(lines, list):
            return f'not judged: {lines}'
        return not lines or f'it ends with {lines[-1]}'

    stop = 'In finally: node.stop(), before rclpy.try_shutdown().'
    handlers = 'rclpy.init(signal_handler_options=SignalHandlerOptions.NO)'
    return [
        ('after Ctrl+C the robot stands', stands('interrupted'), handlers),
        ('without a traceback', ends_quietly, 'except KeyboardInterrupt: pass'),
        (
            'after SIGTERM it stands',
            stands('terminated'),
            'signal.signal(signal.SIGTERM, signal.default_int_handler)',
        ),
        ('after an error in a callback it stands', stands('failed'), stop),
    ]


TURTLEBOT3_LASER = KIND.but(laser='ld08')
HALL = Floor.from_text(
    """
############
#          #
#    o     #
# >      o #
#          #
############
""",
    name='hall',
)


@tasks.add(4)
def stop_before_a_wall(workspace):
    def stops_at(floor, start, near_m):
        def test():
            robot = drive(floor, module(workspace, 'patrol').Patrol, 12, start=start)
            ahead = floor.ranges(*robot.pose[:2], np.array([robot.pose.yaw]))[0][0]
            fastest = max((command.v for command in robot.record.commands), default=0.0)
            if robot.bumps:
                return 'it hits something'
            if fastest > 0.5001:
                return f'it drives at {fastest:.2g} m/s: more than 0.5'
            return 0.2 < ahead < near_m or f'it stands still {ahead:.1f} m from it'

        return test

    def stops_blind():
        patrol = module(workspace, 'patrol').Patrol
        robot = drive(CORRIDOR, patrol, 4, blind_after_s=2)
        if not robot.stopped:
            return 'all beams are nan, and it drives on'
        robot = drive(CORRIDOR, patrol, 12, driver=TURTLEBOT3_LASER)
        ahead = CORRIDOR.ranges(*robot.pose[:2], np.array([robot.pose.yaw]))[0][0]
        return (not robot.bumps and ahead < 0.5) or (
            f'with the laser of a TurtleBot 3 it stands {ahead:.1f} m before the wall'
        )

    hint = 'reach(*beams(scan), 0.0), then safe_speed(..., 0.5)'
    near = stops_at(CORRIDOR, Pose(3.0, 1.25, 1.0), 0.5)
    return [
        ('it stops before the wall', stops_at(CORRIDOR, None, 0.35), hint),
        (
            'it passes a box beside its path, and stops at the next',
            stops_at(HALL, None, 0.35),
            hint,
        ),
        ('it also stops if it starts near a wall', near, hint),
        ('a blind laser, and that of a TurtleBot 3', stops_blind, hint),
    ]
