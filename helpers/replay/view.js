// A replay as a page shows it: lists that can be read, buttons, keys. What may happen is decided in
// model.js, and a state is drawn by board.js. Nothing is global: a page may have many replays.

const PLAYS_S = 10; // about so long a run plays
const SPEEDS = [1, 2, 4, 0.5]; // and how much faster or slower
const SHORT_US = 1e4; // of a run of less, milliseconds are shown
const HOLD_MS = 1200; // a sentence while it plays, at least

// How many times as fast as it was a run of so many microseconds plays: a number that is easily read.
function pace(us) {
  const needed = us / 1e6 / PLAYS_S || 1;
  const power = 10 ** Math.floor(Math.log10(needed));
  return +(power * [10, 7, 5, 4, 3, 2, 1.5, 1].find(n => n * power <= 1.2 * needed)).toPrecision(2);
}

// The lists and the picture of one run. A short one has its times in milliseconds. What comes later is
// covered as long as the replay is new.
function panel(run, record, image, [from, until], grouped, short, isNew, counts) {
  const { setup, name } = record;
  const many = setup.callbacks.length > 1;
  const names = ['threads', ...(grouped ? ['groups'] : []), 'queue', ...(many ? [] : ['lost'])];
  const { rows, draw } = board(setup, names, { losses: run.scan().length });
  const counted = counts && rows.find(one => one.querySelector('.replay-lost'));
  const count = element('summary', {}, element('span', { class: 'replay-count' }));
  if (counted) {
    counted.firstChild.remove();
    counted.firstChild.className = '';
    counted.firstChild.replaceChildren(element('details', {}, count, ...counted.firstChild.childNodes));
  }
  const time = element('span', { class: 'replay-time' });
  const circle = run.end && ring();
  const svg = counts && typeof timeline !== 'undefined' ? timeline(record, [from, until]) : drawing(image);
  const cursor = svg.querySelector('.cursor');
  const later = isNew && rect('later', { y: svg.dataset.top, height: svg.dataset.row * svg.dataset.rows.split(',').length });
  if (later) svg.append(later);
  // No section: the deck takes each for a slide.
  const node = element('div', { class: 'replay-run', role: name ? 'group' : undefined, 'aria-label': name || undefined },
    row(name || 'time', time), ...rows, ...(circle ? [circle.node] : []), element('div', { class: 'replay-picture' }, svg));

  return { node, draw(position, us) {
    const { state } = run.seek(position);
    const now = run.circle?.(position) ?? { stuck: [] };
    count.firstChild.textContent = `${state.lost.length} lost`;
    circle?.draw(now, run.end);
    point(us ?? 1e6 * state.now);
    draw(state, now.stuck);
  }, point, timeAt, light };

  // Put the clock and the cursor to a time.
  function point(us) {
    time.textContent = short ? `${(us / 1e3).toFixed(3)} ms` : `${(us / 1e6).toFixed(3)} s`;
    const part = Math.min(Math.max((us / 1e6 - from) / (until - from), 0), 1);
    const at = part * svg.dataset.wide;
    cursor.setAttribute('transform', `translate(${at.toFixed(1)})`);
    svg.now?.(us);
    if (later) place(later, { x: +svg.dataset.left + at, width: svg.dataset.wide - at + 4 });
  }

  function light(is) {
    svg.querySelector('.same')?.remove();
    const at = svg.dataset.rows.split(',').indexOf(is);
    if (at < 0) return;
    const { row, top } = svg.dataset;
    svg.prepend(rect('same', { x: 0, y: +top + row * at, width: '100%', height: Math.max(row, 4) }));
  }

  function rect(kind, attributes) {
    return place(document.createElementNS(svg.namespaceURI, 'rect'), { class: kind, ...attributes });
  }

  function place(node, attributes) {
    Object.entries(attributes).forEach(([name, value]) => node.setAttribute(name, value));
    return node;
  }

  // Return where a pointer is in the picture: microseconds, and the message of that row, if any.
  function timeAt({ clientX, clientY }) {
    const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(svg.getScreenCTM().inverse());
    const { wide, left, row, top, rows } = svg.dataset;
    const part = Math.min(Math.max((x - left) / wide, 0), 1);
    return { us: 1e6 * (from + part * (until - from)), is: rows.split(',')[Math.floor((y - top) / row)] };
  }
}

function show(root, record) {
  // One that has no setup is the drive of a robot: see drive.js.
  const runs = record.runs.map(one => {
    const run = one.setup ? walk(one) : drive(one, root);
    return typeof ring === 'undefined' ? run : close(run, one);
  });
  const own = runs.map(run => run.scan());
  const ranks = runs.map((run, i) => run.ranks ?? run.times.map((_, step) => +own[i].includes(step + 1)));
  // All steps in the order of time: when, of which run, whether it says something, and whether also
  // while it plays: 1, or 2 if nothing else may be said in its place.
  const steps = runs.flatMap((run, who) => run.times.map((us, step) => ({
    us, who, step, told: run.told?.[step] ?? true, rank: ranks[who][step],
  }))).sort((one, other) => one.us - other.us);
  const last = steps.length;
  // How many steps of each run are done after so many of all.
  const counts = runs.map(() => [0]);
  for (const { who } of steps) counts.forEach((count, i) => count.push(count.at(-1) + (i === who)));
  // The steps after which a message is lost, or the robot hits something.
  const stops = own.map((found, i) => found.map(step => counts[i].indexOf(step)));
  const losses = stops.flat().sort((a, b) => a - b);
  const named = (who, text) => (record.runs[who].name ? `${record.runs[who].name}: ` : '') + text;
  const outcome = () => record.runs.flatMap((one, who) => {
    const says = runs[who].outcome?.() ?? runs[who].end?.says;
    return says ? [named(who, says)] : [];
  }).join(' ');
  // It opens where it tells most: at the bump of the drive, else at the last loss, else at the end. A
  // circle opens at its start, for it is to close before the reader's eyes, and so does each replay on
  // a page whose reader is to guess first.
  const drives = record.runs.flatMap((one, who) => (one.setup ? [] : [who]));
  const hides = root.dataset.opens === 'start';
  const grows = runs.some(({ circle }) => circle);
  const isNew = hides || grows;
  const bump = drives.length === 1 && record.opens !== 'end' ? stops[drives[0]][0] : undefined;
  const telling = isNew ? 0 : bump ?? (drives.length ? last : losses.at(-1) ?? last);
  const length = steps.at(-1)?.us ?? 0;
  let position = 0;
  let fresh = true; // as it was opened
  let playing = null;
  let speed = 0;
  let said = {}; // while it plays

  const images = [...root.querySelectorAll('figure > img')];
  // One thread that runs one callback needs no group to be understood.
  const grouped = record.runs.some(({ setup }) => setup?.callbacks.length > 1 || setup?.threads.length > 1);
  const panels = record.runs.map((one, i) => (one.setup ? panel(runs[i], one, images[i], record.span, grouped, length < SHORT_US, grows || (hides && drives.length), record.runs.some(other => other.strip))
    : floor(runs[i], one, drawing(images[i]))));
  const says = element('p', { 'aria-live': 'polite', class: 'replay-says' });
  const slider = element('input', {
    type: 'range', min: 0, max: last, step: 1, 'aria-label': 'step', onchange: () => speak(true),
    oninput: () => { stop(); speak(false); go(+slider.value); },
  });
  const button = (name, onclick, label, kind) =>
    element('button', { type: 'button', onclick, 'aria-label': label, class: kind }, name);
  const play = button('', toggle, undefined, 'replay-play');
  const usual = pace(length);
  const rate = () => +(usual * SPEEDS[speed]).toPrecision(2);
  const faster = button('', () => {
    speed = (speed + 1) % SPEEDS.length;
    nameSpeed();
  }, undefined, 'replay-rate');
  const back = button('‹', () => step(-1), 'back');
  const forth = button('›', () => step(1), 'forward');
  const shown = element('div', { class: 'replay-runs' }, ...panels.map(({ node }) => node));

  function nameSpeed() {
    const slower = +(1 / rate()).toPrecision(2);
    const exact = slower < 10 ? `${rate()}×` : `1/${slower.toLocaleString('en')}×`;
    faster.textContent = slower < 1000 ? exact : 'slow motion';
    faster.ariaLabel = faster.title = slower < 1000 ? `speed ${exact}` : `slow motion, ${exact}`;
  }

  // A text that changes is read out, but not while it changes all the time.
  function speak(on) {
    if ((says.getAttribute('aria-live') === 'polite') === on) return;
    says.setAttribute('aria-live', on ? 'polite' : 'off');
    if (on) setTimeout(() => says.replaceChildren(says.textContent), 50);
  }

  const sentence = (who, step) => runs[who].says?.(step) ?? runs[who].seek(step).says;

  // What is said of the steps since `from` while it plays.
  function tell(from) {
    const now = performance.now();
    steps.slice(from, position).forEach(({ who, step, rank }) => {
      if (!rank || (now < said.until && rank <= said.rank)) return;
      said = { rank, until: now + HOLD_MS };
      says.textContent = named(who, sentence(who, step + 1));
    });
  }

  // `us` is the time while it plays, between two steps.
  function go(to, us) {
    const [from, plays] = [position, us !== undefined];
    fresh = false;
    position = Math.min(Math.max(to, 0), last);
    if (plays) tell(from);
    if (!plays || position === last) {
      const { who } = steps.slice(0, position).findLast(({ told }) => told) ?? {};
      const text = who === undefined ? '' : sentence(who, counts[who][position]);
      // A text that is set again is read out again.
      const now = (position === last && outcome()) || (text ? named(who, text) : 'Nothing has happened yet. Step: →');
      if (says.textContent !== now) says.textContent = now;
    }
    slider.value = position;
    slider.setAttribute('aria-valuetext', `step ${position} of ${last}`);
    back.disabled = position === 0;
    forth.disabled = position === last;
    // The last thing: a board looks where its messages are, and the page is laid out for that once.
    panels.forEach((one, i) => {
      const still = plays && !one.draw.always && counts[i][from] === counts[i][position];
      if (still) one.point(us);
      else one.draw(counts[i][position], us ?? steps[position - 1]?.us ?? 0, plays);
    });
    requestAnimationFrame(keepHeight); // when the page is laid out anyway
    if (position === last) {
      root.classList.remove('replay-new');
      stop();
    } else nameButton();
  }

  function nameButton() {
    play.textContent = playing ? '❚❚ Pause' : fresh || position === last ? '▶ Watch again' : '▶ Play';
  }

  // What is below does not move while it plays.
  let [tall, wide] = [0, 0];
  function keepHeight() {
    if (shown.offsetWidth !== wide) {
      [tall, wide] = [0, shown.offsetWidth];
      shown.style.minHeight = '';
    }
    if (shown.offsetHeight <= tall) return;
    tall = shown.offsetHeight;
    // On a slide the letters change their size later.
    shown.style.minHeight = `${(tall / parseFloat(getComputedStyle(shown).fontSize)).toFixed(2)}em`;
  }

  function rest(to) {
    stop();
    go(to);
  }

  // To the next step that says something, one way or the other.
  function step(way) {
    let to = position + way;
    while (to < last && steps[to - 1]?.told === false) to += way;
    rest(to);
  }

  function run() {
    let us = steps[position - 1]?.us ?? 0;
    let to = position;
    let before;
    function frame(now) {
      if (!root.isConnected) return stop();
      us += 1000 * Math.min(now - (before ?? now), 100) * rate();
      before = now;
      while (steps[to]?.us <= us) to += 1;
      playing = requestAnimationFrame(frame);
      go(to, us);
    }
    speak(false);
    said = {};
    says.textContent = '';
    playing = requestAnimationFrame(frame);
    nameButton();
  }

  function stop() {
    cancelAnimationFrame(playing);
    playing = null;
    nameButton();
    speak(true);
  }

  function toggle() {
    if (playing) return rest(position);
    if (fresh || position === last) go(0);
    if (last) run();
  }

  const KEYS = {
    ArrowRight: () => step(1),
    ArrowLeft: () => step(-1),
    ' ': toggle,
    Home: () => rest(0),
    End: () => rest(last),
  };

  function onKey(event) {
    const { key, target } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || event.shiftKey || key === 'Tab') return;
    event.stopPropagation(); // what is typed here is no command of JupyterLab
    if (!KEYS[key] || (key === ' ' && target.tagName === 'BUTTON')) return;
    event.preventDefault();
    KEYS[key]();
  }

  // A clicker walks by two stops: the first loss, or the step before a circle closes, and the end. The
  // deck asks for the next one.
  const almost = runs.flatMap((run, who) => (run.almost > 0 ? [counts[who].indexOf(run.almost)] : []));
  function onStop(event) {
    if (position === last) return;
    event.preventDefault();
    const halts = [...losses.slice(0, 1), ...almost].sort((one, other) => one - other);
    rest(halts.find(halt => halt !== position && (fresh || halt > position)) ?? last);
  }

  // The picture is the slider, too: a pointer that is pressed takes the time with it.
  function drag(panel, event) {
    if (event.type === 'pointerdown') event.currentTarget.setPointerCapture(event.pointerId);
    else if (!event.buttons) return;
    const { us } = panel.timeAt(event);
    const to = steps.findLastIndex(one => one.us <= us) + 1;
    stop();
    speak(false);
    if (to !== position) go(to);
  }

  // One message lights up wherever it is: in a queue, on a thread, among the lost, in the picture.
  function light(panel, is) {
    panel.node.querySelectorAll('[data-is]').forEach(one => one.classList.toggle('replay-same', one.dataset.is === is));
    panel.light(is);
  }

  panels.filter(({ timeAt }) => timeAt).forEach(panel => {
    const svg = panel.node.querySelector('.replay-picture svg');
    ['pointerdown', 'pointermove'].forEach(kind => svg.addEventListener(kind, event => {
      drag(panel, event);
      light(panel, panel.timeAt(event).is);
    }));
    ['pointerup', 'pointercancel'].forEach(kind => svg.addEventListener(kind, () => speak(true)));
    ['pointerover', 'pointerdown'].forEach(kind => panel.node.addEventListener(kind, ({ target }) => {
      if (!svg.contains(target)) light(panel, target.closest('[data-is]')?.dataset.is);
    }));
    panel.node.addEventListener('pointerleave', () => light(panel));
  });

  wake(root, 'replay');
  root.addEventListener('keydown', onKey);
  root.addEventListener('next-stop', onStop);
  root.querySelectorAll('figure').forEach(figure => figure.remove());
  const controls = element('div', { class: 'replay-controls' }, back, forth, play, faster, slider);
  root.querySelector('.replay-on > p').before(controls, says, shown); // which is then below
  nameSpeed();
  rest(telling);
  fresh = telling > 0;
  if (isNew) {
    root.classList.add('replay-new');
    shown.nextElementSibling.remove(); // it tells the end
  }
  if (hides) says.textContent = 'Have you guessed? Then play it.';
  else if (bump !== undefined && outcome()) says.textContent = outcome();
  nameButton();
}

const root = document.currentScript.closest('.replay');
show(root, JSON.parse(root.dataset.record));
