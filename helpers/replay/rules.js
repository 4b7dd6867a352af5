// What may happen next, in a state of model.js. The page of a replay goes without: what happened is
// known, and Python has tried each move of it.

import { model } from './model.js';

export const rules = (() => {
  const { named, capital, step, stepsOf, holder, groupOf, runOf } = model;

  // What the clock brings next, if a schedule or a work with a number says so.
  function due(setup, state) {
    const next = setup.arrivals?.[state.arrived];
    const found = next ? [{ do: 'arrive', ...next }] : [];
    state.runs.forEach((run, thread) => {
      if (run && run.until !== undefined) {
        const last = run.step === stepsOf(setup, run).length - 1;
        found.push({ do: last ? 'end' : 'go', thread, at: run.until });
      }
    });
    return found.sort((one, other) => one.at - other.at);
  }

  // The rules: '' if a move is allowed, else the sentence that forbids it.
  function refusal(setup, state, move) {
    const at = move.at ?? state.now;
    if (at < state.now) return `Time does not run backwards: it is ${state.now} s.`;
    const [first] = due(setup, state);
    const isDue = first && move.do === first.do && move.thread === first.thread
      && move.callback === first.callback && move.seq === first.seq;
    if (first && !isDue && (first.at < at || first.at <= state.now))
      return `Not yet: ${does(setup, state, first)} comes first.`;
    if (move.do === 'arrive') {
      if (setup.arrivals && !isDue) return 'The publisher does not send it now.';
      return '';
    }
    const thread = setup.threads[move.thread];
    if (thread === undefined) return 'There is no such thread.';
    const run = state.runs[move.thread];
    if (move.do === 'take') {
      if (run)
        return `${capital(thread)} is busy with ${named(setup, run)}: `
          + 'it runs one callback at a time.';
      const [oldest] = state.queues[move.callback];
      if (!oldest) return 'Nothing waits there.';
      if (oldest.seq !== (move.seq ?? oldest.seq))
        return `A queue gives its oldest first, and ${named(setup, { ...move, ...oldest })} is older.`;
      const held = holder(setup, state, move.callback);
      if (held)
        return `${capital(named(setup, held))} holds ${groupOf(setup, move.callback).name}: `
          + 'a mutually exclusive group runs one callback at a time.';
      return '';
    }
    if (!run) return `${capital(thread)} runs nothing.`;
    if (run.waits) return `${capital(named(setup, run))} waits for an answer.`;
    const now = step(setup, run);
    if (run.until !== undefined && at < run.until)
      return `${capital(named(setup, run))} is not done before ${run.until} s.`;
    const left = stepsOf(setup, run).length - run.step;
    const finished = left === 0 || (left === 1 && 'work' in now);
    if (move.do === 'end') return finished ? '' : 'The callback has more to do.';
    if (finished) return 'The callback has nothing more to do than to end.';
    if (now.lock && state.locks[now.lock] !== undefined)
      return `${now.lock} is locked: ${named(setup, runOf(state, state.locks[now.lock]))} has it.`;
    return '';
  }

  // All moves that are allowed now. Where a schedule says what comes, the clock's move is one.
  function moves(setup, state) {
    const found = due(setup, state).slice(0, 1);
    setup.threads.forEach((_, thread) => {
      setup.callbacks.forEach((_, callback) => found.push({ do: 'take', callback, thread }));
      if (state.runs[thread]?.until === undefined)
        found.push({ do: 'go', thread }, { do: 'end', thread });
    });
    return found.filter(move => !refusal(setup, state, move));
  }

  function does(setup, state, move) {
    if (move.do === 'arrive') return named(setup, move);
    return `the end of ${named(setup, state.runs[move.thread])}`;
  }

  // As that of the model, but what the rules forbid is an error.
  function advance(setup, state, move) {
    const refused = refusal(setup, state, move);
    if (refused) throw new Error(refused);
    return model.advance(setup, state, move);
  }

  // The same, and the state that came in stays as it was.
  function apply(setup, state, move) {
    const after = JSON.parse(JSON.stringify(state));
    const says = advance(setup, after, move);
    return { state: after, says };
  }

  // The move of an executor that never rests: what is due first, then the lowest free thread.
  function eager(setup, state) {
    const [first] = due(setup, state);
    if (first && first.at <= state.now) return first;
    return moves(setup, state).find(move => !isSame(move, first)) ?? first;
  }

  const isSame = (one, other) =>
    other && one.do === other.do && one.thread === other.thread && one.seq === other.seq;

  return { due, refusal, moves, advance, apply, eager };
})();
