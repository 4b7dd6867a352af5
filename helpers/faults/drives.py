"""Drive a robot as it is launched, in the page or to judge it, and say what it did."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import Twist, Vector3
from rcl_interfaces.srv import GetParameters
from rclpy.task import Future
from std_msgs.msg import Float64

from helpers.faults.cases import Case
from helpers.notebook import ProgressBar
from helpers.robot import CORRIDOR, TURTLEBOT3, DriveRecord, Floor, Pose, Robot
from helpers.robot_view import watch
from helpers.ros import Session, ros_session
from helpers.workspace import DIED, Process, without_folders

DRIVER = TURTLEBOT3.but(max_speed=0.5)  # twice as fast as a real one, which is slow to look at
LAUNCH = 'source install/setup.bash\nros2 launch {name} bringup.launch.xml robot:=false'
# Once its nodes are known, a robot may stand so long; and longer, as long as it has not heard a
# command, or nobody has configured its route. Two of its nodes may know each other only when one
# says again who it is: in Fast DDS every 3 s, and on a busy machine that is lost, too.
READY_S, PATIENCE_S, UNFOUND_S = 30.0, 5.0, 10.0
STILL_S, LONGEST_S = 1.2, 12.0
LIMIT_S = 57.0  # of a drive in which nothing is decided
TROUBLE_M, TROUBLE_S, PUSH_S = 0.4, 1.4, 0.5
AHEAD = np.radians(np.arange(-10.0, 11.0))
NODES = 3  # of the package
TOPICS = 'cmd_vel', 'wanted'  # on which only one program may publish
ASKED = 'brake', 'route'
FRESH_S, FRESH_LIMIT_S = 0.15, 6.0  # ten scans come in a second


@dataclass(frozen=True)
class Place:
    """A floor, and where the robot starts on it."""

    floor: Floor
    start: Pose | None = None


SEEN = Place(CORRIDOR, Pose(2.25, 1.25, 0.0))
OTHER = Place(
    Floor.from_text(
        """
#######
#     #
#     #
#     #
#  o  #
#     #
#     #
#     #
#  ^  #
#######
""",
        name='storeroom',
    )
)


@dataclass(frozen=True)
class Drive:
    """What a robot did.

    `how` it ended is 'stands' (it never moved), 'hits', 'stops' (it drove, and stands), 'goes on'
    (too long), or 'died' (a program did, or the launch file cannot be read).
    """

    how: str
    record: DriveRecord
    said: str  # what the launch has printed
    moved_m: float  # from start to end, straight
    free_m: float  # ahead of its middle, at the end
    turned: float  # at the end (rad)
    braked: bool | None  # while its laser saw nothing; None: it did not come so far
    went_on: bool  # after that
    stands_at_exit: bool  # its last command, after Ctrl+C, was to stop
    voices: dict[str, int]  # publishers on cmd_vel and wanted while it drove, without our own
    simulated: list[str]  # its nodes that said they use simulated time
    freshest_s: float  # how old the scan was on which its brake worked, at the end: the least


def drive(
    case: Case,
    place: Place = SEEN,
    name: str = '',
    trouble: str = '',
    params: str = '',
    wanted_mps: float = 0.0,
) -> Drive:
    """Launch a robot's programs beside it, and let it drive until something is decided.

    With a `name` one sees it. `trouble` is what happens for a moment on its way: 'blind', its laser
    sees nothing; 'clock', its stamps are ahead; 'push', it is blind, and somebody turns it by
    remote control. `params` are more words of `ros2 launch`. With `wanted_mps` we publish that
    speed on `wanted`.
    """
    workspace = case.workspace
    end_launches(workspace.terminals.values())
    words = f'{LAUNCH.format(name=case.name)} {params}'.strip()
    freshest_s = 0.0
    with ros_session() as session:
        robot = Robot(place.floor, start=place.start, driver=DRIVER)
        if name:
            watch(robot, name=name)
        with workspace.start(words, f'the launch of {case.name}') as program:
            watcher = Watcher(session, robot, program, trouble, wanted_mps)
            with ProgressBar(None) as bar:
                if name:  # while it stands, nothing else moves
                    watcher.tell = bar.say
                robot.run(LIMIT_S, until=watcher.is_over)
            if watcher.how == 'stops' and trouble:
                freshest_s = watcher.wait_for_a_fresh_scan()
            program.interrupt()
        for record in session.records():  # what programs log stands in their terminal
            record.printed = True
        x, y, yaw = robot.pose
        robot.run(0.2)  # its last command may be on its way
        last = robot.record.commands[-1:]
        return Drive(
            how=watcher.how or 'goes on',
            record=robot.record,
            said=without_folders('\n'.join(program.lines), workspace.path),
            moved_m=watcher.moved_m,
            turned=math.remainder(yaw - watcher.start.yaw, math.tau),
            free_m=float(place.floor.ranges(x, y, yaw + AHEAD)[0].min()),
            braked=watcher.braked,
            went_on=watcher.went_on,
            stands_at_exit=not last or last[0].v == last[0].w == 0,
            voices=watcher.voices,
            simulated=watcher.simulated,
            freshest_s=freshest_s,
        )


class Watcher:
    """Looks at a drive until it is over, and brings the trouble."""

    def __init__(
        self, session: Session, robot: Robot, program: Process, trouble: str, wanted_mps: float
    ) -> None:
        self.robot, self.program, self.trouble = robot, program, trouble
        self.how, self.braked, self.went_on = '', None, False
        self.voices = dict.fromkeys(TOPICS, 0)
        self.node = session.node
        self.ours = {robot.get_name(), self.node.get_name()}  # the names of these two nodes
        # Of a drive that one sees, the session would say what these wait for.
        asked = ASKED if trouble else ()
        self._clients = {
            name: robot.create_client(GetParameters, f'{name}/get_parameters') for name in asked
        }
        self._answers: dict[str, Future] = {}  # whether a node uses simulated time
        self._ages: list[float] = []
        if trouble:
            robot.create_subscription(Float64, 'brake/scan_age', self._on_age, 10)
        self._wanted = robot.create_publisher(Twist, 'wanted', 1) if wanted_mps else None
        self._wanted_mps = wanted_mps
        self._begun_s, self._ready_s = time.monotonic(), None
        self._moved_at_s = self._still_at_s = self._trouble_at_s = None
        self._trouble_at_m = 0.0
        self.tell: Callable[[str], object] = lambda text: None
        self._told = ''
        self.start = robot.pose

    @property
    def moved_m(self) -> float:
        """How far it is from its start."""
        return math.dist(self.start[:2], self.robot.pose[:2])

    def is_over(self) -> bool:
        """Return whether something is decided, and keep in `how` what."""
        self.how = self._decide()
        return bool(self.how)

    def wait_for_a_fresh_scan(self) -> float:
        """Wait until its brake works on a scan that is new. Return how old the newest one was.

        It stands. If its callback is slower than the laser, its queue is full now, and in one of
        three or more each scan waits for two others.
        """
        self._ages.clear()
        self.robot.run(FRESH_LIMIT_S, until=lambda: min(self._ages, default=1.0) < FRESH_S)
        return min(self._ages, default=0.0)

    def _on_age(self, age: Float64) -> None:
        self._ages.append(age.data)

    def _decide(self) -> str:
        robot, now_s = self.robot, self.robot.t_s
        if self._wanted:
            self._wanted.publish(Twist(linear=Vector3(x=self._wanted_mps)))
        if robot.bumps:
            return 'hits'
        if not self.program.running or any(DIED in line for line in self.program.lines):
            return 'died'
        step = robot.record.poses[-1]
        is_still = step.v == 0 == step.w
        if self._moved_at_s is None:
            self._tell_how_long(is_still)
            if is_still:
                return 'stands' if self._waited_enough() else ''
            self._moved_at_s = now_s
        self._look_at_its_nodes()
        if self.trouble and self._is_in_trouble(now_s, is_still):
            return ''
        if self.braked is not None and self.moved_m > self._trouble_at_m + 0.1:
            self.went_on = True
        if not is_still:
            self._still_at_s = None
        elif self._still_at_s is None:
            self._still_at_s = now_s
        elif now_s - self._still_at_s > STILL_S:
            return 'stops'
        return 'goes on' if now_s - self._moved_at_s > LONGEST_S else ''

    @property
    def simulated(self) -> list[str]:
        """Which of its nodes have said that they use simulated time."""
        return [
            name
            for name, answer in self._answers.items()
            if answer.done() and answer.result().values[0].bool_value
        ]

    def _voices(self, topic: str) -> int:
        found = self.node.get_publishers_info_by_topic(topic)
        return sum(publisher.node_name not in self.ours for publisher in found)

    def _look_at_its_nodes(self) -> None:
        """Count who publishes, without us, and ask once whether they use simulated time."""
        for topic in TOPICS:
            self.voices[topic] = max(self.voices[topic], self._voices(topic))
        for name, client in self._clients.items():
            if name not in self._answers and client.service_is_ready():
                request = GetParameters.Request(names=['use_sim_time'])
                self._answers[name] = client.call_async(request)

    def _is_in_trouble(self, now_s: float, is_still: bool) -> bool:
        """Bring the trouble when it is on its way, and end it after its time."""
        if self._trouble_at_s is None:
            if self.moved_m < TROUBLE_M:
                return False
            self._trouble_at_s = now_s
            self._set_trouble(True)
        if self.braked is not None:
            return False
        since_s = now_s - self._trouble_at_s
        if self.trouble == 'push' and since_s < PUSH_S:
            self.robot.command(0.0, 1.0)
        if since_s < TROUBLE_S:
            return True
        self.braked, self._trouble_at_m = is_still, self.moved_m
        self._set_trouble(False)
        return False

    def _set_trouble(self, is_there: bool) -> None:
        if self.trouble == 'clock':
            self.robot.clock_ahead_s = 5.0 if is_there else 0.0
        else:
            self.robot.blind = is_there

    def _tell_how_long(self, is_still: bool) -> None:
        """Say once a second how long its programs have been starting, or how long it stands."""
        since_s = time.monotonic() - (self._ready_s or self._begun_s)
        text = 'Its nodes are there. It stands' if self._ready_s else 'Its programs start'
        text = f'{text}: {since_s:.0f} s' if is_still else ''
        if text != self._told:
            self._told = text
            self.tell(text)

    def _waited_enough(self) -> bool:
        """Return whether a robot that stands will not move any more: a slow machine has longer."""
        now_s = time.monotonic()
        if self._ready_s is None:
            names = {*self.node.get_node_names()} - self.ours
            if len(names) < NODES and now_s - self._begun_s < READY_S:
                return False
            self._ready_s = now_s
        is_found = self.robot.record.commands and self._voices('wanted')
        patience_s = PATIENCE_S if is_found else UNFOUND_S
        return now_s - self._ready_s > max(patience_s, 1.5 * (self._ready_s - self._begun_s))


def end_launches(processes: Iterable[Process]) -> None:
    """End the launches of terminals that are still open, of which robots would hear, and say so."""
    for process in [*processes]:
        if process.running:
            print(f'The terminal {process.name} was closed: its programs would drive, too.')
        process.interrupt()
