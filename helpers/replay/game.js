// The learner is the executor. What is allowed is decided in model.js; here is what may be tried,
// when a game is over, and how well it went. No page here.

import { model } from './model.js';
import { rules } from './rules.js';

// A game of one setup. `goal` is 'keep' (lose no message), 'lose' (let the number count be too
// small), 'answer' (let all callbacks end) or 'stop' (keep the number places small). A state is one
// of model.js. `begun`, moves, are done before the learner's first.
export function game({ setup, goal, begun = [] }) {
  const { callbacks, arrivals = [] } = setup;
  const stepOf = run => (callbacks[run.callback].does ?? [{ work: undefined }])[run.step];
  const canStep = run => run && !run.waits && run.until === undefined;

  const SCORES = {
    keep: state => state.lost.length,
    lose: state => state.values.count ?? 0,
    answer: state => model.going(state).length,
    stop: state => state.values.places ?? 0,
  };
  // The less the better, in each kind of level.
  const score = SCORES[goal];

  const VERBS = { read: 'read', write: 'write', lock: 'take', unlock: 'give back', set: 'accept', call: 'ask' };

  function stepText(run) {
    const [[verb, what]] = Object.entries(stepOf(run));
    if (verb === 'work') return `end ${model.named(setup, run)}`;
    return `${VERBS[verb]} ${verb === 'call' ? callbacks[what].name : what}`;
  }

  // What may be tried now, [{move, text}]. What the rules forbid is among it, to be refused.
  function choices(state) {
    const [first] = rules.due(setup, state);
    const found = first ? [{ move: first, text: 'Wait' }] : [];
    state.runs.forEach((run, thread) => {
      if (!canStep(run)) return;
      const move = { do: 'work' in stepOf(run) ? 'end' : 'go', thread };
      found.push({ move, text: `${setup.threads[thread]}: ${stepText(run)}` });
    });
    const thread = Math.max(state.runs.indexOf(null), 0);
    callbacks.forEach((_, callback) => state.queues[callback].forEach(({ seq }) => {
      const text = `Take ${model.named(setup, { callback, seq })}`;
      found.push({ move: { do: 'take', callback, thread, seq }, text });
    }));
    return found;
  }

  const refusal = (state, move) => rules.refusal(setup, state, move);

  // What happens without a choice: what is due now, and the end of what has no more to do.
  function automatic(state) {
    const [first] = rules.due(setup, state);
    if (first && first.at <= state.now) return first;
    const thread = state.runs.findIndex(run => canStep(run) && !stepOf(run));
    return thread < 0 ? undefined : { do: 'end', thread };
  }

  // Let it happen in the state, and return the sentences. Where nothing more arrives, nothing more
  // can be lost, and the rest is done at once.
  function settle(state) {
    const said = [];
    let next = automatic(state);
    for (; next; next = automatic(state)) said.push(rules.advance(setup, state, next));
    if (goal !== 'keep' || state.arrived < arrivals.length) return said;
    next = rules.eager(setup, state);
    if (next) said.push('No more come. What still waits is done, one after the other.');
    for (; next; next = rules.eager(setup, state)) rules.advance(setup, state, next);
    return said;
  }

  function start() {
    const state = model.start(setup);
    settle(state);
    begun.forEach(move => rules.advance(setup, state, move));
    return state;
  }

  // Do what was chosen: a new state, and what happened. The state that came in stays as it was.
  function choose(state, move) {
    const { state: after, says } = rules.apply(setup, state, move);
    return { state: after, says: [says, ...settle(after)].join(' ') };
  }

  const isOver = state => choices(state).every(({ move }) => refusal(state, move));

  return { start, choices, refusal, choose, isOver, score };
}
