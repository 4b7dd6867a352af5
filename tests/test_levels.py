"""Levels: all orders of the game, and that of rclpy."""

import pytest
from support.javascript import Script

from helpers.replay.levels import LEVELS, level

GLUE = """
// The lowest score of all orders: of the choices of game.js, or of the model's own moves.
function least(level, chosen) {
  const it = game(level);
  const { setup } = level;
  const seen = new Set();
  let found = Infinity;
  const allowed = state => it.choices(state).map(({ move }) => move)
    .filter(move => !it.refusal(state, move));
  const after = state => (chosen ? allowed(state).map(move => it.choose(state, move))
    : rules.moves(setup, state).map(move => rules.apply(setup, state, move)));
  function visit(state) {
    const key = JSON.stringify(state);
    if (seen.has(key)) return;
    seen.add(key);
    const next = after(state);
    if (!next.length) found = Math.min(found, it.score(state));
    next.forEach(one => visit(one.state));
  }
  visit(it.start());
  return found;
}

// Play as rclpy does, in which each executor takes what it can at once.
function eager(level) {
  const { start, score } = game(level);
  let state = start();
  for (let move; (move = rules.eager(level.setup, state)); )
    state = rules.apply(level.setup, state, move).state;
  return score(state);
}
"""
VARIANTS = [
    pytest.param(one.goal, variant, id='-'.join([name, *map(str, values)]))
    for name, one in LEVELS.items()
    for values, variant in one.variants().items()
]


@pytest.fixture(scope='module')
def script():
    return Script('game.js', glue=GLUE)


def played_as(goal, variant):
    """What game.js gets of a variant."""
    return {'goal': goal, 'setup': variant.setup, 'begun': variant.begun}


@pytest.mark.parametrize(('goal', 'variant'), VARIANTS)
def test_the_best_is_the_best_of_all_walks(script, goal, variant):
    played = [script.call('least', played_as(goal, variant), chosen) for chosen in (True, False)]
    assert played == [variant.best] * 2


@pytest.mark.parametrize(('goal', 'variant'), VARIANTS)
def test_rclpy_does_what_the_level_says(script, goal, variant):
    """Other tests hold the eager executor beside real runs: of a queue, of calls, of a job."""
    assert variant.rclpy in (None, script.call('eager', played_as(goal, variant)))


def test_a_name_without_a_level_is_one_sentence():
    with pytest.raises(ValueError, match="There is no level 'chess'. There are: save, ") as failure:
        level('chess')
    assert '\n' not in str(failure.value)
