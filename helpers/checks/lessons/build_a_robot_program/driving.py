"""A node that drives and stops, and its program."""

import contextlib
import signal
import time

from helpers.checks.lessons.build_a_robot_program.shared import tasks
from helpers.checks.patrols import commands_of, one_command_a_scan
from helpers.checks.points import all_of, cached, expect, needs
from helpers.checks.programs import Program
from helpers.patrol import SIM, drive, module
from helpers.robot import CORRIDOR, EMPTY, KIND, Robot
from helpers.ros import ros_session


@tasks.add
def a_node_that_drives(workspace):
    def driven(floor, seconds, driver=KIND):
        return drive(floor, module(workspace, 'patrol').Patrol, seconds, driver=driver)

    def moves():
        robot = driven(CORRIDOR, 3)
        speeds = sorted({*commands_of(robot)} - {(0.3, 0.0)})
        if not robot.record.commands:
            return 'no command came in 3 s'
        if speeds:
            return f'it commands (linear.x, angular.z) = {speeds[0]}, not (0.3, 0.0)'
        way = robot.pose.x - CORRIDOR.start.x
        return expect(way, 0.8, 'in 3 s it drove', within=0.1, unit='m')

    def has_methods():
        with ros_session():
            robot = Robot(EMPTY, sim_time=True)
            node = module(workspace, 'patrol').Patrol(parameter_overrides=SIM)
            robot.run(0.1)
            node.command(0.1, 0.5)
            robot.run(0.1)
            node.stop()
            robot.run(0.1)
        right = [(0.1, 0.5), (0.0, 0.0)]
        return expect(commands_of(robot), right, 'command(0.1, 0.5) and stop() published')

    def hears_any_laser():
        robot = driven(CORRIDOR, 1, KIND.but(laser='ld08'))
        return bool(robot.record.commands) or 'it receives nothing from a laser that is BEST_EFFORT'

    each = 'one command for each scan'
    return [
        ('the robot drives at 0.3 m/s', moves, 'on_scan(self, scan): self.command(0.3, 0.0)'),
        (
            each,
            lambda: one_command_a_scan(driven(EMPTY, 2)),
            'Publish in the callback of the scan.',
        ),
        ('command(v, w), stop()', has_methods, 'twist.linear.x and twist.angular.z'),
        ('the scans of a BEST_EFFORT laser', hears_any_laser, 'create_subscription(..., LASER)'),
    ]


# The student's main(), with a node of ours: what Patrol does later does not matter here.
PROGRAM = """import queue
import sys
import threading
import time

import rclpy
from geometry_msgs.msg import Twist
from patrol_pkg import main
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan


class Slow:
    # A publisher whose messages leave a while later, as over a busy network.
    def __init__(self, publisher):
        self.publisher, self.waiting = publisher, queue.Queue()
        threading.Thread(target=self.send, daemon=True).start()

    def publish(self, message):
        self.waiting.put((time.monotonic() + 0.6, message))

    def send(self):
        while True:
            at_s, message = self.waiting.get()
            time.sleep(max(0.0, at_s - time.monotonic()))
            self.publisher.publish(message)
            self.waiting.task_done()

    def wait_for_all_acked(self, timeout):
        limit_s = time.monotonic() + timeout.nanoseconds / 1e9
        while self.waiting.unfinished_tasks and time.monotonic() < limit_s:
            time.sleep(0.01)
        return self.publisher.wait_for_all_acked(timeout)


class Drives(Node):
    def __init__(self):
        super().__init__('patrol')
        self.publisher, self.scans = self.create_publisher(Twist, 'cmd_vel', 1), 0
        if 'slow' in sys.argv:
            self.publisher = Slow(self.publisher)
        self.create_subscription(LaserScan, 'scan', self.on_scan, qos_profile_sensor_data)
        self.timer = self.create_timer(0.1, self.is_idle) if 'idle' in sys.argv else None

    def command(self, v, w):
        twist = Twist()
        twist.linear.x, twist.angular.z = v, w
        self.publisher.publish(twist)

    def stop(self):
        self.command(0.0, 0.0)

    def on_scan(self, scan):
        self.command(0.3, 0.0)
        self.scans += 1
        if 'failed' in sys.argv and self.scans > 15:
            raise RuntimeError('planted')

    def is_idle(self):
        self.timer.cancel()
        print('idle', flush=True)


main.Patrol = Drives
main.main()
"""
START = (
    '[ -f install/setup.bash ] && source install/setup.bash\n'
    'PYTHONPATH=src/patrol_pkg:$PYTHONPATH exec python -B .start.py '
)
SIGNALS = {
    'interrupted': signal.SIGINT,
    'terminated': signal.SIGTERM,
    'failed': None,
    'slow': signal.SIGINT,
}


@tasks.add(limit_s=120, cpu_s=20)
def a_program(workspace):
    @cached
    def run_all():
        """Run main() for each end, beside a base that keeps its last command, and end it.

        Return for each end whether the robot stands, or what is wrong, and the program.
        """
        workspace.write('.start.py', PROGRAM)
        robots, programs = {}, {}
        with ros_session() as session, contextlib.ExitStack() as stack:
            for end in SIGNALS:
                robots[end] = Robot(EMPTY, namespace=end, driver=KIND.but(command_timeout_s=None))
                command = f'{START} {end} --ros-args -r __ns:=/{end}'
                programs[end] = stack.enter_context(Program(workspace.start(command, end)))

            def drives(end):
                return robots[end].pose.x > EMPTY.start.x + 0.05

            def each(condition, limit_s):
                with contextlib.suppress(TimeoutError):
                    session.wait_until(lambda: all(map(condition, SIGNALS)), limit_s)

            each(lambda end: drives(end) or not programs[end].running, 30)
            by_itself = [end for end in SIGNALS if SIGNALS[end] and not programs[end].running]
            for end, sent in SIGNALS.items():
                if sent and drives(end):
                    programs[end].end(sent, limit_s=0)
            each(lambda end: not drives(end) or not programs[end].running, 30)
            each(lambda end: not drives(end) or robots[end].stopped, 1)
            return {
                end: (
                    how_it_ended(robots[end], drives(end), programs[end], end in by_itself),
                    programs[end],
                )
                for end in SIGNALS
            }

    def stands(end):
        return run_all()[end][0]

    def ends_quietly():
        found, program = run_all()['interrupted']
        if found is not True:
            return f'not judged: {found}'
        return not program.lines or f'it ends with {program.lines[-1]}'

    def stands_and_says_why():
        found, program = run_all()['failed']
        says = program.says('planted') or 'it ends, and says nothing of the error'
        return all_of(found, says)

    def waits_for_the_base():
        needs(lambda: stands('interrupted'), 'not judged: Ctrl+C must end it first')
        found = stands('slow')
        return found is True or f'over a network that is 0.6 s late {found}'

    def ends_while_nothing_happens():
        needs(lambda: stands('interrupted'), 'not judged: Ctrl+C must end it first')
        with Program(workspace.start(f'{START} idle --ros-args -r __ns:=/idle', 'idle')) as idle:
            if not idle.wait(lambda: idle.says('idle'), limit_s=15):
                return f'its timer never fired: {idle.error}'
            time.sleep(0.3)  # now it waits
            ended = idle.end(signal.SIGINT)
        return ended or 'while no callback is due, Ctrl+C does not end it'

    stop = 'In finally: node.stop(), before rclpy.try_shutdown().'
    handlers = 'rclpy.init(signal_handler_options=SignalHandlerOptions.NO)'
    term = 'signal.signal(signal.SIGTERM, signal.default_int_handler)'
    acked = 'node.publisher.wait_for_all_acked(Duration(seconds=1))'
    once_more = 'while rclpy.ok(): rclpy.spin_once(node, timeout_sec=0.1)'
    return [
        ('after Ctrl+C the robot stands', lambda: stands('interrupted'), handlers),
        ('without a traceback', ends_quietly, 'except KeyboardInterrupt: pass'),
        ('after SIGTERM it stands', lambda: stands('terminated'), term),
        ('after an error in a callback it stands', stands_and_says_why, stop),
        ('it waits until the base has the zeros', waits_for_the_base, acked),
        ('Ctrl+C also ends it while no callback is due', ends_while_nothing_happens, once_more),
    ]


def how_it_ended(robot, drove, program, by_itself):
    """Return True if a program has ended and its robot stands, or else what is wrong."""
    if not drove and program.running:
        return 'main() goes on, and its robot never drives: does it spin the node?'
    if not drove:
        return f'main() has ended before its robot drove: {program.error}'
    if by_itself:
        return 'it ends by itself'
    if program.running:
        return 'it does not end'
    last = robot.record.commands[-1]
    return robot.stopped or (
        f'it ends, and the robot drives on: the last command is {last.v:g} m/s'
    )
