// A level: a number on an axis. `said` and `gap` need no page.
const levelKind = (() => {
  const [TALL, LEFT, RIGHT, LINE] = [144, 60, 40, 84];
  const [DOT, STACK, ROOM] = [12, 132, 24]; // a student of the class; how high they stand, at most and below the flags
  const rounded = ({ step }, value) => +(Math.round(value / step) * step).toFixed(3);
  const one = ({ unit }, value) => (value === 1 ? unit.replace(/s$/, '') : unit);
  const named = ({ unit = '', step }, value) => [`${+value.toFixed(3)}`, Number.isInteger(step) ? one({ unit }, value) : unit].filter(Boolean).join(' ');

  const said = (record, value) => `${named(record, value)}.`;

  function gap(record, value, { at, tolerance }) {
    const right = value !== null && Math.abs(value - at) <= tolerance;
    const exact = +at.toPrecision(3);
    if (value === null) return { right, says: `It is ${named(record, exact)}.` };
    if (right) return { right, says: `Right: it is ${named(record, exact)}.` };
    if (!record.unit) return { right, says: `It is ${exact}: you said ${value}.` };
    const [much, little] = Number.isInteger(record.step) ? ['many', 'few'] : ['much', 'little'];
    return { right, says: `It is ${named(record, exact)}: you said ${apart(record, value, at)} too ${value > at ? much : little}.` };
  }

  function apart(record, value, at) {
    return named(Number.isInteger(record.step) ? {} : record, +Math.abs(value - at).toPrecision(2));
  }

  const svgElement = (name, attributes = {}, text = '') => {
    const made = document.createElementNS('http://www.w3.org/2000/svg', name);
    Object.entries(attributes).forEach(([key, one]) => made.setAttribute(key, one));
    made.textContent = text;
    return made;
  };

  // A few whole numbers: a button for each.
  function buttons(record, set) {
    const { question, low, high, outcome } = record;
    const names = Array.from({ length: high - low + 1 }, (_, i) => `${low + i}`);
    const shown = optionsKind.row(names, question, true, outcome && [Math.round(outcome.at) - low], place => set(low + place));
    classOf(record, values => shown.count(values.map(String)));
    return { node: shown.node, put: value => shown.press(value === null ? [] : [value - low]) };
  }

  function draw(record, image, set) {
    if (record.few) return buttons(record, set);
    const { low, high, step, unit, marks = {}, outcome } = record;
    // On a phone it is drawn narrower, not smaller: its letters stay as large.
    const [WIDE, TICKS] = matchMedia('(max-width: 600px)').matches ? [400, 4] : [800, 8];
    const x = value => LEFT + (WIDE - LEFT - RIGHT) * (value - low) / (high - low);
    const tall = unit ? TALL : TALL - 24;
    const svg = svgElement('svg', { class: 'guess-axis', viewBox: `0 0 ${WIDE} ${tall}`, 'font-size': 18, 'font-family': 'system-ui, sans-serif', fill: 'currentColor' });
    const rough = (high - low) / TICKS;
    const power = 10 ** Math.floor(Math.log10(rough));
    const tick = Math.max([1, 2, 5, 10].find(n => n * power >= rough) * power, Number.isInteger(step) ? 1 : 0);
    const ground = svgElement('g'); // the axis, and the class on it
    svg.append(ground);
    ground.append(svgElement('path', { d: `M${LEFT} ${LINE}H${WIDE - RIGHT}`, stroke: 'currentColor', 'stroke-width': 2 }));
    // Both ends have a number, and what is too near to one of them has none.
    const at = [low, high];
    for (let n = Math.ceil(low / tick); n * tick < high; n += 1) {
      if (Math.min(n * tick - low, high - n * tick) > 0.6 * tick) at.push(n * tick);
    }
    for (const value of at) {
      ground.append(svgElement('path', { d: `M${x(value)} ${LINE}v8`, stroke: 'currentColor', 'stroke-width': 2 }),
        svgElement('text', { x: x(value), y: LINE + 28, 'text-anchor': 'middle' }, `${+value.toPrecision(6)}`));
    }
    ground.append(svgElement('text', { x: WIDE - RIGHT, y: TALL - 8, 'text-anchor': 'end' }, unit));
    for (const [name, value] of Object.entries(marks)) {
      ground.append(svgElement('path', { d: `M${x(value)} ${LINE}V62`, stroke: 'currentColor', 'stroke-width': 2, 'stroke-dasharray': '3 4' }),
        svgElement('text', { x: x(value), y: 54, 'text-anchor': 'middle' }, name));
    }
    const gapLine = svgElement('path', { stroke: 'var(--look-lost)', 'stroke-width': 4, fill: 'none', d: '' });
    const gapLabel = svgElement('text', { y: LINE - 20, 'text-anchor': 'middle', class: 'gap-label' });
    const you = svgElement('g', { class: 'you', tabindex: outcome ? -1 : 0, role: 'slider', 'aria-label': 'Your line', 'aria-valuemin': low, 'aria-valuemax': high });
    you.append(svgElement('path', { class: 'you-round flag', d: `M0 ${LINE}V34`, stroke: 'var(--look-you)', 'stroke-width': 4 }),
      svgElement('circle', { cy: 34, r: 9, fill: 'var(--look-you)' }),
      svgElement('text', { class: 'you-label', y: 18 }));
    // The class: a dot for each student, those who have said the same above each other. Those who were
    // right light up.
    const ghosts = svgElement('g', { class: 'class' });
    ground.append(ghosts);
    svg.append(gapLine, gapLabel, you);
    // The axis is lower, so that the class has room above it.
    function lower(by) {
      svg.setAttribute('viewBox', `0 0 ${WIDE} ${tall + by}`);
      ground.setAttribute('transform', `translate(0 ${by})`);
      svg.querySelectorAll('.flag').forEach(flag => flag.setAttribute('d', flag.getAttribute('d').replace(/ .*V/, ` ${LINE + by}V`)));
    }

    if (outcome) {
      const at = x(Math.min(Math.max(outcome.at, low), high));
      svg.append(svgElement('path', { class: 'flag', d: `M${at} ${LINE}V34`, stroke: 'var(--look-robot)', 'stroke-width': 4 }),
        svgElement('circle', { cx: at, cy: 34, r: 9, fill: 'var(--look-robot)' }));
      svg.append(svgElement('text', { class: 'came-out', x: at, y: 18, 'text-anchor': 'middle' }, named(record, +outcome.at.toPrecision(3))));
    }
    let now = null;

    // Before a guess it stands beside the axis: a place on it would be a hint.
    function put(value) {
      now = value;
      you.setAttribute('transform', `translate(${value === null ? LEFT / 2 - 8 : x(value)})`);
      you.querySelector('text').textContent = value === null ? 'you?' : 'you';
      you.setAttribute('aria-valuenow', value ?? low);
      you.setAttribute('aria-valuetext', value === null ? 'not yet' : said(record, value));
      if (outcome && value !== null) measure(x(value), x(Math.min(Math.max(outcome.at, low), high)));
    }

    // The gap between the two lines, and how far it is. Two lines that are near share one name.
    function measure(yours, real) {
      const wide = Math.abs(real - yours);
      you.querySelector('text').textContent = wide < 90 ? '' : 'you';
      if (wide < 24) return;
      const y = LINE - 12;
      gapLine.setAttribute('d', `M${yours} ${y - 6}v12M${real} ${y - 6}v12M${yours} ${y}H${real}`);
      gapLabel.setAttribute('x', (yours + real) / 2);
      gapLabel.textContent = apart(record, now, outcome.at);
    }

    const to = value => set(rounded(record, Math.min(Math.max(value, low), high)));
    if (!outcome) {
      const point = event => {
        const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
        to(low + (high - low) * (at.x - LEFT) / (WIDE - LEFT - RIGHT));
      };
      svg.addEventListener('pointerdown', event => {
        svg.setPointerCapture(event.pointerId);
        you.focus({ preventScroll: true });
        point(event);
      });
      svg.addEventListener('pointermove', event => event.buttons && point(event));
      const KEYS = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };
      you.addEventListener('keydown', event => {
        const ends = { Home: low, End: high }[event.key];
        if (!(event.key in KEYS) && ends === undefined) return;
        event.preventDefault();
        to(ends ?? (now === null ? low : now + KEYS[event.key] * step));
      });
    }
    classOf(record, values => {
      const place = value => Math.round(x(Math.min(Math.max(value, low), high)) / DOT) * DOT;
      const stacks = [...Map.groupBy(values.filter(Number.isFinite).sort((a, b) => a - b), place)];
      const most = Math.max(0, ...stacks.map(([, stack]) => stack.length));
      const apart = Math.min(DOT, STACK / most);
      ghosts.replaceChildren(...stacks.flatMap(([cx, stack]) => stack.map((value, i) => svgElement('circle', {
        cx, cy: LINE - DOT / 2 - i * apart, r: DOT / 2 - 1,
        class: outcome && Math.abs(value - outcome.at) <= outcome.tolerance ? 'right' : '',
      }))));
      lower(Math.max(0, most * apart - ROOM));
    });
    return { node: svg, put };
  }

  return { said, gap, draw };
})();
