// A run that was recorded or predicted, put to any of its steps. No page here.

import { model } from './model.js';

export const DOES = ['arrive', 'take', 'end', 'go'];

// A record is {setup, moves}: the setup of model.js, and moves in short, [microseconds, which of
// DOES, callback, and the number of what arrives, else of the thread]. `does` does a move: that of
// rules.js refuses what cannot have happened.
export function walk({ setup, moves }, does = model.advance) {
  let state = model.start(setup);
  let at = 0; // moves that are done
  let says = '';

  function advance(state, [us, kind, callback, number]) {
    const [made, which] = [DOES[kind], kind ? 'thread' : 'seq'];
    return does(setup, state, { do: made, at: us / 1e6, callback, [which]: number });
  }

  // Return the state after `to` moves, and the sentence of the last one. The next call changes the
  // state.
  function seek(to) {
    if (to < at) [state, at, says] = [model.start(setup), 0, ''];
    for (; at < to; at += 1) says = advance(state, moves[at]);
    return { state, says };
  }

  // Return the numbers of the steps that lose a message.
  function scan() {
    const now = model.start(setup);
    return moves.flatMap((move, index) => {
      const before = now.lost.length;
      advance(now, move);
      return now.lost.length > before ? [index + 1] : [];
    });
  }

  return { seek, scan, times: moves.map(([us]) => us) };
}
