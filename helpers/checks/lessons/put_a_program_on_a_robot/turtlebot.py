"""A TurtleBot 3."""

import os
import re
import signal
import time

from builtin_interfaces.msg import Time as Stamp
from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.srv import GetParameters
from rclpy.clock import ClockType
from rclpy.time import Time

from helpers.checks.bench import Bench, must_have, periods_of
from helpers.checks.builds import build
from helpers.checks.lessons.put_a_program_on_a_robot.shared import tasks
from helpers.checks.patrols import DRIVES, has_a_timer, is_driven_at_most
from helpers.checks.points import all_of, expect
from helpers.checks.programs import Program
from helpers.patrol import LAUNCH, SIM, launched, module, printed
from helpers.robot import TURTLEBOT3, Floor
from helpers.workspace import DIED, started


@tasks.add
def the_guard(workspace):
    def guarded(story, *options):
        def test():
            with Bench() as bench:
                guard = module(workspace, 'guard').Guard(parameter_overrides=[*options])
                bench.spin(guard)
                return story(bench, bench.hear('cmd_vel', TwistStamped))

        return test

    def wanted(v, w):
        twist = Twist()
        twist.linear.x, twist.angular.z = v, w
        return twist

    def speeds(stamped):
        return [(one.twist.linear.x, one.twist.angular.z) for one in stamped]

    def hands_on(bench, heard):
        times = [bench.tester.get_clock().now()]
        for command in (wanted(0.2, 0.0), wanted(0.1, -0.5)):
            bench.say('cmd_vel_wanted', command)
            times.append(bench.tester.get_clock().now())
        moving = [one for one in heard if one.twist != Twist()]
        if speeds(moving)[:2] != [(0.2, 0.0), (0.1, -0.5)]:
            said = ', '.join(f'{v:g} m/s and {w:g} rad/s' for v, w in speeds(moving))
            return f'of two commands it published {said or "nothing"}'
        for before, one, after in zip(times, moving, times[1:], strict=False):
            if not before <= Time.from_msg(one.header.stamp) <= after:
                return f'a stamp is {one.header.stamp.sec} s: not the time at which it was sent'
        return True

    def begins(bench, heard):
        if not bench.wait(lambda: len(heard) >= 5, 2):
            return f'before the first command it publishes {len(heard)} times in 2 s, not 20 times'
        return expect({*speeds(heard)}, {(0.0, 0.0)}, 'before a command it publishes (m/s, rad/s)')

    def drives_then_stops(bench, heard):
        """Send one command. Return when it was passed on, and when zeros came, or None (s)."""
        command = bench.publisher('cmd_vel_wanted', Twist)
        command.publish(wanted(0.2, 0.0))
        came_s = stopped_s = None
        limit = time.monotonic() + 3  # of each: a guard that does nothing is soon told so
        while stopped_s is None and time.monotonic() < limit:
            bench.wait(lambda: False, 0.005)
            said = speeds(heard)
            if came_s is None and (0.2, 0.0) in said:
                came_s = time.monotonic()
                limit = came_s + 3
            if came_s is not None and (0.0, 0.0) in said[said.index((0.2, 0.0)) :]:
                stopped_s = time.monotonic()
        return came_s, stopped_s

    def stops(bench, heard):
        came_s, stopped_s = drives_then_stops(bench, heard)
        if came_s is None:
            return 'it publishes nothing for a command'
        if stopped_s is None:
            return 'no command comes any more, and it does not stop the robot'
        if stopped_s - came_s < 0.25:
            return f'it stops {stopped_s - came_s:.2f} s after the last command: timeout_s is 0.3'
        if stopped_s - came_s > 1.0:
            return f'it stops {stopped_s - came_s:.2f} s after the last command: timeout_s is 0.3'
        right = '[ERROR] [guard]: No command comes: I stop'
        if not bench.wait(lambda: right in bench.log('guard')):
            return f'it logged {bench.log("guard") or "nothing"}'
        count = len(heard)
        bench.wait(lambda: len(heard) >= count + 3)
        if len(heard) < count + 3:
            return f'it stops, and then publishes {len(heard) - count} times in 2 s, not 20 times'
        logged = bench.log('guard').count(right)
        return logged == 1 or f'it has logged this {logged} times'

    def stops_without_clock(bench, heard):
        if not bench.wait(lambda: len(heard) >= 3, 2):
            return 'with use_sim_time and without /clock it does not begin with zeros'
        if heard[0].header.stamp != Stamp():
            return (
                f'no /clock comes, and a stamp is {heard[0].header.stamp.sec} s: of another clock'
            )
        came_s, stopped_s = drives_then_stops(bench, heard)
        if came_s is None:
            return 'it publishes nothing for a command'
        text = 'with use_sim_time and without /clock it does not stop the robot'
        return stopped_s is not None or text

    def counts_alone():
        with Bench():
            guard = module(workspace, 'guard').Guard()
            periods_s = periods_of(guard)
            kinds = {timer.clock.clock_type for timer in guard.timers}
        return all_of(
            has_a_timer(periods_s, 0.1),
            kinds == {ClockType.STEADY_TIME} or 'a timer of it has no steady clock',
        )

    def can_be_run():
        guard = module(workspace, 'guard')
        if not callable(getattr(guard, 'main', None)):
            return 'there is no main() in guard.py'
        with Bench() as bench:
            heard, node = bench.hear('cmd_vel', TwistStamped), guard.Guard()
            must_have(node, 'publisher', 'stop')
            bench.wait(node.publisher.get_subscription_count)
            bench.quiet()
            del heard[:]
            node.stop()  # nothing spins it any more: what is sent now is the last
            bench.wait(lambda: heard)
        return expect({*speeds(heard)}, {(0.0, 0.0)}, 'stop() publishes (m/s, rad/s)')

    send = 'TwistStamped(twist=twist), and header.stamp = self.get_clock().now().to_msg()'
    dog = "Watchdog(self, self.stop, 'command'), and its seen() for each command"
    zeros = 'create_timer(0.1, ..., clock=Clock(clock_type=ClockType.STEADY_TIME))'
    return [
        ('it stamps each command', guarded(hands_on), send),
        ('it begins with zeros', guarded(begins), zeros),
        ('it stops the robot, and goes on with zeros', guarded(stops), dog),
        ('also without /clock', guarded(stops_without_clock, *SIM), zeros),
        ('ten times a second, by a steady clock', counts_alone, zeros),
        ('stop() and publisher, for run', can_be_run, 'self.publisher, stop(), main()'),
    ]


SMALL = Floor.from_text(
    """
##########
#        #
# >   o  #
#        #
##########
""",
    name='small',
)


@tasks.add(limit_s=120, cpu_s=30)
def a_turtlebot(workspace):
    def drives_on_a_new_floor():
        build(workspace, 'patrol_pkg')
        path = 'install/patrol_pkg/share/patrol_pkg/config/small.yaml'
        workspace.write(path, 'patrol:\n  ros__parameters:\n    route: [2.0, 0.5]\n')
        arguments = 'floor:=small robot:=false sim:=true timeout:=60.0'
        options = {'driver': TURTLEBOT3, 'file': 'turtlebot3.launch.xml'}
        robot, end = launched(workspace, arguments, SMALL, 1, 40, **options)
        if robot.bumps:
            return 'it hits something'
        if end != 'SUCCEEDED':
            return end
        return is_driven_at_most(robot, 0.2, 'a TurtleBot 3 drives at most 0.2 m/s')

    def starts_all():
        with Bench() as bench, started_with(workspace, bench) as program:
            found = started('\n'.join(program.lines))
            if found != ['guard', 'halt', 'patrol', 'robot']:
                programs = ' and '.join(found) or 'nothing'
                return f'it starts {programs}. {printed(workspace, program.lines)}'
            for node, name, right in (
                ('patrol', 'timeout_s', 0.7),
                ('guard', 'timeout_s', 0.7),
                ('halt', 'timeout_s', 1.4),
                ('patrol', 'full_battery', 100.0),
            ):
                request = GetParameters.Request(names=[name])
                service = f'/{node}/get_parameters'
                answer = bench.call(service, GetParameters, request, limit_s=10)
                if answer is None:
                    return f'the node {node} does not answer. {printed(workspace, program.lines)}'
                what = f'with timeout:=0.7 the parameter {name} of {node} is'
                is_right = expect(answer.values[0].double_value, right, what, within=0.01)
                if is_right is not True:
                    return is_right
        return True

    def they_come_back():
        with Bench() as bench, started_with(workspace, bench) as program:
            for name in ('guard', 'halt'):
                pids = pids_of(program, name)
                if not pids:
                    return f'not judged: it does not start {name}'
                os.kill(pids[0], signal.SIGKILL)
                if not bench.wait(lambda name=name: len(pids_of(program, name)) > 1, 10):
                    return f'{name} is killed, and does not come back'
        return True

    remap = '<remap from="cmd_vel" to="cmd_vel_wanted"/>, in the node patrol'
    both = '<param name="timeout_s" value="$(var timeout)"/>; in halt $(eval ...)'
    return [
        ('it drives a TurtleBot 3 on a new floor', drives_on_a_new_floor, remap),
        ('it starts robot, guard, halt and patrol', starts_all, both),
        ('guard and halt come back', they_come_back, '<node ... respawn="true">'),
    ]


def started_with(workspace, bench):
    """Launch all of it, and return the program when its robot drives or something has died."""
    program = Program(workspace.start(f'{LAUNCH}turtlebot3.launch.xml timeout:=0.7', 'all'))
    bench.wait(lambda: program.says(DRIVES) or program.says(DIED) or not program.running, 20)
    return program


def pids_of(program, name):
    """Return the ids of the processes that a launch has started for a program, the first first."""
    text = '\n'.join(program.lines)
    return [
        int(pid) for pid in re.findall(rf'\[{name}-\d+\]: process started with pid \[(\d+)\]', text)
    ]
