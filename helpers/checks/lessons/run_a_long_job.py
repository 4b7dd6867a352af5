"""What the tasks of the lesson "Run a long job" are judged by, and the frame of its runs."""

import inspect
import threading

from geometry_msgs.msg import Twist
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci as Patrol

from helpers.checks.bench import Bench
from helpers.checks.errors import Failed
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks
from helpers.ros import STATUS

tasks = Tasks()
check = tasks.check


@tasks.add
def the_job(EagerPatroller):
    def patrol(places):
        moves = []
        with Bench() as bench:
            node = EagerPatroller()
            errors = keep_errors(node, lambda: moves.append('go on'))
            bench.spin(node)
            goal = send(bench, places)
            status, visited = ended(goal)
            if goal.feedback:
                bench.wait(lambda: len(goal.feedback) >= places, 0.5)
        raise_first(errors)
        return status, visited, len(moves), [list(feedback.sequence) for feedback in goal.feedback]

    three, one = cached(lambda: patrol(3)), cached(lambda: patrol(1))

    def ends(run, places):
        status, visited, moves, _ = run()
        if (status, visited) != ('SUCCEEDED', list(range(places))):
            return f'with {places} places, it ended {status} {visited}'
        return moves == places or f'with {places} places, it called go_on {moves} times'

    def feeds_back():
        _, _, _, feedback = three()
        # The last one may come after the result, and is not heard then (rclpy).
        return feedback[:2] == [[0], [0, 1]] or f'the feedback was {feedback}'

    return [
        (
            'three places are visited',
            lambda: ends(three, 3),
            'range(goal_handle.request.order)',
        ),
        (
            'one place is visited',
            lambda: ends(one, 1),
            'After the loop: goal_handle.succeed().',
        ),
        (
            'there is feedback after each place',
            feeds_back,
            'goal_handle.publish_feedback(Patrol.Feedback(sequence=visited)), in the loop.',
        ),
    ]


@tasks.add
def the_client(Operator):
    three = cached(lambda: operate(Operator, 3))

    def hears():
        server, operator = three()
        if server.asked != [3]:
            return f'send(3): the server got {server.asked or "no goal"}'
        right = [[0], [0, 1], [0, 1, 2]]
        return operator.feedback == right or f'self.feedback is {operator.feedback}'

    def has_result():
        _, operator = three()
        result = operator.result
        if not hasattr(result, 'status'):
            return f'self.result is {type(result).__name__}'
        found = STATUS.get(result.status, result.status), list(result.result.sequence)
        return found == ('SUCCEEDED', [0, 1, 2]) or f'the result is {found}'

    def lives_with_no():
        _, operator = operate(Operator, 3, refuse=True)
        if operator.goal_handle is None:
            return 'self.goal_handle is None: keep the handle of a rejected goal, too'
        return operator.result is None or 'there is a result'

    hint = (
        'future = self.client.send_goal_async(goal, self.feedback_callback), then a done callback.'
    )
    return [
        ('a goal is sent, feedback is kept', hears, hint),
        ('the result is kept', has_result, 'self.result = future.result()'),
        ('a goal that is rejected has no result', lives_with_no, hint),
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
        if sent_after[0] != at - 1:
            return f'cancel_at={at}: it cancelled after {sent_after[0] + 1} places'
        return asked == 1 or f'cancel_at={at}: the server got {asked} cancels'

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
        """Cancel while the robot drives to a place. Return how the job ended, and its log."""
        log, there, gate = [], threading.Event(), threading.Event()

        def go_on():
            log.append('go on')
            if log.count('go on') - 1 == cancelled_at:
                there.set()
                gate.wait(10)
            if fails:
                raise WheelStuckError

        def publish(message):
            log.append('stop' if message == Twist() else 'drive')

        with Bench() as bench:
            node = ObedientPatroller()
            errors = keep_errors(node, go_on)
            node.publisher.publish = publish
            bench.spin(node, threads=3)
            goal = send(bench, places)
            try:
                if cancelled_at is not None:
                    bench.wait(lambda: there.is_set() or goal.done)
                    goal.cancel()
            finally:
                gate.set()
            status, visited = ended(goal)
        raise_first(errors)
        return status, visited, log

    def obeys(places, at):
        status, visited, log = patrol(places, at)
        if (status, visited) != ('CANCELED', list(range(at + 1))):
            return f'cancelled on the way to place {at}: {status} {visited}'
        moves = log.count('go on')
        if moves != at + 1:
            return f'cancelled on the way to place {at}, it called go_on {moves} times'
        return log[-1] == 'stop' or 'the robot was not stopped'

    def still_succeeds():
        status, visited, log = patrol(3)
        if (status, visited) != ('SUCCEEDED', [0, 1, 2]):
            return f'it ended {status} {visited}'
        return log[-1] == 'stop' or 'after the third place the robot was not stopped'

    def fails_and_stops():
        status, _, log = patrol(3, fails=True)
        if status != 'ABORTED':
            return f'go_on raised an error, and the job ended {status}'
        return log[-1] == 'stop' or 'go_on raised an error, and the robot was not stopped'

    hint = 'if goal_handle.is_cancel_requested: canceled(), return the result. In the loop.'
    stop = 'try: all that you have. finally: self.publisher.publish(Twist())'
    return [
        (
            'without a cancel: three places, and a stop',
            still_succeeds,
            f'The job of task 1, with an if in it. {stop}',
        ),
        ('a cancel on the way to place 1', lambda: obeys(5, 1), hint),
        ('a cancel on the way to place 0', lambda: obeys(3, 0), hint),
        ('a job that fails stops the robot, too', fails_and_stops, stop),
    ]


@tasks.add
def answer_at_the_end(ChargingPatroller):
    def charge(patrols, how):
        """Ask to charge in each patrol. Return what is wrong with the answers, for each patrol."""
        found = []
        with Bench() as bench:
            node = ChargingPatroller(MutuallyExclusiveCallbackGroup())
            node.job_ended = ImpatientEvent()
            bench.spin(node, threads=4)
            for _ in range(patrols):
                found.append(charge_once(bench, node, how))
        return found

    def charge_once(bench, node, how):
        there, gate = threading.Event(), threading.Event()

        def go_on():
            there.set()
            gate.wait(10)
            if how == 'fails':
                raise WheelStuckError

        errors = keep_errors(node, go_on)
        goal = send(bench, 1 if how == 'succeeds' else 3)
        try:
            if not bench.wait(lambda: there.is_set() or goal.done) or goal.done:
                raise_first(errors)
                raise Failed('the job ended without a drive to place 0')
            node.job_ended.waiters = 0
            answer = bench.ask('charge', Trigger, limit_s=1)
            bench.wait(lambda: answer.done() or node.job_ended.is_waited_for)
            early = answer.done()
            if how == 'is cancelled':
                goal.cancel()
            gate.set()
            goal.ended()
            answered = bench.wait(answer.done)
        finally:
            gate.set()
            node.job_ended.set()  # nobody shall wait for ever
        raise_first(errors)
        if early:
            return 'an answer while the robot was on patrol'
        return '' if answered else 'no answer'

    twice = cached(lambda: charge(2, 'succeeds'))
    hint = 'self.job_ended.wait() without a time-out; clear() first, set() in a finally.'
    return [
        ('it answers when a patrol has ended', lambda: twice()[0] or True, hint),
        ('also in a second patrol', lambda: twice()[1] or True, 'When is the Event cleared?'),
        (
            'also when a patrol is cancelled',
            lambda: charge(1, 'is cancelled')[0] or True,
            hint,
        ),
        (
            'also when a patrol fails',
            lambda: charge(1, 'fails')[0] or True,
            'try: return ... finally: ...',
        ),
    ]


@tasks.add
def a_group_of_its_own(options, ChargingPatroller):
    def is_heard(threads):
        there, gate = threading.Event(), threading.Event()

        def go_on():
            there.set()
            gate.wait(10)

        with Bench() as bench:
            node = ChargingPatroller(**options())
            errors = keep_errors(node, go_on)
            node.job_ended = ImpatientEvent()
            bench.spin(node, threads=threads)
            goal = send(bench, 3)
            try:
                bench.wait(there.is_set)
                bench.ask('charge', Trigger)
                bench.wait(lambda: node.job_ended.is_waited_for)
                heard = goal.cancel(limit_s=1)
            finally:
                gate.set()
            goal.ended()
        raise_first(errors)
        return heard or 'the cancel was not received while the service waited'

    def is_new():
        first, second = options(), options()
        return first['action_group'] is not second['action_group'] or (
            'two nodes get the same group, and each can then hold that of the other'
        )

    hint = "{'action_group': MutuallyExclusiveCallbackGroup()}"
    return [
        ('the cancel is received, with 3 threads', lambda: is_heard(3), hint),
        ('and with 4 threads', lambda: is_heard(4), hint),
        ('a group of its own for each node', is_new, 'Make the group inside the function.'),
    ]


@tasks.add
def one_patrol_at_a_time(PolitePatroller):
    def answers_to_goals(how_the_first_ends):
        """Send goals before, during and after a patrol. Return by name which are accepted."""
        begin, gate = threading.Event(), threading.Event()
        fails = how_the_first_ends == 'fails'

        class Watched(PolitePatroller):
            def execute_callback(self, goal_handle):
                begin.wait(10)  # so the second goal comes before the first job has begun
                return super().execute_callback(goal_handle)

        def go_on():
            gate.wait(10)
            if fails:
                raise WheelStuckError

        with Bench() as bench:
            node = Watched()
            errors = keep_errors(node, go_on)
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
                gate.set()
            for goal in goals.values():
                goal.ended()
            bench.quiet()
            fails = False
            goals['one after it'] = send(bench, 1)
            goals['one after it'].ended()
        raise_first(errors)
        return {name: goal.accepted for name, goal in goals.items()}

    def is_polite(how_the_first_ends):
        for name, accepted in answers_to_goals(how_the_first_ends).items():
            if accepted != (name in ('the first', 'one after it')):
                return f'{name}: {"accepted" if accepted else "rejected"}'
        return True

    def forgets_who_has_gone():
        """Accept a goal of a client that has gone: rclpy calls no callback after this one."""
        with Bench() as bench:
            node = PolitePatroller()
            errors = keep_errors(node, lambda: None)
            answer = node.goal_callback(Patrol.Goal(order=2))
            if answer != GoalResponse.ACCEPT:
                return f'a goal of 2 places gets {answer}'
            bench.spin(node, threads=4)
            goal = send(bench, 1)
            goal.ended()
        raise_first(errors)
        return goal.accepted or 'its job never began, and the next goal was rejected'

    hint = 'busy = True in handle_accepted_callback, before execute(); busy = False in a finally.'
    gone = 'goal_callback only asks self.busy: it is set in handle_accepted_callback.'
    return [
        ('if the patrol succeeds', lambda: is_polite('succeeds'), hint),
        ('if it is cancelled', lambda: is_polite('is cancelled'), hint),
        ('if it fails', lambda: is_polite('fails'), 'try: return ... finally: ...'),
        ('if its client has gone before it began', forgets_who_has_gone, gone),
    ]


# --- What the tasks share -------------------------------------------------------------------------


class WheelStuckError(RuntimeError):
    """What a check lets a job fail of."""


class ImpatientEvent(threading.Event):
    """For it, every time-out is over at once: a wait with a time-out cannot hide behind it.

    It `is_waited_for` if somebody waits for ever, or again and again.
    """

    waiters = 0

    def wait(self, timeout=None):
        if not super().is_set():
            self.waiters += 3 if timeout is None else 1
        return super().wait(None if timeout is None else min(timeout, 0.01))

    def is_set(self):
        self.waiters += 1
        return super().is_set()

    @property
    def is_waited_for(self):
        return self.waiters >= 3


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


def keep_errors(node, drive):
    """Let a patroller drive in this way. Return a list of what its job raises, from now on.

    rclpy only logs what a job raises, and says that the goal was aborted.
    """
    errors = []

    def go_on():
        drive()

    node.go_on = go_on
    node.get_logger().set_level(40)  # rclpy warns of an aborted goal by its id, which changes

    async def execute_callback(goal_handle):
        try:
            result = node.execute_callback(goal_handle)
            return await result if inspect.isawaitable(result) else result
        except Exception as error:
            errors.append(error)
            return Patrol.Result()

    node.server.register_execute_callback(execute_callback)
    return errors


def raise_first(errors):
    """Raise the first error that is the student's, and does not follow from a stuck wheel."""
    for error in errors:
        if not any(isinstance(e, WheelStuckError) for e in (error, error.__context__)):
            raise error


def send(bench, places):
    return bench.send_goal('patrol', Patrol, Patrol.Goal(order=places))


def ended(goal):
    status, result = goal.ended()
    return status, list(result.sequence) if result else []
