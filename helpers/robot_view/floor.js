// A floor as picture.py has drawn it, and what moves on it: the one picture of a replay, of the drive that
// goes on, and of free drive. With a guess of a place comes place.js.

import { element, legible, row, shape } from '../replay/element.js';
import { isCalm } from '../replay/motion.js';

// A ring that grows around a place, to a radius (m).
function ringAt(metres, x, y, radius, stroke) {
  if (isCalm()) return;
  const looks = { fill: 'none', stroke, 'stroke-width': 3, 'vector-effect': 'non-scaling-stroke' };
  const ring = shape('circle', { class: 'ring', cx: x, cy: y, r: radius, ...looks });
  metres.append(ring);
  ring.animate([{ r: 0.3 * radius, opacity: 1 }, { r: radius, opacity: 0.2 }], 400).finished.finally(() => ring.remove());
}

// Return `draw(ms, plays)`, which puts all to a time of the run, and returns what is seen then, and
// `flash(x, y, colour)`, which lets a ring grow around a place (m). `run` is what drive.js returns of the
// record, whose rows may still grow.
export function floor(svg, run, record) {
  const find = name => svg.querySelector(`.${name}`);
  const [robot, driven, fan, old, seconds, bumps] = ['robot', 'driven', 'fan', 'old', 'seconds', 'bumps'].map(find);
  const inPixels = robot.parentNode.transform.baseVal.consolidate().matrix;
  const r = +robot.querySelector('circle').getAttribute('r');
  const arm = 7 / inPixels.a;
  const circle = `a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`;
  const ghost = shape('text', { class: 'ghost' });
  const places = [...svg.querySelectorAll('.place')].map(ring => ({ ring, at: ['cx', 'cy', 'r'].map(name => +ring.getAttribute(name)) }));
  const ended = record.id === undefined ? run.times.at(-1) / 1000 : Infinity; // ms; not yet
  const mine = run.kept && placeKind.yours(svg, record.guess);
  let [second, hits] = [0, 0];
  let scale = 1; // pixels on the screen of one of the picture
  let now; // what is seen
  let measure = () => {};

  // A dot for each second, and a cross where it hit something.
  const dot = ({ x, y }) => `M${x.toFixed(2)} ${y.toFixed(2)}h0`;
  const front = ({ x, y, yaw }) => [x + r * Math.cos(yaw), y + r * Math.sin(yaw)];
  const cross = ([x, y]) => `M${x.toFixed(3)} ${y.toFixed(3)}m${-arm} ${-arm}l${2 * arm} ${2 * arm}m0 ${-2 * arm}l${-2 * arm} ${2 * arm}`;

  const flash = (x, y, stroke) => ringAt(robot.parentNode, x, y, 30 / (scale * inPixels.a), stroke);

  // Places to which it has come are filled.
  function fill(place) {
    const [cx, cy, near] = place.at;
    if (!(place.came >= 0)) place.came = record.poses.findIndex(([x, y]) => Math.hypot(x - cx, y - cy) < near);
    place.ring.setAttribute('fill-opacity', place.came >= 0 && place.came <= now.till ? 0.35 : 0);
  }

  // What the dashed robot is, beside it: the real age of what the brake acts on. To measure a text lays
  // out the page, so one of each length is measured.
  let halves = {};
  function label() {
    const { was, age } = now;
    ghost.textContent = now.old ? `the brake sees this, ${age.toFixed(1)} s ago` : '';
    if (!now.old) return;
    const { x, y } = new DOMPoint(was.x, was.y + 1.3 * r).matrixTransform(inPixels);
    const half = (halves[ghost.textContent.length] ??= ghost.getComputedTextLength() / 2);
    ghost.setAttribute('x', Math.min(Math.max(x, half + 8), svg.viewBox.baseVal.width - half - 8).toFixed(1));
    ghost.setAttribute('y', record.strip ? 26 : Math.max(y - 6, 30).toFixed(1));
  }

  function draw(ms, plays) {
    now = run.look(ms);
    const { x, y, yaw, was } = now;
    robot.setAttribute('transform', `translate(${x.toFixed(3)} ${y.toFixed(3)})`);
    robot.firstChild.setAttribute('transform', `rotate(${(yaw * 180 / Math.PI).toFixed(1)})`);
    driven.setAttribute('d', `M${run.points.slice(0, now.till + 1).join('L')}L${x.toFixed(3)} ${y.toFixed(3)}`);
    fan.setAttribute('d', now.fan);
    old.setAttribute('d', now.old && `${now.old}M${was.x - r} ${was.y}${circle}`);
    label();
    places.forEach(fill);
    const bumped = record.bumps.filter(at => at <= ms);
    if (plays && bumped.length > hits) flash(...front(now), bumps.getAttribute('stroke'));
    if (bumped.length !== hits || second !== Math.floor(ms / 1000) || !plays) {
      [second, hits] = [Math.floor(ms / 1000), bumped.length];
      seconds.setAttribute('d', Array.from({ length: second + 1 }, (_, i) => dot(run.pose(1000 * i))).join(''));
      bumps.setAttribute('d', bumped.map(at => cross(front(run.pose(at)))).join(''));
    }
    measure = () => mine?.measure(ms >= (record.bumps[0] ?? ended) - 1 ? now : null);
    measure();
    return now;
  }

  // Your robot, once you have put it somewhere: also elsewhere on this page.
  function guessed() {
    const value = run.kept.get();
    mine.node.style.display = value === null ? 'none' : '';
    if (value !== null) mine.put(value);
    measure();
  }

  find('all').setAttribute('stroke-opacity', '.3');
  svg.append(ghost);
  legible(svg, found => {
    scale = found;
    halves = {};
    if (now) label();
  });
  if (mine) {
    guessed();
    document.addEventListener('guess', ({ detail }) => {
      if (detail.question !== record.guess.question || !svg.isConnected) return;
      run.kept.see(detail.value);
      guessed();
    });
  }
  return { draw, flash };
}

// The floor and three values below it: what view.js shows of a drive.
export function drivePanel(run, record, svg) {
  const { draw: put } = floor(svg, run, record);
  const [time, robot, told] = Array.from({ length: 3 }, () => element('span', { class: 'replay-time' }));
  const name = (text, kind) => (text ? [element('b', { class: kind }, text)] : []);
  const node = element('div', { class: record.strip ? 'replay-floor replay-lane' : 'replay-floor' },
    ...name(record.name), ...name(record.label, 'replay-label'), svg,
    row('time', time), row('robot', robot), row('told', told));

  function draw(position, us, plays) {
    const now = put(us / 1000, plays);
    time.textContent = `${(us / 1e6).toFixed(2)} s`;
    robot.textContent = `${now.v.toFixed(2)} m/s, ${now.w.toFixed(2)} rad/s`;
    told.textContent = now.told;
  }

  return { node, draw, pass: us => draw(0, us, true) };
}
