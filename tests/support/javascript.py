"""The script of the replays, without its page, in a JavaScript engine."""

import json

import quickjs

from helpers.replay.script import source, with_imports

GLUE = """
// All states of a run, one a step from before the first, as a page could read them.
function states(record) {
  const run = walk(record, rules.advance);
  return Array.from({ length: run.times.length + 1 }, (_, step) => {
    const { state, says } = run.seek(step);
    return {
      now: state.now,
      queue: state.queues[0].map(({ seq }) => seq),
      threads: state.runs.map(it => it && it.seq),
      lost: state.lost.map(({ seq, by }) => [seq, by]),
      cause: model.cause(record.setup, state, 0),
      says,
    };
  });
}

// Of each step what a page shows: the sentence, who runs, who waits and why, which groups are held
// and by whom, and the circle that can never go on: its sentence, and who waits for or holds what.
function steps(record) {
  const { setup } = record;
  const run = walk(record, rules.advance);
  const named = item => (item ? setup.callbacks[item.callback].name : null);
  return run.times.map((_, step) => {
    const { state, says } = run.seek(step + 1);
    return {
      says,
      running: state.runs.map(named),
      queues: state.queues.map(queue => queue.length),
      causes: state.queues.map((queue, i) => queue.length && model.cause(setup, state, i)),
      held: setup.groups.map((_, group) => named(model.holderOf(setup, state, group))),
      circle: circleOf(setup, state).says,
      arrows: circleOf(setup, state).arrows.map(({ says, hot }) => [says, Boolean(hot)]),
    };
  });
}

// Of each step of a run that ends in a circle: the arrows on the page, whether it is closed, and
// the sentence, undefined if it is that of the run.
function grown(record) {
  const run = close(walk(record), record);
  const here = new Set(placed(run.end).map(({ id }) => id));
  const isHere = ({ from, to }) => here.has(from) && here.has(to);
  return run.times.map((_, i) => ({
    arrows: run.circle(i + 1).arrows.filter(isHere).map(({ says }) => says),
    closed: run.circle(i + 1).stuck.length > 0,
    says: run.says(i + 1),
  }));
}

// The states of some steps, asked for in this order.
const seek = (record, steps) => {
  const run = walk(record);
  return steps.map(step => {
    const { state, says } = run.seek(step);
    return JSON.parse(JSON.stringify([state.queues, state.lost, state.runs, says]));
  });
};
const scan = record => walk(record).scan();

// Play a setup until nothing is left to do; `prefer`, names of moves, says what is done first.
function play(setup, prefer = []) {
  let state = model.start(setup);
  const done = [];
  for (;;) {
    const allowed = rules.moves(setup, state);
    const rank = move => (prefer.includes(move.do) ? prefer.indexOf(move.do) : prefer.length);
    const move = prefer.length
      ? allowed.sort((one, other) => rank(one) - rank(other))[0] : rules.eager(setup, state);
    if (!move) return { state, done, circle: circleOf(setup, state) };
    const before = JSON.stringify(state);
    const { state: after, says } = rules.apply(setup, state, move);
    if (JSON.stringify(state) !== before) throw new Error('apply changed the state it got');
    done.push({ ...move, at: after.now, says });
    state = after;
  }
}

const after = (setup, moves) =>
  moves.reduce((was, move) => rules.apply(setup, was.state, move), { state: model.start(setup) });
const refusal = (setup, moves, move) => rules.refusal(setup, after(setup, moves).state, move);
const last = (setup, moves) => after(setup, moves).says;
"""


class Script:
    """Files `.js` with what they import, and glue. `call` exchanges JSON."""

    def __init__(self, *names: str, glue: str = GLUE) -> None:
        self._context = quickjs.Context()
        for path in with_imports(names or ('rules.js', 'circle.js')):
            self._context.eval(source(path))
        self._context.eval(glue)

    def call(self, function: str, *arguments):
        """Return what a function of the glue returns."""
        given = ', '.join(json.dumps(argument) for argument in arguments)
        return json.loads(self._context.eval(f'JSON.stringify({function}({given}))'))
