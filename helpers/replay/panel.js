// The lists and the picture of one run of messages. With such a run come board.js, ring.js if its callbacks
// ask others, and timeline.js beside a lane.

import { axis } from './axis.js';
import { drawing, element, row } from './element.js';

// `run` is what walk.js returns of the record. Of `looks`: the `span` of its time axis; `short`, whether times
// are milliseconds; `grouped`, whether its groups are shown; `isNew`, whether what comes later is covered;
// `lane`, whether a drive is above it.
export function panel(run, record, image, { span, short, grouped, isNew, lane }) {
  const { setup, name } = record;
  const many = setup.callbacks.length > 1;
  const names = ['threads', ...(grouped ? ['groups'] : []), 'queue', ...(many ? [] : ['lost'])];
  const { rows, draw, look } = board(setup, names, { losses: run.scan().length, folds: lane });
  const time = element('span', { class: 'replay-time' });
  const circle = run.end && ring();
  const { svg, now } = lane ? timeline(record, span) : { svg: drawing(image) };
  const { point, at, light } = axis(svg, span, isNew);
  // No section: the deck takes each for a slide.
  const node = element('div', { class: 'replay-run', ...(name && { role: 'group', 'aria-label': name }) },
    row(name || 'time', time), ...rows, ...(circle ? [circle.node] : []), element('div', { class: 'replay-picture' }, svg));

  // Time goes on, and nothing happens.
  function pass(us) {
    time.textContent = short ? `${(us / 1e3).toFixed(3)} ms` : `${(us / 1e6).toFixed(3)} s`;
    point(us);
    now?.(us);
  }

  return { node, svg, at, pass, look, draw(position, us) {
    const { state } = run.seek(position);
    const { stuck } = run.circle?.(position) ?? { stuck: [] };
    circle?.draw(run.circle(position), run.end);
    pass(us ?? 1e6 * state.now);
    draw(state, stuck);
  }, light(is) {
    node.querySelectorAll('[data-is]').forEach(one => one.classList.toggle('replay-same', one.dataset.is === is));
    light(is);
  } };
}
