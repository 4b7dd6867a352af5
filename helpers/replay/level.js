// A level as a page shows it: lists that can be read, buttons, keys. What may be tried is decided in
// game.js, and a state is drawn by board.js. Nothing is global: a page may have many levels.

import { board } from './board.js';
import { circleOf, openOf } from './circle.js';
import { element, row, wake } from './element.js';
import { game } from './game.js';
import { ring } from './ring.js';

// A level is {goal, options: [{name, values}], variants: [{setup, begun, code, lesson, best,
// rclpy}]}: one variant for each combination of the options, the last option changing first.
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
  let lists;
  let waits;
  let open; // the newest circle that did not close

  const says = element('div', { 'aria-live': 'polite', class: 'replay-says' });
  const ready = element('ul', { 'aria-label': 'ready', role: 'list', class: 'level-ready' });
  const shown = element('div', { class: 'replay-runs' });
  const time = element('span', { class: 'replay-time' });
  const code = element('pre');
  const again = element('button', { type: 'button', onclick: begin }, 'Play again');
  const selects = level.options.map(({ name, values }) => element('select', { onchange: begin },
    ...values.map(value => element('option', {}, value))));

  const ROWS = { keep: ['lost'], lose: ['count'], answer: [], stop: ['places'] };

  function draw() {
    const over = now.isOver(state);
    const circle = circleOf(setup, state);
    lists.draw(state, over ? circle.stuck : []);
    open = openOf(setup, state) ?? open;
    if (over) waits.draw(circle.stuck.length || !open ? circle : open);
    time.textContent = `${+state.now.toFixed(3)} s`;

    const index = [...ready.children].findIndex(item => item.contains(document.activeElement));
    ready.textContent = '';
    now.choices(state).forEach(({ move, text }, place) => ready.append(element('li', {},
      element('button', { type: 'button', onclick: () => choose(move) },
        element('span', { 'aria-hidden': 'true', class: 'level-key' }, `${place + 1}`), text))));
    ready.classList.toggle('level-over', over);
    if (over) tell(result());
    lists.look()();
    if (index >= 0) (buttons()[index] ?? buttons()[0] ?? again).focus();
  }

  const buttons = () => [...ready.querySelectorAll('button')];
  const say = (text, kind) => says.append(element('p', { class: kind }, text));
  const tell = ([score, lesson]) => {
    say(score, 'level-score');
    say(lesson);
  };

  function result() {
    const own = now.score(state);
    const { best } = variant;
    const real = variant.rclpy === null ? '' : ` What the real rclpy did: ${words(variant.rclpy)}.`;
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
      if (now.isOver(state)) tell(result());
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
    open = undefined;
    const { threads, groups, arrivals } = setup;
    const grouped = threads.length * groups.length > 1 ? ['groups'] : [];
    const names = ['threads', ...grouped, 'queue', ...ROWS[level.goal]];
    waits = ring();
    lists = board(setup, names, { full: true });
    const timed = arrivals.at(-1).at ? [row('time', time)] : [];
    shown.replaceChildren(element('div', { class: 'replay-run' }, ...timed, ...lists.rows, waits.node));
    code.textContent = variant.code;
    code.hidden = !variant.code;
    says.textContent = '';
    say('Choose what happens next: a click, a number key, or Tab and Enter.');
    draw();
  }

  function leave() {
    document.activeElement.blur();
    root.parentElement.closest('[tabindex]')?.focus();
  }

  function onKey(key, target) {
    const chosen = target.tagName !== 'SELECT' && buttons()[+key - 1];
    if (chosen) chosen.click();
    else if (key === 'Escape') leave();
    else return false;
    return true;
  }

  wake(root, 'level', onKey);
  root.querySelector('.replay-static').replaceWith(
    element('div', { class: 'replay-controls' }, ...level.options.map(
      ({ name }, i) => element('label', {}, `${name} `, selects[i]))),
    code, says, ready, shown, element('div', { class: 'replay-controls' }, again));
  begin();
}

const root = document.currentScript.closest('.replay');
show(root, JSON.parse(root.dataset.level));
