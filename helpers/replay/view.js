// A replay as a page shows it: lists that can be read, buttons, keys. What may happen is decided in
// model.js; here each state is drawn. Nothing is global: a page may have many replays.

const MOST_ITEMS = 100; // of a list; what is more is counted
const DELAYS = [800, 400, 200, 100, 50]; // ms a step, while it plays

// Of many callbacks nothing is lost; where one asks a service, they may wait in a circle.
const many = ({ setup }) => setup?.callbacks.length > 1;
const asks = ({ setup }) => setup.callbacks.some(({ does = [] }) => does.some(step => 'client' in step));

// The lists of one run.
function panel(run, record, picture, [from, until], [left, right, top, bottom], grouped) {
  const list = name => element('ul', { 'aria-label': name, role: 'list', class: `replay-${name}` });
  const [threads, groups, queue, lost] = ['threads', 'groups', 'queue', 'lost'].map(list);
  const places = element('span', { 'aria-hidden': 'true' });
  const time = element('span', { class: 'replay-time' });
  const row = (name, ...content) => element('div', { class: 'replay-row' },
    element('b', { 'aria-hidden': 'true' }, name), element('div', {}, ...content));
  const percent = part => `${100 * part}%`;
  const cursor = element('span', {
    class: 'replay-cursor', 'aria-hidden': 'true', style: `top: ${percent(top)}; height: ${percent(bottom - top)}`,
  });
  const shown = element('div', { class: 'replay-picture' }, picture, cursor);
  const { setup } = record;
  const calls = asks(record);
  const circle = element('ul', { 'aria-label': 'circle', role: 'list' });
  const { depth } = setup.callbacks[0];

  function fill(target, items) {
    while (target.children.length > items.length) target.lastChild.remove();
    items.forEach(([text, kind = ''], index) => {
      const item = target.children[index] ?? target.appendChild(element('li'));
      if (item.textContent !== text) item.textContent = text;
      if (item.className !== kind) item.className = kind;
    });
  }

  const seqOf = item => many(record) ? model.named(setup, item) : `${item.seq}`;

  function draw(position) {
    const { state, says } = run.seek(position);
    const stuck = calls ? circleOf(setup, state) : [];
    const kind = ({ id }) => (stuck.some(({ run: one }) => one === id) ? 'replay-stuck' : 'replay-busy');
    fill(circle, stuck.map(({ says: why }) => [why, 'replay-circle']));
    fill(threads, setup.threads.length
      ? setup.threads.map((name, i) => {
        const it = state.runs[i];
        if (!it) return [`${name}: free`];
        return [`${name}: ${seqOf(it)}${it.waits ? ', waits' : ''}`, kind(it)];
      })
      : [['no executor']]);
    fill(groups, setup.groups.map(({ name, exclusive }, group) => {
      if (!exclusive) return [`${name}: lets all in`];
      const holder = model.holderOf(setup, state, group);
      return holder ? [`${name}: held by ${seqOf(holder)}`, kind(holder)] : [`${name}: free`];
    }));
    const waiting = setup.callbacks.flatMap((_, callback) =>
      state.queues[callback].map(item => ({ ...item, callback })));
    const more = waiting.length - MOST_ITEMS;
    fill(queue, waiting.slice(0, MOST_ITEMS).map(item => [seqOf(item)])
      .concat(more > 0 ? [[`and ${more} more`]] : []));
    places.textContent = '';
    const empty = many(record) ? 0 : Math.min(depth, 40) - waiting.length;
    for (let i = 0; i < empty; i += 1) places.append(element('i'));
    const early = state.lost.length - MOST_ITEMS;
    fill(lost, (early > 0 ? [[`${early} before`]] : []).concat(
      state.lost.slice(-MOST_ITEMS).map(item => [seqOf(item)])));
    time.textContent = `${state.now.toFixed(3)} s`;
    const part = Math.min(Math.max((state.now - from) / (until - from), 0), 1);
    cursor.style.left = percent(left + part * (right - left));
    return says;
  }

  // No section: reveal.js takes each for a slide.
  const name = record.name || undefined;
  const node = element('div', { class: 'replay-run', role: name && 'group', 'aria-label': name },
    row(record.name || 'time', time),
    row('threads', threads), ...(grouped ? [row('groups', groups)] : []),
    row('queue', queue, places), ...(calls ? [row('circle', circle)] : many(record) ? [] : [row('lost', lost)]), shown);
  return { node, draw };
}

function show(root, record) {
  // One that has no setup is the drive of a robot: see drive.js.
  const drives = record.runs.some(({ setup }) => !setup);
  const runs = record.runs.map(one => (one.setup ? walk(one) : drive(one)));
  // All steps in the order of time: when, of which run, and whether it says something.
  const steps = runs.flatMap((run, who) => run.times.map(
    (us, own) => ({ us, who, told: run.told?.[own] ?? true }))).sort((one, other) => one.us - other.us);
  const last = steps.length;
  // How many steps of each run are done after so many of all.
  const counts = runs.map(() => [0]);
  for (const { who } of steps) counts.forEach((count, i) => count.push(count.at(-1) + (i === who)));
  let position = 0;
  let playing = null;
  let delay = 0;

  const pictures = [...root.querySelectorAll('figure > img')];
  // One thread that runs one callback needs no group to be understood.
  const grouped = record.runs.some(one => many(one) || one.setup?.threads.length > 1);
  const panels = record.runs.map(
    (one, i) => (one.setup ? panel : floor)(runs[i], one, pictures[i], record.span, record.plots[i], grouped));
  const says = element('p', { 'aria-live': 'polite', class: 'replay-says' });
  const slider = element('input', {
    type: 'range', min: 0, max: last, step: 1, 'aria-label': 'step', oninput: () => go(+slider.value),
  });
  const number = element('input', { type: 'number', min: 0, 'aria-label': 'message', onchange: find });
  const button = (name, onclick, label) =>
    element('button', { type: 'button', onclick, 'aria-label': label }, name);
  const play = button('Play', toggle);
  const rate = () => DELAYS[0] / DELAYS[delay];
  const faster = button('Speed 1×', () => {
    delay = (delay + 1) % DELAYS.length;
    faster.textContent = `Speed ${rate()}×`;
    if (playing) begin();
  });
  const loss = button('Next loss', () => {
    const step = nextLoss();
    if (step === undefined) says.textContent = 'No message is lost after this.';
    else go(step);
  });
  const forward = () => step(1);
  const backward = () => step(-1);
  const back = button('◀', backward, 'back');
  const forth = button('▶', forward, 'forward');

  // `us` is the time of a drive that plays, between two steps.
  function go(to, us) {
    position = Math.min(Math.max(to, 0), last);
    const texts = panels.map(({ draw }, i) => draw(counts[i][position], us ?? steps[position - 1]?.us ?? 0));
    const { who } = steps.slice(0, position).findLast(({ told }) => told) ?? {};
    const name = record.runs[who]?.name;
    const text = texts[who] ? (name && `${name}: `) + texts[who] : 'Nothing has happened yet. Step forward: ▶ or →.';
    // A text that is set again is read out again.
    if (says.textContent !== text) says.textContent = text;
    slider.value = position;
    slider.setAttribute('aria-valuetext', `step ${position} of ${last}`);
    back.disabled = position === 0;
    forth.disabled = position === last;
    if (position === last) stop();
  }

  // To the next step that says something, one way or the other.
  function step(way) {
    let to = position + way;
    while (to < last && steps[to - 1]?.told === false) to += way;
    go(to);
  }

  function nextLoss() {
    const found = runs.flatMap((run, i) => {
      const own = run.scan().losses.find(step => step > counts[i][position]);
      return own === undefined ? [] : [counts[i].indexOf(own)];
    });
    return found.length ? Math.min(...found) : undefined;
  }

  // The next step, from here on and then from the start, that is about this message.
  function find() {
    const seq = +number.value;
    const found = steps.map((_, index) => index + 1).filter(to => {
      const { who } = steps[to - 1];
      return runs[who].scan().about[counts[who][to] - 1].includes(seq);
    });
    const to = found.find(one => one > position) ?? found[0];
    if (to === undefined) says.textContent = `There is no message ${number.value}.`;
    else go(to);
  }

  function begin() {
    clearInterval(playing);
    const next = drives ? inTime(steps, position, rate(), go) : () => go(position + 1);
    playing = setInterval(() => (root.isConnected ? next() : stop()), drives ? FRAME : DELAYS[delay]);
    play.textContent = 'Pause';
  }

  function stop() {
    clearInterval(playing);
    playing = null;
    play.textContent = 'Play';
  }

  function toggle() {
    if (playing) return stop();
    if (position === last) go(0);
    begin();
  }

  // On a slide a clicker's keys step, too, and at the last step they walk on.
  const onSlide = () => Boolean(document.body.dataset.jpDeckMode || root.closest('.reveal'));
  const KEYS = {
    ArrowRight: forward,
    ArrowLeft: backward,
    ' ': toggle,
    Home: () => go(0),
    End: () => go(last),
    PageDown: forward,
    PageUp: backward,
  };

  function leaves(key) {
    return onSlide() && (position === last
      ? ['ArrowRight', 'PageDown'].includes(key)
      : position === 0 && ['ArrowLeft', 'PageUp'].includes(key));
  }

  function onKey(event) {
    const { key, target } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || event.shiftKey || key === 'Tab') return;
    if (leaves(key) || (key === 'Escape' && onSlide())) return;
    event.stopPropagation(); // what is typed here is no command of JupyterLab
    if (key.startsWith('Page') && !onSlide()) return;
    if (!KEYS[key] || (key === ' ' && target.tagName === 'BUTTON')) return;
    if (target === number) return;
    event.preventDefault();
    KEYS[key]();
  }

  root.classList.add('replay-on');
  root.setAttribute('role', 'group');
  root.setAttribute('aria-label', 'replay');
  root.tabIndex = 0;
  root.addEventListener('keydown', onKey);
  root.querySelectorAll('figure').forEach(figure => figure.remove());
  root.querySelector('.replay-on > p').after(
    says,
    element('div', { class: 'replay-controls' }, back, forth, play, faster, slider,
      ...(record.runs.some(({ setup }) => setup?.callbacks.length === 1)
        ? [loss, element('label', {}, 'Message ', number)] : [])),
    element('div', { class: 'replay-runs' }, ...panels.map(({ node }) => node)),
  );
  go(0);
}

const root = document.currentScript.closest('.replay');
show(root, JSON.parse(root.dataset.record));
