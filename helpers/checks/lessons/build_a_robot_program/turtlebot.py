"""Of the project: a TurtleBot 3."""

import time

from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.srv import GetParameters
from rclpy.time import Time

from helpers.checks.bench import Bench, must_have
from helpers.checks.builds import build
from helpers.checks.lessons.build_a_robot_program.shared import (
    DRIVES,
    is_driven_at_most,
    tasks,
)
from helpers.checks.points import expect
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
        before = bench.tester.get_clock().now()
        bench.say('cmd_vel_wanted', wanted(0.2, 0.0), wanted(0.1, -0.5))
        after = bench.tester.get_clock().now()
        if speeds(heard)[:2] != [(0.2, 0.0), (0.1, -0.5)]:
            said = ', '.join(f'{v:g} m/s and {w:g} rad/s' for v, w in speeds(heard))
            return f'of two commands it published {said or "nothing"}'
        for one in heard[:2]:
            if not before <= Time.from_msg(one.header.stamp) <= after:
                return f'a stamp is {one.header.stamp.sec} s: not the time at which it was sent'
        return True

    def stops(bench, heard):
        if bench.wait(lambda: heard, 0.6):
            return 'it publishes before the first command'
        begin = time.monotonic()
        bench.say('cmd_vel_wanted', wanted(0.2, 0.0))
        if not bench.wait(lambda: heard):
            return 'it publishes nothing for a command'
        if not bench.wait(lambda: (0.0, 0.0) in speeds(heard), 10):
            return 'no command comes any more, and it does not stop the robot'
        waited_s = time.monotonic() - begin
        if waited_s < 0.3:
            return f'it stops {waited_s:.2f} s after the last command: timeout_s is 0.3'
        right = '[ERROR] [guard]: No command comes: I stop'
        if not bench.wait(lambda: right in bench.log('guard')):
            return f'it logged {bench.log("guard") or "nothing"}'
        bench.wait(lambda: len(heard) > 2, 0.6)
        return len(heard) == 2 or 'it stops the robot again and again'

    def stops_without_clock(bench, heard):
        bench.say('cmd_vel_wanted', wanted(0.2, 0.0))
        if not bench.wait(lambda: heard):
            return 'it publishes nothing for a command'
        stopped = bench.wait(lambda: (0.0, 0.0) in speeds(heard), 10)
        return stopped or 'with use_sim_time and without /clock it does not stop the robot'

    def can_be_run(bench, heard):
        guard = module(workspace, 'guard')
        if not callable(getattr(guard, 'main', None)):
            return 'there is no main() in guard.py'
        node = guard.Guard()
        must_have(node, 'publisher', 'stop')
        node.stop()
        bench.wait(lambda: heard)
        return expect(speeds(heard), [(0.0, 0.0)], 'stop() publishes (m/s, rad/s)')

    send = 'TwistStamped(twist=twist), and header.stamp = self.get_clock().now().to_msg()'
    dog = "Watchdog(self, self.stop, 'command'), and its seen() for each command"
    return [
        ('it stamps each command', guarded(hands_on), send),
        ('it stops the robot, once', guarded(stops), dog),
        ('also without /clock', guarded(stops_without_clock, *SIM), dog),
        ('stop() and publisher, for run', guarded(can_be_run), 'self.publisher, stop(), main()'),
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
        command = f'{LAUNCH}turtlebot3.launch.xml timeout:=0.7'
        with Bench() as bench, Program(workspace.start(command, 'all')) as program:
            bench.wait(
                lambda: program.says(DRIVES) or program.says(DIED) or not program.running, 20
            )
            found = started('\n'.join(program.lines))
            if found != ['guard', 'patrol', 'robot']:
                programs = ' and '.join(found) or 'nothing'
                return f'it starts {programs}. {printed(workspace, program.lines)}'
            for node in ('patrol', 'guard'):
                request = GetParameters.Request(names=['timeout_s'])
                service = f'/{node}/get_parameters'
                answer = bench.call(service, GetParameters, request, limit_s=10)
                if answer is None:
                    return f'the node {node} does not answer. {printed(workspace, program.lines)}'
                what = f'with timeout:=0.7 the parameter timeout_s of {node} is'
                waits = expect(answer.values[0].double_value, 0.7, what)
                if waits is not True:
                    return waits
        return True

    remap = '<remap from="cmd_vel" to="cmd_vel_wanted"/>, in the node patrol'
    both = '<param name="timeout_s" value="$(var timeout)"/>, in both nodes'
    return [
        ('it drives a TurtleBot 3 on a new floor', drives_on_a_new_floor, remap),
        ('it starts robot, guard and patrol', starts_all, both),
    ]
