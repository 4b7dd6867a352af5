// The boxes and arrows of circle.js, on a ring.

const [RING_WIDE, RING_HIGH] = [340, 260]; // pixels, of up to five boxes: letters keep their size on a phone
const LETTERS = 17; // of a line in a box
const NEAR = 14; // of one beside the middle

// Return the node of the picture, and `draw(now, last)`: what circle.js returns of this state, and of
// the end. Only the boxes of the circle have a place, or those of a chain that is open.
function ring() {
  const draws = (tag, attributes, ...children) => {
    const made = document.createElementNS('http://www.w3.org/2000/svg', tag);
    Object.entries(attributes).forEach(([name, value]) => made.setAttribute(name, value));
    made.append(...children);
    return made;
  };
  const text = (words, x, y, kind) => draws('text', { x, y, class: kind }, words);
  const node = element('div', { class: 'ring' });
  let known; // the arrows that are drawn already

  // It begins with a capital letter, but a name of code keeps its letters.
  const sentence = says => (/^\w+\(\)/.test(says) ? says : says[0].toUpperCase() + says.slice(1));

  // A word with a space behind it. One that is too long for a line is cut behind a dot, a _ or a /.
  const cut = word => (word.length > LETTERS ? `${word} `.match(/[^._/]*[._/]|.+$/g) : [`${word} `]);

  function lines(name, most) {
    const found = [''];
    name.split(' ').flatMap(cut).forEach(part => {
      const longer = found.at(-1) + part;
      if (longer.trim().length <= most || !found.at(-1)) found[found.length - 1] = longer;
      else found.push(part);
    });
    return found.map(line => line.trim());
  }

  // Where a line from the middle of a box to a point leaves the box, and a little more.
  function edge({ x, y, w, h }, to, gap) {
    const [dx, dy] = [to.x - x, to.y - y];
    const part = Math.min((w / 2 + gap) / Math.abs(dx || 1e-9), (h / 2 + gap) / Math.abs(dy || 1e-9), 1);
    return [x + part * dx, y + part * dy];
  }

  function drawArrow({ label, hot }, from, to, isNew) {
    const [[x1, y1], [x2, y2]] = [edge(from, to, 2), edge(to, from, 4)];
    const angle = Math.atan2(y2 - y1, x2 - x1);
    const at = (along, aside) => `${(x2 - along * Math.cos(angle) - aside * Math.sin(angle)).toFixed(1)} ${(y2 - along * Math.sin(angle) + aside * Math.cos(angle)).toFixed(1)}`;
    const head = hot ? 13 : 10;
    return draws('g', { class: `${hot ? 'ring-hot' : 'ring-arrow'}${isNew ? ' ring-new' : ''}` },
      draws('path', { class: 'ring-line', pathLength: 1, d: `M${x1.toFixed(1)} ${y1.toFixed(1)}L${at(head - 2, 0)}` }),
      draws('path', { class: 'ring-head', d: `M${at(0, 0)}L${at(head, head / 2)}L${at(head, -head / 2)}z` }),
      text(label, ((x1 + x2) / 2).toFixed(1), ((y1 + y2) / 2 + 4).toFixed(1), 'ring-label'));
  }

  function draw(now, last = now) {
    node.replaceChildren();
    const all = placed(last);
    if (!all.length) return;
    const tall = RING_HIGH + 90 * Math.max(0, all.length - 5);
    const places = new Map(all.map((box, i) => {
      // Of three, two are above each other: there is room for the words of the arrows.
      const turn = 2 * Math.PI * (i / all.length - (all.length === 3 ? 1 / 3 : 1 / 4));
      const words = lines(box.name, Math.abs(Math.sin(turn)) < 0.5 ? NEAR : LETTERS);
      const [w, h] = [Math.max(...words.map(line => line.length)) * 7.3 + 16, 16 * words.length + 10];
      const x = all.length === 3 ? [85, 278, 85][i] : RING_WIDE / 2 + 105 * Math.cos(turn);
      const y = tall / 2 + (tall - 62) / 2 * Math.sin(turn) * (all.length === 3 ? 1.15 : 1);
      const inside = (at, size, whole) => Math.max(size / 2 + 2, Math.min(at, whole - size / 2 - 2));
      return [box.id, { x: inside(x, w, RING_WIDE), y: inside(y, h, tall), w, h, words }];
    }));
    const here = now.boxes.filter(({ id }) => places.has(id));
    const arrows = now.arrows.filter(({ from, to }) => places.has(from) && places.has(to));
    const closed = now.stuck.length > 0;
    const drawn = arrows.map(one => drawArrow(one, places.get(one.from), places.get(one.to), known && !known.has(sameArrow(one))));
    known = new Set(arrows.map(sameArrow));
    const boxes = here.map(({ id }) => {
      const { x, y, w, h, words } = places.get(id);
      const hot = arrows.some(one => one.hot && (one.from === id || one.to === id));
      const kind = `ring-box ring-${id.split(' ')[0]}${hot ? ' ring-on' : ''}`;
      return draws('g', { class: kind },
        draws('rect', { x: x - w / 2, y: y - h / 2, width: w, height: h, rx: id.startsWith('run') ? 4 : h / 2 }),
        ...words.map((line, i) => text(line, x, y + 4 + 16 * (i - (words.length - 1) / 2))));
    });
    const result = closed ? ['Nobody', 'can go on'] : now.isOpen ? ['The circle', 'is open'] : [];
    const middle = result.map((line, i) =>
      text(line, all.length === 3 ? 162 : RING_WIDE / 2, tall / 2 + 18 * i - 2, 'ring-closed'));
    const words = [...arrows.map(({ says }) => sentence(says)), ...(result.length ? [result.join(' ')] : [])].join('. ');
    node.replaceChildren(seen(draws('svg', { viewBox: `0 0 ${RING_WIDE} ${tall}` }, ...drawn, ...boxes, ...middle),
      words ? `${words}.` : 'Nobody holds or waits for anything.'));
  }

  return { node, draw };
}
