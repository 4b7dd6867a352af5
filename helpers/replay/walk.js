// A run that was recorded or predicted, put to any of its steps. No page here.

const CHECKPOINT = 64; // moves between two states that are kept, of a run with many
const DOES = ['arrive', 'take', 'end', 'go', 'resume'];
const model = typeof refereed === 'undefined' ? queueModel() : refereed(queueModel());

// A record is {setup, moves}: the setup of model.js, and moves in short, [microseconds, which of
// DOES, and two numbers].
function walk({ setup, moves }) {
  const kept = [model.start(setup)];
  let state = model.copy(kept[0]);
  let at = 0; // moves that are done
  let says = '';

  function move(index) {
    const [us, kind, one, other] = moves[index];
    const made = { do: DOES[kind], at: us / 1e6 };
    if (kind === 0) return { ...made, callback: one, seq: other };
    if (kind === 4) return { ...made, run: one, thread: other };
    return { ...made, callback: one, thread: other };
  }

  // Return the state after `to` moves, and the sentence of the last one. The next
  // call changes the state.
  function seek(to) {
    // From one before, because the sentence belongs to the last move.
    const near = Math.min(Math.floor(Math.max(to - 1, 0) / CHECKPOINT), kept.length - 1);
    if (to < at || near * CHECKPOINT > at) {
      at = near * CHECKPOINT;
      state = model.copy(kept[near]);
    }
    while (at < to) {
      says = model.advance(setup, state, move(at));
      at += 1;
      if (at === kept.length * CHECKPOINT) kept.push(model.copy(state));
    }
    return { state, says: to ? says : '' };
  }

  // Return the numbers of the steps that lose a message.
  function scan() {
    const now = model.start(setup);
    return moves.flatMap((_, index) => {
      const before = now.lost.length;
      model.advance(setup, now, move(index));
      return now.lost.length > before ? [index + 1] : [];
    });
  }

  return { seek, scan, times: moves.map(([us]) => us) };
}
