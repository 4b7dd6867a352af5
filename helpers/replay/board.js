// A state of model.js as lists that can be read. A message moves from where it was before.

import { element, row } from './element.js';
import { keep } from './keep.js';
import { model } from './model.js';
import { isCalm } from './motion.js';

const MOST = 27; // of the messages of a list
const PLACES = 40; // free ones that are drawn
const MOVES_MS = 250;

// Return the rows of a board; `draw(state, stuck)`, where `stuck` are the ids of runs that never go on; and
// `look()`, which looks where each message is now, and returns what lets it come from where it was. To look
// lays out the page: so all boards look after all else is drawn, and before anything moves.
// Names are those of the rows: threads, groups, queue, lost, or a number of the setup. `full` names
// each message on a thread in full; `losses` is how many messages will be lost; `folds`, whether a
// number stands for those that are lost, until it is opened.
export function board(setup, names, { full = false, losses = 0, folds = false } = {}) {
  const { callbacks, threads, groups } = setup;
  const many = callbacks.length > 1;
  const count = element('span', { class: 'replay-count' });
  const free = element('span', { 'aria-hidden': 'true' });
  const lists = names.map(name => element('ul', { 'aria-label': name, role: 'list', class: `replay-${name}` }));
  const rows = lists.map((list, i) => {
    const name = names[i];
    if (name === 'lost' && folds) {
      return element('div', { class: 'replay-row' }, element('div', {}, element('details', {}, element('summary', {}, count), list)));
    }
    const made = row(name, list, ...(name === 'queue' ? [free] : []));
    if (!many && ['queue', 'lost'].includes(name)) made.lastChild.className = 'replay-places';
    if (!many && name === 'lost') made.lastChild.style.setProperty('--rows', Math.ceil(Math.min(losses, MOST) / 10));
    return made;
  });

  const named = item => (many ? model.named(setup, item) : `${item.seq}`);
  const message = (item, text = named(item)) => ({ is: `${item.callback} ${item.seq}`, text });

  // Of each list its items: a class, and what is in it.
  const ITEMS = {
    threads: (state, kind) => (threads.length ? threads.map((name, i) => {
      const run = state.runs[i];
      if (!run) return ['replay-free', `${name}: free`];
      const seen = run.seen === undefined ? '' : `, has read ${run.seen}`;
      return [kind(run), `${name}: `, message(run, full ? model.named(setup, run) : named(run)),
        `${seen}${run.waits ? ', waits' : ''}`];
    }) : [['replay-free', 'no executor']]),
    groups: (state, kind) => groups.map(({ name, exclusive }, group) => {
      if (!exclusive) return ['replay-free', `${name}: lets all in`];
      const holder = model.holderOf(setup, state, group);
      return holder ? [kind(holder), `${name}: held by ${full ? model.named(setup, holder) : named(holder)}`]
        : ['replay-free', `${name}: free`];
    }),
    queue: state => {
      const waiting = state.queues.flatMap((queue, callback) => queue.map(item => ({ ...item, callback })));
      const more = waiting.length - PLACES;
      return waiting.slice(0, PLACES).map(item => ['', message(item)])
        .concat(more > 0 ? [['replay-more', `and ${more} more`]] : []);
    },
    lost: ({ lost }) => (lost.length > MOST ? [['replay-more', `${lost.length - MOST} before`]] : [])
      .concat(lost.slice(-MOST).map(item => ['', message(item)])),
  };

  const made = part => (part.is ? element('b', { 'data-is': part.is }, part.text) : part);

  function draw(state, stuck = []) {
    const kind = ({ id }) => (stuck.includes(id) ? 'replay-stuck' : 'replay-busy');
    lists.forEach((list, i) => {
      const items = ITEMS[names[i]]?.(state, kind) ?? [['', `${state.values[names[i]] ?? 0}`]];
      keep(list, items, ([kind, ...content]) => element('li', { class: kind }, ...content.map(made)));
    });
    const empty = callbacks.flatMap(({ depth, name }, i) => (many && depth > 4 ? []
      : Array(Math.max(Math.min(depth, PLACES) - state.queues[i].length, 0)).fill(many ? name : '')));
    keep(free, empty, name => element('i', {}, name));
    count.textContent = `${state.lost.length} lost`;
  }

  // Where each message is drawn, within the board. What is folded would be laid out for that alone.
  const places = () => new Map(rows.filter(one => !one.querySelector('details:not([open])'))
    .flatMap(one => [...one.querySelectorAll('[data-is]')])
    .map(node => [node.dataset.is, { node, x: node.offsetLeft, y: node.offsetTop }]));
  let before;

  function look() {
    if (isCalm()) return () => {};
    const [then, now] = [before, places()];
    before = rows[0].offsetParent ? now : undefined; // nobody sees it
    return () => then && before && now.forEach(({ node, x, y }, is) => come(node, x, y, then.get(is)));
  }

  function come(node, x, y, from) {
    if (from && from.x === x && from.y === y) return;
    const start = from ? { transform: `translate(${from.x - x}px, ${from.y - y}px)` }
      : { transform: 'translate(2em)', opacity: 0 };
    node.animate([start, { transform: 'none' }], { duration: MOVES_MS, easing: 'ease-out' });
  }

  return { rows, draw, look };
}
