// A guess of a place: your robot on the way that it drives, or your point on a floor. `said` and `gap`
// need no page.
const placeKind = (() => {
  const STEP = 0.05; // m, of a key
  const RIGHT = 0.1; // m: so near, a guess is right
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
  const round = value => +value.toFixed(2);
  const sentence = (...parts) => parts.filter(Boolean).join(' ');

  // Where on the floor a point is that the robot sees from its start, x ahead and y to its left; and back.
  const onFloor = ({ start: [x0, y0, yaw] }, [x, y]) => [
    x0 + x * Math.cos(yaw) - y * Math.sin(yaw), y0 + x * Math.sin(yaw) + y * Math.cos(yaw)];
  const fromRobot = ({ start: [x0, y0, yaw] }, [x, y]) => [
    (x - x0) * Math.cos(yaw) + (y - y0) * Math.sin(yaw), (y - y0) * Math.cos(yaw) - (x - x0) * Math.sin(yaw)];

  const hits = ({ radius }, value) => value <= radius + 0.005;

  // On its way a value is the distance (m) from the middle of the robot to what is ahead.
  const way = {
    fits: Number.isFinite,
    unset: ({ ahead }) => ahead / 2,
    at: (record, value, side = 0) => onFloor(record, [record.ahead - value, side]),
    valueAt: (record, point) => record.ahead - fromRobot(record, point)[0],
    within: ({ ahead, radius }, value) => round(clamp(value, radius, ahead)),
    slider: ({ ahead, radius }, value) => ({
      'aria-label': 'Your robot: metres before the wall', 'aria-valuemin': radius, 'aria-valuemax': ahead, 'aria-valuenow': value.toFixed(2) }),
    key({ ahead, radius }, key, value) {
      const step = { ArrowRight: -STEP, ArrowUp: -STEP, ArrowLeft: STEP, ArrowDown: STEP }[key];
      return { Home: ahead, End: radius }[key] ?? (step && value + step);
    },
    said: (record, value) => (hits(record, value) ? 'it hits the wall.' : `it stops ${value.toFixed(2)} m before the wall.`),
    // What came out: `at`, whether it `hit` something, what, and the `cause`, a sentence or ''.
    gap(record, value, { at, hit, what, cause }) {
      const end = hit ? `it hit ${what}` : `it stands ${at.toFixed(2)} m before ${what}`;
      if (value === null) return { right: false, says: sentence(`I${end.slice(1)}.`, cause) };
      const far = Math.abs(value - at);
      const right = far <= RIGHT && hits(record, value) === hit;
      const side = value > at ? 'further than' : 'short of what';
      const wrong = hit ? `It is in ${what}, ${far.toFixed(2)} m further than you said.`
        : `It stands ${at.toFixed(2)} m before ${what}, ${far.toFixed(2)} m ${side} you said.`;
      return { right, says: sentence(right ? `Right: ${end}.` : wrong, cause) };
    },
  };

  const words = ([x, y]) => {
    const ahead = Math.abs(x) >= 0.005 && `${Math.abs(x).toFixed(2)} m ${x > 0 ? 'ahead of' : 'behind'} the start`;
    const side = Math.abs(y) >= 0.005 && `${Math.abs(y).toFixed(2)} m to ${ahead ? 'its' : "the start's"} ${y > 0 ? 'left' : 'right'}`;
    return [ahead, side].filter(Boolean).join(', ') || 'where the robot starts';
  };

  // On a plane a value is [x, y] (m), as the robot sees it from its start.
  const plane = {
    fits: Array.isArray,
    // In a corner: a point in the middle would be a hint.
    unset: record => fromRobot(record, [[2, 0], [1, 3]].map(([edge, other]) => 0.9 * record.plane[edge] + 0.1 * record.plane[other])),
    at: onFloor,
    valueAt: fromRobot,
    within(record, value) {
      const [left, low, right, high] = record.plane;
      const [x, y] = onFloor(record, value);
      return fromRobot(record, [clamp(x, left, right), clamp(y, low, high)]).map(round);
    },
    slider: (record, [x]) => ({ 'aria-label': 'Your point: metres from the start', 'aria-valuenow': x.toFixed(2) }),
    key(record, key, value) {
      if (key === 'Home') return [0, 0];
      const step = { ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowLeft: [-STEP, 0], ArrowDown: [0, -STEP] }[key];
      return step && fromRobot(record, onFloor(record, value).map((one, i) => one + step[i])); // as the picture has it
    },
    said: (record, value) => `it is ${words(value)}.`,
    // What came out: `at`, the `path` that led there, and the `tolerance` (m).
    gap(record, value, { at, tolerance }) {
      if (value === null) return { right: false, says: `It is ${words(at)}.` };
      const far = Math.hypot(value[0] - at[0], value[1] - at[1]);
      const right = far <= Math.max(tolerance, RIGHT);
      return { right, says: right ? `Right: it is ${words(at)}.` : `It is ${words(at)}: ${far.toFixed(2)} m from your point.` };
    },
  };

  const kindOf = record => (record.plane ? plane : way);
  const said = (record, value) => kindOf(record).said(record, value);
  const gap = (record, value, outcome) => kindOf(record).gap(record, value, outcome);

  // Return what is yours in a picture of the floor, your robot or your point, and `put(value)`, and
  // `measure(pose)`, which draws the bracket from there to the real one; without a pose, none.
  function yours(svg, record) {
    const kind = kindOf(record);
    const group = svg.querySelector('.robot').parentNode;
    const scale = group.transform.baseVal.consolidate().matrix.a;
    const r = +svg.querySelector('.robot circle').getAttribute('r');
    const along = (value, side) => kind.at(record, value, side);
    const make = (name, attributes, ...children) => {
      const made = document.createElementNS(svg.namespaceURI, name);
      Object.entries({ 'vector-effect': 'non-scaling-stroke', ...attributes }).forEach(([key, one]) => made.setAttribute(key, one));
      made.append(...children);
      return made;
    };
    const text = (words, kind) => make('text', { class: kind, transform: `scale(${1 / scale} ${-1 / scale})`, 'text-anchor': 'middle' }, words);
    const at = (node, [x, y]) => node.setAttribute('transform', `translate(${x.toFixed(3)} ${y.toFixed(3)})`);
    const path = points => `M${points.map(point => point.map(one => one.toFixed(3)).join(' ')).join('L')}`;

    // A line before the wall, or points that have a name.
    function sign(label, where, ...drawn) {
      const words = text(label, 'line-label');
      words.setAttribute('dy', '1.1em');
      words.setAttribute('fill', 'currentColor');
      const made = make('g', {}, words);
      at(made, where);
      group.prepend(...drawn, made);
    }
    if (record.line) {
      const [from, to] = [along(record.line, 0.5), along(record.line, -0.5)];
      sign(record.label, to, make('path', { class: 'line', d: path([from, to]), stroke: 'currentColor', 'stroke-width': 2, 'stroke-dasharray': '3 6' }));
    }
    for (const [name, point] of Object.entries(record.marks ?? {})) {
      const arm = 7 / scale;
      const [x, y] = along(point);
      sign(name, [x, y - arm], make('path', { class: 'mark', d: `M${x - arm} ${y}h${2 * arm}M${x} ${y - arm}v${2 * arm}`, stroke: 'currentColor', 'stroke-width': 3 }));
    }

    const round = { class: 'you-round', fill: 'var(--look-you)', 'fill-opacity': 0.25, stroke: 'var(--look-you)', 'stroke-width': 3 };
    const shape = record.plane
      ? [make('circle', { ...round, r: 10 / scale }), make('circle', { r: 3 / scale, fill: 'var(--look-you)' })]
      : [make('circle', { ...round, r }), make('path', { d: `M${0.68 * r} 0L${-0.42 * r} ${0.52 * r}L${-0.18 * r} 0L${-0.42 * r} ${-0.52 * r}z`, fill: 'var(--look-you)' })];
    const turned = make('g', { transform: `rotate(${record.start[2] * 180 / Math.PI})` },
      make('circle', { r: Math.max(r, 22 / scale), fill: 'transparent' }), ...shape);
    const name = text('you', 'you-label');
    name.setAttribute('y', record.plane ? 12 : scale * r + 4);
    name.setAttribute('dy', '1em');
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
      ghosts.replaceChildren(...values.filter(kind.fits).map((value, i) => {
        const aside = ((i * 37) % 9 - 4) * 0.1;
        const [cx, cy] = record.plane ? along(value).map((one, axis) => one + [aside, ((i * 37) % 7 - 3) * 0.1][axis] * 24 / scale)
          : along(Math.max(value, record.radius), aside);
        const ghost = make('circle', { cx, cy, r: record.plane ? 9 / scale : r / 2, fill: 'var(--look-you)' });
        ghost.dataset.at = JSON.stringify(value);
        return ghost;
      }));
      light();
    });

    function light() {
      const value = stands && kind.valueAt(record, [stands.x, stands.y]);
      const outcome = stands && { hit: hits(record, value), what: '', cause: '', ...record.outcome, at: value };
      ghosts.childNodes.forEach(ghost => {
        const isRight = outcome && gap(record, JSON.parse(ghost.dataset.at), outcome).right;
        ghost.setAttribute('fill', isRight ? 'var(--look-robot)' : 'var(--look-you)');
        ghost.setAttribute('fill-opacity', isRight ? 1 : 0.6);
        ghost.classList.toggle('right', Boolean(isRight));
      });
    }

    function put(value) {
      now = value;
      const where = along(value ?? kind.unset(record));
      at(you, where);
      if (record.plane) { // its word stays inside the floor
        const isLow = where[1] - record.plane[1] < 40 / scale;
        name.setAttribute('y', isLow ? -16 : 12);
        name.setAttribute('dy', isLow ? 0 : '1em');
      }
      name.textContent = value === null ? 'you?' : 'you';
      you.style.display = value === null && record.outcome ? 'none' : '';
    }

    function measure(pose) {
      bracket.setAttribute('d', '');
      far.textContent = '';
      stands = pose;
      light();
      if (!pose || now === null) return;
      const real = kind.valueAt(record, [pose.x, pose.y]);
      // On a way the bracket is beside it.
      const side = record.plane ? 0 : 1.9 * r;
      const [from, to] = [along(now, side), along(real, side)];
      const wide = Math.hypot(to[0] - from[0], to[1] - from[1]);
      if (wide < RIGHT / 2) return;
      const [x, y] = [(to[0] - from[0]) / wide, (to[1] - from[1]) / wide];
      const tick = 0.06 * (record.plane ? 100 / scale : 1);
      const end = ([atX, atY]) => path([[atX - tick * y, atY + tick * x], [atX + tick * y, atY - tick * x]]);
      bracket.setAttribute('d', `${end(from)}${end(to)}${path([from, to])}`);
      far.textContent = `${wide.toFixed(2)} m`;
      const middle = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2];
      if (!record.plane) {
        at(number, along((real + now) / 2, side + 0.1));
        return;
      }
      // Above a flat line, and else to the right of it, where the line is not.
      const flat = Math.abs(y) < 0.3 * Math.abs(x);
      far.setAttribute('text-anchor', flat ? 'middle' : 'start');
      far.setAttribute('dy', flat ? '-0.5em' : x * y > 0 ? '1em' : '-0.2em');
      at(number, [middle[0] + (flat ? 0 : 9 / scale), middle[1]]);
    }

    // What came out, if no drive shows it: the path, and where it ends.
    function came({ at: real, path: points }) {
      if (points) {
        group.insertBefore(make('path', { class: 'came-path', d: path(points.map(point => along(point))), fill: 'none', stroke: 'var(--look-robot)', 'stroke-width': 3 }), you);
        const [cx, cy] = along(real);
        group.insertBefore(make('circle', { class: 'came-out', cx, cy, r: 9 / scale, fill: 'var(--look-robot)', stroke: 'var(--jp-layout-color1, Canvas)', 'stroke-width': 2 }), you);
      }
      const [x, y] = along(real);
      if (!points) at(svg.querySelector('.robot'), [x, y]);
      return { x, y };
    }

    return { node: you, put, measure, came, valueAt: ({ clientX, clientY }) => {
      const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(group.getScreenCTM().inverse());
      return kind.valueAt(record, [x, y]);
    } };
  }

  function draw(record, image, set) {
    const svg = legible(drawing(image));
    const kind = kindOf(record);
    const { node: you, put, measure, came, valueAt } = yours(svg, record);
    // A screen reader hears one slider, and the picture's words before it.
    svg.setAttribute('role', 'group');
    you.setAttribute('role', 'slider');
    const pose = record.outcome && came(record.outcome);
    let now = null;
    const to = value => set(kind.within(record, value));
    if (!pose) {
      you.setAttribute('tabindex', 0);
      svg.addEventListener('pointerdown', event => {
        svg.setPointerCapture(event.pointerId);
        you.focus({ preventScroll: true });
        to(valueAt(event));
      });
      svg.addEventListener('pointermove', event => event.buttons && to(valueAt(event)));
      you.addEventListener('keydown', event => {
        const moved = kind.key(record, event.key, now ?? kind.unset(record));
        if (moved === undefined) return;
        event.preventDefault();
        to(moved);
      });
    }

    return { node: element('div', { class: record.plane ? 'replay-floor guess-floor' : 'replay-floor' }, svg), put(value) {
      now = value;
      put(value);
      if (pose) measure(pose);
      Object.entries(kind.slider(record, value ?? kind.unset(record))).forEach(([name, one]) => you.setAttribute(name, one));
      you.setAttribute('aria-valuetext', value === null ? 'not yet' : said(record, value));
    } };
  }

  return { said, gap, draw, yours };
})();
