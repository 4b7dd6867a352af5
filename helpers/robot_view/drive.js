// The drive of a robot: one more run under the slider of view.js. What was when, and no page: floor.js
// draws it. With a guess come memory.js and place.js.

// Return what walk.js returns of a run: times, scan, and what each step says. And `told`, which steps say something.
// In a drive that still goes on, the rows of `record` grow, and `took` is the scan that a callback has.
// `works` are the callbacks of a node that commands nothing itself.
export function drive(record, root) {
  const { step, poses, commands, scans, events, bumps, guess, strip = Infinity, works = [], outcome: said } = record;
  const kept = guess && memory(root, guess);
  const turn = w => (w ? ` and ${w.toFixed(2)} rad/s` : '');
  const speed = ([, v, w]) => `${v.toFixed(2)} m/s${turn(w)}`;
  const told = one => (one[1] || one[2] ? `The robot is told to drive ${speed(one)}.` : 'The robot is told to stop.');
  const seconds = age => Math.max(age / 1000, 0).toFixed(2);
  const because = ([, , , seq, age]) => (seq < 0
    ? '' : ` The callback of message ${seq} says so, which is ${seconds(age)} s old.`);
  const isNew = (one, i) => !i || one[1] !== commands[i - 1][1] || one[2] !== commands[i - 1][2];
  const steps = [
    ...poses.map((_, i) => [1000 * i * step, '', 0]),
    ...commands.map((one, i) => [one[0], isNew(one, i) ? told(one) + because(one) : '', isNew(one, i) && !one[1] && !one[2] ? 1 : 0]),
    ...events.map(([ms, text]) => [ms, text, bumps.includes(ms) ? 2 : 1]),
  ].sort(([one], [other]) => one - other);
  let text = '';
  const says = steps.map(([, said]) => (text = said || text));

  // Return where the last pose is that was reached at a time: a number with a fraction.
  const reached = ms => Math.min(Math.max(ms / (1000 * step), 0), poses.length - 1);

  // Between two poses it is on a straight line.
  function pose(ms) {
    const i = Math.floor(reached(ms));
    const [from, to] = [poses[i], poses[i + 1] ?? poses[i]];
    const [x, y, yaw, v, w] = from.map((value, k) => value + (reached(ms) - i) * (to[k] - value));
    return { x, y, yaw, v, w };
  }

  // What the brake acted on when it was decided stays: at the bump, or when it was told to stand.
  function decided() {
    const drives = commands.findLastIndex(([, v, w]) => v || w);
    return bumps[0] ?? (drives < 0 ? Infinity : commands[drives + 1]?.[0] ?? Infinity);
  }

  const point = ([x, y]) => `${x} ${y}`;
  const latest = (rows, ms) => rows.findLast(([at]) => at <= ms);

  // The path around what the laser saw, from where it was.
  function fan(scan) {
    if (!scan) return '';
    const [ms, , first, last, ranges] = scan;
    const { x, y, yaw } = pose(ms);
    const hits = ranges.map((range, k) => {
      const angle = yaw + first + (last - first) * k / (ranges.length - 1);
      const reach = Math.min(range / 100, strip / Math.max(Math.abs(Math.sin(angle)), 1e-6));
      return [x + reach * Math.cos(angle), y + reach * Math.sin(angle)].map(at => at.toFixed(2)).join(' ');
    });
    return `M${x} ${y}L${hits.join('L')}z`;
  }

  // All that is seen at a time.
  function look(ms) {
    const till = Math.min(ms, decided());
    const command = latest(commands, till);
    // Not each scan is saved: the time of the one that it acts on is that of the command, less its age.
    const work = latest(works, till);
    const has = record.took ?? work?.[1] ?? command?.[3] ?? -1;
    const taken = has < 0 ? undefined : scans.findLast(([, seq]) => seq <= has);
    const seen = taken && (record.took === undefined ? work?.[2] ?? command[0] - command[4] : taken[0]);
    const now = latest(scans, ms);
    return {
      ...pose(ms), till: Math.floor(reached(ms)), fan: fan(now), old: taken === now ? '' : fan(taken), was: taken && pose(seen), age: taken && (till - seen) / 1000,
      // The one age that is shown is that of the ghost.
      told: command ? speed(command) + (command[3] < 0 ? '' : `, by message ${command[3]}`) : 'nothing yet',
    };
  }

  // With a guess the last sentence says how far it was from what came out.
  function outcome() {
    const value = guess && kept.get();
    return value === null || value === undefined ? said : placeKind.gap(guess, value, guess.outcome).says;
  }

  const points = poses.map(point);

  return {
    kept, outcome, points, pose, look,
    grow: () => points.push(...poses.slice(points.length).map(point)), // as the poses have
    times: steps.map(([ms]) => 1000 * ms),
    told: steps.map(([, said]) => said !== ''),
    ranks: steps.map(([, , rank]) => rank), // what is said while it plays: a stop or an event, above all a bump
    says: to => says[to - 1] ?? '',
    scan: () => bumps.map(at => steps.findLastIndex(([ms]) => ms <= at) + 1),
  };
}
