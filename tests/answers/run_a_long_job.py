"""Answers to the tasks of lesson 07, as students give them."""

JOB = """class NAME(Patroller):
    def execute_callback(self, goal_handle):
        visited = []
        for place in range(goal_handle.request.order):
BODY"""
EAGER = JOB.replace('NAME', 'EagerPatroller')
OBEDIENT = JOB.replace('NAME', 'ObedientPatroller')
GO_ON = """            self.go_on()
            visited.append(place)
            goal_handle.publish_feedback(Patrol.Feedback(sequence=visited))
"""
LOOK = """            if goal_handle.is_cancel_requested:
                self.publisher.publish(Twist())
                goal_handle.canceled()
                return Patrol.Result(sequence=visited)
"""
SUCCEED = """        goal_handle.succeed()
        return Patrol.Result(sequence=visited)
"""
OPERATOR = """class Operator(Node):
    def __init__(self):
        super().__init__('operator')
        self.client = ActionClient(self, Patrol, 'patrol')
        self.goal_handle = self.result = None
        self.feedback = []

    def send(self, places):
        goal = Patrol.Goal(order=places)
        future = self.client.send_goal_async(goal, self.feedback_callback)
        future.add_done_callback(self.goal_response_callback)

    def goal_response_callback(self, future):
        self.goal_handle = future.result()
        if self.goal_handle.accepted:
            self.goal_handle.get_result_async().add_done_callback(self.result_callback)

    def result_callback(self, future):
        self.result = future.result()

    def feedback_callback(self, message):
        self.feedback.append(list(message.feedback.sequence))
"""
CANCELLING = """class CancellingOperator(Operator):
    cancel_at, cancel_future = 2, None

    def feedback_callback(self, message):
        super().feedback_callback(message)
BODY"""
CHARGING = """class ChargingPatroller(ObedientPatroller):
    def __init__(self, action_group=None):
        super().__init__(action_group)
        self.job_ended = threading.Event()
        self.service = self.create_service(Trigger, 'charge', self.charge_callback)

    def charge_callback(self, request, response):
        self.job_ended.wait()
        return response

    def execute_callback(self, goal_handle):
        self.job_ended.clear()
        try:
            return super().execute_callback(goal_handle)
        finally:
            self.job_ended.set()
"""
POLITE = """class PolitePatroller(ObedientPatroller):
    busy = False

    def goal_callback(self, goal):
        if self.busy or goal.order < 1:
            return GoalResponse.REJECT
        self.busy = True
        return GoalResponse.ACCEPT

    def execute_callback(self, goal_handle):
        try:
            return super().execute_callback(goal_handle)
        finally:
            self.busy = False
"""
WITHOUT_FINALLY = """        result = super().execute_callback(goal_handle)
        END
        return result
"""


def without_finally(code: str, end: str) -> str:
    """Return the code with a job whose last line runs only if nothing was raised."""
    head = code[: code.index('        try:')]
    return head + WITHOUT_FINALLY.replace('END', end)


ANSWERS = {
    1: {
        'wrong': [
            EAGER.replace('BODY', GO_ON + '        return Patrol.Result(sequence=visited)\n'),
            EAGER.replace(
                'BODY',
                '            self.go_on()\n            visited.append(place)\n' + SUCCEED,
            ),
            EAGER.replace('BODY', GO_ON.replace('            self.go_on()\n', '') + SUCCEED),
            EAGER.replace('BODY', GO_ON.replace('(place)', '(place + 1)') + SUCCEED),
            EAGER.replace(
                'BODY', GO_ON.replace('Patrol.Feedback(sequence=visited)', 'visited') + SUCCEED
            ),
            EAGER.replace(
                'BODY', GO_ON + SUCCEED.replace('        return', '            return', 1)
            ).replace('        goal_handle.succeed', '            goal_handle.succeed'),
        ],
        'right': [
            EAGER.replace('BODY', GO_ON + SUCCEED),
            """class EagerPatroller(Patroller):
    def execute_callback(self, goal_handle):
        visited, feedback = [], Patrol.Feedback()
        while len(visited) < goal_handle.request.order:
            self.go_on()
            visited += [len(visited)]
            feedback.sequence = visited
            goal_handle.publish_feedback(feedback)
        goal_handle.succeed()
        result = Patrol.Result()
        result.sequence = visited
        return result
""",
            """class EagerPatroller(Patroller):
    def execute_callback(self, goal_handle):
        feedback = Patrol.Feedback()
        for place in range(goal_handle.request.order):
            self.go_on()
            feedback.sequence.append(place)
            goal_handle.publish_feedback(feedback)
        goal_handle.succeed()
        return Patrol.Result(sequence=feedback.sequence)
""",
        ],
    },
    2: {
        'wrong': [
            OPERATOR.replace(', self.feedback_callback)', ')'),
            OPERATOR.replace('        if self.goal_handle.accepted:\n    ', ''),
            OPERATOR.replace('self.result = future.result()', 'self.result = future'),
            OPERATOR.replace('list(message.feedback.sequence)', 'list(message.sequence)'),
            OPERATOR.replace('        future.add_done_callback(self.goal_response_callback)\n', ''),
            OPERATOR.replace('(order=places)', '()'),
            OPERATOR.replace('send_goal_async', 'send_goal'),
        ],
        'right': [
            OPERATOR,
            OPERATOR.replace('goal = Patrol.Goal(order=places)', 'goal = Patrol.Goal()').replace(
                '        future = self',
                '        goal.order = places\n        future = self',
            ),
            OPERATOR.replace(
                'self.client.send_goal_async(goal, self.feedback_callback)',
                'self.client.send_goal_async(goal, feedback_callback=self.feedback_callback)',
            ).replace(
                '        if self.goal_handle.accepted:\n',
                '        if not self.goal_handle.accepted:\n            return\n        if True:\n',
            ),
            OPERATOR.replace('list(message.feedback.sequence)', '[*message.feedback.sequence]'),
        ],
    },
    3: {
        'wrong': [
            CANCELLING.replace(
                'BODY', '        self.cancel_future = self.goal_handle.cancel_goal_async()\n'
            ),
            CANCELLING.replace(
                'BODY',
                '        if len(self.feedback) >= self.cancel_at:\n'
                '            self.cancel_future = self.goal_handle.cancel_goal_async()\n',
            ),
            CANCELLING.replace(
                'BODY',
                '        if len(self.feedback) == 2:\n'
                '            self.cancel_future = self.goal_handle.cancel_goal_async()\n',
            ),
            CANCELLING.replace(
                'BODY',
                '        if self.feedback[-1][-1] == self.cancel_at:\n'
                '            self.cancel_future = self.goal_handle.cancel_goal_async()\n',
            ),
            CANCELLING.replace(
                'BODY',
                '        if len(self.feedback) == self.cancel_at:\n'
                '            self.goal_handle.cancel_goal_async()\n',
            ),
            CANCELLING.replace(
                'BODY',
                '        if len(self.feedback) == self.cancel_at:\n'
                '            self.cancel_future = self.client.cancel_goal_async()\n',
            ),
        ],
        'right': [
            CANCELLING.replace(
                'BODY',
                '        if len(message.feedback.sequence) == self.cancel_at:\n'
                '            self.cancel_future = self.goal_handle.cancel_goal_async()\n',
            ),
            CANCELLING.replace(
                'BODY',
                '        if len(self.feedback) >= self.cancel_at and self.cancel_future is None:\n'
                '            self.cancel_future = self.goal_handle.cancel_goal_async()\n',
            ),
            CANCELLING.replace(
                'BODY',
                '        if self.cancel_future or len(self.feedback[-1]) < self.cancel_at:\n'
                '            return\n'
                '        self.cancel_future = self.goal_handle.cancel_goal_async()\n',
            ),
        ],
    },
    4: {
        'wrong': [
            OBEDIENT.replace('BODY', GO_ON + SUCCEED),
            OBEDIENT.replace(
                'BODY',
                LOOK.replace('                goal_handle.canceled()\n', '') + GO_ON + SUCCEED,
            ),
            OBEDIENT.replace(
                'BODY',
                LOOK.replace('                self.publisher.publish(Twist())\n', '')
                + GO_ON
                + SUCCEED,
            ),
            OBEDIENT.replace(
                'BODY',
                LOOK.replace('canceled()', 'succeed()') + GO_ON + SUCCEED,
            ),
            OBEDIENT.replace(
                'BODY',
                LOOK.replace('(sequence=visited)', '()') + GO_ON + SUCCEED,
            ),
            OBEDIENT.replace(
                'BODY',
                LOOK.replace('                return Patrol.Result(sequence=visited)\n', '')
                + GO_ON
                + SUCCEED,
            ),
        ],
        'right': [
            OBEDIENT.replace('BODY', LOOK + GO_ON + SUCCEED),
            OBEDIENT.replace(
                'BODY',
                """            if goal_handle.is_cancel_requested:
                break
"""
                + GO_ON
                + """        if goal_handle.is_cancel_requested:
            self.publisher.publish(Twist())
            goal_handle.canceled()
        else:
            goal_handle.succeed()
        return Patrol.Result(sequence=visited)
""",
            ),
            OBEDIENT.replace('BODY', GO_ON + LOOK + SUCCEED).replace(
                '(Patroller)', '(EagerPatroller)'
            ),
        ],
    },
    5: {
        'wrong': [
            CHARGING.replace('self.job_ended.wait()', 'self.job_ended.wait(timeout=2)'),
            CHARGING.replace('        self.job_ended.clear()\n', ''),
            without_finally(CHARGING, 'self.job_ended.set()'),
            CHARGING.replace('        self.job_ended.wait()\n', ''),
            CHARGING.replace('self.job_ended.set()', 'self.job_ended.clear()'),
            CHARGING.replace("'charge'", "'load'"),
            CHARGING.replace('        return response\n', ''),
        ],
        'right': [
            CHARGING,
            CHARGING.replace(
                '        self.job_ended.wait()\n',
                '        while not self.job_ended.wait(timeout=0.1):\n            pass\n',
            ),
            CHARGING.replace(
                '            return super().execute_callback(goal_handle)\n',
                '            result = super().execute_callback(goal_handle)\n',
            )
            + '        return result\n',
            without_finally(CHARGING, 'self.job_ended.set()').replace(
                '        result = super().execute_callback(goal_handle)\n',
                '        try:\n            result = super().execute_callback(goal_handle)\n'
                '        except BaseException:\n            self.job_ended.set()\n'
                '            raise\n',
            ),
        ],
    },
    6: {
        'wrong': [
            'def options():\n    pass',
            "def options():\n    return {'action_group': None}",
            "def options():\n    return {'group': MutuallyExclusiveCallbackGroup()}",
            'def options():\n    return MutuallyExclusiveCallbackGroup()',
            "def options():\n    return {'action_group': MutuallyExclusiveCallbackGroup}",
        ],
        'right': [
            'def options():\n    return dict(action_group=MutuallyExclusiveCallbackGroup())',
            'from rclpy.callback_groups import ReentrantCallbackGroup\n\n\n'
            "def options():\n    return {'action_group': ReentrantCallbackGroup()}",
            'def options():\n    group = MutuallyExclusiveCallbackGroup()\n'
            "    return {'action_group': group}",
        ],
    },
    7: {
        'wrong': [
            without_finally(POLITE, 'self.busy = False'),
            POLITE.replace('        self.busy = True\n', '').replace(
                '        try:\n', '        self.busy = True\n        try:\n'
            ),
            POLITE.replace(' or goal.order < 1', ''),
            POLITE.replace('goal.order < 1', 'goal.order < 0'),
            POLITE.replace('self.busy or ', ''),
            POLITE.replace('            self.busy = False', '            pass'),
            POLITE.replace(
                '        if self.busy or goal.order < 1:\n            return GoalResponse.REJECT\n'
                '        self.busy = True\n',
                '        if self.busy:\n            return GoalResponse.REJECT\n'
                '        self.busy = True\n        if goal.order < 1:\n'
                '            return GoalResponse.REJECT\n',
            ),
        ],
        'right': [
            POLITE,
            POLITE.replace(
                '        if self.busy or goal.order < 1:\n            return GoalResponse.REJECT\n'
                '        self.busy = True\n        return GoalResponse.ACCEPT\n',
                '        if goal.order > 0 and not self.busy:\n            self.busy = True\n'
                '            return GoalResponse.ACCEPT\n        return GoalResponse.REJECT\n',
            ),
            """class PolitePatroller(ObedientPatroller):
    def __init__(self):
        self.lock = threading.Lock()
        super().__init__()

    def goal_callback(self, goal):
        if goal.order >= 1 and self.lock.acquire(blocking=False):
            return GoalResponse.ACCEPT
        return GoalResponse.REJECT

    def execute_callback(self, goal_handle):
        try:
            return super().execute_callback(goal_handle)
        finally:
            self.lock.release()
""",
        ],
    },
}
