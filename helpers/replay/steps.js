// The steps of all runs of a replay, in one order. No page here.

// Return `steps` in the order of time, {us, who, step, told, rank}: of which run, whether it says
// something, and whether also while it plays: 1, or 2 if nothing else may be said in its place. Also
// `done(who, position)`, how many steps of a run are done after so many of all, and `after(who, step)`, the
// first position at which so many are. `stops` are, for each run, the positions after which a message is lost or
// the robot hits something.
export function inOneOrder(runs) {
  const own = runs.map(run => run.scan());
  const ranks = runs.map((run, who) => run.ranks ?? run.times.map((_, step) => +own[who].includes(step + 1)));
  const steps = runs.flatMap((run, who) => run.times.map((us, step) => (
    { us, who, step, told: run.told?.[step] ?? true, rank: ranks[who][step] }
  ))).sort((one, other) => one.us - other.us);
  const counts = runs.map(() => [0]);
  for (const { who } of steps) counts.forEach((count, i) => count.push(count.at(-1) + (i === who)));
  const after = (who, step) => counts[who].indexOf(step);
  return {
    steps,
    after,
    done: (who, position) => counts[who][position],
    stops: own.map((found, who) => found.map(step => after(who, step))),
  };
}
