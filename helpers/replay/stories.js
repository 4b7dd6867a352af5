// What became of each message of a run, for its picture.

import { model } from './model.js';
import { rules } from './rules.js';
import { walk } from './walk.js';

// Return of the first `most` messages, in the order of their arrival: {callback, seq, arrived, waits,
// left, by, runs, ended}. `waits` and `runs` are pairs of a time and the cause that holds from then
// on; `by` is the message that pushed it out.
export function stories(record, most) {
  const { setup, moves } = record;
  const { seek } = walk(record, rules.advance);
  const found = new Map();
  const of = ({ callback, seq }) => found.get(`${callback} ${seq}`);
  const because = (phases, at, cause) => {
    if (phases.at(-1)?.[1] !== cause) phases.push([at, cause]);
  };
  let lost = 0;

  function wait(state, callback) {
    const cause = model.cause(setup, state, callback);
    state.queues[callback].slice(0, most).forEach(({ seq }) => {
      const item = { callback, seq };
      if (!of(item)) {
        if (found.size === most) return;
        found.set(`${callback} ${seq}`, { ...item, arrived: state.now, waits: [], runs: [] });
      }
      because(of(item).waits, state.now, cause);
    });
  }

  function run(state) {
    const going = model.going(state);
    going.filter(of).forEach(it => {
      of(it).left ??= state.now;
      because(of(it).runs, state.now, it.waits ? 'answer' : '');
    });
    found.forEach(story => {
      const goes = going.some(it => of(it) === story);
      if (story.runs.length && !goes) story.ended ??= state.now;
    });
  }

  const isOver = () => found.size === most
    && [...found.values()].every(({ by, ended }) => by !== undefined || ended !== undefined);

  for (let step = 1; step <= moves.length && !isOver(); step += 1) {
    const { state } = seek(step);
    setup.callbacks.forEach((_, callback) => wait(state, callback));
    state.lost.slice(lost).filter(of).forEach(out => Object.assign(of(out), { left: state.now, by: out.by }));
    lost = state.lost.length;
    run(state);
  }
  return [...found.values()];
}
