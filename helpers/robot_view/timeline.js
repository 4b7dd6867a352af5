// The time axis below a lane: when each message was published, which one had a callback, and when one
// was pushed out. A line leads from the callback of now to the moment at which its message was made.
// Its dataset is what axis.js wants of a picture of a run.

import { seen, shape } from '../replay/element.js';
import { DOES } from '../replay/walk.js';

// Return its `svg`, and `now(us)`, which leads the line.
export function timeline({ setup: { callbacks: [{ depth }] }, moves }, [from, until]) {
  const [LEFT, RIGHT, ROW] = [92, 20, 28];
  const WIDTH = matchMedia('(max-width: 600px)').matches ? 420 : 720; // narrower there, not smaller
  const wide = WIDTH - LEFT - RIGHT;
  const x = us => +(LEFT + wide * (us / 1e6 - from) / (until - from)).toFixed(1);
  const y = row => 6 + ROW * (row + 0.5);
  const bottom = 12 + 3 * ROW;
  const looks = { class: 'timeline', viewBox: `0 0 ${WIDTH} ${bottom + 32}`, 'font-size': 16, 'font-family': 'system-ui, sans-serif', fill: 'currentColor' };
  const svg = seen(shape('svg', looks), 'A time axis: when each message was published, which one had a callback, and when one was lost.');
  const add = (name, attributes, text = '') => {
    const made = shape(name, attributes, text);
    svg.append(made);
    return made;
  };

  const waits = []; // those that wait: when they were published
  const runs = {}; // of a thread: the callback that it has
  const begun = []; // callbacks: when their message was published, their begin, their end
  let [published, lost] = ['', ''];
  for (const [us, kind, , thread] of moves) {
    if (DOES[kind] === 'arrive') {
      waits.push(us);
      published += `M${x(us)} ${y(0) - 7}v14`;
      if (waits.length > depth) lost += `M${x(us)} ${y(2)}m-4-4l8 8m0-8l-8 8`;
      if (waits.length > depth) waits.shift();
    } else if (DOES[kind] === 'take') begun.push(runs[thread] = [waits.shift(), us, 1e6 * until]);
    else if (DOES[kind] === 'end' && runs[thread]) runs[thread][2] = us;
  }
  ['published', 'callback', 'lost'].forEach((name, row) => add('text', { x: LEFT - 10, y: y(row) + 5, 'text-anchor': 'end' }, name));
  add('path', { d: published, stroke: 'var(--look-waiting)', 'stroke-width': 2 });
  for (const [, begin, end] of begun) add('rect', { x: x(begin), y: y(1) - 8, width: Math.max(x(end) - x(begin) - 1, 1.5), height: 16, rx: 3, fill: 'var(--look-heard)' });
  add('path', { d: lost, stroke: 'var(--look-lost)', 'stroke-width': 2 });
  add('path', { d: `M${LEFT} ${bottom}h${wide}`, stroke: 'currentColor' });
  const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find(one => (until - from) / one <= 8) ?? 100;
  for (let n = Math.ceil(from / step); n * step <= until; n += 1) {
    add('path', { d: `M${x(1e6 * n * step)} ${bottom}v6`, stroke: 'currentColor' });
    add('text', { x: x(1e6 * n * step), y: bottom + 24, 'text-anchor': 'middle' }, `${+(n * step).toFixed(1)}`);
  }
  add('text', { x: WIDTH - RIGHT + 4, y: bottom + 24, 'text-anchor': 'start' }, 's');
  const link = add('path', { class: 'link', d: '', stroke: 'currentColor', 'stroke-width': 3, fill: 'none' });
  add('path', { class: 'cursor', d: `M${LEFT} 0V${bottom}`, stroke: 'currentColor', 'stroke-width': 1.5 });

  Object.assign(svg.dataset, { wide, left: LEFT, row: ROW, top: 6, rows: ',,' });
  return { svg, now(us) {
    const run = begun.findLast(([, begin]) => begin <= us);
    link.setAttribute('d', run ? `M${x(run[0])} ${y(0) + 7}V${y(0.5)}H${x(Math.min(us, run[2]))}V${y(1) - 8}` : '');
  } };
}
