// The boxes and arrows of circle.js, on a ring.

import { placed, sameArrow } from './circle.js';
import { change, element, seen, shape } from './element.js';
import { keep } from './keep.js';
import { model } from './model.js';

// Pixels, of up to five boxes, and how much higher it is for each further one: letters keep their size on a phone.
const [RING_WIDE, RING_HIGH, MORE] = [340, 260, 90];
const LETTERS = 17; // of a line in a box
const NEAR = 14; // of one beside the middle

const text = (words, x, y, kind) => shape('text', { x, y, class: kind }, words);

// It begins with a capital letter, but a name of code keeps its letters.
const sentence = says => (/^\w+\(\)/.test(says) ? says : model.capital(says));

// A word with a space behind it. One that is too long for a line is cut behind a dot, a _ or a /.
const cut = word => (word.length > LETTERS ? `${word} `.match(/[^._/]*[._/]|.+$/g) : [`${word} `]);

// The lines of a name in a box.
function lines(name, most) {
  const found = [''];
  name.split(' ').flatMap(cut).forEach(part => {
    const longer = found.at(-1) + part;
    if (longer.trim().length <= most || !found.at(-1)) found[found.length - 1] = longer;
    else found.push(part);
  });
  return found.map(line => line.trim());
}

// Where all boxes are. Of three, two are above each other: there is room for the words of the arrows.
function placesOf(boxes, high) {
  return new Map(boxes.map((box, i) => {
    const three = boxes.length === 3;
    const turn = 2 * Math.PI * (i / boxes.length - (three ? 1 / 3 : 1 / 4));
    const words = lines(box.name, Math.abs(Math.sin(turn)) < 0.5 ? NEAR : LETTERS);
    const [w, h] = [Math.max(...words.map(line => line.length)) * 7.3 + 16, 16 * words.length + 10];
    const x = three ? [85, 278, 85][i] : RING_WIDE / 2 + 105 * Math.cos(turn);
    const y = high / 2 + (high - 62) / 2 * Math.sin(turn) * (three ? 1.15 : 1);
    const inside = (at, size, whole) => Math.max(size / 2 + 2, Math.min(at, whole - size / 2 - 2));
    return [box.id, { x: inside(x, w, RING_WIDE), y: inside(y, h, high), w, h, words }];
  }));
}

// Where a line from the middle of a box to a point leaves the box, and a little more.
function edge({ x, y, w, h }, to, gap) {
  const [dx, dy] = [to.x - x, to.y - y];
  const part = Math.min((w / 2 + gap) / Math.abs(dx || 1e-9), (h / 2 + gap) / Math.abs(dy || 1e-9), 1);
  return [x + part * dx, y + part * dy];
}

// An arrow without a place yet, and a box. To lay out letters takes time, so each is made once.
const arrowOf = label => shape('g', {},
  shape('path', { class: 'ring-line', pathLength: 1 }), shape('path', { class: 'ring-head' }), text(label, 0, 0, 'ring-label'));

const boxOf = (id, { x, y, w, h, words }) => shape('g', {},
  shape('rect', { x: x - w / 2, y: y - h / 2, width: w, height: h, rx: id.startsWith('run') ? 4 : h / 2 }),
  ...words.map((line, i) => text(line, x, y + 4 + 16 * (i - (words.length - 1) / 2))));

function putArrow(node, from, to, hot, isNew) {
  const [[x1, y1], [x2, y2]] = [edge(from, to, 2), edge(to, from, 4)];
  const angle = Math.atan2(y2 - y1, x2 - x1);
  const at = (along, aside) => `${(x2 - along * Math.cos(angle) - aside * Math.sin(angle)).toFixed(1)} ${(y2 - along * Math.sin(angle) + aside * Math.cos(angle)).toFixed(1)}`;
  const head = hot ? 13 : 10;
  const [line, point, words] = node.children;
  change(node, { class: `${hot ? 'ring-hot' : 'ring-arrow'}${isNew ? ' ring-new' : ''}` });
  change(line, { d: `M${x1.toFixed(1)} ${y1.toFixed(1)}L${at(head - 2, 0)}` });
  change(point, { d: `M${at(0, 0)}L${at(head, head / 2)}L${at(head, -head / 2)}z` });
  change(words, { x: ((x1 + x2) / 2).toFixed(1), y: ((y1 + y2) / 2 + 4).toFixed(1) });
}

// Return the node of the picture, and `draw(now, last)`: what circle.js returns of this state, and of
// the end. Only the boxes of the circle have a place, or those of a chain that is open.
export function ring() {
  const svg = shape('svg');
  const node = element('div', { class: 'ring', hidden: '' }, svg);
  let known; // the arrows that are drawn already

  function draw(now, last = now) {
    const all = placed(last);
    node.hidden = !all.length;
    if (node.hidden) return;
    const high = RING_HIGH + MORE * Math.max(0, all.length - 5);
    const places = placesOf(all, high);
    change(svg, { viewBox: `0 0 ${RING_WIDE} ${high}` });
    const arrows = now.arrows.filter(({ from, to }) => places.has(from) && places.has(to));
    const result = now.stuck.length ? ['Nobody', 'can go on'] : now.isOpen ? ['The circle', 'is open'] : [];
    const middle = all.length === 3 ? 162 : RING_WIDE / 2;
    keep(svg, [
      ...arrows.map(({ label, from, to }) => ['arrow', label, from, to]),
      ...all.map(({ id }) => ['box', id, places.get(id)]),
      ...result.map((line, i) => ['result', line, high / 2 + 18 * i - 2]),
    ], ([kind, what, where]) => {
      if (kind === 'arrow') return arrowOf(what);
      return kind === 'box' ? boxOf(what, where) : text(what, middle, where, 'ring-closed');
    });

    arrows.forEach((one, i) => putArrow(svg.children[i], places.get(one.from), places.get(one.to), one.hot, known && !known.has(sameArrow(one))));
    all.forEach(({ id }, i) => {
      const isOn = arrows.some(one => one.hot && (one.from === id || one.to === id));
      const isHere = now.boxes.some(box => box.id === id);
      change(svg.children[arrows.length + i], { class: `ring-box ring-${id.split(' ')[0]}${isOn ? ' ring-on' : ''}`, visibility: isHere ? 'visible' : 'hidden' });
    });
    known = new Set(arrows.map(sameArrow));
    const words = [...arrows.map(({ says }) => sentence(says)), ...(result.length ? [result.join(' ')] : [])].join('. ');
    seen(svg, words ? `${words}.` : 'Nobody holds or waits for anything.');
  }

  return { node, draw };
}
