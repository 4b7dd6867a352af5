// A replay as a page shows it: lists that can be read, buttons, keys. What may happen is decided in
// model.js, and a state is drawn by board.js. Nothing is global: a page may have many replays.

const DELAYS = [800, 400, 200, 100, 50]; // ms a step, while it plays

// The picture of a run, as a part of the page: its ink is that of the page.
function drawing(image) {
  const text = decodeURIComponent(image.src.slice(image.src.indexOf(',') + 1));
  const svg = new DOMParser().parseFromString(text, 'image/svg+xml').documentElement;
  return seen(svg, image.alt);
}

// The lists and the picture of one run.
function panel(run, record, image, [from, until], grouped) {
  const { setup, name } = record;
  const many = setup.callbacks.length > 1;
  const asks = setup.callbacks.some(({ does = [] }) => does.some(step => 'client' in step));
  const names = ['threads', ...(grouped ? ['groups'] : []), 'queue', ...(asks ? ['circle'] : many ? [] : ['lost'])];
  const { rows, draw } = board(setup, names, { losses: run.scan().length });
  const time = element('span', { class: 'replay-time' });
  const svg = drawing(image);
  const cursor = svg.querySelector('.cursor');
  // No section: the deck takes each for a slide.
  const node = element('div', { class: 'replay-run', role: name ? 'group' : undefined, 'aria-label': name || undefined },
    row(name || 'time', time), ...rows, element('div', { class: 'replay-picture' }, svg));

  return { node, draw(position) {
    const { state, says } = run.seek(position);
    draw(state, asks ? circleOf(setup, state) : []);
    time.textContent = `${state.now.toFixed(3)} s`;
    const part = Math.min(Math.max((state.now - from) / (until - from), 0), 1);
    cursor.setAttribute('transform', `translate(${(part * svg.dataset.wide).toFixed(1)})`);
    return says;
  } };
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
  // The steps after which a message is lost, or the robot hits something.
  const losses = runs.flatMap((run, i) => run.scan().map(own => counts[i].indexOf(own))).sort((a, b) => a - b);
  const lists = record.runs.some(({ setup }) => setup?.callbacks.length === 1);
  let position = 0;
  let playing = null;
  let delay = 0;

  const images = [...root.querySelectorAll('figure > img')];
  // One thread that runs one callback needs no group to be understood.
  const grouped = record.runs.some(({ setup }) => setup?.callbacks.length > 1 || setup?.threads.length > 1);
  const panels = record.runs.map((one, i) => (one.setup ? panel(runs[i], one, images[i], record.span, grouped)
    : floor(runs[i], one, drawing(images[i]))));
  const says = element('p', { 'aria-live': 'polite', class: 'replay-says' });
  const slider = element('input', {
    type: 'range', min: 0, max: last, step: 1, 'aria-label': 'step', oninput: () => go(+slider.value),
  });
  const button = (name, onclick, label) =>
    element('button', { type: 'button', onclick, 'aria-label': label }, name);
  const play = button('Play', toggle);
  const rate = () => DELAYS[0] / DELAYS[delay];
  const faster = button('Speed 1×', () => {
    delay = (delay + 1) % DELAYS.length;
    faster.textContent = `Speed ${rate()}×`;
    if (playing) run();
  });
  const nextLoss = () => losses.find(step => step > position);
  const loss = button('Next loss', () => {
    const step = nextLoss();
    if (step === undefined) says.textContent = 'No message is lost after this.';
    else go(step);
  });
  const back = button('◀', () => step(-1), 'back');
  const forth = button('▶', () => step(1), 'forward');

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

  function run() {
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
    run();
  }

  const KEYS = {
    ArrowRight: () => step(1),
    ArrowLeft: () => step(-1),
    ' ': toggle,
    Home: () => go(0),
    End: () => go(last),
  };

  function onKey(event) {
    const { key, target } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || event.shiftKey || key === 'Tab') return;
    event.stopPropagation(); // what is typed here is no command of JupyterLab
    if (!KEYS[key] || (key === ' ' && target.tagName === 'BUTTON')) return;
    event.preventDefault();
    KEYS[key]();
  }

  // A clicker walks by two stops: the first loss, and the end. The deck asks for the next one.
  function onStop(event) {
    if (position === last) return;
    event.preventDefault();
    go(position < losses[0] ? losses[0] : last);
  }

  wake(root, 'replay');
  root.addEventListener('keydown', onKey);
  root.addEventListener('next-stop', onStop);
  root.querySelectorAll('figure').forEach(figure => figure.remove());
  root.querySelector('.replay-on > p').after(
    says,
    element('div', { class: 'replay-controls' }, back, forth, play, faster, slider, ...(lists && losses.length ? [loss] : [])),
    element('div', { class: 'replay-runs' }, ...panels.map(({ node }) => node)),
  );
  go(0);
}

const root = document.currentScript.closest('.replay');
show(root, JSON.parse(root.dataset.record));
