// Free drive: the robot of the lessons on the site's first page, moved by keys, mouse or fingers,
// without a kernel: a drive that goes on, as drive.js and floor.js have it. A person who has come to all
// places has a time, and may try again.

import { clock } from '../../helpers/replay/clock.js';
import { element, wake } from '../../helpers/replay/element.js';
import { drive } from '../../helpers/robot_view/drive.js';
import { floor } from '../../helpers/robot_view/floor.js';
import { body } from './body.js';

const SPEED = 1, BACK = -0.5, TURN = 1.6; // m/s, rad/s
const KEYS = { ArrowUp: [SPEED, 0], ArrowDown: [BACK, 0], ArrowLeft: [0, TURN], ArrowRight: [0, -TURN] };
const PAD = [ // a button: what it holds, its face, its name
  [['ArrowUp', 'ArrowLeft'], '◤', 'forward and left'], [['ArrowUp'], '▲', 'forward'],
  [['ArrowUp', 'ArrowRight'], '◥', 'forward and right'], [['ArrowLeft'], '◀', 'left'],
  [['ArrowDown'], '▼', 'back'], [['ArrowRight'], '▶', 'right'],
];
const BEAMS = 61;

const HELLO = 'Come to A, B and C. Click the floor, then hold arrow keys, two for a curve; or hold a button, or a place on the floor.';
const list = names => names.join(', ').replace(/, (?=[^,]*$)/, ' and ');
const bumped = count => (count ? `with ${count} ${count > 1 ? 'bumps' : 'bump'}` : 'without a bump');

// What is said: where one was, and at the end the time, and what to try next.
function said(places, reached, bumps, seconds, best) {
  const left = Object.keys(places).sort().filter(name => !reached.includes(name));
  if (!reached.length) return bumps ? `A bump. Come to ${list(left)}.` : HELLO;
  const tells = bumps ? ', ' + bumped(bumps) : '';
  if (left.length) return `${list(reached)} ${reached.length > 1 ? 'are' : 'is'} done, ${list(left)} to go${tells}.`;
  const next = bumps ? 'Now without a bump?' : best < seconds ? `Your best is ${best.toFixed(1)} s.` : 'Your best so far. Faster?';
  return `${list([...reached].sort())} in ${seconds.toFixed(1)} s, ${bumped(bumps)}. ${next}`;
}

function show(root) {
  const { places, ...room } = JSON.parse(root.dataset.drive);
  const step = room.limits[3]; // s
  const says = element('p', { 'aria-live': 'polite', class: 'drive-says' });
  const time = element('output', { class: 'drive-clock', 'aria-hidden': 'true' });
  const again = element('button', { type: 'button', onclick: begin }, 'Again');
  const shown = root.querySelector('.replay-floor');
  const empty = shown.firstChild;
  const near = empty.querySelector('.place').r.baseVal.value; // m
  const keys = new Set(); // that are held
  const fingers = new Map(); // of a pointer: the keys of its button, or a point of the floor
  let robot, record, run, picture, seconds, left, reached, best;

  // All from the start; also the first time.
  function begin() {
    const svg = empty.cloneNode(true);
    shown.replaceChildren(svg);
    robot = body(room);
    record = { id: 'free', step, poses: [], commands: [], scans: [], events: [], bumps: [] };
    run = drive(record);
    picture = floor(svg, run, record);
    [seconds, left, reached] = [0, 0, []];
    says.textContent = HELLO;
    root.classList.remove('drive-over');
    keep();
    draw();
  }

  const isOver = () => reached.length === Object.keys(places).length;
  const drivenMs = () => 1000 * step * (record.poses.length - 1);

  // What the robot does now is a row of the record. Return whether it has come to a place, or into a wall.
  function keep() {
    const { x, y, yaw, v, w, bumps } = robot.now;
    record.poses.push([x, y, yaw, v, w]);
    const hit = bumps.length > record.bumps.length;
    if (hit) record.bumps.push(drivenMs());
    const came = Object.keys(places).filter(name => !reached.includes(name) && Math.hypot(places[name][0] - x, places[name][1] - y) < near);
    reached.push(...came);
    came.forEach(name => picture.flash(...places[name], 'var(--look-robot)'));
    return hit || came.length > 0;
  }

  function draw() {
    const ranges = Array.from({ length: BEAMS }, (_, i) => 100 * robot.range(robot.now.yaw + Math.PI * (i / (BEAMS - 1) - 0.5)));
    record.scans = [[drivenMs(), 0, -Math.PI / 2, Math.PI / 2, ranges]];
    run.grow();
    picture.draw(drivenMs(), true);
    time.textContent = `${seconds.toFixed(1)} s`;
  }

  // One step of the robot. After the last place nothing counts any more.
  function go() {
    robot.step(...wanted());
    if (isOver()) return keep();
    seconds += step;
    if (keep()) says.textContent = said(places, reached, record.bumps.length, seconds, best);
    if (!isOver()) return;
    best = Math.min(best ?? Infinity, seconds);
    root.classList.add('drive-over');
  }

  // While it moves, or shall move, one picture a frame.
  const player = clock(root, passed => {
    for (left += passed; left >= 1000 * step; left -= 1000 * step) go();
    draw();
    const { v, w } = robot.now;
    if (!keys.size && !fingers.size && !v && !w) player.stop();
  });

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

  // A finger that slides from button to button takes the next one.
  function held({ clientX, clientY }) {
    const over = document.elementFromPoint(clientX, clientY);
    const button = over?.closest?.('.drive-pad button');
    if (button && root.contains(button)) return button.dataset.holds.split(' ');
    const metres = shown.querySelector('.robot').parentNode;
    const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(metres.getScreenCTM().inverse());
    return shown.contains(over) ? [x, y] : [];
  }

  function touch(event) {
    root.focus({ preventScroll: true });
    event.preventDefault();
    fingers.set(event.pointerId, held(event));
    player.start();
  }

  const pad = element('div', { class: 'drive-pad', onpointerdown: touch, oncontextmenu: event => event.preventDefault() },
    ...PAD.map(([holds, face, name]) => element('button', { type: 'button', 'data-holds': holds.join(' '), 'aria-label': name, tabindex: -1 }, face)));
  shown.addEventListener('pointerdown', touch);
  window.addEventListener('pointermove', event => {
    if (fingers.has(event.pointerId)) fingers.set(event.pointerId, held(event));
  });
  for (const name of ['pointerup', 'pointercancel']) window.addEventListener(name, event => fingers.delete(event.pointerId));
  wake(root, 'free drive', key => {
    if (!KEYS[key]) return false;
    keys.add(key);
    player.start();
    return true;
  });
  root.addEventListener('keyup', event => keys.delete(event.key));
  for (const target of [root, window]) target.addEventListener('blur', () => keys.clear(), target === root);
  root.querySelector('.drive-hello').replaceWith(says);
  root.append(element('div', { class: 'drive-controls' }, pad, element('div', {}, time, again)));
  begin();
}

show(document.currentScript.closest('.replay'));
