"""One trial: a program, a base, a trouble. `python -m ordeal.trial FOLDER` runs it, in FOLDER.

It is a process of its own, with a ROS domain of its own. `trial.json` in its folder says what to
run, and `result.json` what came of it.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import json
import math
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
from action_msgs.msg import GoalStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from helpers.robot import FLOORS, Floor, Pose
from helpers.ros import ros_session
from ordeal.happen import happening
from ordeal.law import Seen, broken
from ordeal.robot import Second, TroubledRobot, base_of
from ordeal.troubles import Trouble

START_S, END_S, POLL_S = 40.0, 8.0, 0.02
AFTER_S = 12.0  # so long a program has to do what it promises
STAYS_S = 1.0  # what has stood so long before the wall has stopped for it
PLACE_M = 0.5  # so near its goal a job has arrived
NO_PROGRAMS = ('ros2', 'python', 'bash', 'sh')


class DidNotBeginError(Exception):
    """The program did not come to drive, so that no trouble could be tried."""


class Trial:
    """A program beside a robot, in a trouble. `run()` does it once.

    `told` is what `trial.json` says: `declared` (as in programs.yaml), `commands` of its processes,
    their `folder` and `environment`, `base`, `trouble`, `clock` (a library).
    """

    def __init__(self, told: dict[str, Any], folder: Path) -> None:
        self.told, self.declared, self.folder = told, told['declared'], folder
        self.trouble = Trouble(**told['trouble'])
        self.values = self.trouble.values
        self.clock = folder / 'clock'
        self.network = None
        self.second: Second | None = None
        self.processes: dict[str, subprocess.Popen] = {}
        self.result = None  # of the goal: a future

    def run(self) -> dict[str, Any]:
        """Return what was seen: `broken`, what broke the law, or empty; `said`; and more."""
        session_options = {}
        if self.trouble.of == 'network':
            from ordeal.network import Network

            self.network = Network()
            session_options = {'domain_id': 42, 'discovery': 'SUBNET'}
        with ros_session(**session_options) as session:
            self.session = session
            self.node, executor = Node('bench'), SingleThreadedExecutor()
            executor.add_node(self.node)
            session.spin(executor)
            start = self.declared.get('start')
            self.robot = TroubledRobot(
                self._floor(),
                driver=base_of(self.told['base'], self.declared['stamped']),
                start=Pose(*start) if start else None,
            )
            try:
                return self._try() | {'said': self._said()}
            except DidNotBeginError as error:
                return {'broken': '', 'did_not_begin': str(error), 'said': self._said()}
            finally:
                self._end()

    def _try(self) -> dict[str, Any]:
        if self.trouble.what == 'nothing':
            self._start()
            self._ask(START_S)
            self._wait_until_it_drives()
            begun_s = self._now()
            promised = self._keeps_promise(begun_s)
            return self._judged(begun_s, begun_s, promised) | {'seen': self._consists_of()}
        if self.trouble.what == 'silent from the start':
            with happening(self):
                self._start()
                self._wait_for_nodes()
                self._ask(2.0)
                begun_s = 0.0
                self._wait(self._now() + 3.0, lambda: bool(self.robot.bumps))
                ended_s = self._now()
        else:
            self._start()
            self._ask(START_S)
            self._wait_until_it_drives()
            begun_s = self._now()
            with happening(self):
                self._wait(begun_s + self._lasts_s(), lambda: bool(self.robot.bumps))
                ended_s = self._now()
        promised = None
        if self.trouble.ends and not self.robot.bumps:
            promised = self._keeps_promise(ended_s)
        return self._judged(begun_s, ended_s, promised)

    def _lasts_s(self) -> float:
        may_go_on = not self.trouble.must_stand and self.declared['promises'] != 'drives'
        return self.declared['long_s'] if may_go_on else self.values['lasts_s']

    def _judged(self, begun_s: float, ended_s: float, promised: bool | None) -> dict[str, Any]:
        record = self.robot.record
        found = broken(
            Seen(
                moves=[(step.t_s, step.v, step.w) for step in record.poses],
                commands=[command.t_s for command in record.commands],
                bumps=[event.t_s for event in record.events if event.kind == 'bump'],
                begun_s=begun_s,
                ended_s=ended_s,
                must_stand=self.trouble.must_stand,
                within_s=self.values.get('within_s', self.declared['within_s']),
                from_start=self.trouble.what == 'silent from the start',
                promised=promised,
            )
        )
        if found:
            from helpers.robot_view import replay_drive  # slow to load, and seldom needed

            replay = replay_drive(record, name=self.trouble.name)
            page = replay._repr_mimebundle_()['text/html']
            (self.folder / 'replay.html').write_text(page, encoding='utf-8')
        return {'broken': found}

    # --- Start, and end

    def _floor(self) -> Floor:
        name = self.declared['floor']
        if name in FLOORS:
            return FLOORS[name]
        names: dict[str, Any] = {}
        exec((Path(self.told['folder']) / 'lesson.py').read_text(encoding='utf-8'), names)
        return names[name]

    def _start(self) -> None:
        self.clock.write_bytes(struct.pack('q', 0))
        folder, given = self.told['folder'], self.told['environment']
        before = given.get('PYTHONPATH', '').split(os.pathsep)
        inside = [str(Path(__file__).parent / 'inside'), folder]
        environment = given | self.session.environment
        environment |= {
            'PYTHONPATH': os.pathsep.join([*inside, *filter(None, before)]),
            'ORDEAL_FOLDER': str(self.folder),
            'PYTHONUNBUFFERED': '1',
        }
        if self.trouble.of == 'clock':
            environment |= {'ORDEAL_CLOCK': str(self.clock), 'LD_PRELOAD': self.told['clock']}
        for name, command in self.told['commands'].items():
            with (self.folder / f'{name}.txt').open('w') as said:
                self.processes[name] = subprocess.Popen(
                    self.network.inside(command) if self.network else command,
                    env=environment,
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=said,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )

    def _said(self) -> str:
        lines = []
        for path in sorted(self.folder.glob('*.txt')):
            lines += path.read_text(encoding='utf-8', errors='replace').splitlines()[-6:]
        return '\n'.join(lines)

    def _end(self) -> None:
        for sent in (signal.SIGCONT, signal.SIGINT):
            self._signal_all(sent)
        limit = time.monotonic() + END_S
        while any(p.poll() is None for p in self.processes.values()):
            if time.monotonic() > limit:
                break
            time.sleep(POLL_S)
        self._signal_all(signal.SIGKILL)
        for process in self.processes.values():
            process.wait()
        if self.network:
            self.network.close()

    def _signal_all(self, sent: signal.Signals) -> None:
        for process in self.processes.values():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, sent)

    # --- Wait

    def _now(self) -> float:
        return self.robot.t_s

    def _wait(self, until_s: float, over: Callable[[], bool] = lambda: False) -> bool:
        """Wait until a time of the robot, or until `over()` holds. Return whether it does."""
        while self._now() < until_s:
            if self.second:
                self.second.speak()
            if over():
                return True
            time.sleep(POLL_S)
        return over()

    def _nodes(self) -> list[str]:
        own = ('robot', 'bench', 'second')
        names = {*self.node.get_node_names()}
        return sorted(n for n in names if n not in own and not n.startswith(('launch_ros', '_')))

    def _wait_for_nodes(self) -> None:
        wanted = self.declared['nodes']
        if not self._wait(self._now() + START_S, lambda: len(self._nodes()) >= wanted):
            raise DidNotBeginError(f'Only these nodes came: {", ".join(self._nodes()) or "none"}.')

    def _wait_until_it_drives(self) -> None:
        start = Pose(*self.declared.get('start') or self.robot.floor.start)
        after_m = self.values.get('after_m', 0.1)

        def drives() -> bool:
            if all(process.poll() is not None for process in self.processes.values()):
                raise DidNotBeginError('The program has ended.')
            return math.dist(self.robot.pose[:2], start[:2]) >= after_m

        if not self._wait(self._now() + START_S, drives):
            raise DidNotBeginError(f'It did not drive {after_m} m in {START_S:g} s.')

    # --- Ask the program

    def call(self, kind: type, service: str, request: Any) -> Any:
        """Return the answer of a service, or None."""
        client = self.node.create_client(kind, service)
        try:
            if not self._wait(self._now() + 2.0, client.service_is_ready):
                return None
            future = client.call_async(request)
            return future.result() if self._wait(self._now() + 2.0, future.done) else None
        finally:
            self.node.destroy_client(client)

    def _ask(self, patience_s: float) -> None:
        """Let the program begin to drive: activate it, or send it a goal, if it takes one."""
        self._activate()
        goal = self.declared.get('goal')
        if not goal:
            return
        package, kind = goal['type'].split('/')
        action = getattr(importlib.import_module(f'{package}.action'), kind)
        client = ActionClient(self.node, action, goal['to'])
        limit_s = self._now() + patience_s
        while self._now() < limit_s:
            if client.server_is_ready():
                sent = client.send_goal_async(action.Goal(**goal['fields']))
                if self._wait(self._now() + 3.0, sent.done) and sent.result().accepted:
                    self.result = sent.result().get_result_async()
                    return
            self._wait(self._now() + 0.3)
        if patience_s == START_S:
            raise DidNotBeginError('Its goal was not accepted.')

    def _activate(self) -> None:
        name = self.declared.get('activate')
        if not name:
            return
        for change in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            request = ChangeState.Request(transition=Transition(id=change))
            limit_s = self._now() + START_S
            while self.call(ChangeState, f'{name}/change_state', request) is None:
                if self._now() > limit_s:
                    raise DidNotBeginError('It could not be activated.')

    # --- What it consists of

    def _consists_of(self) -> dict[str, list[str]]:
        callbacks = self.folder / 'callbacks'
        names = callbacks.read_text(encoding='utf-8').split('\n') if callbacks.exists() else []
        return {
            'processes': sorted(self.programs()),
            'callbacks': sorted({*filter(None, names)}),
            'parameters': self._parameters(),
        }

    def programs(self) -> dict[str, psutil.Process]:
        """Return the processes of the program by their names; a shell between is none of them."""
        found = {}
        for name, process in self.processes.items():
            top = psutil.Process(process.pid)
            found[name] = top
            for child in top.children(recursive=True):
                with contextlib.suppress(psutil.NoSuchProcess):
                    called = [Path(word).name for word in child.cmdline()[:2] if word]
                    known = [word for word in called if not word.startswith(NO_PROGRAMS)]
                    if known and child.status() != psutil.STATUS_ZOMBIE:
                        found[known[0]] = child
        return found

    def _parameters(self) -> list[str]:
        found = []
        for node in self._nodes():
            answer = self.call(ListParameters, f'{node}/list_parameters', ListParameters.Request())
            names = [*answer.result.names] if answer else []
            names = [name for name in names if not name.startswith(('use_sim', 'qos_', 'start_'))]
            request = GetParameters.Request(names=names)
            answer = self.call(GetParameters, f'{node}/get_parameters', request) if names else None
            for name, value in zip(names, answer.values if answer else [], strict=False):
                if value.type == ParameterType.PARAMETER_DOUBLE:
                    found.append(f'{node}.{name}')
        return found

    # --- What it promises

    def _keeps_promise(self, since_s: float) -> bool:
        """Return whether the program does from now on what it promises.

        drives: it moves, by commands after `since_s`. brakes: it stands before the wall. arrives:
        its job ends, and if it says that it succeeded, the robot is where it was sent.
        """
        return getattr(self, f'_{self.declared["promises"]}')(since_s)

    def _drives(self, since_s: float) -> bool:
        def moves() -> bool:
            step, commands = self.robot.record.poses[-1], self.robot.record.commands
            return (step.v != 0 or step.w != 0) and commands[-1].t_s >= since_s

        return self._wait(self._now() + AFTER_S, moves)

    def _brakes(self, since_s: float) -> bool:
        robot, near_m, stood_s = self.robot, self.declared['near_m'], math.inf

        def stays_at_wall() -> bool:
            nonlocal stood_s
            step, (x, y, yaw) = robot.record.poses[-1], robot.pose
            ahead_m = float(robot.floor.ranges(x, y, [yaw])[0][0])
            stands = max(abs(step.v), abs(step.w)) < 0.01 and ahead_m < near_m
            stood_s = min(stood_s, self._now()) if stands else math.inf
            return bool(robot.bumps) or self._now() - stood_s > STAYS_S

        return self._wait(self._now() + AFTER_S, stays_at_wall) and not robot.bumps

    def _arrives(self, since_s: float) -> bool:
        if self.result is None:  # the trouble was there before its goal
            self._ask(AFTER_S)
        if self.result is None:
            return False
        over = lambda: bool(self.robot.bumps) or self.result.done()  # noqa: E731
        if not self._wait(self._now() + self.declared['arrives_s'], over) or self.robot.bumps:
            return False
        if self.result.result().status != GoalStatus.STATUS_SUCCEEDED:
            return True  # it says that it has not arrived
        return math.dist(self.robot.pose[:2], self.declared['goal']['place']) < PLACE_M


def main() -> None:
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # its programs end with it
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG: and it with the ordeal
    folder = Path(sys.argv[1])
    told = json.loads((folder / 'trial.json').read_text(encoding='utf-8'))
    result = Trial(told, folder).run()
    (folder / 'result.json').write_text(json.dumps(result), encoding='utf-8')


if __name__ == '__main__':
    main()
