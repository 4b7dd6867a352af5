// A drive while it happens: the floor of floor.js and the queue of board.js, as live.py tells of them
// by the event 'drive'. Between two tellings the robot goes on, a little later than it does.

import { board } from '../replay/board.js';
import { clock } from '../replay/clock.js';
import { controls } from '../replay/controls.js';
import { drawing, element, row } from '../replay/element.js';
import { drive } from './drive.js';
import { drivePanel } from './floor.js';

const LATE_MS = [150, 300]; // later than this it hurries, and more it never is

function live(root, record) {
  const { depth } = record;
  const run = drive(record, root);
  const shown = drivePanel(run, record, drawing(root.querySelector('img')));
  const says = element('p', { class: 'replay-says' });
  const time = element('span', { class: 'replay-time' });
  const lost = element('span', { class: 'replay-count' });
  const setup = { callbacks: [{ name: 'callback', depth }], threads: ['thread 1'], groups: [] };
  const queue = depth && board(setup, ['threads', 'queue']);
  let [ms, heard] = [0, 0];

  // Rows come again and again: a telling may be lost.
  function put(rows) {
    for (const [name, { from, added }] of Object.entries(rows)) {
      while (record[name].length < from) record[name].push(record[name].at(-1) ?? added[0]);
      record[name].splice(from, record[name].length, ...added);
    }
    run.grow();
  }

  function hear({ detail }) {
    if (!root.isConnected) return document.removeEventListener('drive', hear);
    if (detail.id !== record.id) return;
    put(detail.rows);
    heard = detail.ms;
    Object.assign(record, { took: detail.took });
    says.textContent = detail.says;
    if (!queue) return;
    setup.threads = detail.busy.map((_, i) => `thread ${i + 1}`);
    const item = seq => ({ callback: 0, seq });
    queue.draw({ runs: detail.busy.map(seq => (seq === null ? undefined : item(seq))), queues: [detail.waits.map(item)], lost: [], values: {} });
    queue.look()();
    lost.textContent = `${detail.lost} lost`;
  }

  // The row of a replay, of which nothing can be used yet.
  const { node: above, put: slide, name } = controls(0, 1, {});
  above.ariaHidden = 'true';
  slide(1);
  name('● Live');
  for (const one of above.children) one.disabled = true;

  const beside = queue && element('div', { class: 'replay-run' }, row('time', time), queue.rows[0], row('', lost), queue.rows[1]);
  root.querySelectorAll('figure').forEach(figure => figure.remove());
  root.querySelector('p').before(above, says, element('div', { class: 'replay-runs' }, shown.node, ...(queue ? [beside] : [])));
  root.classList.add('replay-on');
  document.addEventListener('drive', hear);
  put({});
  clock(root, passed => {
    const hurry = heard - ms > LATE_MS[0] ? 1.25 : 1;
    ms = Math.min(Math.max(ms + hurry * passed, heard - LATE_MS[1]), heard);
    shown.pass(1000 * ms);
    time.textContent = `${(ms / 1000).toFixed(3)} s`;
  }).start();
}

const root = document.currentScript.closest('.replay');
live(root, JSON.parse(root.dataset.live));
