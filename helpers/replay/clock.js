// The clock of all that moves: replays, the drive that goes on, free drive. Before each picture it calls
// `tick` with the milliseconds since the one before: 100 at most, so that nothing jumps when a page was
// hidden. It ends with its node.
export function clock(node, tick) {
  let frame = null;
  let before;

  function next(now) {
    if (!node.isConnected) return stop();
    const passed = Math.min(now - (before ?? now), 100);
    before = now;
    frame = requestAnimationFrame(next);
    tick(passed);
  }

  function start() {
    if (frame !== null) return;
    before = undefined;
    frame = requestAnimationFrame(next);
  }

  function stop() {
    cancelAnimationFrame(frame);
    frame = null;
  }

  return { start, stop, runs: () => frame !== null };
}
