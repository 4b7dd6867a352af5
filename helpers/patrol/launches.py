"""Drives of the program as it is started: beside a robot in simulated time, or in real time."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import time
from collections.abc import Sequence
from typing import NamedTuple

from geometry_msgs.msg import TwistStamped
from rclpy.action import ActionClient
from rclpy.node import Node

from helpers.guesses import Guess
from helpers.notebook import ProgressBar
from helpers.patrol.floors import CLOSE
from helpers.patrol.program import PACKAGE, action, route_of
from helpers.robot import CORRIDOR, KIND, RATE_HZ, TURTLEBOT3, Driver, DriveRecord, Floor, Robot
from helpers.robot_view import watch
from helpers.ros import STATUS, Session, ros_session, spun
from helpers.workspace import (
    DIED,
    Process,
    Workspace,
    end_together,
    error_of_launch,
    why_it_failed,
    without_folders,
)

LAUNCH = 'source install/setup.bash\nexec ros2 launch patrol_pkg '
BEATS = 12  # scans before a goal: in this time the battery says how full it is
GOALS = 40  # more of them, as long as the goal is refused
ENDS = 'Ctrl+C', 'patrol crashes', 'patrol freezes', 'the laser is blind', 'the guard crashes'
ALL_END = 'the guard crashes, then Ctrl+C ends the rest'
SIGNALS = {
    'Ctrl+C': signal.SIGINT,
    'patrol crashes': signal.SIGKILL,
    'patrol freezes': signal.SIGSTOP,
}
QUIET = ['--ros-args', '--disable-rosout-logs']  # which line comes first is an accident
ALONE = [
    *(*QUIET, '-r', 'imu/data:=imu'),
    *('-p', 'route:=[3.0, 0.0]', '-p', 'speed:=0.2', '-p', 'full_battery:=100.0'),
]
ON_A_TURTLEBOT = [*ALONE, '-r', 'cmd_vel:=cmd_vel_wanted']
LIMIT_S = 20.0


def send_goal(session: Session, server: ActionClient, places: int):
    """Send a goal to another process. Return its handle, or None if no answer comes.

    A server that has not discovered the client yet cannot answer: rmw_fastrtps waits for it as long
    as its writer may block, 0.1 s (rmw_response.cpp), and rclpy does not begin such a goal. On a
    busy computer this happens, so it is sent again.
    """
    for _ in range(5):
        sent = server.send_goal_async(action().Goal(places=places))
        with contextlib.suppress(TimeoutError):
            session.wait_until(sent.done, 5.0)
            return sent.result()
    return None


def launched(
    workspace: Workspace,
    arguments: str,
    floor: Floor,
    places: int,
    seconds: float,
    seed: int = 0,
    driver: Driver = KIND,
    file: str = 'patrol.launch.xml',
) -> tuple[Robot, str]:
    """Launch the program beside a robot in simulated time, one scan and one command at a time.

    It gets a goal of so many places, and so many seconds of simulated time.

    Return the robot, and how the job ended or why it did not begin.
    """
    with ros_session() as session:
        robot, client = Robot(floor, sim_time=True, seed=seed, driver=driver), Node('client')
        server = ActionClient(client, action(), 'patrol')
        session.spin(spun(client))
        with workspace.start(f'{LAUNCH}{file} {arguments}', 'program') as program:

            def beat(limit_s=10.0):
                """Let the robot go on by a scan. Return whether its command came."""
                before = len(robot.record.commands)
                robot.run(0.1)
                limit = time.monotonic() + limit_s
                while len(robot.record.commands) == before and time.monotonic() < limit:
                    robot.executor.spin_once(timeout_sec=0.1)  # ends when the command comes
                return len(robot.record.commands) > before

            if problem := _begun(workspace, program, server, robot):
                return robot, problem
            # The first scans are lost, as long as the program does not receive them yet.
            beats, limit = 0, time.monotonic() + 30
            while beats < BEATS and time.monotonic() < limit:
                beats += beat(0.5)
            if beats < BEATS:
                return robot, f'a scan had no command. {printed(workspace, program.lines)}'
            # A program that waits for its sensors, or whose battery has not spoken, refuses it.
            for _ in range(GOALS):
                goal = send_goal(session, server, places)
                if goal is None or goal.accepted:
                    break
                beat(0.5)
            if goal is None or not goal.accepted:
                return robot, 'the goal is refused' if goal else 'the goal gets no answer'
            ended, begun_s = goal.get_result_async(), time.monotonic()
            with ProgressBar(lambda: robot.t_s / seconds) as bar:
                while robot.t_s < seconds and not ended.done() and not robot.bumps:
                    if not beat():
                        return robot, f'a scan had no command. {printed(workspace, program.lines)}'
                    bar.update(time.monotonic() - begun_s)
    return robot, STATUS[ended.result().status] if ended.done() else 'not ended'


def _begun(workspace: Workspace, program: Process, server: ActionClient, robot: Robot) -> str:
    """Wait until the launched node is there. Return why it is not, or nothing."""

    def is_ready():
        return (
            server.server_is_ready()
            and robot.count_subscribers('scan')
            and robot.count_publishers('cmd_vel')
        )

    limit, begun_s = time.monotonic() + 30, math.inf
    while not is_ready() and program.running and time.monotonic() < limit:
        time.sleep(0.02)
        text = ' '.join(program.lines)
        if 'process started' in text:
            begun_s = min(begun_s, time.monotonic())
        without = '[patrol-' not in text and time.monotonic() > begun_s + 10
        if DIED in text or without:
            break
    if not server.server_is_ready():
        return f'no node patrol with an action came. {printed(workspace, program.lines)}'
    if not is_ready():
        return f'nobody drives the robot. {printed(workspace, program.lines)}'
    if '[robot-' in ' '.join(program.lines):
        return 'with robot:=false it starts a robot'
    limit = time.monotonic() + 20
    while not robot.count_subscribers('/clock') and time.monotonic() < limit:
        time.sleep(0.02)
    if not robot.count_subscribers('/clock'):
        return 'with sim:=true the node patrol does not hear /clock'
    return ''


def printed(workspace: Workspace, lines: Sequence[str]) -> str:
    """Return what a launched program printed of its first error, or its last line."""
    text = without_folders('\n'.join(lines), workspace.path)
    last = ['nothing', *(line for line in text.splitlines() if line.strip())][-1]
    return f'ros2 launch printed: {error_of_launch(text) or last}'


# --- What stops the robot


class Ended(NamedTuple):
    """What a robot did after an end: whether it stands, and how far (m) and long (s) it went on."""

    record: DriveRecord
    stands: bool
    metres: float
    seconds: float


def ended_by(workspace: Workspace, end: str, halt: bool = False) -> Ended:
    """Drive a TurtleBot 3 with patrol and guard, end something, and return what the robot did.

    `end` is one of `ENDS`, or `ALL_END`. With `halt` the program `halt` runs as well. The robot is
    watched until it stands, but two seconds at most if the guard crashes. Raises RuntimeError if
    the robot does not come to drive.
    """
    with ros_session() as session, contextlib.ExitStack() as stack:
        robot, client = Robot(CORRIDOR, driver=TURTLEBOT3), Node('client')
        server = ActionClient(client, action(), 'patrol')
        session.spin(spun(client))
        options = {'guard': QUIET, 'patrol': ON_A_TURTLEBOT}
        if halt:
            options['halt'] = [*QUIET, '-p', 'timeout_s:=0.6']
        programs = {
            name: stack.enter_context(workspace.run('patrol_pkg', name, *words))
            for name, words in options.items()
        }

        if halt:
            _wait_until_it_misses(session, client, programs['guard'])
        _begin_to_drive(session, robot, server, [*programs.values()])
        since_s = robot.t_s
        if end in SIGNALS:
            os.kill(programs['patrol'].pid, SIGNALS[end])
        elif end == 'the laser is blind':
            robot.blind = True
        else:
            os.kill(programs['guard'].pid, signal.SIGKILL)
            if end == ALL_END:
                for name in {*programs} - {'guard'}:
                    os.kill(programs[name].pid, signal.SIGINT)
        # It must stand before the other programs end, which stop it, too.
        limit_s = 2.0 if end in (ENDS[-1], ALL_END) else LIMIT_S
        stands = robot.run(limit_s, until=lambda: robot.stopped)
        moves = [step for step in robot.record.poses if step.t_s > since_s and (step.v or step.w)]
        if end == 'patrol freezes':
            os.kill(programs['patrol'].pid, signal.SIGCONT)  # or it could not end
        end_together(programs.values())
    metres, seconds = sum(step.v for step in moves) / RATE_HZ, len(moves) / RATE_HZ
    return Ended(robot.record, stands, metres, seconds)


def _wait_until_it_misses(session: Session, client: Node, guard: Process) -> None:
    """Freeze the guard until `halt` says that no command comes, then let it go on.

    Only what `halt` has heard it can miss, and nobody else can see whom it has discovered. Without
    this, a busy computer may end the guard before `halt` has met it. Raises RuntimeError if `halt`
    says nothing, TimeoutError if the guard says nothing.
    """
    senders = set()
    client.create_subscription(
        TwistStamped, 'cmd_vel', lambda stamped: senders.add(stamped.header.frame_id), 10
    )
    for _ in range(10):
        senders.clear()
        session.wait_until(lambda: '' in senders, LIMIT_S)  # those of the guard
        os.kill(guard.pid, signal.SIGSTOP)
        try:
            with contextlib.suppress(TimeoutError):
                session.wait_until(lambda: 'halt' in senders, 2.0)
        finally:
            os.kill(guard.pid, signal.SIGCONT)  # or it could not end
        if 'halt' in senders:
            return
    raise RuntimeError('The guard was frozen, and halt did not stop the robot.')


def killed_alone(workspace: Workspace, guess: Guess | None = None) -> Robot:
    """Drive a TurtleBot 3 with patrol alone, kill it, and return the robot when it stands.

    This base hears `Twist`, so that no other program speaks to it. The robot is shown, with a guess
    of where it ends. Raises RuntimeError if the robot does not come to drive.
    """
    with ros_session() as session:
        robot = Robot(CLOSE, driver=TURTLEBOT3.but(stamped_commands=False))
        client = Node('client')
        server = ActionClient(client, action(), 'patrol')
        session.spin(spun(client))
        watch(robot, guess=guess)
        with workspace.run('patrol_pkg', 'patrol', *ALONE) as patrol:
            _begin_to_drive(session, robot, server, [patrol])
            os.kill(patrol.pid, signal.SIGKILL)
            robot.run(LIMIT_S, until=lambda: robot.stopped or robot.bumps)
            robot.run(0.5)
    return robot


def _begin_to_drive(
    session: Session,
    robot: Robot,
    server: ActionClient,
    programs: Sequence[Process],
) -> None:
    """Send goals until the robot drives. Raises RuntimeError with the last line if it does not."""
    start = robot.pose

    def drives():
        if server.server_is_ready() and robot.pose.x == start.x:
            send_goal(session, server, 1)  # refused, as long as its sensors have not spoken
        return robot.record.poses[-1].v > 0.15

    limit_s = robot.t_s + LIMIT_S
    while not drives():
        if robot.t_s > limit_s or not all(program.running for program in programs):
            last = [*(line for program in programs for line in program.lines), 'nothing'][-1]
            raise RuntimeError(f'The robot does not drive. The programs printed: {last}')
        robot.run(0.2)


def driven_live(workspace: Workspace, file: str) -> Robot:
    """Build, and drive a robot on the student's floor with the launched program, in real time.

    `file` is the floor, in the package; its route has the same name. Return the robot. Raises
    RuntimeError, with the first error, if the program cannot be built.
    """
    path = workspace.file(f'{PACKAGE}/{file}')
    floor = Floor.from_text(path.read_text(encoding='utf-8'), name=path.stem)
    result = workspace.build('patrol_pkg')
    if not result.ok:
        raise RuntimeError(why_it_failed(result))
    with ros_session() as session:
        robot, client = Robot(floor), Node('client')
        watch(robot)
        server = ActionClient(client, action(), 'patrol')
        session.spin(spun(client))
        # A busy computer may hold back a scan for longer than a robot's own would.
        arguments = f'patrol.launch.xml floor:={path.stem} robot:=false timeout:=5.0'
        with workspace.start(LAUNCH + arguments, 'program') as program:
            robot.run(LIMIT_S, until=lambda: server.server_is_ready() or not program.running)
            if not server.server_is_ready():
                print(printed(workspace, program.lines))
                return robot
            places = len(route_of(path.with_suffix('.yaml')))
            for _ in range(GOALS):  # refused, as long as the battery has not spoken
                goal = send_goal(session, server, places)
                if goal is None or goal.accepted:
                    break
                robot.run(0.1)
            if goal is None or not goal.accepted:
                print('The goal is refused.' if goal else 'The goal gets no answer.')
                return robot
            ended = goal.get_result_async()
            robot.run(120, until=lambda: ended.done() or robot.bumps)
            robot.run(1.0)
    print(STATUS[ended.result().status] if ended.done() else 'not ended', 'bumps:', robot.bumps)
    return robot
