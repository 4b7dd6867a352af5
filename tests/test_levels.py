"""Levels: the game, played by chance and by the real rclpy."""

import functools
import threading
from collections import deque

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from std_msgs.msg import Int32
from support.javascript import Script
from support.nodes import LIMIT_S, call_in_executor, spin
from test_msgs.action import Fibonacci

from helpers.replay.levels import LEVELS, level
from helpers.session import ros_session

GLUE = """
// Play with numbers that say which choice is tried, and go round in them.
function play(level, numbers) {
  const it = game(level);
  const { setup } = level;
  let state = it.start();
  const tried = [];
  for (let i = 0; i < 200 && !it.isOver(state); i += 1) {
    const choices = it.choices(state);
    const { move } = choices[numbers[i % numbers.length] % choices.length];
    const before = JSON.stringify(state);
    const refused = it.refusal(state, move);
    // A queue is known by its callback: the model takes its oldest.
    const takes = move.do === 'take';
    const rules = model.refusal(setup, state, takes ? { ...move, seq: undefined } : move);
    const isOldest = !takes || move.seq === state.queues[move.callback][0].seq;
    tried.push({ ...move, refused, rules, isOldest });
    if (!refused) state = it.choose(state, move).state;
    else if (before !== JSON.stringify(state)) throw new Error('a refusal changed the state');
  }
  return { tried, over: it.isOver(state), score: it.score(state), best: it.best(), state };
}

// The lowest score of all orders of the model's own moves, without the choices of game.js.
function least(level) {
  const { score, start } = game(level);
  const { setup } = level;
  const seen = new Set();
  let found = Infinity;
  function visit(state) {
    const key = JSON.stringify(state);
    if (seen.has(key)) return;
    seen.add(key);
    const allowed = model.moves(setup, state);
    if (!allowed.length) found = Math.min(found, score(state));
    allowed.forEach(move => visit(model.apply(setup, state, move).state));
  }
  visit(start());
  return found;
}

// Do the moves of a real run; a move that the rules forbid is an error.
function follow(setup, goal, moves) {
  const state = model.start(setup);
  moves.forEach(move => model.advance(setup, state, move));
  const lost = state.lost.map(({ callback, seq }) => [callback, seq]);
  return { lost, score: game({ setup, goal }).score(state) };
}
"""
VARIANTS = [
    pytest.param(one.goal, variant, id='-'.join([name, *map(str, values)]))
    for name, one in LEVELS.items()
    for values, variant in one.variants().items()
]
OF_ACTIONS = [pytest.param(p.values[1], id=p.id) for p in VARIANTS if p.values[0] == 'stop']
OF_TOPICS = [one for one in VARIANTS if one.values[0] == 'keep']


@pytest.fixture(scope='module')
def script():
    return Script('game.js', GLUE)


def played_as(goal, variant):
    """What game.js gets of a variant."""
    return {'goal': goal, 'setup': variant.setup, 'begun': variant.begun}


# The rules


@pytest.mark.parametrize(('goal', 'variant'), VARIANTS)
@settings(max_examples=10)
@given(numbers=st.lists(st.integers(0, 6), min_size=30, max_size=30))
def test_the_game_follows_the_model(script, goal, variant, numbers):
    played = script.call('play', played_as(goal, variant), numbers)
    for tried in played['tried']:
        assert bool(tried['refused']) == (bool(tried['rules']) or not tried['isOldest'])
        assert not tried['rules'] or tried['refused'] == tried['rules']
    if played['over']:
        assert played['score'] >= played['best']


@pytest.mark.parametrize(('goal', 'variant'), VARIANTS)
def test_the_best_is_the_best_of_all_walks(script, goal, variant):
    played = script.call('play', played_as(goal, variant), [0])
    assert played['best'] == script.call('least', played_as(goal, variant))


def best(script, name, *values):
    one = level(name)
    return script.call('play', played_as(one.goal, one.variants()[values]), [0])['best']


def test_what_the_levels_teach_is_so(script):
    assert best(script, 'save') > 0
    assert best(script, 'starve') > 0
    assert [best(script, 'depth', depth) for depth in (1, 2, 4)] == [3, 2, 0]
    one, both = 'Mutually exclusive', 'Reentrant'
    assert [best(script, 'threads', *c) for c in ((1, one), (2, one), (1, both))] == [2, 2, 2]
    assert best(script, 'threads', 2, both) == 0
    assert [best(script, 'counter', lock) for lock in ('without', 'with')] == [1, 2]
    jobs = [(1, 'looks'), (1, 'does not look'), (2, 'does not look'), (2, 'looks')]
    assert [best(script, 'cancel', *job) for job in jobs] == [3, 3, 3, 2]


# The real rclpy


def real_run(setup):
    """Let rclpy be the executor of a setup. Return its moves, and what was never heard.

    The clock is the setup's: a message is published when its time has come, and a callback is held
    until its work is done. What runs next is rclpy's own choice: each time, the clock waits until
    it has made it. Which of the free threads takes a message is not compared.
    """
    exclusive = [group['exclusive'] for group in setup['groups']]
    depths = [callback['depth'] for callback in setup['callbacks']]
    waiting = [deque(maxlen=depth) for depth in depths]
    entered, running = deque(), []
    threads = len(setup['threads'])

    def hold(callback, message):
        done = threading.Event()
        entered.append((callback, message.data, done))
        assert done.wait(LIMIT_S)

    def can_start():
        busy = {setup['callbacks'][callback]['group'] for _, callback, *_ in running}
        groups = [setup['callbacks'][i]['group'] for i, queue in enumerate(waiting) if queue]
        return len(running) < threads and any(g not in busy or not exclusive[g] for g in groups)

    arrivals = [(move['at'], move['callback'], move['seq']) for move in setup['arrivals']]
    moves, heard = [], set()
    with ros_session() as session:
        node, publisher_node = Node('listener'), Node('talker')
        groups = [
            MutuallyExclusiveCallbackGroup() if one else ReentrantCallbackGroup()
            for one in exclusive
        ]
        publishers = []
        for index, callback in enumerate(setup['callbacks']):
            node.create_subscription(
                Int32,
                callback['name'],
                lambda message, index=index: hold(index, message),
                callback['depth'],
                callback_group=groups[callback['group']],
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            )
            publishers.append(publisher_node.create_publisher(Int32, callback['name'], 10))
        spin(session, node, threads=threads)
        while arrivals or running:
            ends = sorted(running)
            if arrivals and (not ends or arrivals[0][0] <= ends[0][0]):
                now, callback, seq = arrivals.pop(0)
                publishers[callback].publish(Int32(data=seq))
                waiting[callback].append(seq)
                moves.append({'do': 'arrive', 'at': now, 'callback': callback, 'seq': seq})
            else:
                now, callback, seq, thread, done = ends[0]
                running.remove(ends[0])
                done.set()
                moves.append({'do': 'end', 'at': now, 'thread': thread})
            while can_start():
                session.wait_until(lambda: entered, LIMIT_S)
                callback, seq, done = entered.popleft()
                heard.add((callback, seq))
                waiting[callback].remove(seq)
                thread = min(set(range(threads)) - {one[3] for one in running})
                (step,) = setup['callbacks'][callback]['does']
                running.append((now + step['work'], callback, seq, thread, done))
                moves.append({'do': 'take', 'at': now, 'callback': callback, 'thread': thread})
        assert not entered
    published = {(move['callback'], move['seq']) for move in setup['arrivals']}
    return moves, sorted(published - heard)


@pytest.mark.parametrize(('goal', 'variant'), OF_TOPICS)
def test_rclpy_did_what_the_level_says(script, goal, variant):
    moves, lost = real_run(variant.setup)
    followed = script.call('follow', variant.setup, goal, moves)
    assert sorted(map(tuple, followed['lost'])) == lost
    assert followed['score'] == variant.rclpy


def cancelled_job(setup):
    """Let a real action server do the job of a setup, and cancel it. Return the places visited.

    The clock is the setup's: each place is visited when its time has come, and before that the
    executor does all that it can.
    """
    job = setup['callbacks'][0]['does']
    gates = [threading.Event() for _ in job]
    at_place, visited = [], []

    def execute(goal_handle):
        for place, visit in enumerate(job):
            if 'unless' in visit and goal_handle.is_cancel_requested:
                goal_handle.canceled()
                return Fibonacci.Result()
            at_place.append(place)
            assert gates[place].wait(LIMIT_S)
            visited.append(place)
        goal_handle.succeed()
        return Fibonacci.Result()

    with ros_session() as session:
        robot, operator = Node('robot'), Node('operator')
        ActionServer(
            robot, Fibonacci, 'job', execute, cancel_callback=lambda _: CancelResponse.ACCEPT
        )
        client = ActionClient(operator, Fibonacci, 'job')
        executor = spin(session, robot, threads=len(setup['threads']))
        own = spin(session, operator)

        ask = functools.partial(call_in_executor, session, own)
        session.wait_until(client.server_is_ready, LIMIT_S)
        goal = ask(client.send_goal_async, Fibonacci.Goal())
        session.wait_until(lambda: goal.done() and at_place, LIMIT_S)
        result = ask(goal.result().get_result_async)
        now = 0
        cancel = None
        for place, visit in enumerate(job):
            now += visit['work']
            if cancel is None and now > setup['arrivals'][1]['at']:
                cancel = ask(goal.result().cancel_goal_async)
                session.wait_until_quiet(executor)
            gates[place].set()
            session.wait_until(
                lambda place=place: len(at_place) > place + 1 or result.done(), LIMIT_S
            )
            if result.done():
                break
    return len(visited)


@pytest.mark.parametrize('variant', OF_ACTIONS)
def test_the_robot_stopped_where_the_level_says(variant):
    assert cancelled_job(variant.setup) == variant.rclpy


# The page


def test_a_name_without_a_level_is_one_sentence():
    with pytest.raises(ValueError, match="There is no level 'chess'. There are: save, ") as failure:
        level('chess')
    assert '\n' not in str(failure.value)
