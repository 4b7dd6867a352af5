// A replay as a page shows it: its runs beside each other, with one slider. What may happen is decided in
// model.js. Nothing is global: a page may have many replays. A run of messages comes with walk.js, and with
// circle.js if its callbacks ask others; one that has no setup is the drive of a robot, with floor.js.

import { clock } from './clock.js';
import { controls } from './controls.js';
import { drawing, element, wake } from './element.js';
import { panel } from './panel.js';
import { inOneOrder } from './steps.js';

const SHORT_US = 1e4; // of a run of less, milliseconds are shown
const HOLD_MS = 1200; // a sentence while it plays, at least

const asks = setup => setup.callbacks.some(({ does = [] }) => does.some(step => 'client' in step));

function walked(one, root) {
  if (!one.setup) return drive(one, root);
  return asks(one.setup) ? close(walk(one), one) : walk(one);
}

function show(root, record) {
  const runs = record.runs.map(one => walked(one, root));
  const { steps, done, after, stops } = inOneOrder(runs);
  const last = steps.length;
  const losses = stops.flat().sort((a, b) => a - b);
  const timeOf = position => steps[position - 1]?.us ?? 0;
  const named = (who, text) => (record.runs[who].name ? `${record.runs[who].name}: ` : '') + text;
  const sentence = (who, step) => runs[who].says?.(step) ?? runs[who].seek(step).says;
  const outcome = () => runs.flatMap((run, who) => {
    const says = run.outcome?.() ?? run.end?.says;
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
  let position = 0;
  let fresh = true; // as it was opened
  let [time, said] = [0, {}]; // while it plays

  const images = [...root.querySelectorAll('figure > img')];
  const looks = {
    span: record.span,
    short: timeOf(last) < SHORT_US,
    // One thread that runs one callback needs no group to be understood.
    grouped: record.runs.some(({ setup }) => setup?.callbacks.length > 1 || setup?.threads.length > 1),
    isNew: grows || (hides && drives.length > 0),
    lane: record.runs.some(({ strip }) => strip),
  };
  const panels = record.runs.map((one, i) => (one.setup ? panel(runs[i], one, images[i], looks)
    : drivePanel(runs[i], one, drawing(images[i]))));
  const says = element('p', { 'aria-live': 'polite', class: 'replay-says' });
  const shown = element('div', { class: 'replay-runs' }, ...panels.map(({ node }) => node));
  const { node: above, put, name, rate } = controls(timeOf(last), last, {
    step, toggle, slide: drag, rest: () => speak(true),
  });
  const player = clock(root, ms => {
    time += 1000 * ms * rate();
    let to = position;
    while (steps[to]?.us <= time) to += 1;
    go(to, time);
  });

  // A text that changes is read out, but not while it changes all the time.
  function speak(on) {
    if ((says.getAttribute('aria-live') === 'polite') === on) return;
    says.setAttribute('aria-live', on ? 'polite' : 'off');
    if (on) setTimeout(() => says.replaceChildren(says.textContent), 50);
  }

  // What is said of the steps since `from` while it plays.
  function tell(from) {
    const now = performance.now();
    steps.slice(from, position).forEach(({ who, step, rank }) => {
      if (!rank || (now < said.until && rank <= said.rank)) return;
      said = { rank, until: now + HOLD_MS };
      says.textContent = named(who, sentence(who, step + 1));
    });
  }

  // What is said at rest.
  function sayWhere() {
    const { who } = steps.slice(0, position).findLast(({ told }) => told) ?? {};
    const text = who === undefined ? '' : sentence(who, done(who, position));
    // A text that is set again is read out again.
    const now = (position === last && outcome()) || (text ? named(who, text) : 'Nothing has happened yet. Step: →');
    if (says.textContent !== now) says.textContent = now;
  }

  // `us` is the time while it plays, between two steps.
  function go(to, us) {
    const [from, plays] = [position, us !== undefined];
    fresh = false;
    position = Math.min(Math.max(to, 0), last);
    if (plays) tell(from);
    if (!plays || position === last) sayWhere();
    put(position);
    const changed = panels.filter((one, i) => !plays || done(i, from) !== done(i, position));
    panels.forEach((one, i) => {
      if (changed.includes(one)) one.draw(done(i, position), us ?? timeOf(position), plays);
      else one.pass(us);
    });
    changed.map(({ look }) => look?.()).forEach(move => move?.());
    if (position === last) {
      root.classList.remove('replay-new');
      stop();
    } else nameButton();
  }

  function nameButton() {
    name(player.runs() ? '❚❚ Pause' : fresh || position === last ? '▶ Watch again' : '▶ Play');
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

  function stop() {
    player.stop();
    nameButton();
    speak(true);
  }

  function run() {
    [time, said] = [timeOf(position), {}];
    speak(false);
    says.textContent = '';
    player.start();
    nameButton();
  }

  function toggle() {
    if (player.runs()) return rest(position);
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

  function onKey(key, target) {
    if (!KEYS[key] || (key === ' ' && target.tagName === 'BUTTON')) return false;
    KEYS[key]();
    return true;
  }

  // A clicker walks by two stops: the first loss, or the step before a circle closes, and the end. The
  // deck asks for the next one.
  const almost = runs.flatMap((run, who) => (run.almost > 0 ? [after(who, run.almost)] : []));
  function onStop(event) {
    if (position === last) return;
    event.preventDefault();
    const halts = [...losses.slice(0, 1), ...almost].sort((one, other) => one - other);
    rest(halts.find(halt => halt !== position && (fresh || halt > position)) ?? last);
  }

  // A slider takes the time with it.
  function drag(to) {
    stop();
    speak(false);
    if (to !== position) go(to);
  }

  // The picture is one, too. And one message lights up wherever it is: in a queue, on a thread, among the
  // lost, in the picture.
  panels.filter(({ at }) => at).forEach(({ node, svg, at, light }) => {
    function onPointer(event) {
      const { us: when, is } = at(event);
      if (event.type === 'pointerdown') svg.setPointerCapture(event.pointerId);
      if (event.buttons || event.type === 'pointerdown') drag(steps.findLastIndex(one => one.us <= when) + 1);
      light(is);
    }
    ['pointerdown', 'pointermove'].forEach(kind => svg.addEventListener(kind, onPointer));
    ['pointerup', 'pointercancel'].forEach(kind => svg.addEventListener(kind, () => speak(true)));
    ['pointerover', 'pointerdown'].forEach(kind => node.addEventListener(kind, ({ target }) => {
      if (!svg.contains(target)) light(target.closest('[data-is]')?.dataset.is);
    }));
    node.addEventListener('pointerleave', () => light());
  });

  // What is below does not move while it plays: the runs become higher, and never lower again. In letters,
  // for on a slide these change their size.
  let [tall, wide] = [0, 0];
  new ResizeObserver(() => {
    if (shown.offsetWidth !== wide) {
      [tall, wide] = [0, shown.offsetWidth];
      shown.style.minHeight = '';
    }
    const now = shown.offsetHeight / parseFloat(getComputedStyle(shown).fontSize);
    if (now < tall + 0.02) return;
    tall = now;
    shown.style.minHeight = `${tall.toFixed(2)}em`;
  }).observe(shown);

  wake(root, 'replay', onKey);
  root.addEventListener('next-stop', onStop);
  root.querySelectorAll('figure').forEach(figure => figure.remove());
  root.querySelector('.replay-on > p').before(above, says, shown); // which is then below
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
