// Free drive: the robot of the lessons on the site's first page, moved by keys, mouse or fingers,
// without a kernel. A person who has come to all places has a time, and may try again.

const SPEED = 1, BACK = -0.5, TURN = 1.6; // m/s, rad/s
const KEYS = { ArrowUp: [SPEED, 0], ArrowDown: [BACK, 0], ArrowLeft: [0, TURN], ArrowRight: [0, -TURN] };
const PAD = [ // a button: what it holds, its face, its name
  [['ArrowUp', 'ArrowLeft'], '◤', 'forward and left'], [['ArrowUp'], '▲', 'forward'],
  [['ArrowUp', 'ArrowRight'], '◥', 'forward and right'], [['ArrowLeft'], '◀', 'left'],
  [['ArrowDown'], '▼', 'back'], [['ArrowRight'], '▶', 'right'],
];
const BEAMS = 61;

// The body of helpers/robot/body.py: a disc among walls [x0, y0, x1, y1], in steps of 0.02 s.
function body({ walls, start: [x, y, yaw], limits: [radius, acceleration, turning, seconds] }) {
  const now = { x, y, yaw, v: 0, w: 0, bumps: [], touching: false };
  const apart = (low, at, high) => Math.max(low - at, 0, at - high);
  const clearance = at => Math.min(...walls.map(
    ([x0, y0, x1, y1]) => Math.hypot(apart(x0, at.x, x1), apart(y0, at.y, y1)))) - radius;
  const towards = (value, target, most) => value + Math.max(-most, Math.min(most, target - value));

  function arc(v, w, part) {
    const half = w * seconds * part / 2;
    const chord = v * seconds * part * (Math.abs(half) > 1e-9 ? Math.sin(half) / half : 1);
    const along = now.yaw + half;
    return { x: now.x + chord * Math.cos(along), y: now.y + chord * Math.sin(along), yaw: now.yaw + 2 * half };
  }

  // Change the speeds towards those that are wanted, and move; into a wall as far as to touch it.
  function step(v, w) {
    const [oldV, oldW] = [now.v, now.w];
    now.v = towards(oldV, v, acceleration * seconds);
    now.w = towards(oldW, w, turning * seconds);
    const means = [(oldV + now.v) / 2, (oldW + now.w) / 2];
    const end = arc(...means, 1);
    if (clearance(end) >= 0 || !means[0]) {
      now.touching = now.touching && clearance(end) < 0.005;
      return Object.assign(now, end);
    }
    let [free, blocked] = [0, 1];
    for (let i = 0; i < 50; i += 1) {
      const half = (free + blocked) / 2;
      if (clearance(arc(...means, half)) >= 0) free = half;
      else blocked = half;
    }
    Object.assign(now, arc(...means, free), { yaw: end.yaw, v: 0 });
    if (!now.touching) now.bumps.push({ ...now });
    now.touching = true;
    return now;
  }

  // How far a beam goes, 8 m at most: to where it is between both pairs of a wall's edges.
  function range(angle) {
    const [cos, sin] = [Math.cos(angle) || 1e-12, Math.sin(angle) || 1e-12];
    return Math.min(8, ...walls.map(([x0, y0, x1, y1]) => {
      const [a, b, c, d] = [(x0 - now.x) / cos, (x1 - now.x) / cos, (y0 - now.y) / sin, (y1 - now.y) / sin];
      const enter = Math.max(Math.min(a, b), Math.min(c, d), 0);
      return enter <= Math.min(Math.max(a, b), Math.max(c, d)) ? enter : 8;
    }));
  }

  return { now, step, range };
}

const HELLO = 'Come to A, B and C. Click the floor, then hold arrow keys, two for a curve; or hold a button, or a place on the floor.';
const list = names => names.join(', ').replace(/, (?=[^,]*$)/, ' and ');
const bumped = count => (count ? `with ${count} ${count > 1 ? 'bumps' : 'bump'}` : 'without a bump');

// What is said: where one was, and at the end the time, and what to try next.
function said(places, reached, bumps, seconds, best) {
  const left = Object.keys(places).sort().filter(name => !reached.includes(name));
  if (!reached.length) return bumps ? `A bump. Come to ${list(left)}.` : HELLO;
  if (left.length) return `${list(reached)} ${reached.length > 1 ? 'are' : 'is'} done, ${list(left)} to go${bumps ? `, ${bumped(bumps)}` : ''}.`;
  const next = bumps ? 'Now without a bump?' : best < seconds ? `Your best is ${best.toFixed(1)} s.` : 'Your best so far. Faster?';
  return `${list([...reached].sort())} in ${seconds.toFixed(1)} s, ${bumped(bumps)}. ${next}`;
}

function ringOf(svg, looks) {
  const made = document.createElementNS(svg.namespaceURI, 'circle');
  for (const [name, value] of Object.entries(looks)) made.setAttribute(name, value);
  made.setAttribute('vector-effect', 'non-scaling-stroke');
  return made;
}

function show(root) {
  const floor = JSON.parse(root.dataset.drive);
  const svg = root.querySelector('svg');
  const find = name => svg.querySelector(`.${name}`);
  const picture = find('robot').parentNode; // in metres
  const says = element('p', { 'aria-live': 'polite', class: 'drive-says' });
  const clock = element('output', { class: 'drive-clock', 'aria-hidden': 'true' });
  const again = element('button', { type: 'button', onclick: begin }, 'Again');
  const keys = new Set(); // that are held
  const fingers = new Map(); // of a pointer: the keys of its button, or a point of the floor
  const rings = {};
  let robot, path, before, seconds, reached, hits, best;

  Object.keys(floor.places).forEach((name, i) => (rings[name] = svg.querySelectorAll('.place')[i]));

  // All from the start; also the first time.
  function begin() {
    robot = body(floor);
    path = `M${robot.now.x} ${robot.now.y}`;
    [seconds, hits, reached, before] = [0, 0, [], undefined];
    for (const ring of Object.values(rings)) ring.classList.remove('drive-done');
    says.textContent = HELLO;
    root.classList.remove('drive-over');
    draw();
  }

  // A ring that grows where something has happened.
  function flash(x, y, kind) {
    if (matchMedia('(prefers-reduced-motion: reduce)').matches) return;
    const ring = ringOf(svg, { class: `drive-flash ${kind}`, cx: x, cy: y, r: 0 });
    picture.append(ring);
    ring.animate([{ r: 0.2, opacity: 1 }, { r: 0.9, opacity: 0 }], 500).finished.finally(() => ring.remove());
  }

  function draw() {
    const { now, range } = robot;
    find('robot').setAttribute('transform', `translate(${now.x} ${now.y})`);
    find('robot').firstChild.setAttribute('transform', `rotate(${now.yaw * 180 / Math.PI})`);
    const beams = Array.from({ length: BEAMS }, (_, i) => {
      const angle = now.yaw + Math.PI * (i / (BEAMS - 1) - 0.5);
      const far = range(angle);
      return `${now.x + far * Math.cos(angle)} ${now.y + far * Math.sin(angle)}`;
    });
    find('fan').setAttribute('d', `M${now.x} ${now.y}L${beams.join('L')}z`);
    find('driven').setAttribute('d', path);
    find('bumps').setAttribute('d', now.bumps.map(({ x, y }) => `M${x} ${y}m-.1-.1l.2 .2m0-.2l-.2 .2`).join(''));
    clock.textContent = `${seconds.toFixed(1)} s`;
  }

  // Towards a point of the floor: turn to it, and drive while it is ahead.
  function towards([x, y]) {
    const { now } = robot;
    if (Math.hypot(x - now.x, y - now.y) < 0.1) return [0, 0];
    const turn = Math.atan2(y - now.y, x - now.x) - now.yaw;
    const error = Math.atan2(Math.sin(turn), Math.cos(turn));
    return [SPEED * Math.max(Math.cos(error), 0) ** 3, Math.max(-TURN, Math.min(TURN, 4 * error))];
  }

  function wanted() {
    const point = [...fingers.values()].find(held => typeof held[0] === 'number');
    if (point) return towards(point);
    const held = new Set([...keys, ...[...fingers.values()].flat()]);
    return [...held].reduce(([v, w], key) => [v + KEYS[key][0], w + KEYS[key][1]], [0, 0]);
  }

  const isOver = () => reached.length === Object.keys(floor.places).length;

  // What has happened since the last picture: a bump, a place, the end.
  function look() {
    const { now } = robot;
    if (isOver()) return;
    const news = Object.entries(floor.places).filter(([name, [x, y]]) =>
      !reached.includes(name) && Math.hypot(x - now.x, y - now.y) < rings[name].r.baseVal.value); // m
    for (const [name, [x, y]] of news) {
      reached.push(name);
      rings[name].classList.add('drive-done');
      flash(x, y, 'drive-came');
    }
    if (now.bumps.length > hits) flash(now.x + 0.11 * Math.cos(now.yaw), now.y + 0.11 * Math.sin(now.yaw), 'drive-hit');
    if (news.length || now.bumps.length > hits) {
      says.textContent = said(floor.places, reached, now.bumps.length, seconds, best);
      hits = now.bumps.length;
    }
    if (isOver()) {
      best = Math.min(best ?? Infinity, seconds);
      root.classList.add('drive-over');
    }
  }

  // While it moves, or shall move, one picture a frame.
  function frame(ms) {
    if (before === undefined) return;
    const step = floor.limits[3];
    const steps = Math.min(Math.floor((ms - before) / (1000 * step)), 10);
    for (let i = 0; i < steps; i += 1) {
      robot.step(...wanted());
      if (!isOver()) seconds += step;
      look();
    }
    const { now } = robot;
    before += steps === 10 ? ms - before : steps * 1000 * step;
    if (steps && now.v) path += `L${now.x.toFixed(2)} ${now.y.toFixed(2)}`;
    draw();
    if (keys.size || fingers.size || now.v || now.w) requestAnimationFrame(frame);
    else before = undefined;
  }

  function go() {
    if (before !== undefined) return;
    before = performance.now();
    requestAnimationFrame(frame);
  }

  // A finger that slides from button to button takes the next one.
  function held({ clientX, clientY }) {
    const over = document.elementFromPoint(clientX, clientY);
    const button = over?.closest?.('.drive-pad button');
    if (button && root.contains(button)) return button.dataset.holds.split(' ');
    const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(picture.getScreenCTM().inverse());
    return svg.contains(over) ? [x, y] : [];
  }

  function touch(event) {
    root.focus({ preventScroll: true });
    event.preventDefault();
    fingers.set(event.pointerId, held(event));
    go();
  }

  const pad = element('div', { class: 'drive-pad', onpointerdown: touch, oncontextmenu: event => event.preventDefault() },
    ...PAD.map(([holds, face, name]) => element('button', { type: 'button', 'data-holds': holds.join(' '), 'aria-label': name, tabindex: -1 }, face)));
  svg.addEventListener('pointerdown', touch);
  window.addEventListener('pointermove', event => {
    if (fingers.has(event.pointerId)) fingers.set(event.pointerId, held(event));
  });
  for (const name of ['pointerup', 'pointercancel']) window.addEventListener(name, event => fingers.delete(event.pointerId));
  wake(root, 'free drive');
  root.addEventListener('keydown', event => {
    if (!KEYS[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    keys.add(event.key);
    go();
  });
  root.addEventListener('keyup', event => keys.delete(event.key));
  for (const target of [root, window]) target.addEventListener('blur', () => keys.clear(), target === root);
  root.querySelector('.drive-hello').replaceWith(says);
  root.append(element('div', { class: 'drive-controls' }, pad, element('div', {}, clock, again)));
  begin();
}
