// Free play as a page shows it: a slider for each number, and the picture of free.js's prediction.

const NAMES = {
  period: ['period (s)', 0.01, 0.5, 0.01],
  callback: ['callback (s)', 0.01, 1, 0.01],
  depth: ['depth', 1, 41, 1],
  threads: ['threads', 1, 10, 1],
};
const [WIDTH, ROW] = [720, 6]; // pixels

function drawn(messages) {
  const end = Math.max(...messages.flatMap(({ arrived, ended = 0, lost = 0 }) => [arrived, ended, lost]));
  const x = at => (at / end * WIDTH).toFixed(1);
  const paths = { waits: '', runs: '', lost: '' };
  messages.forEach(({ arrived, started, ended, lost }, row) => {
    const y = ROW * (row + 0.5);
    paths.waits += `M${x(arrived)} ${y}H${x(started ?? lost)}`;
    if (started !== undefined) paths.runs += `M${x(started)} ${y}H${x(ended)}`;
    else paths.lost += `M${x(lost) - 2} ${y - 2}l4 4m0-4l-4 4`;
  });
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('viewBox', `-4 0 ${WIDTH + 8} ${ROW * messages.length}`);
  svg.setAttribute('role', 'img');
  svg.setAttribute('aria-label', 'A row for each message: a thin line while it waits, a bar while '
    + 'its callback runs, a cross where it is pushed out.');
  for (const [name, d] of Object.entries(paths)) {
    const path = document.createElementNS(svg.namespaceURI, 'path');
    path.setAttribute('d', d);
    path.setAttribute('class', `free-${name}`);
    svg.append(path);
  }
  return svg;
}

function show(root, values) {
  const says = element('p', { 'aria-live': 'polite', class: 'replay-says' });
  const picture = element('div');
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
    const messages = predicted(now);
    says.textContent = told(messages);
    picture.replaceChildren(drawn(messages));
  }

  root.classList.add('replay-on');
  root.setAttribute('role', 'group');
  root.setAttribute('aria-label', 'free play');
  root.addEventListener('keydown', event => event.stopPropagation());
  root.querySelector('.free-static').replaceWith(
    element('div', { class: 'replay-controls' }, ...sliders.map(({ node }) => node),
      element('label', {}, 'group ', group)),
    says, picture);
  draw();
}

const root = document.currentScript.closest('.replay');
show(root, JSON.parse(root.dataset.free));
