// Free play: numbers of a run on sliders, and its prediction, drawn again at each change. The rules
// are those of model.js, played by an executor that never rests.

const model = queueModel();
const MESSAGES = 41;

// Return what becomes of each message, {arrived, started, ended, lost}: times in seconds, or none.
// Inside, times are whole hundredths: sums of 0.05 and of 0.2 would not meet.
function predicted({ period, callback, depth, threads, exclusive }) {
  const hundredths = seconds => Math.round(100 * seconds);
  const setup = {
    threads: Array.from({ length: threads }, (_, i) => `thread ${i + 1}`),
    groups: [{ name: 'group', exclusive }],
    callbacks: [{ name: 'topic', group: 0, depth, does: [{ work: hundredths(callback) }] }],
    arrivals: Array.from({ length: MESSAGES }, (_, seq) => ({
      at: seq * hundredths(period), callback: 0, seq,
    })),
  };
  const messages = setup.arrivals.map(({ at }) => ({ arrived: at / 100 }));
  const state = model.start(setup);
  for (let move = model.eager(setup, state); move; move = model.eager(setup, state)) {
    const seq = move.do === 'take' ? state.queues[0][0].seq : state.runs[move.thread]?.seq;
    const lost = state.lost.length;
    model.advance(setup, state, move);
    if (move.do === 'take') messages[seq].started = state.now / 100;
    if (move.do === 'end') messages[seq].ended = state.now / 100;
    if (state.lost.length > lost) messages[state.lost.at(-1).seq].lost = state.now / 100;
  }
  return messages;
}

function told(messages) {
  const heard = messages.filter(({ started }) => started !== undefined);
  const oldest = Math.max(...heard.map(({ arrived, started }) => started - arrived));
  return `${heard.length} of ${MESSAGES} messages are heard. The oldest waits ${oldest.toFixed(2)} s.`;
}
