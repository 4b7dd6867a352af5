"""The action, the job, the battery, the watchdog."""

import math
import re
import time

from rclpy.action import ActionClient
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import BatteryState

from helpers.checks.bench import Bench, must_define, periods_of
from helpers.checks.builds import builds
from helpers.checks.lessons.build_a_robot_program.shared import tasks
from helpers.checks.patrols import NOT_BUILT
from helpers.checks.points import cached, expect, needs
from helpers.patrol import SIM, Ear, action, module
from helpers.robot import EMPTY, Robot
from helpers.ros import STATUS, ros_session, spun


@tasks.add(limit_s=90, cpu_s=60)
def an_action(workspace):
    show = 'source install/setup.bash\nros2 interface show patrol_interfaces/action/Patrol'
    shown = cached(lambda: workspace.terminal(show))
    it_builds = cached(lambda: builds(workspace, 'patrol_interfaces'))

    def has(number, name, right):
        needs(it_builds, NOT_BUILT)
        written = re.sub(r'#.*', '', shown())
        parts = re.split(r'^---$', written, flags=re.MULTILINE)
        found = ' '.join(parts[number].split()) if number < len(parts) else ''
        return found == right or f'the {name} has {found or "nothing"}'

    visited = 'int32[] visited'
    return [
        ('it builds', it_builds, 'Three parts, with a line --- between them.'),
        ('the goal', lambda: has(0, 'goal', 'int32 places'), 'int32 places'),
        ('the result', lambda: has(1, 'result', visited), 'A list is int32[].'),
        ('the feedback', lambda: has(2, 'feedback', visited), 'A list is int32[].'),
    ]


class Asked:
    """A job in a node, a client, and what the client is told. Make it in a session."""

    def __init__(self, workspace, route=(1.0, 2.0, 3.0, 4.0)):
        given = [Parameter('route', value=list(route))] if route else []
        self.robot, self.allowed = Robot(EMPTY, sim_time=True), True
        node, client = Node('tested', parameter_overrides=[*SIM, *given]), Node('client')
        self.job = module(workspace, 'job').Job(node, lambda: self.allowed)
        self.client, self.executor = ActionClient(client, action(), 'patrol'), spun(node, client)
        self.robot.run(0.5, self.executor, until=self.client.server_is_ready)

    def ask(self, places):
        """Send a goal. Return whether it was accepted."""
        self.heard, self.ended = [], None
        sent = self.client.send_goal_async(action().Goal(places=places), self.hear)
        self.robot.run(0.2, self.executor)
        if not sent.done():
            return 'no answer'
        self.handle = sent.result()
        if self.handle.accepted:
            self.ended = self.handle.get_result_async()
        return 'accepted' if self.handle.accepted else 'refused'

    def hear(self, message):
        """Keep feedback."""
        self.heard.append(list(message.feedback.visited))

    def result(self):
        """Return how the job ended, and the places of its result."""
        self.robot.run(0.2, self.executor)
        if self.ended is None or not self.ended.done():
            return 'no result'
        answer = self.ended.result()
        return STATUS[answer.status], list(answer.result.visited)


@tasks.add
def the_job(workspace):
    def told(story):
        """Tell a story: each of its steps says of what something came, what, and what is right."""
        with ros_session():
            for step, came, right in story(Asked(workspace)):
                if came != right:
                    return f'{step}: {came}, not {right}'
        return True

    one, two = (1.0, 2.0), (3.0, 4.0)

    def three_places(asked):
        yield 'place() without a goal', asked.job.place(), None
        yield 'a goal of 3 places', asked.ask(3), 'accepted'
        for number, right in enumerate([one, two, one]):
            yield f'place() after {number} places', asked.job.place(), right
            asked.job.arrived()
            asked.robot.run(0.1, asked.executor)
        yield 'the result after 3 places', asked.result(), ('SUCCEEDED', [0, 1, 2])
        # The last one may come after the result.
        yield 'the feedback after 1 and 2 places', asked.heard[:2], [[0], [0, 1]]
        yield 'place() after the last one', asked.job.place(), None
        yield 'a goal of 1 place after it', asked.ask(1), 'accepted'
        asked.job.arrived()
        yield 'its result', asked.result(), ('SUCCEEDED', [0])

    def refusals(asked):
        yield 'a goal of 0 places', asked.ask(0), 'refused'
        asked.allowed = False
        yield 'a goal while may_begin() is False', asked.ask(2), 'refused'
        asked.allowed = True
        yield 'a goal of 2 places', asked.ask(2), 'accepted'
        yield 'a second goal at once', asked.ask(2), 'refused'

    def without_route():
        with ros_session():
            answer = Asked(workspace, route=()).ask(1)
        return answer == 'refused' or f'without the parameter route, a goal of 1 place: {answer}'

    def cancelled(asked):
        yield 'a goal of 5 places', asked.ask(5), 'accepted'
        asked.job.arrived()
        asked.handle.cancel_goal_async()
        asked.robot.run(0.2, asked.executor)
        yield 'place() after a cancel', asked.job.place(), None
        yield 'the result after a cancel', asked.result(), ('CANCELED', [0])
        yield 'a new goal of 1 place', asked.ask(1), 'accepted'
        asked.job.arrived()
        yield 'its result', asked.result(), ('SUCCEEDED', [0])

    def broken_off(asked):
        asked.job.end()
        yield 'a goal of 2 places', asked.ask(2), 'accepted'
        asked.job.arrived()
        asked.job.end()
        yield 'the result after one place and end()', asked.result(), ('ABORTED', [0])
        yield 'a new goal', asked.ask(1), 'accepted'

    numbers = 'The numbers go on: 0, 1, 2. goal.succeed(), and publish feedback.'
    asked_for = 'is_cancel_requested in place()'
    return [
        ('three places', lambda: told(three_places), numbers),
        ('what it refuses', lambda: told(refusals), 'GoalResponse.REJECT'),
        ('without a route', without_route, 'not self.places'),
        ('a cancel, and a new goal', lambda: told(cancelled), asked_for),
        ('aborted', lambda: told(broken_off), 'abort(), and self.goal = None'),
    ]


@tasks.add
def the_battery(workspace):
    def battery_says(percentages, *options):
        """Send percentages. Return when it was low, and what was logged."""
        with ros_session():
            robot = Robot(EMPTY, namespace='other', sim_time=True)
            node, ear = Node('tested', parameter_overrides=[*SIM, *options]), Ear()
            talker = ear.create_publisher(BatteryState, 'battery_state', 10)
            battery, executor = module(workspace, 'battery').Battery(node), spun(node, ear)
            lows = [battery.low]
            for percentage in percentages:
                robot.run(0.1, executor)
                talker.publish(BatteryState(percentage=percentage))
                robot.run(0.1, executor)
                lows.append(battery.low)
        return [bool(low) for low in lows], ear.heard

    def low(percentages, right, *options):
        lows, _ = battery_says(percentages, *options)
        return expect(lows, right, f'before and after each of {percentages} low was')

    def logs():
        _, records = battery_says([0.871, 0.87, 0.19, 0.19, 0.5, 0.19])
        warning = 'warning', 'The battery is at 19 %'
        right = [('information', 'The battery is at 87 %'), warning]
        right += [('information', 'The battery is at 50 %'), warning]
        return expect(records, right, 'of 0.871, 0.87, 0.19, 0.19, 0.5, 0.19 it logged')

    least, full = Parameter('least_battery', value=0.5), Parameter('full_battery', value=100.0)
    share = 'battery.percentage / self.full'
    text = "f'{100 * percentage:.0f} %', and compare it with the last text"
    return [
        (
            'low',
            lambda: low([0.9, 0.19, 0.2], [True, False, True, False]),
            'battery.percentage < self.least',
        ),
        (
            'least_battery',
            lambda: low([0.9, 0.4], [True, False, True], least),
            'node.declare_parameter',
        ),
        (
            'no number',
            lambda: low([math.nan, 0.9], [True, True, False]),
            'not battery.percentage >= self.least',
        ),
        (
            'a battery that is full at 100',
            lambda: low([90.0, 19.0, 20.0], [True, False, True, False], full),
            share,
        ),
        ('it says so, once, and warns if it is low', logs, text),
    ]


@tasks.add
def the_watchdog(workspace):
    def made(node, stop):
        dog = module(workspace, 'watchdog').Watchdog(node, stop, 'scan')
        must_define(type(dog), 'now_s', 'seen', 'look')
        return dog

    def told(times, *options):
        """Tell it the time at each look. Return when it stopped, and what was logged."""
        with Bench() as bench:
            now_s, stops = [0.0], []
            node = Node('tested', parameter_overrides=[*options])
            dog = made(node, lambda: stops.append(now_s[0]))
            for timer in node.timers:
                timer.cancel()
            dog.now_s = lambda: now_s[0]
            for at_s, seen in times:
                now_s[0] = at_s
                if seen:
                    dog.seen()
                dog.look()
            bench.wait(lambda: len(bench.log('tested')) >= len(stops))
            return stops, bench.log('tested')

    # Of each time: when, and whether something comes then.
    twice = [(1.0, False), (2.0, True), (2.2, False), (2.4, False), (9.0, False)]
    twice += [(20.0, True), (20.25, True), (20.5, False), (20.6, False), (30.0, False)]

    def stops_at(times, right, *options):
        stops, _ = told(times, *options)
        came = ', '.join(f'{at:g}' for at, seen in times if seen)
        stopped = ', '.join(f'{at:g} s' for at in stops) or 'no time'
        wanted = ', '.join(f'{at:g} s' for at in right)
        return stops == right or (
            f'scans come at {came} s, and it stops at {stopped}, not at {wanted}'
        )

    def says_so():
        _, records = told(twice)
        return expect(records, ['[ERROR] [tested]: No scan comes: I stop'] * 2, 'it logged')

    def looks():
        with Bench():
            node = Node('tested')
            made(node, list)
            periods_s = periods_of(node)
        return expect(periods_s, [0.05], 'the periods of its timers (s) are')

    def between(dog):
        """Return the time of the watchdog, between two of our own."""
        return time.monotonic(), dog.now_s(), time.monotonic()

    def with_a_stopped_clock():
        with Bench() as bench:
            node, stops = Node('tested', parameter_overrides=SIM), []
            dog = made(node, lambda: stops.append(1))
            bench.spin(node)
            begin = dog.now_s()
            if abs(begin - time.time()) < 3600:
                return 'now_s() is the time of day: if somebody sets it, your watchdog changes'
            if not bench.wait(lambda: dog.now_s() != begin):
                return 'now_s() stands still: no /clock comes'
            earlier, began_s, later = between(dog)
            if bench.wait(lambda: stops, 0.5):
                return 'it stops before the first seen()'
            at_least, ended_s, at_most = between(dog)
            waited_s, least_s, most_s = ended_s - began_s, at_least - later, at_most - earlier
            if not 0.99 * least_s <= waited_s <= 1.01 * most_s:
                return f'in {least_s:.1f} s its now_s() grows by {waited_s:.2g}'
            dog.seen()
            if bench.wait(lambda: stops, 10):
                return True
            kinds = {timer.clock.clock_type for timer in node.timers}
            if kinds != {ClockType.STEADY_TIME}:
                return 'its timer does not fire: no /clock comes'
            return 'it does not stop, 10 s after the last scan'

    forget = 'After stop(), set the time of the last seen() to None.'
    steady = 'create_timer(..., clock=self.clock), with Clock(clock_type=ClockType.STEADY_TIME)'
    longer = Parameter('timeout_s', value=0.8)
    late = [(1.0, True), (1.7, False), (1.85, False), (3.0, False)]
    return [
        ('once, when nothing comes for 0.3 s', lambda: stops_at(twice, [2.4, 20.6]), forget),
        (
            'after 0.8 s, if the parameter says so',
            lambda: stops_at(late, [1.85], longer),
            'timeout_s',
        ),
        ('it says so', says_so, 'node.get_logger().error(...)'),
        ('it looks 20 times a second', looks, 'node.create_timer(0.05, self.look, ...), once'),
        ('even if no /clock comes', with_a_stopped_clock, steady),
    ]
