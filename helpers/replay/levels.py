"""Levels: the learner is the executor, and chooses what runs next.

A level is an output of a cell, as a replay is: a script that needs neither a kernel nor the
network. If a page does not run it, the task stays as a text. What may happen is decided in
model.js, what may be tried and how well it went in game.js; level.js shows it.

`best` of a variant is the best that any order of choices reaches, and `rclpy` what the real rclpy
did: how many messages were lost, how many callbacks never ended, or how many places were visited.
tests/test_levels.py tries all orders, and plays each as rclpy does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

from helpers.notebook import shown
from helpers.replay.script import played

ONE = 'SingleThreadedExecutor()'


@dataclass(frozen=True)
class Variant:
    """What the options of a level make: a setup of model.js, its lines of rclpy, what it shows.

    `begun` are moves of model.js that are done when the level begins.
    """

    setup: dict
    best: int
    lesson: str
    code: str = ''
    rclpy: int | None = None
    begun: tuple[dict, ...] = ()


@dataclass(frozen=True)
class Level:
    """A level. The last line of a cell shows it.

    `goal` is 'keep' (lose no message), 'lose' (let the number `count` be too small), 'answer' (let
    all callbacks end) or 'stop' (keep the number `places` small). `variant` makes a variant of a
    value of each option.
    """

    task: str
    goal: str
    variant: Callable[..., Variant]
    options: dict[str, tuple]

    def variants(self) -> dict[tuple, Variant]:
        """Return the variant of each combination of the options, the last one changing first."""
        return {values: self.variant(*values) for values in product(*self.options.values())}

    def __str__(self) -> str:
        return f'A level to play: {self.task}'

    def html(self) -> str:
        record = {
            'goal': self.goal,
            'options': [{'name': name, 'values': of} for name, of in self.options.items()],
            'variants': [vars(variant) for variant in self.variants().values()],
        }
        return played('level', record, self.task, 'ring.css')

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        return {'text/plain': str(self), 'text/html': self.html()}


def level(name: str) -> Level:
    """Return a level by its name. Raises ValueError, with the names, if there is none."""
    if name not in LEVELS:
        raise ValueError(f'There is no level {shown(name)}. There are: {", ".join(LEVELS)}.')
    return LEVELS[name]


def _threads(number: int) -> list[str]:
    return ['the thread'] if number == 1 else [f'thread {i + 1}' for i in range(number)]


def _executor(threads: int) -> str:
    return ONE if threads == 1 else f'MultiThreadedExecutor(num_threads={threads})'


def _arrivals(callback: int, times_s: list[float]) -> list[dict]:
    return [{'at': at, 'callback': callback, 'seq': seq} for seq, at in enumerate(times_s)]


# The levels. But for the arrivals of 'counter', no two events of one are at the same time.


def _save() -> Variant:
    return Variant(
        {
            'threads': ['the program'],
            'groups': [{'name': 'the group', 'exclusive': True}],
            'callbacks': [
                {'name': 'camera', 'word': 'picture', 'group': 0, 'depth': 2}
                | {'does': [{'work': 3.5}]}
            ],
            'arrivals': _arrivals(0, [0, 1, 2, 3, 4, 5]),
        },
        2,
        'You made no mistake: no order saves them all. Pictures come faster than one at a time '
        'can be looked at, and only two can wait. The lesson "Lose messages" shows why, and the '
        'next one what helps.',
        rclpy=2,
    )


def _depth(depth: int) -> Variant:
    return Variant(
        {
            'threads': _threads(1),
            'groups': [{'name': 'the group', 'exclusive': True}],
            'callbacks': [{'name': 'topic', 'group': 0, 'depth': depth, 'does': [{'work': 3.5}]}],
            'arrivals': _arrivals(0, [0, 1, 2, 3, 4, 5]),
        },
        {1: 3, 2: 2, 4: 0}[depth],
        {
            1: 'Only one can wait, so each new message pushes out the one before it.',
            2: 'Two can wait: one more than with depth 1 is received, and later. Try depth 4.',
            4: 'All six are received, because no more came. The last one waits longest: a deeper '
            'queue does not make the callback faster.',
        }[depth],
        f"self.create_subscription(String, 'topic', self.listener_callback, {depth})",
        {1: 3, 2: 2, 4: 0}[depth],
    )


def _starve() -> Variant:
    return Variant(
        {
            'threads': _threads(1),
            'groups': [{'name': 'the group', 'exclusive': True}],
            'callbacks': [
                {'name': 'imu', 'group': 0, 'depth': 1, 'does': [{'work': 0.4}]},
                {'name': 'camera', 'group': 0, 'depth': 1, 'does': [{'work': 2.5}]},
            ],
            'arrivals': sorted(
                _arrivals(0, [0, 1, 2, 3, 4, 5]) + _arrivals(1, [0.2, 3.2]),
                key=lambda arrival: arrival['at'],
            ),
        },
        1,
        "No order saves them all. While the camera's callback runs, messages of the IMU push each "
        'other out; while the camera waits, a picture is pushed out. With one thread one has '
        'to wait, and rclpy does not know which you would choose.',
        rclpy=2,
    )


def _threads_and_groups(threads: int, group: str) -> Variant:
    reentrant = group == 'Reentrant'
    lessons = {
        'Mutually exclusive': {
            1: 'One thread runs one callback at a time. Give it a second thread: is that enough?',
            2: 'The second thread had nothing to do: the group lets one callback in at a time.',
        },
        'Reentrant': {
            1: 'The group lets all in, but there is only one thread.',
            2: 'Two threads, and a group that lets both in: none is lost. You need both.',
        },
    }
    return Variant(
        {
            'threads': _threads(threads),
            'groups': [{'name': 'the group', 'exclusive': not reentrant}],
            'callbacks': [{'name': 'topic', 'group': 0, 'depth': 1, 'does': [{'work': 1.9}]}],
            'arrivals': _arrivals(0, [0, 1, 2, 3, 4, 5]),
        },
        0 if threads == 2 and reentrant else 2,
        lessons[group][threads],
        f'executor = {_executor(threads)}\n'
        f'group = {group.title().replace(" ", "")}CallbackGroup()\n'
        'self.create_subscription(\n'
        "    String, 'topic', self.listener_callback, 1, callback_group=group\n)",
        0 if threads == 2 and reentrant else 2,
    )


def _counter(lock: str) -> Variant:
    update = [{'read': 'count'}, {'write': 'count'}]
    steps = [{'lock': 'the lock'}, *update, {'unlock': 'the lock'}] if lock == 'with' else update
    indent = '    ' if lock == 'with' else ''
    return Variant(
        {
            'threads': _threads(2),
            'groups': [{'name': 'the group', 'exclusive': False}],
            'callbacks': [{'name': 'topic', 'group': 0, 'depth': 2, 'does': steps}],
            'arrivals': _arrivals(0, [0, 0]),
        },
        2 if lock == 'with' else 1,
        'No order loses one: the thread with the lock reads and writes before the other one reads.'
        if lock == 'with'
        else 'Two callbacks ran, and the count is 1: both read 0, and both wrote 1. One update is '
        'lost. Try it with a lock.',
        ('with self.lock:\n' if lock == 'with' else '')
        + f'{indent}count = self.count\n{indent}self.count = count + 1',
    )


def _deadlock(threads: int, groups: str) -> Variant:
    exclusive = groups != 'Reentrant'
    two = groups == 'two groups'
    answered = threads == 2 and groups != 'one group'
    timer = 'self.create_timer(0.05, self.timer_callback, callback_group={})'
    client = "self.create_client(Trigger, 'look', callback_group={})"
    made = 'MutuallyExclusiveCallbackGroup()' if exclusive else 'ReentrantCallbackGroup()'
    code = [f'executor = {_executor(threads)}', f'group = {made}', timer.format('group')]
    code += [client.format('MutuallyExclusiveCallbackGroup()' if two else 'group')]
    if answered:
        lesson = 'A thread is free for the answer, and a group lets it in: the callback ends.'
    elif threads == 1:
        lesson = 'No order ends it. The only thread waits for work that only it could do.'
    else:
        lesson = 'No order ends it. A thread is free, but the client is in the group that is held.'
    name = "the timer's group" if two else 'the group of timer and client'
    groups_made = [{'name': name, 'exclusive': exclusive}]
    groups_made += [{'name': "the client's group", 'exclusive': True}] if two else []
    camera = len(groups_made)
    return Variant(
        {
            'threads': _threads(threads),
            'groups': [*groups_made, {'name': "the camera's group", 'exclusive': True}],
            'callbacks': [
                {'name': 'timer', 'word': 'tick', 'group': 0, 'depth': 1}
                | {'does': [{'call': 1, 'client': 2}]},
                {'name': 'look', 'word': 'request', 'group': camera, 'depth': 10},
                {'name': 'client', 'word': 'answer', 'group': int(two), 'depth': 10, 'does': []},
            ],
            'arrivals': _arrivals(0, [0]),
        },
        0 if answered else 1,
        lesson,
        '\n'.join(code),
        0 if answered else 1,
    )


def _cancel(threads: int, job: str) -> Variant:
    looks = job == 'looks'
    visit = {'work': 1, 'adds': 'places'} | ({'unless': 'the cancel'} if looks else {})
    look = """    if goal_handle.is_cancel_requested:
        goal_handle.canceled()
        return Fibonacci.Result()
"""
    if threads == 1:
        too_late = (
            'Too late: the job holds the only thread until it ends. The real rclpy then answers '
            'that the goal has ended, and asks nobody.'
        )
        lesson = (
            f'{too_late} No order changes that, and it does not help that the job looks. '
            'Try two threads.'
            if looks
            else f'{too_late} Try two threads.'
        )
    elif looks:
        lesson = 'The second thread took the cancel while the job ran, and the job looked.'
    else:
        lesson = 'The cancel was heard, but the job did not look: hearing is not obeying.'
    return Variant(
        {
            'threads': _threads(threads),
            'groups': [
                {'name': 'no group', 'exclusive': False},
                {'name': "the action's group", 'exclusive': True},
            ],
            'callbacks': [
                {'name': 'job', 'word': 'goal', 'group': 0, 'depth': 10, 'does': [visit] * 3},
                {'name': 'action', 'word': 'cancel', 'group': 1, 'depth': 10}
                | {'does': [{'set': 'the cancel'}]},
            ],
            'arrivals': _arrivals(0, [0]) + _arrivals(1, [1.5]),
        },
        2 if threads == 2 and looks else 3,
        lesson,
        f'executor = {_executor(threads)}\n\n'
        f'for place in range(3):\n{look if looks else ""}    self.visit(place)',
        2 if threads == 2 and looks else 3,
        ({'do': 'take', 'callback': 0, 'thread': 0},),
    )


LEVELS = {
    'save': Level(
        'A camera sends a picture every second. Your program needs 3.5 seconds for each, one after '
        'the other. Meanwhile two more can wait; when another comes, the oldest of them is thrown '
        'away. Choose what the program does next, and lose no picture.',
        'keep',
        _save,
        {},
    ),
    'depth': Level(
        'You are the executor, with one thread. A message comes every second, a callback needs '
        '3.5 s. Choose the depth, then what runs next, and lose as few as you can.',
        'keep',
        _depth,
        {'depth': (1, 2, 4)},
    ),
    'starve': Level(
        'You are the executor, with one thread. The IMU, a motion sensor, sends a message '
        'every second, and its callback needs 0.4 s. The camera sends one every 3 s, and needs '
        '2.5 s. Lose as few as you can.',
        'keep',
        _starve,
        {},
    ),
    'threads': Level(
        'You are the executor. A message comes every second, a callback needs 1.9 s, and one '
        'message can wait. Choose threads and group, then what runs next, and lose none.',
        'keep',
        _threads_and_groups,
        {'threads': (1, 2), 'group': ('Mutually exclusive', 'Reentrant')},
    ),
    'counter': Level(
        'You are the executor, with two threads. Each callback reads the count, and writes it back '
        'plus one. Two messages wait. Choose an order in which one update is lost.',
        'lose',
        _counter,
        {'lock': ('without', 'with')},
    ),
    'deadlock': Level(
        'You are the executor. The callback of a timer asks the camera, with call, and waits. Find '
        'an order in which it gets its answer. Where there is none, change threads or groups.',
        'answer',
        _deadlock,
        {'threads': (1, 2), 'groups': ('one group', 'two groups', 'Reentrant')},
    ),
    'cancel': Level(
        'You are the executor of a robot. Its job has begun: visit three places, a second each. '
        'After 1.5 s somebody cancels. Let the robot visit as few places as you can. Choose the '
        'threads, and whether the job looks for a cancel before each place.',
        'stop',
        _cancel,
        {'threads': (1, 2), 'job': ('looks', 'does not look')},
    ),
}
