"""What the tasks of the lesson "Publish and subscribe" are judged by."""

import math
import signal
import time

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from helpers.checks.bench import RELIABLE, Bench
from helpers.checks.points import all_of, cached, expect, rows
from helpers.checks.programs import run_python
from helpers.checks.tasks import Tasks
from helpers.robot import EMPTY, Robot
from helpers.ros import ros_session

tasks = Tasks()
check = tasks.check


@tasks.add
def hear_the_text(MinimalSubscriber):
    def keeps(*texts):
        with Bench() as bench:
            node = bench.spin(MinimalSubscriber())
            bench.say('topic', *(String(data=text) for text in texts))
        return expect(node.heard, [*texts], f'of {[*texts]}, self.heard has')

    def logs(*texts):
        with Bench() as bench:
            bench.spin(MinimalSubscriber())
            bench.say('topic', *(String(data=text) for text in texts))
            log = bench.log('minimal_subscriber')
        right = [f'[INFO] [minimal_subscriber]: I heard: "{text}"' for text in texts]
        return expect(log, right, 'its log is')

    append = 'The text is message.data, and a list has .append(...).'
    info = 'self.get_logger().info(...), and the text has quotation marks: I heard: "..."'
    return [
        ('it keeps one text', lambda: keeps('Hello World: 7'), append),
        ('it keeps two texts', lambda: keeps('one', 'two'), append),
        ('it logs one text', lambda: logs('Hello World: 7'), info),
        ('it logs two texts', lambda: logs('one', 'two'), info),
    ]


@tasks.add
def one_executor_for_all(spin_together):
    def all_tick(count):
        ticked = set()
        with Bench() as bench:
            nodes = [Node(f'node_{number}') for number in range(count)]
            for number, node in enumerate(nodes):
                node.create_timer(0.01, lambda number=number: ticked.add(number))
            spin_together(bench.session, *nodes)
            bench.wait(lambda: len(ticked) == count)
            executors = {node.executor for node in nodes}
        if len(ticked) < count:
            return f'{count - len(ticked)} of {count} nodes: their timers never fired'
        kinds = sorted({type(executor).__name__ for executor in executors})
        return all_of(
            expect(len(executors), 1, f'the number of executors for {count} nodes is'),
            expect(kinds, ['SingleThreadedExecutor'], 'the kind of its executor is'),
        )

    hint = 'One executor before the loop, add_node(node) in the loop, session.spin after it.'
    return rows(
        all_tick,
        hint,
        ('two nodes spin in one executor', 2),
        ('four nodes spin in one executor', 4),
    )


@tasks.add
def a_driver(Driver):
    def drives(speed, turn):
        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist)
            node = Driver(speed, turn)
            ticks = ticks_of(node)
            bench.spin(node)
            bench.wait(lambda: len(commands) >= 3 or len(commands) > len(ticks))
            too_many = len(commands) > len(ticks)
        driver = f'Driver({speed}, {turn})'
        if not commands:
            return f'{driver} published nothing on cmd_vel'
        right = Twist()
        right.linear.x, right.angular.z = speed, turn
        wrong = [twist for twist in commands[:3] if twist != right]
        if wrong:
            return f'{driver} published {fields(wrong[0])}, not {fields(right)}'
        if too_many:
            return f'{driver} publishes more than one message in a call of timer_callback'
        return len(commands) >= 3 or f'in 2 s {driver} published {len(commands)} messages, not 3'

    hint = 'message = Twist(), message.linear.x = ..., message.angular.z = ..., and publish it.'
    return rows(drives, hint, ('Driver(0.5, 1.0)', 0.5, 1.0), ('Driver(-0.2, -0.7)', -0.2, -0.7))


def ticks_of(node):
    """Return a list that grows with each call of a timer's callback, before that call begins."""
    ticks = []

    def counts(callback):
        def tick():
            ticks.append(callback)
            return callback()

        return tick

    for timer in node.timers:
        timer.callback = counts(timer.callback)
    return ticks


def fields(twist):
    """Name the fields of a Twist that are not 0."""
    parts = {'linear': twist.linear, 'angular': twist.angular}
    set_fields = [
        f'{name}.{axis} = {getattr(part, axis):g}'
        for name, part in parts.items()
        for axis in 'xyz'
        if getattr(part, axis)
    ]
    return ', '.join(set_fields) or 'only zeros'


@tasks.add
def measure_the_distance(Odometer):
    def measures(distance, *places):
        messages = [Odometry() for _ in places]
        for message, (x, y) in zip(messages, places, strict=True):
            message.pose.pose.position.x, message.pose.pose.position.y = float(x), float(y)
        with Bench() as bench:
            node = bench.spin(Odometer())
            bench.say('odom', *messages)
        what = f'at the places {places} it measures'
        return expect(node.distance, distance, what, within=0.001, unit='m')

    def measures_a_burst():
        messages = [Odometry() for _ in range(6)]
        for x, message in enumerate(messages):
            message.pose.pose.position.x = float(x * x % 7)  # there and back: 0 1 4 2 2 4
        with Bench() as bench:
            node = Odometer()
            bench.say('odom', *messages, at_once=True)
            bench.spin(node)
            bench.quiet()
        what = 'of six places that come at once, 8 m long, it measures'
        return expect(node.distance, 8, what, within=0.001, unit='m')

    def there_and_back():
        return all_of(measures(10, (0, 0), (3, 4), (0, 0)), measures_a_burst())

    return [
        ('3 m', lambda: measures(3, (1, 1), (1, 2), (3, 2)), 'math.dist((0, 0), (3, 4)) is 5.0.'),
        ('there and back: 10 m', there_and_back, 'Keep each place. The depth is 10.'),
        ('one message: 0 m', lambda: measures(0, (5, 5)), 'If self.place is None, add nothing.'),
    ]


@tasks.add
def drive_a_square(Square):
    def drive(side):
        """Drive in simulated time: the timers fire as fast as they can, and in the same order."""
        with ros_session():
            robot, node = Robot(EMPTY, sim_time=True), Square(side)
            timers = list(node.timers)
            while robot.t_s < 20 and (live := [t for t in node.timers if not t.is_canceled()]):
                period_s = live[0].timer_period_ns / 1e9
                for timer in live:
                    timer.callback()
                robot.run(max(0.02, period_s))
            running = sum(not timer.is_canceled() for timer in node.timers)
            commands = [(command.v, command.w) for command in robot.record.commands]
            robot.run(1.0)
        path = [(pose.x - 5, pose.y - 5) for pose in robot.record.poses]
        return path, commands, timers, running, robot.pose.yaw

    small, large = cached(lambda: drive(0.6)), cached(lambda: drive(1.0))

    def corners(drive, side):
        path, *_, yaw = drive
        for corner in (side, 0), (side, side), (0, side), (0, 0):
            near = [number for number, place in enumerate(path) if math.dist(place, corner) < 0.1]
            if not near:
                return f'the robot does not come to the corner {corner}'
            path = path[near[0] :]
        if math.dist(path[-1], (0, 0)) > 0.1:
            return 'it does not end where it started'
        turned = math.degrees(math.remainder(yaw, math.tau))
        return abs(turned) < 20 or f'at its end it looks {turned:.0f} degrees to the side'

    def ticks(drive, side):
        _, commands, *_ = drive
        return all_of(
            expect(sum(v > 0 for v, _ in commands), round(4 * side * 20), 'ticks straight ahead:'),
            expect(sum(w > 0 for _, w in commands), 4 * 10, 'ticks that turn:'),
        )

    def stops():
        _, commands, timers, running, _ = small()
        if not timers:
            return 'it has no timer'
        if running:
            return 'after 20 s its timer still runs'
        if not commands:
            return 'it published no speed'
        return expect(commands[-1], (0.0, 0.0), 'the last speed that it published is')

    tick = 'self.ticks % (self.side_ticks + 10) is the number of the tick in this side and turn.'
    end = 'After 4 * (self.side_ticks + 10) ticks: publish Twist(), and self.timer.cancel().'
    return [
        ('side 1 m: it comes to the corners, and back', lambda: corners(large(), 1.0), tick),
        ('side 0.6 m: it comes to the corners, and back', lambda: corners(small(), 0.6), tick),
        ('side 1 m: so many ticks ahead and to the left', lambda: ticks(large(), 1.0), tick),
        ('it stops the robot and its timer', stops, end),
    ]


MORE_S = 0.5  # for a command that no message has asked for


@tasks.add
def mirror_the_robot(Mirror):
    def mirrors(*speeds):
        messages = [Odometry() for _ in speeds]
        for message, (v, w) in zip(messages, speeds, strict=True):
            message.twist.twist.linear.x, message.twist.twist.angular.z = v, w
        with Bench() as bench:
            commands = bench.hear('two/cmd_vel', Twist)
            bench.spin(Mirror())
            bench.say('odom', *messages)
            bench.wait(lambda: len(commands) > len(speeds), MORE_S)
        found = [(twist.linear.x, twist.angular.z) for twist in commands]
        right = [(v, -w) for v, w in speeds]
        return expect(found, right, f'of {[*speeds]} it made')

    def name():
        with ros_session():
            name = Mirror().get_name()
        return expect(name, 'mirror', 'its name is')

    hint = 'A callback that makes a Twist, sets two fields, and publishes it. Compare Driver.'
    return [
        ('one message', lambda: mirrors((0.5, 1.0)), hint),
        ('two messages', lambda: mirrors((0.0, -0.25), (0.5, 0.0)), hint),
        ('the node is called mirror', name, "super().__init__('mirror')"),
    ]


@tasks.add
def hear_the_laser(asked):
    def hears(reliability):
        heard = []
        offered = QoSProfile(depth=10, reliability=reliability)
        with Bench() as bench:
            node = Node('minimal_subscriber')
            node.create_subscription(String, 'topic', heard.append, asked)
            bench.spin(node)
            bench.say('topic', *(String(data=str(number)) for number in range(4)), qos=offered)
        return expect(len(heard), 4, 'of four messages it received')

    def has_depth():
        with ros_session():
            node = Node('minimal_subscriber')
            subscription = node.create_subscription(String, 'topic', print, asked)
            depth = subscription.qos_profile.depth
        return expect(depth, 10, 'the depth is')

    hint = 'Above, a QoSProfile has a depth and a reliability. Ask for less.'
    return [
        ('it receives BEST_EFFORT', lambda: hears(ReliabilityPolicy.BEST_EFFORT), hint),
        ('it receives RELIABLE', lambda: hears(ReliabilityPolicy.RELIABLE), hint),
        ('its depth is 10', has_depth, 'QoSProfile(depth=10, ...)'),
    ]


@tasks.add(limit_s=60)
def a_program_of_its_own(workspace, file):
    def is_program(team, sent=signal.SIGINT, name='Ctrl+C'):
        line = f'[talker]: {team} talks'

        def logged():
            return sum(line in printed for printed in talker.lines)

        with Bench() as bench:
            heard = bench.hear('topic', String)
            with run_python(workspace, file, team) as talker:
                # It takes 1.5 s on an idle computer; once a second is too seldom on each.
                often = talker.wait(lambda: heard) and talker.wait(lambda: len(heard) > 15, 10)
                # A shutdown in the callback ends spin() without an exception: it waits, then.
                talker.wait(lambda: logged() >= len(heard), 1)
                ended = talker.end(sent)
        teams = {message.data for message in heard}
        if teams != {team}:
            received = ', '.join(sorted(teams)) or 'nothing'
            return f'the listener received {received}, not {team}'
        if not logged():
            return f'its log has no line "{line}"'
        if logged() < len(heard) - 1:  # the end may come between the two
            return f'it sent {len(heard)} messages, and logged {logged()} lines "{line}"'
        if not often:
            return f'in 10 s, {len(heard)} messages came, and not one every 0.1 s'
        if talker.failed:
            return f'{name} ends it with a traceback: {talker.error}'
        return ended or f'{name} does not end it'

    def ends_well_or_fails():
        ended = is_program('blue')
        if ended is not True:
            return ended
        error = ERROR.format(name=file.removesuffix('.py'))
        with run_python(workspace, '-c', error, 'blue') as program:
            hides = program.has_ended() and program.exit_code() == 0
        return not hides or 'it hides an error in spin, as if that were a normal end'

    def can_be_imported():
        with run_python(workspace, '-c', f'import {file.removesuffix(".py")}') as program:
            ended = program.has_ended()
        if not ended:
            return 'the import does not end within 8 s: it starts to talk'
        return program.exit_code() == 0 or f'the import ends with an error: {program.error}'

    hint = 'main(): rclpy.init(), then in a try: rclpy.spin(Talker(sys.argv[1])).'
    caught = 'except (KeyboardInterrupt, ExternalShutdownException): pass'
    guarded = "Below the class only main(), and if __name__ == '__main__': main()."
    return [
        ('red talks, until Ctrl+C ends it', lambda: is_program('red'), hint),
        ('blue talks, until Ctrl+C ends it', ends_well_or_fails, caught),
        (
            'red talks, until a shutdown by something else ends it',
            lambda: is_program('red', signal.SIGTERM, 'SIGTERM, which shuts rclpy down,'),
            caught,
        ),
        ('a program that imports it gets the class, and nothing starts', can_be_imported, guarded),
    ]


# What spins a node has an error.
ERROR = """
import rclpy

def fail(*_, **__):
    raise RuntimeError('planted')

rclpy.spin = fail
import {name} as own
own.main()
"""

# The third tick that somebody hears fails.
FAILS = """
import {name} as own
drive, ticks = own.Driver.timer_callback, []

def fail(self):
    drive(self)
    if self.publisher.get_subscription_count():
        ticks.append(1)
    if len(ticks) == 3:
        raise RuntimeError('the sensor is gone')

own.Driver.timer_callback = fail
own.main()
"""


@tasks.add(limit_s=90)
def leave_a_robot_that_stands(workspace, file):
    def leaves_it_standing(sent):
        """Let the program drive, send it a signal, and look at what it has commanded."""
        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist, RELIABLE)
            with run_python(workspace, file) as driver:
                if not driver.wait(lambda: len(commands) >= 3, limit_s=15):
                    return f'it does not drive: {driver.error}'
                if not driver.end(sent, limit_s=3):
                    return f'3 s after {sent.name} it has not ended'
            bench.quiet()
        speed = commands[-1].linear.x
        if speed:  # first: whether spin raises or returns depends on what it does just then
            return f'{sent.name} ends it, and its last command is {speed:g} m/s, not 0 m/s'
        return not driver.failed or f'{sent.name} ends it with an error: {driver.error}'

    def leaves_it_standing_after_an_error():
        """Let a callback fail while the robot drives, and look at what is commanded last."""
        with Bench() as bench:
            commands = bench.hear('cmd_vel', Twist, RELIABLE)
            fails = FAILS.format(name=file.removesuffix('.py'))
            with run_python(workspace, '-c', fails) as driver:
                ended = driver.has_ended(15)
            bench.quiet()
        if not ended or not commands:
            return f'it does not drive, and then end: {driver.error}'
        speed = commands[-1].linear.x
        return not speed or f'an error ends it, and its last command is {speed:g} m/s, not 0 m/s'

    def ends_while_nothing_happens():
        """Let the same main() spin a node to which nothing happens."""
        name = file.removesuffix('.py')
        idle = (
            f'import {name} as own; '
            'own.Driver.timer_callback = lambda self: (self.timer.cancel(), print(self.timer)); '
            'own.main()'
        )
        with run_python(workspace, '-c', idle) as driver:
            if not driver.wait(lambda: driver.lines, limit_s=15):
                return 'its timer never fired'
            time.sleep(0.3)  # now it waits
            ended = driver.end(signal.SIGINT, limit_s=3)
        return ended or 'while no callback is due, Ctrl+C does not end it'

    no_handler = 'SignalHandlerOptions.NO, and node.stop() in finally, before try_shutdown().'
    term = 'signal.signal(signal.SIGTERM, signal.default_int_handler)'
    once_more = 'while rclpy.ok(): rclpy.spin_once(node, timeout_sec=0.1)'
    return [
        (
            'after Ctrl+C (SIGINT) the robot stands',
            lambda: leaves_it_standing(signal.SIGINT),
            no_handler,
        ),
        ('after SIGTERM, too', lambda: leaves_it_standing(signal.SIGTERM), term),
        ('Ctrl+C also ends it while no callback is due', ends_while_nothing_happens, once_more),
        (
            'after an error in a callback the robot stands',
            leaves_it_standing_after_an_error,
            'What is in finally happens after each end, what is in except only after one of them.',
        ),
    ]
