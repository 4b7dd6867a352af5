// The prediction of free play: the rules of model.js, played by an executor that never rests.

import { model } from './model.js';
import { rules } from './rules.js';
import { DOES } from './walk.js';

export const MESSAGES = 41;

// Return a record of what becomes of each message. Times are whole hundredths of a second here:
// sums of 0.05 and of 0.2 would not meet.
export function predicted({ period, callback, depth, threads, exclusive }) {
  const hundredths = seconds => Math.round(100 * seconds);
  const setup = {
    threads: Array.from({ length: threads }, (_, i) => `thread ${i + 1}`),
    groups: [{ name: 'group', exclusive }],
    callbacks: [{ name: 'topic', group: 0, depth, does: [{ work: hundredths(callback) }] }],
    arrivals: Array.from({ length: MESSAGES }, (_, seq) => ({
      at: seq * hundredths(period), callback: 0, seq,
    })),
  };
  const moves = [];
  const state = model.start(setup);
  for (let move = rules.eager(setup, state); move; move = rules.eager(setup, state)) {
    rules.advance(setup, state, move);
    moves.push([1e4 * state.now, DOES.indexOf(move.do), 0, move.do === 'arrive' ? move.seq : move.thread]);
  }
  const { threads: names, groups, callbacks: [{ name, group }] } = setup;
  return { setup: { threads: names, groups, callbacks: [{ name, group, depth }] }, moves };
}

export function told(messages) {
  const heard = messages.filter(({ by }) => by === undefined);
  const oldest = Math.max(...heard.map(({ arrived, left }) => left - arrived));
  return `${heard.length} of ${MESSAGES} messages are received. The oldest waits ${oldest.toFixed(2)} s.`;
}
