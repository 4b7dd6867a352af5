// Options, of which one is chosen, or several. `said` and `gap` need no page. A value is the place
// of the option, or a list of places.
const optionsKind = (() => {
  const DOTS = 60; // of a class, about so many at most
  const listed = (names, places) => [places].flat().map(place => names[place]).join(', ') || 'none';

  const said = ({ names }, value) => `${listed(names, value)}.`;

  function gap({ names }, value, { at }) {
    if (value === null) return { right: false, says: `It is ${listed(names, at)}.` };
    const right = `${value}` === `${at}`;
    return { right, says: right ? `Right: ${listed(names, at)}.` : `It is ${listed(names, at)}: you said ${listed(names, value)}.` };
  }

  // The class page makes numbers of texts: 1 is '1.0'.
  const isSame = (value, name) => value === name || (name !== '' && +value === +name);

  // Return a row of buttons and `press(places)`. `choose` gets the place of one that is clicked, or
  // reached by an arrow key, if only `one` is chosen. `right` are the places of what came out.
  function row(names, label, one, right, choose) {
    const buttons = names.map((name, place) => element('button', {
      type: 'button', role: one ? 'radio' : 'checkbox', disabled: right ? '' : undefined, onclick: () => choose(place),
      class: `guess-choice${right?.includes(place) ? ' guess-true' : ''}`,
    }, name));

    function onkeydown(event) {
      const way = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
      const at = buttons.indexOf(document.activeElement);
      if (!way || at < 0) return;
      event.preventDefault();
      const next = buttons[(at + way + buttons.length) % buttons.length];
      next.focus();
      if (one) next.click();
    }

    const node = element('div', { class: 'guess-options', role: one ? 'radiogroup' : 'group', 'aria-label': label, onkeydown }, ...buttons);
    const press = places => buttons.forEach((button, place) => button.setAttribute('aria-checked', places.includes(place)));

    // Those of a class who have chosen each, a dot for a student, and in a large class a dot for
    // several: `values` are their words, none at all before they are shown. Dots of what is right
    // light up.
    function count(values, size = values.length) {
      const each = Math.ceil(size / DOTS);
      buttons.forEach((button, place) => {
        const students = values.filter(value => isSame(value, names[place])).length;
        button.querySelector('.guess-class')?.remove();
        delete button.dataset.class;
        if (!students) return;
        button.dataset.class = `${students}`;
        button.style.setProperty('--class', students);
        const dots = Array.from({ length: Math.ceil(students / each) }, () => element('i'));
        button.append(element('span', { class: 'guess-class', 'aria-hidden': 'true' }, ...dots));
      });
    }

    return { node, press, count };
  }

  // Put buttons where their points (m) are, around the robot. What has no point stands below.
  function plane(node, points) {
    const [wide, high] = [0, 1].map(axis => 1.2 * Math.max(...points.map(point => Math.abs(point[axis]))) + 0.5);
    const place = (one, x, y) => Object.assign(one.style, { left: `${50 + 50 * x / wide}%`, top: `${50 - 50 * y / high}%` });
    const label = (words, x, y) => {
      const made = element('span', { 'aria-hidden': 'true' }, words);
      place(made, x, y);
      return made;
    };
    const shown = element('div', { class: 'guess-plane', style: `aspect-ratio: ${wide} / ${high}` });
    for (let x = 2; x < wide; x += 2) shown.append(label(`-${x} m`, -x, 0), label(`${x} m`, x, 0));
    for (let y = 2; y < high; y += 2) shown.append(label(`-${y} m`, -0.05 * wide, -y), label(`${y} m`, -0.05 * wide, y));
    shown.append(label('➤', 0, 0));
    points.forEach(([x, y], i) => {
      place(node.children[0], x, y);
      node.children[0].title = `x ${x} m, y ${y} m`;
      shown.append(node.children[0]);
    });
    node.prepend(shown);
  }

  // A button in a table whose head or row says its name.
  function bare(button) {
    button.ariaLabel = button.textContent;
    button.replaceChildren();
    button.classList.add('guess-bare');
    return button;
  }

  // Put buttons into the cells of their table. In that which has come, a cell also says what came.
  function table(node, { columns, rows }, names, came) {
    const buttons = [...node.children];
    const all = came?.columns ?? columns;
    const texts = new Map(came?.rows);
    const cell = (name, row, i) => {
      const place = row[columns.indexOf(all[i])] ?? null;
      const button = place === null ? [] : [buttons[place]];
      // The name of its row is read there.
      if (button.length && names[place] === name) bare(button[0]);
      return element('td', {}, ...button, ...(came ? [' ', element('span', {}, texts.get(name)?.[i] ?? '')] : []));
    };
    const head = element('tr', {}, element('td'), ...all.map(name => element('th', { scope: 'col' }, name)));
    const body = rows.map(([name, row]) => element('tr', {}, element('th', { scope: 'row' }, name), ...all.map((_, i) => cell(name, row, i))));
    node.prepend(element('table', { class: 'guess-table' }, head, ...body));
  }

  function draw(record, image, set) {
    const { names, several, points, outcome } = record;
    const one = several === null;
    // Of any number, none is an answer, too.
    const none = several === 0 ? names.length : -1;
    const pressed = value => (value === null ? [] : value.length === 0 ? [none] : [value].flat());
    const shown = row(none < 0 ? names : [...names, 'none of them'], record.question, one, outcome && pressed(outcome.at), choose);
    if (points) plane(shown.node, points);
    if (record.table) table(shown.node, record.table, names, outcome?.table);
    let now = null;
    // A list that is empty says none of them. An option that is the text of a number comes as one.
    classOf(record, values => shown.count(values.flatMap(value => ([].concat(value).length ? value : ['none of them'])).map(String), values.length));

    function choose(place) {
      if (one) return set(place);
      if (place === none) return set([]);
      const before = now ?? [];
      const after = before.includes(place) ? before.filter(other => other !== place) : [...before, place].sort((a, b) => a - b);
      // One more than are asked for takes the place of the last one.
      if (several && after.length > several) after.splice(after.findIndex(other => other !== place), 1);
      return set(after);
    }

    function put(value) {
      now = value;
      shown.press(pressed(value));
    }

    return { node: shown.node, put };
  }

  return { said, gap, draw, row, bare };
})();
