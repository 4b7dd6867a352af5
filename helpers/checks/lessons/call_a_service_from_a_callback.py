"""What the tasks of the lesson "Call a service from a callback" are judged by."""

import inspect
import math
import threading
import time
import warnings
from contextlib import contextmanager

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.client import Client
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Empty, Int32
from std_srvs.srv import Trigger

from helpers.checks.bench import Bench, one_cpu, scan
from helpers.checks.errors import Failed
from helpers.checks.points import all_of, cached, expect, in_turn, needs, rows
from helpers.checks.tasks import Tasks
from helpers.ros import ros_session
from helpers.trials import Camera

tasks = Tasks()
check = tasks.check

MORE_S = 0.2  # for a stop that no scan has caused
SOLID = 'bricks'  # a wall, in other words: what counts is `success`


@tasks.add(limit_s=15)
def ask_from_a_cell(ask):
    def asks(sees, late_s):
        with Bench() as bench, limits_of_clients() as limits_s:
            asking_node, cameras = bench.spin(Node('asking_node')), []
            come = threading.Timer(late_s, lambda: cameras.append(bench.spin(Camera(sees))))
            come.start()
            if not late_s:
                come.join()
            begun_cpu_s = time.thread_time()
            response = ask(asking_node)
            cpu_s = time.thread_time() - begun_cpu_s
            come.join()
            looks = cameras[0].looks
        late = f'the camera came {late_s} s late: ' if late_s else ''
        if looks != 1:
            return expect(looks, 1, f'{late}it was asked', unit='times')
        if not isinstance(response, Trigger.Response):
            return f'{late}ask returns {response!r}, which is no response'
        if cpu_s > late_s / 2 > 0:
            return f'{late}it does not sleep meanwhile: it keeps a CPU busy'
        for name in limits_s:
            if limits_s[name] is None:
                return f'{name} has no timeout_sec: without a camera, it waits for ever'
        return expect(response.message, sees, 'the message of what ask returns is')

    hint = 'Three lines: create the client, wait for the service, return what call returns.'
    return rows(
        asks,
        hint,
        ('a camera that sees a wall', 'a wall', 0),
        ('a camera that sees dust', 'only dust', 0.5),
    )


@contextmanager
def limits_of_clients():
    """Yield a dict: for how long a method of a client waits at most (s, or None), by its name."""
    limits_s, plain = {}, {name: getattr(Client, name) for name in ('wait_for_service', 'call')}

    def noted(name):
        def method(client, *arguments, **options):
            bound = inspect.signature(plain[name]).bind(client, *arguments, **options)
            limits_s[name] = bound.arguments.get('timeout_sec')
            return plain[name](client, *arguments, **options)

        return method

    for name in plain:
        setattr(Client, name, noted(name))
    try:
        yield limits_s
    finally:
        for name, method in plain.items():
            setattr(Client, name, method)


@tasks.add
def ask_from_a_terminal(camera):
    def was_asked():
        return expect(camera.looks, 1, 'the camera was asked', unit='times')

    hint = '!ros2 service call /look, and after it what ros2 service type /look prints.'
    return [('the camera was asked once, from a terminal', was_asked, hint)]


@tasks.add
def stop_for_a_wall(Brake):
    def is_called(sees, distance, questions, times, takes_s=0.1):
        """Let the callback run in a thread that nobody needs, whatever its groups are."""
        with Bench() as bench:
            stops = bench.hear('stop', Empty)
            brake, camera, other = Brake(), Camera(sees, takes_s), SingleThreadedExecutor()
            bench.spin(brake, camera)
            bench.spin(Node('other'), executor=other)
            if not bench.wait(brake.client.service_is_ready):
                raise Failed(f'self.client asks for {brake.client.srv_name}, which nobody serves')
            called = other.create_task(brake.scan_callback, scan(distance))
            if not bench.wait(called.done, takes_s + 5):
                raise Failed(f'scan_callback does not end. {bench.line_of_callback()}')
            looks = camera.looks  # a callback that does not wait has none yet
            bench.quiet()
        of = f'{sees} at {distance} m'
        return all_of(
            expect(looks, questions, f'{of}: it asked, and waited for the answer,', unit='times'),
            expect(len(stops), times, f'{of}: it stopped', unit='times'),
        )

    def stops_if_it_is_blind():
        return in_turn(lambda: is_called('a wall', math.nan, 0, 1), hears_each_once)

    def hears_each_once():
        with Bench() as bench:
            stops = bench.hear('stop', Empty)
            bench.spin(Brake())
            bench.say('scan', scan(math.nan))
            bench.wait(lambda: len(stops) > 1, MORE_S)
        return expect(len(stops), 1, 'for one scan that says nothing, it stopped', unit='times')

    def has_its_groups():
        with ros_session():
            scan_group, client_group = two_groups()
            brake = Brake(scan_group, client_group)
            topic = brake.subscription.topic_name
            scans_in_group = brake.subscription.callback_group is scan_group
            client_in_group = brake.client.callback_group is client_group
        return all_of(
            expect(topic, '/scan', 'self.subscription is to'),
            scans_in_group or 'self.subscription is not in scan_group',
            client_in_group or 'self.client is not in client_group',
        )

    call = 'response = self.client.call(Trigger.Request()), then response.success.'
    blind = 'if distance is None: publish. elif distance < LIMIT_M: ask.'
    groups = 'callback_group=scan_group, callback_group=client_group'
    return [
        *rows(
            is_called,
            call,
            ('a wall at 0.5 m: it asks and stops', SOLID, 0.5, 1, 1),
            ('dust at 0.9 m: it asks and does not stop', 'dust on a wall', 0.9, 1, 0),
        ),
        *rows(
            is_called,
            'Compare with LIMIT_M.',
            ('nothing near: it does not ask', 'a wall', 2.0, 0, 0),
        ),
        ('a blind laser: it stops, and does not ask', stops_if_it_is_blind, blind),
        (
            'a late answer: it waits',
            lambda: is_called('a wall', 0.5, 1, 1, takes_s=1.5),
            'No timeout_sec.',
        ),
        ('client and subscription are in the groups that it gets', has_its_groups, groups),
    ]


@tasks.add
def free_thread_and_group(make_brake, make_executor):
    counted = []  # not empty if the executor has as many threads as there are CPUs

    def make_small_executor():
        with one_cpu() as asked:
            executor = made(make_executor)
        counted[:] = asked
        return executor

    def wrong(found):
        return f'on a computer with one CPU, {found}' if counted else found

    def stops(sees):
        try:
            return stops_for(make_brake, make_small_executor, sees, 0.5)
        except Failed as failed:
            raise Failed(wrong(str(failed))) from None

    def stops_twice():
        """Show two scans: the second answer comes, too, if nothing is held for ever."""
        with Bench() as bench:
            stops = bench.hear('stop', Empty)
            bench.spin(make_brake(), Camera(), executor=make_small_executor())
            for _ in range(2):
                bench.say('scan', scan(0.5))
            if len(stops) != 2:  # raised, so that the bench does not wait for what is held
                waits = bench.line_of_callback()
                found = f'of two scans of a wall, {len(stops)} stopped it. {waits}'
                raise Failed(wrong(found.strip()))
        return True

    free = 'Which thread takes the answer, and in which group is the client? Neither may be held.'
    return [
        *rows(stops, free, ('a wall: it stops', SOLID), ('dust: it does not', 'dust')),
        ('two scans, two stops', stops_twice, free),
    ]


@tasks.add
def await_the_answer(AwaitBrake):
    awaits = 'response = await self.client.call_async(Trigger.Request())'
    groups = 'The group of the callback is held while it awaits. So the client needs another one.'
    return with_one_thread(AwaitBrake, groups, awaits, awaits, awaits)


@tasks.add
def be_told(DoneBrake):
    def in_one_group():
        group = MutuallyExclusiveCallbackGroup()
        return DoneBrake(group, group)

    later = 'call_async(Trigger.Request()) returns a future: give it a method of yours, without ().'
    near = 'if distance is None: ... elif distance < LIMIT_M: ...'
    return with_one_thread(in_one_group, later, 'future.result().success', near, later)


def with_one_thread(make_brake, *hints):
    def stops(sees, distance):
        return stops_for(make_brake, SingleThreadedExecutor, sees, distance)

    def thread_stays_free():
        """Look at the thread while the camera, which has another executor, keeps its answer."""
        with Bench() as bench:
            gate, brake, executor = bench.gate(), make_brake(), SingleThreadedExecutor()
            camera = Camera(hold=gate.hold)
            bench.spin(brake, executor=executor)
            bench.spin(camera)
            bench.say('scan', scan(0.5), at_once=True)
            bench.wait(lambda: camera.asked)
            if not bench.quiet(executor=executor):
                waits = bench.line_of_callback()
                raise Failed(f'while it waits, it holds the thread. {waits}'.strip())
        return expect(camera.asked, 1, 'of a near wall, the camera was asked', unit='times')

    wall, dust, unasked, free = hints
    return [
        *rows(stops, wall, ('a wall: it stops', SOLID, 0.5)),
        *rows(stops, dust, ('dust: it does not', 'dust on a wall', 0.5)),
        *rows(
            stops,
            unasked,
            ('nothing near: it does not', 'a wall', 2.0),
            ('a blind laser: it stops', 'dust', math.nan),
        ),
        ('the thread is free while it waits', thread_stays_free, free),
    ]


@tasks.add
def ask_what_hangs(Survey):
    def asks_twice(sees, together):
        """Let the timer call twice, each node with one thread of its own, or both with the same."""
        with Bench() as bench:
            survey, camera = Survey(), Camera(sees, takes_s=0.0)
            if together:
                bench.spin(survey, camera)
            else:
                bench.spin_each(survey, camera)
            for calls in (1, 2):
                if not bench.wait(lambda calls=calls: len(survey.answers) >= calls):
                    found = f'timer_callback was called, and answers is {survey.answers}'
                    raise Failed(f'{found}. {bench.line_of_callback()}'.rstrip('. '))
                if calls == 1:
                    survey.timer.reset()
            bench.quiet()
        return expect(survey.answers, [sees] * camera.looks, f'of {camera.looks} answers, it has')

    told = 'future.add_done_callback(self.answered): answered gets the future, which is done.'
    return rows(
        asks_twice,
        told,
        ('one thread for both: it has the answers', 'dust', True),
        ('a thread for each: it has them, too', 'bricks', False),
    )


@tasks.add
def the_rule(rule, stops):
    def explains(threads):
        measured = min(threads, 2)  # a third thread frees nothing that a second one does not
        cases = [(groups, style) for number, groups, style in stops if number == measured]
        for groups, style in cases:
            if bool(rule(threads, groups, style)) != stops[measured, groups, style]:
                case = (threads, groups, style)
                return f'of {len(cases)} combinations your rule is wrong about {case}'
        return True

    holds = 'call holds a thread and the group of the scans. What do await and a done callback?'
    table = 'A rule, not a table: what do more threads change?'
    return [
        *rows(explains, holds, ('one thread', 1), ('two threads', 2)),
        ('three threads', lambda: explains(3), table),
    ]


@tasks.add
def if_you_do_not_know_stop(SafeBrake):
    def says_go(what, sees, distance, questions, times, age_s=0.0):
        """Show a scan to a brake that is with the camera, in one thread: which `go` follow?"""
        too_late = []

        class Tried(SafeBrake):
            def give_up(self):
                if self.future is None:
                    too_late.append(self)
                super().give_up()

        with Bench() as bench:
            goes, stops = bench.hear('go', Empty), bench.hear('stop', Empty)
            brake, camera = Tried(), Camera(sees)
            bench.spin(brake, camera)
            bench.wait(brake.client.service_is_ready)
            bench.say('scan', scan(distance, age_s=age_s))
            waits = bench.line_of_callback()
            is_over = waits or bench.wait(lambda: no_timer_runs(brake), 1.0)
        if waits:
            raise Failed(f'{what}: its callback still waits. {waits}')
        return all_of(
            expect(camera.looks, questions, f'{what}: it asked the camera', unit='times'),
            expect(len(goes), times, f'{what}: it said go', unit='times'),
            not stops or f'{what}: it said stop, which PermittedRemote does not hear',
            is_over or f'{what}: its timer runs on',
            not too_late or f'{what}: it gives up, and no question is open any more',
        )

    def gives_up(camera_is_there):
        """Show a near scan, twice. No answer comes, and it asks again."""
        why = 'the camera never answers' if camera_is_there else 'there is no camera'
        with Bench() as bench:
            goes, gate, brake = bench.hear('go', Empty), bench.gate(), bench.spin(SafeBrake())
            asked = Asked(brake.client)
            if camera_is_there:
                bench.spin(Camera(hold=gate.hold))
                bench.wait(brake.client.service_is_ready)
            for number in (1, 2):
                bench.say('scan', scan(0.5), at_once=True)
                bench.wait(lambda number=number: len(asked.futures) == number, 1.0)
                bench.quiet(executor=brake.executor)
                if waits := bench.line_of_callback():
                    raise Failed(f'{why}, and its callback waits. {waits}')
                if len(asked.futures) != number:
                    found = f'after {number} near scans, it has asked'
                    raise Failed(f'{why}: {found} {len(asked.futures)} times')
                if not bench.wait(lambda: brake.future is None, 2.0):
                    raise Failed(f'{why}, and 2 s later self.future is not None')
                if not bench.wait(lambda: no_timer_runs(brake), 1.0):
                    raise Failed('it has given up, and its timer still runs: it gives up for ever')
            gate.open()
        return not goes or f'{why}, and it says go'

    @cached
    def gives_up_on_a_camera():
        return gives_up(camera_is_there=True)

    def asks(right, answers):
        """Show three near scans, and count the questions. With `answers`, each gets its answer."""
        with Bench() as bench:
            gate, brake = bench.gate(), SafeBrake()
            camera = Camera('dust', takes_s=0.0, hold=None if answers else gate.hold)
            bench.spin(brake)
            bench.spin(camera)
            bench.wait(brake.client.service_is_ready)
            for _ in range(3):
                bench.say('scan', scan(0.5), at_once=True)
                bench.quiet(executor=brake.executor)
                if answers:
                    bench.quiet()
            free = bench.quiet(executor=brake.executor)
            gate.open()
            bench.quiet()
        if not free:
            return 'while it waits, it holds the thread'
        when = 'after each answer' if answers else 'before an answer came'
        return expect(
            camera.asked, right, f'of three near scans, {when}, it asked the camera', unit='times'
        )

    def forgets():
        """Let the camera answer "dust" after the brake has given up."""
        needs(gives_up_on_a_camera)
        # rclpy only warns of an exception in a done callback.
        with warnings.catch_warnings(record=True) as warned, Bench() as bench:
            warnings.simplefilter('always')
            gate, goes = bench.gate(), bench.hear('go', Empty)
            brake = bench.spin(SafeBrake())
            bench.spin(Camera('dust', hold=gate.hold))
            bench.wait(brake.client.service_is_ready)
            bench.say('scan', scan(0.5), at_once=True)
            gate.wait_until_entered()
            bench.wait(lambda: brake.future is None)
            gate.open()
            bench.quiet()
        if warned:
            return f'after it has given up, answered fails: {warned[0].message}'
        return not goes or 'it has given up, the answer comes late, and it says go'

    free = 'if distance >= LIMIT_M: self.go.publish(Empty()).'
    answer = 'answered: self.timer.cancel(), self.future = None; not future.result().success: go.'
    timer = 'self.timer.reset() when it asks. give_up: cancel it, and self.future = None.'
    one_question = 'Ask only while self.future is None; answered and give_up set it to None.'
    forget = 'give_up: self.client.remove_pending_request(self.future), then self.future = None.'
    unknown = 'if distance is None or not is_fresh(self, scan): return.'
    return [
        *rows(
            says_go,
            free,
            ('the way is free: go', 'the way is free', 'a wall', 2.0, 0, 1),
        ),
        *rows(
            says_go,
            answer,
            ('only dust: it asks, then go', 'dust', 'dust on a wall', 0.9, 1, 1),
            ('a wall: it asks, no go', 'a wall', SOLID, 0.5, 1, 0),
        ),
        *rows(
            says_go,
            unknown,
            ('a blind laser: no go, no question', 'blind', 'dust', math.nan, 0, 0),
            ('an old scan: the same', '3 s old', 'dust', 2.0, 0, 0, 3),
            ('from the future: the same', '3 s ahead', 'dust', 2.0, 0, 0, -3),
        ),
        ('no camera: no go', lambda: gives_up(camera_is_there=False), timer),
        ('a camera that never answers: no go', gives_up_on_a_camera, timer),
        ('one question at a time, in a free thread', lambda: asks(1, False), one_question),
        ('after an answer it asks again', lambda: asks(3, True), one_question),
        ('a late answer is thrown away', forgets, forget),
    ]


@tasks.add
def three_callbacks_four_threads(Explorer):
    @cached
    def during_scan_0():
        """Return the number of timers, and the callbacks that begin while scan 0 is drawn."""
        calls = []
        with Bench() as bench:
            gate = bench.gate()

            class Watched(Explorer):
                def scan_callback(self, message):
                    calls.append(f'scan {message.data}')
                    gate.hold()

                def motor_callback(self):
                    calls.append('motor')

                def save_callback(self, request, response):
                    calls.append('save')
                    return response

            explorer, executor = Watched(), MultiThreadedExecutor(num_threads=4)
            timers = list(explorer.timers)
            periods_s = [timer.timer_period_ns / 1e9 for timer in timers]
            names = [one.topic_name for one in explorer.subscriptions]
            names += [one.srv_name for one in explorer.services]
            names = [name.strip('/') for name in names]
            bench.spin(explorer, executor=executor)
            bench.say('scan', Int32(data=0), Int32(data=1), at_once=True)
            if not bench.wait(lambda: 'scan 0' in calls):
                raise Failed('it does not receive scan')
            motors = calls.count('motor')
            bench.ask('save', Trigger)
            bench.wait(lambda: calls.count('motor') > motors or any(t.is_ready() for t in timers))
            bench.quiet(executor=executor)
            during = calls[calls.index('scan 0') :]
            gate.open()
            if not bench.wait(lambda: 'save' in calls):
                raise Failed('save_callback is never called')
        return periods_s, names, during

    def motors():
        periods_s, _, during = during_scan_0()
        if len(periods_s) != 1:
            return f'it has {len(periods_s)} timers, and one drives the motors'
        return all_of(
            expect(periods_s[0], 0.05, 'the period of its timer is', unit='s'),
            'motor' in during or 'while scan 0 was drawn, the motors waited',
        )

    def never(call):
        _, names, during = during_scan_0()
        if call in during:
            return f'{call} began while scan 0 was drawn'
        name = call.split()[0]
        return expect(names.count(name), 1, f'its subscriptions or services with the name {name}:')

    return [
        ('the motors never wait', motors, 'What must not wait needs a group of its own.'),
        ('scans come one by one', lambda: never('scan 1'), 'Which group lets one callback run?'),
        ('no save during a scan', lambda: never('save'), 'Which callbacks use the map?'),
    ]


# --- What the tasks share -------------------------------------------------------------------------


def no_timer_runs(brake):
    return all(timer.is_canceled() for timer in brake.timers)


class Asked:
    """The futures of a client, from now on, of questions that do not wait."""

    def __init__(self, client):
        self.futures, call_async = [], client.call_async

        def noted(request):
            self.futures.append(call_async(request))
            return self.futures[-1]

        client.call_async = noted


def two_groups():
    return MutuallyExclusiveCallbackGroup(), MutuallyExclusiveCallbackGroup()


def two_threads():
    return MultiThreadedExecutor(num_threads=2)


def made(make_executor):
    executor = make_executor()
    if executor is None:
        raise Failed('make_executor returns None')
    return executor


def stops_for(make_brake, make_executor, sees, distance):
    """Show a scan to a brake that is with the camera: it stops for a near wall, and only then."""
    right = math.isnan(distance) or ('dust' not in sees and distance < 1.0)
    with Bench() as bench:
        stops = bench.hear('stop', Empty)
        camera = Camera(sees)
        bench.spin(make_brake(), camera, executor=made(make_executor))
        bench.say('scan', scan(distance))
        waits = bench.line_of_callback()
        if len(stops) != right or waits:
            does = {0: 'does not stop', 1: 'stops'}.get(len(stops), f'stops {len(stops)} times')
            found = f'{sees} at {distance} m: the camera looked {camera.looks} times, and the brake'
            if waits:
                waits = f'. Its callback still waits. {waits}'
            raise Failed(f'{found} {does}{waits}')
    return True
