// The drive of a robot: one more run under the slider of view.js, with a floor instead of lists.

// Return what walk.js returns of a run: times, seek, scan. And `told`, which steps say something.
// In a drive that still goes on, the rows of `record` grow, and `took` is the scan that a callback has.
// `works` are the callbacks of a node that commands nothing itself.
function drive(record, root) {
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
      told: command ? speed(command) + (command[3] < 0 ? '' : `, by message ${command[3]}, ${seconds(command[4])} s old`) : 'nothing yet',
    };
  }

  // With a guess the last sentence says how far it was from what came out.
  function outcome() {
    const value = guess && kept.get();
    return value === null || value === undefined ? said : placeKind.gap(guess, value, guess.outcome).says;
  }

  return {
    kept, outcome,
    times: steps.map(([ms]) => 1000 * ms),
    told: steps.map(([, said]) => said !== ''),
    ranks: steps.map(([, , rank]) => rank), // what is said while it plays: a stop or an event, above all a bump
    points: poses.map(point),
    point, pose,
    says: to => says[to - 1] ?? '',
    scan: () => bumps.map(at => steps.findLastIndex(([ms]) => ms <= at) + 1),
    look,
  };
}

// A ring that grows around where it hit something.
function ringAt(svg, { x, y, yaw }, r) {
  if (matchMedia('(prefers-reduced-motion: reduce)').matches) return;
  const group = svg.querySelector('.robot').parentNode;
  const ring = document.createElementNS(svg.namespaceURI, 'circle');
  const most = 30 / group.getScreenCTM().a; // pixels in metres
  const looks = { class: 'ring', cx: x + r * Math.cos(yaw), cy: y + r * Math.sin(yaw), r: most, fill: 'none',
    stroke: svg.querySelector('.bumps').getAttribute('stroke'), 'stroke-width': 3, 'vector-effect': 'non-scaling-stroke' };
  Object.entries(looks).forEach(([name, value]) => ring.setAttribute(name, value));
  group.append(ring);
  ring.animate([{ r: 0.3 * most, opacity: 1 }, { r: most, opacity: 0.2 }], 400).finished.finally(() => ring.remove());
}

function floor(run, record, svg) {
  let labelled = () => {};
  legible(svg, () => {
    halves = {};
    labelled();
  });
  const find = name => svg.querySelector(`.${name}`);
  find('all').setAttribute('stroke-opacity', '.3');
  const radius = +find('robot').querySelector('circle').getAttribute('r');
  const arm = 7 / find('robot').parentNode.transform.baseVal.consolidate().matrix.a;
  // A dot for each second, and a cross where it hit something.
  const dot = ({ x, y }) => `M${x.toFixed(2)} ${y.toFixed(2)}h0`;
  const cross = ({ x, y, yaw }) => `M${(x + radius * Math.cos(yaw)).toFixed(3)} ${(y + radius * Math.sin(yaw)).toFixed(3)}`
    + `m${-arm} ${-arm}l${2 * arm} ${2 * arm}m0 ${-2 * arm}l${-2 * arm} ${2 * arm}`;
  let [seconds, hits] = [0, 0];
  // Places to which it has come are filled.
  const places = [...svg.querySelectorAll('.place')].map(ring => [ring, ...['cx', 'cy', 'r'].map(name => +ring.getAttribute(name))]);
  const came = (till, cx, cy, r) => record.poses.some(([x, y], i) => i <= till && Math.hypot(x - cx, y - cy) < r);
  const wide = svg.viewBox.baseVal.width;
  const ghost = document.createElementNS(svg.namespaceURI, 'text');
  ghost.setAttribute('class', 'ghost');
  svg.append(ghost);

  // What the dashed robot is, beside it: the real age of what the brake acts on. To measure a text lays
  // out the page, so one of each length is measured.
  let halves = {};
  function label({ old, was, age }, r) {
    ghost.textContent = old ? `the brake sees this, ${age.toFixed(1)} s ago` : '';
    if (!old) return;
    const { x, y } = new DOMPoint(was.x, was.y + 1.3 * r).matrixTransform(find('robot').parentNode.transform.baseVal.consolidate().matrix);
    const half = (halves[ghost.textContent.length] ??= ghost.getComputedTextLength() / 2);
    ghost.setAttribute('x', Math.min(Math.max(x, half + 8), wide - half - 8).toFixed(1));
    ghost.setAttribute('y', record.strip ? 26 : Math.max(y - 6, 30).toFixed(1));
  }
  const mine = run.kept && placeKind.yours(svg, record.guess);
  const ended = record.id === undefined ? run.times.at(-1) / 1000 : Infinity; // ms; not yet
  let drawn = () => {};

  // Your robot, once you have put it somewhere: also elsewhere on this page.
  function guessed() {
    const value = run.kept.get();
    mine.node.style.display = value === null ? 'none' : '';
    if (value !== null) mine.put(value);
    drawn();
  }
  const [time, robot, told] = Array.from({ length: 3 }, () => element('span', { class: 'replay-time' }));

  function draw(position, us, plays) {
    const ms = us / 1000;
    const now = run.look(ms);
    const { x, y, yaw, v, w } = now;
    find('robot').setAttribute('transform', `translate(${x.toFixed(3)} ${y.toFixed(3)})`);
    find('robot').firstChild.setAttribute('transform', `rotate(${(yaw * 180 / Math.PI).toFixed(1)})`);
    find('driven').setAttribute('d', `M${run.points.slice(0, now.till + 1).join('L')}L${x.toFixed(3)} ${y.toFixed(3)}`);
    find('fan').setAttribute('d', now.fan);
    const r = radius;
    find('old').setAttribute('d', now.old && `${now.old}M${now.was.x - r} ${now.was.y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`);
    labelled = () => label(now, r);
    labelled();
    places.forEach(([ring, ...place]) => ring.setAttribute('fill-opacity', came(now.till, ...place) ? 0.35 : 0));
    const bumped = record.bumps.filter(at => at <= ms);
    if (plays && bumped.length > hits) ringAt(svg, now, radius);
    if (bumped.length !== hits || seconds !== Math.floor(ms / 1000) || !plays) {
      [seconds, hits] = [Math.floor(ms / 1000), bumped.length];
      find('seconds').setAttribute('d', Array.from({ length: seconds + 1 }, (_, i) => dot(run.pose(1000 * i))).join(''));
      find('bumps').setAttribute('d', bumped.map(at => cross(run.pose(at))).join(''));
    }
    drawn = () => mine?.measure(ms >= (record.bumps[0] ?? ended) - 1 ? now : null);
    drawn();
    time.textContent = `${(ms / 1000).toFixed(2)} s`;
    robot.textContent = `${v.toFixed(2)} m/s, ${w.toFixed(2)} rad/s`;
    told.textContent = now.told;
  }

  const node = element('div', { class: record.strip ? 'replay-floor replay-lane' : 'replay-floor' }, ...(record.name ? [element('b', {}, record.name)] : []), ...(record.label ? [element('b', { class: 'replay-label' }, record.label)] : []), svg,
    row('time', time), row('robot', robot), row('told', told));
  if (mine) {
    guessed();
    document.addEventListener('guess', ({ detail }) => {
      if (detail.question !== record.guess.question || !svg.isConnected) return;
      run.kept.see(detail.value);
      guessed();
    });
  }
  draw.always = true; // also between two steps
  return { node, draw };
}
