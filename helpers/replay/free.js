// Free play as a page shows it: a slider for each number, and the picture of what is predicted.

import { element, seen, wake } from './element.js';
import { pictures } from './picture.js';
import { MESSAGES, predicted, told } from './predicted.js';
import { stories } from './stories.js';

const NAMES = {
  period: ['period (s)', 0.01, 0.5, 0.01],
  callback: ['callback (s)', 0.01, 1, 0.01],
  depth: ['depth', 1, 41, 1],
  threads: ['threads', 1, 10, 1],
};

const WORDS = 'A row for each message: a thin line while it waits, a bar while its callback runs, a cross '
  + 'where it is pushed out.';

function show(root, values) {
  const says = element('p', { 'aria-live': 'polite', class: 'replay-says' });
  const drawn = element('div', { class: 'replay-picture' });
  const group = element('select', { onchange: draw },
    ...['mutually exclusive', 'reentrant'].map(name => element('option', {}, name)));
  const sliders = Object.entries(NAMES).map(([name, [label, min, max, step]]) => {
    const number = element('output');
    const input = element('input', { type: 'range', min, max, step, value: values[name], oninput: draw });
    return { name, input, number, node: element('label', {}, `${label} `, input, number) };
  });

  function draw() {
    const now = { exclusive: group.selectedIndex === 0 };
    for (const { name, input, number } of sliders) {
      now[name] = +input.value;
      number.textContent = input.value;
    }
    const run = { ...predicted(now), time: 'time (s)' };
    says.textContent = told(stories(run, MESSAGES));
    [drawn.innerHTML] = pictures([run], [0, run.moves.at(-1)[0] / 1e6], 0);
    seen(drawn.firstChild, WORDS);
  }

  wake(root, 'free play');
  root.removeAttribute('tabindex');
  root.querySelector('.replay-static').replaceWith(
    element('div', { class: 'replay-controls' }, ...sliders.map(({ node }) => node),
      element('label', {}, 'group ', group)),
    says, drawn);
  draw();
}

const root = document.currentScript.closest('.replay');
show(root, JSON.parse(root.dataset.free));
