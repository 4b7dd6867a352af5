// Free drive: the robot of the lessons on the site's first page, moved by keys, mouse or fingers,
// without a kernel.

const KEYS = { // m/s, rad/s, a button's face and name
  ArrowUp: [1, 0, '▲', 'forward'],
  ArrowDown: [-0.5, 0, '▼', 'back'],
  ArrowLeft: [0, 1.2, '◀', 'left'],
  ArrowRight: [0, -1.2, '▶', 'right'],
};
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

function show(root) {
  const floor = JSON.parse(root.dataset.drive);
  const { now, step, range } = body(floor);
  const find = name => root.querySelector(`.${name}`);
  const bumps = element('p', { 'aria-live': 'polite' });
  let held;
  let path = `M${now.x} ${now.y}`;
  let before;

  function draw() {
    find('robot').setAttribute('transform', `translate(${now.x} ${now.y})`);
    find('robot').firstChild.setAttribute('transform', `rotate(${now.yaw * 180 / Math.PI})`);
    const hits = Array.from({ length: BEAMS }, (_, i) => {
      const angle = now.yaw + Math.PI * (i / (BEAMS - 1) - 0.5);
      const far = range(angle);
      return `${now.x + far * Math.cos(angle)} ${now.y + far * Math.sin(angle)}`;
    });
    find('fan').setAttribute('d', `M${now.x} ${now.y}L${hits.join('L')}z`);
    find('driven').setAttribute('d', path);
    find('bumps').setAttribute('d', now.bumps.map(({ x, y }) => `M${x} ${y}m-.1-.1l.2 .2m0-.2l-.2 .2`).join(''));
    const text = now.bumps.length ? `${now.bumps.length} ${now.bumps.length > 1 ? 'bumps' : 'bump'}` : '';
    if (bumps.textContent !== text) bumps.textContent = text;
  }

  // While it moves, or shall move, one picture a frame.
  function frame(ms) {
    const steps = Math.min(Math.floor((ms - before) / (1000 * floor.limits[3])), 10);
    for (let i = 0; i < steps; i += 1) step(...(KEYS[held] ?? [0, 0]));
    before += steps === 10 ? ms - before : steps * 1000 * floor.limits[3];
    if (steps && now.v) path += `L${now.x.toFixed(2)} ${now.y.toFixed(2)}`;
    draw();
    if (held || now.v || now.w) requestAnimationFrame(frame);
    else before = undefined;
  }

  function press(key) {
    held = key;
    if (before === undefined) {
      before = performance.now();
      requestAnimationFrame(frame);
    }
  }

  const release = () => (held = undefined);
  const buttons = Object.entries(KEYS).map(([key, [, , face, name]]) =>
    element('button', { type: 'button', 'aria-label': name, onpointerdown: () => press(key) }, face));
  wake(root, 'free drive');
  root.addEventListener('keydown', event => {
    if (!KEYS[event.key]) return;
    event.preventDefault();
    if (!event.repeat) press(event.key);
  });
  for (const name of ['keyup', 'blur']) root.addEventListener(name, release, true);
  for (const name of ['pointerup', 'pointercancel']) window.addEventListener(name, release);
  root.append(element('div', { class: 'replay-controls' }, ...buttons, bumps));
  draw();
}
