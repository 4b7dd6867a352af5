// A guess of a place: your robot on the way that it drives. `said` and `gap` need no page. A value is
// the distance (m) from the middle of the robot to what is ahead.
const placeKind = (() => {
  const STEP = 0.05; // m, of a key
  const RIGHT = 0.1; // m: so near, a guess is right

  const hits = ({ radius }, value) => value <= radius + 0.005;
  const said = (record, value) => (hits(record, value) ? 'it hits the wall.' : `it stops ${value.toFixed(2)} m before the wall.`);

  // What came out: `at`, whether it `hit` something, what, and the `cause`, a sentence or ''.
  function gap(record, value, { at, hit, what, cause }) {
    const far = Math.abs(value - at);
    const right = far <= RIGHT && hits(record, value) === hit;
    const end = hit ? `it hit ${what}` : `it stands ${at.toFixed(2)} m before ${what}`;
    const way = value > at ? 'further than' : 'short of what';
    const wrong = hit ? `It is in ${what}, ${far.toFixed(2)} m further than you said.`
      : `It stands ${at.toFixed(2)} m before ${what}, ${far.toFixed(2)} m ${way} you said.`;
    return { right, says: [right ? `Right: ${end}.` : wrong, cause].filter(Boolean).join(' ') };
  }

  // Return your robot in a picture of the floor, a line before the wall, and `put(value)`, and
  // `measure(pose)`, which draws the bracket from your robot to the real one; without a pose, none.
  function yours(svg, record) {
    const { start: [x0, y0, yaw], ahead, radius, line, label } = record;
    const group = svg.querySelector('.robot').parentNode;
    const scale = group.transform.baseVal.consolidate().matrix.a;
    const r = +svg.querySelector('.robot circle').getAttribute('r');
    const along = (value, side = 0) => [
      x0 + (ahead - value) * Math.cos(yaw) - side * Math.sin(yaw),
      y0 + (ahead - value) * Math.sin(yaw) + side * Math.cos(yaw),
    ];
    const make = (name, attributes, ...children) => {
      const made = document.createElementNS(svg.namespaceURI, name);
      Object.entries({ 'vector-effect': 'non-scaling-stroke', ...attributes }).forEach(([key, one]) => made.setAttribute(key, one));
      made.append(...children);
      return made;
    };
    const text = (words, kind) => make('text', { class: kind, transform: `scale(${1 / scale} ${-1 / scale})`, 'text-anchor': 'middle' }, words);
    const at = (node, [x, y]) => node.setAttribute('transform', `translate(${x.toFixed(3)} ${y.toFixed(3)})`);
    if (line) {
      const [from, to] = [along(line, 0.5), along(line, -0.5)];
      const words = text(label, 'line-label');
      words.setAttribute('y', 18);
      words.setAttribute('fill', 'currentColor');
      const sign = make('g', {}, words);
      at(sign, to);
      group.prepend(make('path', { class: 'line', d: `M${from.join(' ')}L${to.join(' ')}`, stroke: 'currentColor', 'stroke-width': 2, 'stroke-dasharray': '3 6' }), sign);
    }
    const turned = make('g', { transform: `rotate(${yaw * 180 / Math.PI})` },
      make('circle', { r: Math.max(r, 0.22), fill: 'transparent' }),
      make('circle', { class: 'you-round', r, fill: 'var(--look-you)', 'fill-opacity': 0.25, stroke: 'var(--look-you)', 'stroke-width': 3 }),
      make('path', { d: `M${0.68 * r} 0L${-0.42 * r} ${0.52 * r}L${-0.18 * r} 0L${-0.42 * r} ${-0.52 * r}z`, fill: 'var(--look-you)' }));
    const name = text('you', 'you-label');
    name.setAttribute('y', scale * r + 20);
    const you = make('g', { class: 'you' }, turned, name);
    const bracket = make('path', { class: 'gap', d: '', fill: 'none', stroke: 'var(--look-lost)', 'stroke-width': 4 });
    const far = text('', 'gap-label');
    const number = make('g', {}, far);
    group.append(you, bracket, number);
    let now = null;

    // The robots of a class, one beside the other. Those who were right light up at the end.
    const ghosts = make('g', { class: 'class' });
    group.insertBefore(ghosts, svg.querySelector('.robot'));
    let stands = null;
    classOf(record, values => {
      ghosts.replaceChildren(...values.filter(Number.isFinite).map((value, i) => {
        const [cx, cy] = along(Math.max(value, radius), ((i * 37) % 9 - 4) * 0.1);
        const ghost = make('circle', { cx, cy, r: r / 2, fill: 'var(--look-you)' });
        ghost.dataset.at = value;
        return ghost;
      }));
      light();
    });

    function light() {
      const outcome = stands && { at: metres(stands), hit: hits(record, metres(stands)), what: '', cause: '' };
      ghosts.childNodes.forEach(ghost => {
        const isRight = outcome && gap(record, +ghost.dataset.at, outcome).right;
        ghost.setAttribute('fill', isRight ? 'var(--look-robot)' : 'var(--look-you)');
        ghost.setAttribute('fill-opacity', isRight ? 1 : 0.6);
      });
    }

    function put(value) {
      now = value;
      at(you, along(value ?? ahead / 2));
      name.textContent = value === null ? 'you?' : 'you';
      you.style.display = '';
    }

    const metres = ({ x, y }) => ahead - (x - x0) * Math.cos(yaw) - (y - y0) * Math.sin(yaw);

    function measure(pose) {
      bracket.setAttribute('d', '');
      far.textContent = '';
      stands = pose;
      light();
      if (!pose || now === null) return;
      const real = metres(pose);
      if (Math.abs(real - now) < RIGHT / 2) return;
      const side = 1.9 * r;
      const end = value => `M${along(value, side - 0.06).join(' ')}L${along(value, side + 0.06).join(' ')}`;
      bracket.setAttribute('d', `${end(now)}${end(real)}M${along(now, side).join(' ')}L${along(real, side).join(' ')}`);
      far.textContent = `${Math.abs(real - now).toFixed(2)} m`;
      at(number, along((real + now) / 2, side + 0.1));
    }

    return { node: you, put, measure, valueAt: ({ clientX, clientY }) => {
      return metres(new DOMPoint(clientX, clientY).matrixTransform(group.getScreenCTM().inverse()));
    } };
  }

  function draw(record, image, set) {
    const svg = legible(drawing(image));
    const { node: you, put, valueAt } = yours(svg, record);
    const { ahead, radius } = record;
    // A screen reader hears one slider, and the picture's words before it.
    svg.setAttribute('role', 'group');
    const looks = { tabindex: 0, role: 'slider', 'aria-label': 'Your robot: metres before the wall', 'aria-valuemin': radius, 'aria-valuemax': ahead };
    Object.entries(looks).forEach(([name, one]) => you.setAttribute(name, one));
    let now = null;
    const to = value => set(+Math.min(Math.max(value, radius), ahead).toFixed(2));
    const point = event => to(valueAt(event));
    svg.addEventListener('pointerdown', event => {
      svg.setPointerCapture(event.pointerId);
      you.focus({ preventScroll: true });
      point(event);
    });
    svg.addEventListener('pointermove', event => event.buttons && point(event));
    const KEYS = { ArrowRight: -STEP, ArrowUp: -STEP, ArrowLeft: STEP, ArrowDown: STEP };
    you.addEventListener('keydown', event => {
      const end = { Home: ahead, End: radius }[event.key];
      if (!(event.key in KEYS) && end === undefined) return;
      event.preventDefault();
      to(end ?? (now ?? ahead / 2) + KEYS[event.key]);
    });

    return { node: element('div', { class: 'replay-floor' }, svg), put(value) {
      now = value;
      put(value);
      you.setAttribute('aria-valuenow', (value ?? ahead / 2).toFixed(2));
      you.setAttribute('aria-valuetext', value === null ? 'not yet' : said(record, value));
    } };
  }

  return { said, gap, draw, yours };
})();
