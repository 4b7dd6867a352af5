// The time axis of a picture is a slider, too. What picture.js and timeline.js say of it is in the dataset
// of their SVG: from where and how far the time goes, and the messages of its rows.

import { change, shape } from './element.js';

// `span` are its first and last second. If a run `isNew`, what comes later is covered.
export function axis(svg, [from, until], isNew) {
  const [wide, left, high, top] = ['wide', 'left', 'row', 'top'].map(name => +svg.dataset[name]);
  const rows = svg.dataset.rows.split(',');
  const cursor = svg.querySelector('.cursor');
  const later = shape('rect', { class: 'later', y: top, height: high * rows.length });
  if (isNew) svg.append(later);

  // Put the cursor to a time.
  function point(us) {
    const at = wide * Math.min(Math.max((us / 1e6 - from) / (until - from), 0), 1);
    cursor.setAttribute('transform', `translate(${at.toFixed(1)})`);
    if (isNew) change(later, { x: left + at, width: wide - at + 4 });
  }

  // Return where a pointer is: microseconds, and the message of that row, if any.
  function at({ clientX, clientY }) {
    const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(svg.getScreenCTM().inverse());
    const part = Math.min(Math.max((x - left) / wide, 0), 1);
    return { us: 1e6 * (from + part * (until - from)), is: rows[Math.floor((y - top) / high)] };
  }

  // Light up the row of a message, and no other.
  function light(is) {
    svg.querySelector('.same')?.remove();
    const row = rows.indexOf(is);
    if (row < 0) return;
    svg.prepend(shape('rect', { class: 'same', x: 0, y: top + high * row, width: '100%', height: Math.max(high, 4) }));
  }

  return { svg, point, at, light };
}
