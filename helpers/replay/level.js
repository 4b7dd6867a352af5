// A level as a page shows it: lists that can be read, buttons, keys. What may be tried is decided in
// game.js. Nothing is global: a page may have many levels.

// A level is {goal, options: [{name, values}], variants: [{setup, begun, code, lesson, rclpy}]}: one
// variant for each combination of the options, the last option changing first.
function show(root, level) {
  const WORDS = {
    keep: count => (count ? `${count} lost` : 'none lost'),
    lose: count => `the count is ${count}`,
    answer: count => (count ? 'the answer never comes' : 'the answer comes'),
    stop: count => `${count} places visited`,
  };
  const words = WORDS[level.goal];

  let variant;
  let setup;
  let now;
  let state;

  const says = element('div', { 'aria-live': 'polite', class: 'replay-says' });
  const ready = element('ul', { 'aria-label': 'ready', role: 'list', class: 'level-ready' });
  const lists = element('div');
  const code = element('pre');
  const again = element('button', { type: 'button', onclick: begin }, 'Play again');
  const selects = level.options.map(({ name, values }) => element('select', { onchange: begin },
    ...values.map(value => element('option', {}, value))));

  function row(name, items) {
    const list = element('ul', { 'aria-label': name, role: 'list', class: `replay-${name}` });
    list.append(...items.map(([text, kind]) => element('li', { class: kind }, text)));
    lists.append(element('div', { class: 'replay-row' },
      element('b', { 'aria-hidden': 'true' }, name), element('div', {}, list)));
    return list;
  }

  function draw() {
    const over = now.isOver(state);
    const circle = over ? circleOf(setup, state) : [];
    const stuck = run => circle.some(({ run: id }) => id === run.id);
    const kind = run => (stuck(run) ? 'replay-stuck' : 'replay-busy');
    const about = callback => seq => setup.callbacks.length > 1
      ? model.named(setup, { callback, seq }) : `${seq}`;
    lists.textContent = '';
    if (setup.arrivals.at(-1).at) row('time', [[`${+state.now.toFixed(3)} s`]]);
    row('threads', setup.threads.map((name, thread) => {
      const run = state.runs[thread];
      if (!run) return [`${name}: free`];
      const seen = run.seen === undefined ? '' : `, has read ${run.seen}`;
      return [`${name}: ${model.named(setup, run)}${seen}${run.waits ? ', waits' : ''}`, kind(run)];
    }));
    if (setup.threads.length * setup.groups.length > 1) {
      row('groups', setup.groups.map(({ name, exclusive }, group) => {
        if (!exclusive) return [`${name}: lets all in`];
        const holder = model.holderOf(setup, state, group);
        return holder ? [`${name}: held by ${model.named(setup, holder)}`, kind(holder)]
          : [`${name}: free`];
      }));
    }
    const queue = row('queue', setup.callbacks.flatMap((_, callback) =>
      state.queues[callback].map(({ seq }) => [about(callback)(seq)])));
    if (setup.callbacks.length === 1) {
      const places = element('span', { 'aria-hidden': 'true' });
      for (let i = state.queues[0].length; i < setup.callbacks[0].depth; i += 1)
        places.append(element('i'));
      queue.after(places);
    }
    if (level.goal === 'keep')
      row('lost', state.lost.map(({ callback, seq }) => [about(callback)(seq)]));
    if (level.goal === 'lose') row('count', [[`${state.values.count ?? 0}`]]);
    if (level.goal === 'stop') row('places', [[`${state.values.places ?? 0}`]]);
    circle.forEach(({ says: why }) => lists.append(element('p', { class: 'replay-circle' }, why)));

    const index = [...ready.children].findIndex(item => item.contains(document.activeElement));
    ready.textContent = '';
    now.choices(state).forEach(({ move, text }, place) => ready.append(element('li', {},
      element('button', { type: 'button', onclick: () => choose(move) },
        element('span', { 'aria-hidden': 'true', class: 'level-key' }, `${place + 1}`), text))));
    ready.classList.toggle('level-over', over);
    if (over) say(...result());
    if (index >= 0) (buttons()[index] ?? buttons()[0] ?? again).focus();
  }

  const buttons = () => [...ready.querySelectorAll('button')];
  const say = (...texts) => says.append(...texts.map(text => element('p', {}, text)));

  function result() {
    const own = now.score(state);
    const best = now.best();
    const real = variant.rclpy === undefined ? '' : ` What the real rclpy did: ${words(variant.rclpy)}.`;
    return [
      `You: ${words(own)}. The best possible: ${words(best)}.${real}`,
      own > best ? 'Another order does better. Play again.' : variant.lesson,
    ];
  }

  function choose(move) {
    const refused = now.refusal(state, move);
    says.textContent = '';
    if (refused) {
      say(`No. ${refused}`);
      if (now.isOver(state)) say(...result());
      return;
    }
    const done = now.choose(state, move);
    state = done.state;
    say(done.says);
    draw();
  }

  function begin() {
    const place = level.options.reduce(
      (sum, { values }, i) => sum * values.length + selects[i].selectedIndex, 0);
    variant = level.variants[place];
    setup = variant.setup;
    now = game({ ...variant, goal: level.goal });
    state = now.start();
    code.textContent = variant.code;
    code.hidden = !variant.code;
    says.textContent = '';
    say('Choose what happens next: a click, a number key, or Tab and Enter.');
    draw();
  }

  function walk(by) {
    const all = buttons();
    const index = all.indexOf(document.activeElement);
    all[index < 0 ? 0 : (index + by + all.length) % all.length]?.focus();
  }

  const KEYS = {
    ArrowRight: () => walk(1),
    ArrowDown: () => walk(1),
    ArrowLeft: () => walk(-1),
    ArrowUp: () => walk(-1),
    Escape: () => {
      document.activeElement.blur();
      root.parentElement.closest('[tabindex]')?.focus();
    },
  };

  function onKey(event) {
    const { key, target } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || key === 'Tab') return;
    // A clicker walks on; what else is typed here is no command of JupyterLab.
    if (key.startsWith('Page')) return;
    event.stopPropagation();
    if (target.tagName === 'SELECT' && key !== 'Escape') return;
    const chosen = buttons()[+key - 1];
    if (!chosen && !KEYS[key]) return;
    event.preventDefault();
    if (chosen) chosen.click();
    else KEYS[key]();
  }

  root.classList.add('replay-on');
  root.setAttribute('role', 'group');
  root.setAttribute('aria-label', 'level');
  root.tabIndex = 0;
  root.addEventListener('keydown', onKey);
  root.querySelector('.level-static').replaceWith(
    element('div', { class: 'replay-controls' }, ...level.options.map(
      ({ name }, i) => element('label', {}, `${name} `, selects[i]))),
    code, says, ready, lists, element('div', { class: 'replay-controls' }, again));
  begin();
}

const root = document.currentScript.closest('.replay');
show(root, JSON.parse(root.dataset.level));
