// A row for each thing that is asked about, and one option chosen in each. `said` and `gap` need no
// page. A value is a list of places, in the order of the rows.
const rowsKind = (() => {
  const listed = (rows, value) => rows.map(({ name, names }, i) => `${name}: ${names[value[i]]}`).join(', ');

  const said = ({ rows }, value) => `${listed(rows, value)}.`;

  function gap({ rows }, value, { at }) {
    if (value === null) return { right: false, says: `It is ${listed(rows, at)}.` };
    const wrong = rows.map(({ name, names }, i) => (value[i] === at[i] ? '' : `${name} is ${names[at[i]]}, and you said ${names[value[i]]}`));
    const right = !wrong.some(Boolean);
    return { right, says: right ? `Right: ${listed(rows, at)}.` : `${wrong.filter(Boolean).join('. ')}.` };
  }

  function draw(record, image, set) {
    const { rows, outcome } = record;
    let now = rows.map(() => null);
    const shown = rows.map(({ name, names }, i) => optionsKind.row(names, name, true, outcome && [outcome.at[i]], place => {
      now[i] = place;
      press();
      if (!now.includes(null)) set([...now]);
    }));
    const press = () => shown.forEach(({ press: one }, i) => one([now[i]]));

    function put(value) {
      // Until each row is answered, what was chosen is here alone.
      if (value) now = [...value];
      press();
    }

    // Rows with the same options are a table, where there is room for their words.
    let node;
    const { names } = rows[0];
    const alike = rows.every(one => `${one.names}` === `${names}`);
    if (alike && (!matchMedia('(max-width: 600px)').matches || (names.length < 6 && names.join('').length < 12))) {
      const head = element('tr', { 'aria-hidden': 'true' }, element('td'), ...names.map(name => element('th', {}, name)));
      const body = rows.map(({ name }, i) => {
        const cells = [...shown[i].node.children].map(button => element('td', { role: 'presentation' }, optionsKind.bare(button)));
        return element('tr', { role: 'radiogroup', 'aria-label': name, onkeydown: shown[i].node.onkeydown }, element('th', { 'aria-hidden': 'true' }, name), ...cells);
      });
      node = element('table', { class: 'guess-table', role: 'presentation' }, head, ...body);
    } else {
      node = element('div', { class: 'guess-rows' }, ...rows.flatMap(({ name }, i) => [element('b', { 'aria-hidden': 'true' }, name), shown[i].node]));
    }
    classOf(record, values => shown.forEach(({ count }, i) => count(values.map(value => String(value[i]).replace(`${rows[i].name}: `, '')))));
    return { node, put };
  }

  return { said, gap, draw };
})();
