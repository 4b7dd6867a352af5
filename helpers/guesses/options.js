// Options, of which one is chosen, or several. `said` and `gap` need no page. A value is the place
// of the option, or a list of places.
const optionsKind = (() => {
  const listed = (names, places) => [places].flat().map(place => names[place]).join(', ') || 'none';

  const said = ({ names }, value) => `${listed(names, value)}.`;

  function gap({ names }, value, { at }) {
    const right = `${value}` === `${at}`;
    return { right, says: right ? `Right: ${listed(names, at)}.` : `It is ${listed(names, at)}: you said ${listed(names, value)}.` };
  }

  function draw(record, image, set) {
    const { names, several, outcome } = record;
    const one = several === null;
    let now = null;
    const buttons = names.map((name, place) => element('button', {
      type: 'button', role: one ? 'radio' : 'checkbox', disabled: outcome ? '' : undefined, onclick: () => choose(place),
      class: outcome && [outcome.at].flat().includes(place) ? 'guess-true' : undefined,
    }, name));
    const node = element('div', { class: 'guess-options', role: one ? 'radiogroup' : 'group', 'aria-label': record.question, onkeydown }, ...buttons);

    function choose(place) {
      if (one) return set(place);
      const before = now ?? [];
      const after = before.includes(place) ? before.filter(other => other !== place) : [...before, place].sort((a, b) => a - b);
      // One more than are asked for takes the place of the last one.
      if (several && after.length > several) after.splice(after.findIndex(other => other !== place), 1);
      return set(after);
    }

    function onkeydown(event) {
      const way = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
      const at = buttons.indexOf(document.activeElement);
      if (!way || at < 0) return;
      event.preventDefault();
      const next = buttons[(at + way + buttons.length) % buttons.length];
      next.focus();
      if (one) next.click();
    }

    function put(value) {
      now = value;
      const chosen = value === null ? [] : [value].flat();
      buttons.forEach((button, place) => button.setAttribute('aria-checked', chosen.includes(place)));
    }

    return { node, put };
  }

  return { said, gap, draw };
})();
