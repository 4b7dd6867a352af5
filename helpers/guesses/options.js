// Options, of which one is chosen, or several. `said` and `gap` need no page. A value is the place
// of the option, or a list of places.
const optionsKind = (() => {
  const listed = (names, places) => [places].flat().map(place => names[place]).join(', ') || 'none';

  const said = ({ names }, value) => `${listed(names, value)}.`;

  function gap({ names }, value, { at }) {
    const right = `${value}` === `${at}`;
    return { right, says: right ? `Right: ${listed(names, at)}.` : `It is ${listed(names, at)}: you said ${listed(names, value)}.` };
  }

  // Return a row of buttons and `press(places)`. `choose` gets the place of one that is clicked, or
  // reached by an arrow key, if only `one` is chosen. `right` are the places of what came out.
  function row(names, label, one, right, choose) {
    const buttons = names.map((name, place) => element('button', {
      type: 'button', role: one ? 'radio' : 'checkbox', disabled: right ? '' : undefined, onclick: () => choose(place),
      class: right?.includes(place) ? 'guess-true' : undefined,
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

    // How many of a class have chosen each: `values` are their words, none at all before they are shown.
    function count(values) {
      buttons.forEach((button, place) => {
        const students = values.filter(value => value === names[place]).length;
        if (students) button.dataset.class = `${students}`;
        else delete button.dataset.class;
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

  function draw(record, image, set) {
    const { names, several, points, outcome } = record;
    const one = several === null;
    // Of any number, none is an answer, too.
    const none = several === 0 ? names.length : -1;
    const pressed = value => (value === null ? [] : value.length === 0 ? [none] : [value].flat());
    const shown = row(none < 0 ? names : [...names, 'none of them'], record.question, one, outcome && pressed(outcome.at), choose);
    if (points) plane(shown.node, points);
    let now = null;
    // A list that is empty says none of them. An option that is the text of a number comes as one.
    classOf(record, values => shown.count(values.flatMap(value => ([].concat(value).length ? value : ['none of them'])).map(String)));

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

  return { said, gap, draw, row };
})();
