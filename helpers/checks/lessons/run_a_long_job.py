"""What the tasks of the lesson "Run a long job" are judged by."""

import inspect
import threading
from functools import partial

from geometry_msgs.msg import Twist
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci as Patrol

from helpers.checks.bench import Bench
from helpers.checks.errors import Failed
from helpers.checks.points import all_of, cached, expect, in_turn, rows
from helpers.checks.tasks import Tasks
from helpers.ros import STATUS

tasks = Tasks()
check = tasks.check

RESULT_S = 3.0  # in which a result comes, if one comes


@tasks.add
def the_job(EagerPatroller):
    def patrol(places):
        with Bench() as bench:
            node = EagerPatroller()
            job = Job(node)
            bench.spin(node)
            end = ended(send(bench, places))
        job.raise_first_error()
        return end, job

    three, one = cached(lambda: patrol(3)), cached(lambda: patrol(1))

    def ends(run, places):
        end, job = run()
        return all_of(
            ends_as(end, 'SUCCEEDED', places, f'with {places} places,'),
            expect(job.drives, places, f'with {places} places, it called go_on', unit='times'),
            job.drives_before_its_end,
        )

    feedback = 'goal_handle.publish_feedback(Patrol.Feedback(sequence=visited)), in the loop.'
    return [
        ('three places are visited', lambda: ends(three, 3), 'range(goal_handle.request.order)'),
        ('one place is visited', lambda: ends(one, 1), 'After the loop: goal_handle.succeed().'),
        (
            'there is feedback after each place',
            lambda: three()[1].feeds_back_after_each_of(3),
            feedback,
        ),
    ]


@tasks.add
def the_client(Operator):
    three = cached(lambda: operate(Operator, 3))

    def hears():
        server, operator = three()
        return all_of(
            expect(server.asked, [3], 'send(3): the places of the goals that the server got are'),
            expect(operator.feedback, [[0], [0, 1], [0, 1, 2]], 'self.feedback is'),
        )

    def has_result():
        _, operator = three()
        result = operator.result
        if not hasattr(result, 'status'):
            return f'self.result is {type(result).__name__}'
        end = STATUS.get(result.status, result.status), list(result.result.sequence)
        return ends_as(end, 'SUCCEEDED', 3, 'by the result,')

    def keeps_the_newest():
        """Send a goal of two places, and then one of one place."""
        places = []

        class Told(Operator):
            def result_callback(self, future):
                places.append(len(future.result().result.sequence))
                super().result_callback(future)

        with Bench() as bench:
            server, operator = Counted(False, lambda goal_handle: CancelResponse.ACCEPT), Told()
            server.gate.release(100)
            bench.spin(server, threads=3)
            bench.spin(operator)
            bench.wait(operator.client.server_is_ready)
            for number in (2, 1):
                before = operator.result
                operator.executor.create_task(operator.send, number)
                bench.wait(lambda before=before: operator.result is not before, RESULT_S)
                bench.quiet()
        last = len(operator.result.result.sequence) if operator.result else None
        sent = 'send(2), then send(1): '
        return all_of(
            # A send that awaits its result needs no callback.
            expect(
                places or [2, 1], [2, 1], f'{sent}the places in the results of result_callback are'
            ),
            expect(last, 1, f'{sent}the places in self.result are'),
        )

    def lives_with_no():
        _, operator = operate(Operator, 3, refuse=True)
        if operator.goal_handle is None:
            return 'self.goal_handle is None: keep the handle of a rejected goal, too'
        return operator.result is None or 'there is a result'

    send_it = 'send: self.client.send_goal_async(goal, self.feedback_callback), a done callback.'
    kept = 'self.result = future.result()'
    keep_it = 'goal_response_callback: keep the goal handle first, then look at its accepted.'
    return [
        ('a goal is sent, feedback is kept', hears, send_it),
        ('the result is kept', lambda: in_turn(has_result, keeps_the_newest), kept),
        ('a goal that is rejected has no result', lives_with_no, keep_it),
    ]


@tasks.add
def cancel_in_time(CancellingOperator):
    def cancels(places, at):
        """Return after which places a cancel had been sent, and how many the server got."""
        asked, sent_after = [], []

        class At(CancellingOperator):
            cancel_at = at

        def refuse(goal_handle):
            asked.append(goal_handle)
            return CancelResponse.REJECT  # so the feedback goes on

        def look(bench, operator, place):
            if operator.cancel_future is not None:
                sent_after.append(place)
                bench.wait(operator.cancel_future.done)

        operate(At, places, cancel_callback=refuse, after_each=look)
        return sent_after, len(asked)

    def in_time(places, at):
        sent_after, asked = cancels(places, at)
        if not sent_after:
            return f'cancel_at={at}: self.cancel_future is None after {places} places'
        return all_of(
            expect(sent_after[0] + 1, at, f'cancel_at={at}: it cancelled after', unit='places'),
            expect(asked, 1, f'cancel_at={at}: the server got', unit='cancels'),
        )

    def not_before():
        sent_after, asked = cancels(2, 4)
        return not (sent_after or asked) or 'with cancel_at = 4, it cancelled after two places'

    hint = 'How many places are in the last feedback? Once: while self.cancel_future is None.'
    return [
        ('with cancel_at = 2', lambda: in_time(4, 2), hint),
        ('with cancel_at = 3', lambda: in_time(5, 3), hint),
        ('before, nothing is cancelled', not_before, hint),
    ]


@tasks.add
def obey(ObedientPatroller):
    def patrol(places, cancelled_at=None, fails=False):
        """Cancel while the robot drives to a place. Return how the job ended, and the job."""
        with Bench() as bench:
            gate, node = bench.gate(), ObedientPatroller()

            def drive():
                if job.drives - 1 == cancelled_at:
                    gate.hold()
                if fails:
                    raise WheelStuckError

            job = Job(node, drive)
            node.publisher.publish = job.note_command
            bench.spin(node, threads=3)
            goal = send(bench, places)
            if cancelled_at is not None:
                bench.wait(lambda: gate.entered or goal.done)
                goal.cancel()
                gate.open()
            end = ended(goal)
        job.raise_first_error()
        return end, job

    def obeys(places, at):
        end, job = patrol(places, at)
        case = f'cancelled on the way to place {at},'
        return all_of(
            ends_as(end, 'CANCELED', at + 1, case),
            expect(job.drives, at + 1, f'{case} it called go_on', unit='times'),
            job.stands or 'the robot was not stopped',
        )

    def still_succeeds():
        end, job = patrol(3)
        return all_of(
            ends_as(end, 'SUCCEEDED', 3, 'with 3 places,'),
            job.feeds_back_after_each_of(3),
            job.drives_before_its_end,
            job.stands or 'after the third place the robot was not stopped',
        )

    def fails_and_stops():
        (status, _), job = patrol(3, fails=True)
        return all_of(
            expect(status, 'ABORTED', 'go_on raised an error, and the job ended'),
            job.stands or 'go_on raised an error, and the robot was not stopped',
        )

    hint = 'if goal_handle.is_cancel_requested: canceled(), return the result. In the loop.'
    stop = 'try: all that you have. finally: self.command(0.0)'
    before = f'The job of task 1, with an if in it. {stop}'
    return [
        ('without a cancel: three places, and a stop', still_succeeds, before),
        *rows(
            obeys,
            hint,
            ('a cancel on the way to place 1', 5, 1),
            ('a cancel on the way to place 0', 3, 0),
        ),
        ('a job that fails stops the robot, too', fails_and_stops, stop),
    ]


@tasks.add
def a_group_of_its_own(options, ChargingPatroller):
    def is_heard(threads):
        with Bench() as bench:
            gate, node = bench.gate(), ChargingPatroller(**options())
            job = Job(node, gate.hold)
            node.job_ended = WatchedEvent()
            bench.spin(node, threads=threads)
            goal = send(bench, 3)
            gate.wait_until_entered()
            bench.ask('charge', Trigger)
            bench.wait(lambda: node.job_ended.is_waited_for)
            heard = goal.cancel(limit_s=1)
            gate.open()
            goal.ended()
        job.raise_first_error()
        return heard or 'the cancel was not received while the service waited'

    def is_new():
        first, second = options(), options()
        return first['action_group'] is not second['action_group'] or (
            'two nodes get the same group, and each can then hold that of the other'
        )

    hint = "{'action_group': MutuallyExclusiveCallbackGroup()}"
    return [
        *rows(
            is_heard,
            hint,
            ('the cancel is received, with 3 threads', 3),
            ('and with 4 threads', 4),
        ),
        ('a group of its own for each node', is_new, 'Make the group inside the function.'),
    ]


@tasks.add
def one_patrol_at_a_time(PolitePatroller):
    def answers_to_goals(how_the_first_ends):
        """Send goals before, during and after a patrol. Return by name which are accepted."""
        begin, short_ended, answers = threading.Event(), threading.Event(), []
        fails = how_the_first_ends == 'fails'

        class Watched(PolitePatroller):
            is_short = False

            def goal_callback(self, goal):
                answer = super().goal_callback(goal)
                answers.append(answer)
                return answer

            def handle_accepted_callback(self, goal_handle):
                if self.is_short:  # a job that has ended before execute() returns
                    goal_handle.execute = partial(execute_to_the_end, goal_handle.execute)
                super().handle_accepted_callback(goal_handle)

            def execute_callback(self, goal_handle):
                begin.wait(10)  # so the second goal comes before the first job has begun
                try:
                    return super().execute_callback(goal_handle)
                finally:
                    if self.is_short:
                        short_ended.set()

        def execute_to_the_end(execute, *arguments):
            execute(*arguments)
            short_ended.wait(5)

        def drive():
            gate.hold()
            if fails:
                raise WheelStuckError

        with Bench() as bench:
            gate, node = bench.gate(), Watched()
            job = Job(node, drive)
            bench.spin(node, threads=4)
            try:
                goals = {'0 places': send(bench, 0), '-1 places': send(bench, -1)}
                goals['the first'] = send(bench, 3)
                goals['a second at once'] = send(bench, 3)
                begin.set()
                goals['one during it'] = send(bench, 2)
                if how_the_first_ends == 'is cancelled' and goals['the first'].accepted:
                    goals['the first'].cancel()
            finally:
                begin.set()
                gate.open()
            for goal in goals.values():
                goal.ended()
            bench.quiet()
            fails = False
            goals['one after it'] = send(bench, 1)
            goals['one after it'].ended()
            bench.quiet()
            node.is_short = True
            goals['a short one'] = send(bench, 1)
            goals['a short one'].ended()
            bench.quiet()
            goals['one after a job that was over before execute() returned'] = send(bench, 1)
        job.raise_first_error()
        if odd := [one for one in answers if not isinstance(one, GoalResponse)]:
            raise Failed(f'goal_callback returns {odd[0]!r}, which is no GoalResponse')
        return {name: goal.accepted for name, goal in goals.items()}

    def is_polite(how_the_first_ends):
        refused = {'0 places', '-1 places', 'a second at once', 'one during it'}
        for name, accepted in answers_to_goals(how_the_first_ends).items():
            if accepted == (name in refused):
                return f'{name}: {"accepted" if accepted else "rejected"}'
        return True

    def forgets_who_has_gone():
        """Accept a goal of a client that has gone: rclpy calls no callback after this one."""
        with Bench() as bench:
            node = PolitePatroller()
            job = Job(node)
            answer = node.goal_callback(Patrol.Goal(order=2))
            if answer != GoalResponse.ACCEPT:
                return f'a goal of 2 places gets {answer}'
            bench.spin(node, threads=4)
            goal = send(bench, 1)
            goal.ended()
        job.raise_first_error()
        return goal.accepted or 'its job never began, and the next goal was rejected'

    refuse = 'goal_callback: refuse if self.busy, or if goal.order < 1. '
    note = 'handle_accepted_callback: self.busy = True, then execute().'
    always = 'execute_callback: try: return ... finally: self.busy = False.'
    gone = 'goal_callback only asks self.busy: it is set in handle_accepted_callback.'
    return [
        *rows(
            is_polite,
            refuse + note,
            ('if the patrol succeeds', 'succeeds'),
            ('if it is cancelled', 'is cancelled'),
        ),
        ('if it fails', lambda: is_polite('fails'), refuse + always),
        ('if its client has gone before it began', forgets_who_has_gone, gone),
    ]


# --- What the tasks share -------------------------------------------------------------------------


class WheelStuckError(RuntimeError):
    """What a check lets a job fail of."""


class WatchedEvent(threading.Event):
    """An event that knows whether somebody has begun to wait for it."""

    is_waited_for = False

    def wait(self, timeout=None):
        self.is_waited_for = True
        return super().wait(timeout)


class Counted(Node):
    """A correct server, whose job waits before each place until the check opens its gate."""

    def __init__(self, refuse, cancel_callback):
        super().__init__('patroller')
        self.refuse, self.gate, self.asked = refuse, threading.Semaphore(0), []
        self.server = ActionServer(
            self,
            Patrol,
            'patrol',
            execute_callback=self.execute_callback,
            goal_callback=self.goal_callback,
            cancel_callback=cancel_callback,
        )

    def goal_callback(self, goal):
        self.asked.append(goal.order)
        return GoalResponse.REJECT if self.refuse else GoalResponse.ACCEPT

    def execute_callback(self, goal_handle):
        visited = []
        for place in range(goal_handle.request.order):
            self.gate.acquire()
            visited.append(place)
            goal_handle.publish_feedback(Patrol.Feedback(sequence=visited))
        self.gate.acquire()
        goal_handle.succeed()
        return Patrol.Result(sequence=visited)


def operate(
    operator_class,
    places,
    refuse=False,
    cancel_callback=lambda goal_handle: CancelResponse.ACCEPT,
    after_each=None,
):
    """Let an operator send a goal, and let the job go on when its feedback was heard."""
    with Bench() as bench:
        server, operator = Counted(refuse, cancel_callback), operator_class()
        bench.spin(server, threads=3)
        bench.spin(operator)
        try:
            if not bench.wait(operator.client.server_is_ready):
                raise Failed('self.client finds no server of the action patrol')
            operator.executor.create_task(operator.send, places)
            bench.quiet(executor=operator.executor)
            bench.quiet(executor=server.executor)
            if server.asked and bench.wait(lambda: operator.goal_handle) and not refuse:
                for place in range(places):
                    server.gate.release()
                    bench.wait(lambda n=place: len(operator.feedback) > n or operator.result)
                    bench.quiet(executor=operator.executor)
                    if after_each:
                        after_each(bench, operator, place)
        finally:
            server.gate.release(100)
        bench.wait(lambda: operator.result or not operator.goal_handle or refuse)
        bench.quiet()
    return server, operator


class Job:
    """What the job of a patroller does, from now on, while the robot drives as `drive` does.

    `log` has 'drive' for each go_on, and the places of each feedback, in their order. What the job
    raises is kept, since rclpy only logs it, and says that the goal was aborted.
    """

    def __init__(self, node, drive=lambda: None):
        self.log, self.commands, self._errors = [], [], []
        self._goal_handle, self._ended_early = None, False

        def go_on():
            self.log.append('drive')
            if self._goal_handle and not self._goal_handle.is_active:
                self._ended_early = True
            drive()

        async def execute_callback(goal_handle):
            publish = goal_handle.publish_feedback

            def publish_feedback(feedback):
                publish(feedback)
                self.log.append(list(feedback.sequence))

            goal_handle.publish_feedback = publish_feedback
            self._goal_handle = goal_handle
            try:
                result = node.execute_callback(goal_handle)
                return await result if inspect.isawaitable(result) else result
            except Exception as error:
                self._errors.append(error)
                return Patrol.Result()

        node.go_on = go_on
        node.get_logger().set_level(40)  # rclpy warns of an aborted goal by its id, which changes
        node.server.register_execute_callback(execute_callback)

    def note_command(self, twist):
        """Take a command in place of the publisher."""
        self.commands.append(twist)

    @property
    def stands(self):
        """Whether the last command is a stop."""
        return bool(self.commands) and self.commands[-1] == Twist()

    @property
    def drives(self):
        """How often go_on was called."""
        return self.log.count('drive')

    @property
    def drives_before_its_end(self):
        """True, or a text: it has said how the job ends, and then drives on."""
        return not self._ended_early or 'it says how the job has ended, and then drives on'

    def feeds_back_after_each_of(self, places):
        """Return True, or a text: which feedback is wrong, or comes before the robot is there."""
        feedback = [one for one in self.log if one != 'drive']
        right = [[*range(place + 1)] for place in range(places)]
        in_order = [step for one in right for step in ('drive', one)]
        early = 'the feedback names a place before go_on has ended, which drives there'
        return all_of(expect(feedback, right, 'the feedback was'), self.log == in_order or early)

    def raise_first_error(self):
        """Raise the first error that is the student's, and does not follow from a stuck wheel."""
        for error in self._errors:
            if not any(isinstance(e, WheelStuckError) for e in (error, error.__context__)):
                raise error


def send(bench, places):
    return bench.send_goal('patrol', Patrol, Patrol.Goal(order=places))


def ended(goal):
    status, result = goal.ended()
    return status, list(result.sequence) if result else []


def ends_as(end, status, places, case):
    """Return whether a job has ended with this status, after so many places, or a text."""
    right = status, [*range(places)]
    return end == right or f'{case} it ended {end[0]} {end[1]}, not {right[0]} {right[1]}'
