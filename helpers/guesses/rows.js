// A row for each thing that is asked about, and one option chosen in each. `said` and `gap` need no
// page. A value is a list of places, in the order of the rows.
const rowsKind = (() => {
  const listed = (rows, value) => rows.map(({ name, names }, i) => `${name}: ${names[value[i]]}`).join(', ');

  const said = ({ rows }, value) => `${listed(rows, value)}.`;

  function gap({ rows }, value, { at }) {
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

    classOf(record, values => shown.forEach(({ count }, i) => count(values.map(value => String(value[i]).replace(`${rows[i].name}: `, '')))));

    function put(value) {
      // Until each row is answered, what was chosen is here alone.
      if (value) now = [...value];
      press();
    }

    return { node: element('div', { class: 'guess-rows' }, ...rows.flatMap(({ name }, i) => [element('b', { 'aria-hidden': 'true' }, name), shown[i].node])), put };
  }

  return { said, gap, draw };
})();
