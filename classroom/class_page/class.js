// Shows what the server sends. What students wrote is put into the page as text, never as HTML.
//
// #wall shows how to join only. #cell=ID shows the guesses of one cell, for a slide, on a dark one
// #cell=ID&dark. The slide says 'show' to have its button pressed, and 'drawn' or 'bars': whether it
// draws them itself.

const find = id => document.getElementById(id);
let drawn = false; // by the slide
const shown = {}; // by the id of an element: what was put there last, as JSON

function element(tag, text = '', properties = {}) {
  return Object.assign(document.createElement(tag), { textContent: text }, properties);
}

// A JupyterHub wants to be told what stands in its cookie.
function address(name) {
  const [, token] = document.cookie.match(/\b_xsrf=([^;]*)/) ?? [];
  return token ? `${name}?_xsrf=${token}` : name;
}

async function ask(what, body = {}) {
  const answer = await fetch(address(what), { method: 'POST', body: JSON.stringify(body) }).catch(() => null);
  if (!answer?.ok) find('trouble').textContent = 'The class does not answer.';
}

function button(text, what, body) {
  return element('button', text, { onclick: () => ask(what, body) });
}

// Puts new children into an element, unless they stand there: the focus of a button stays.
function put(id, state, draw) {
  const text = JSON.stringify(state);
  if (shown[id] === text) return;
  shown[id] = text;
  find(id).replaceChildren(...state.map(draw));
}

function guess({ question, answered, shown: open, bars = [], measured = [], by }, seats) {
  const box = element('article');
  const count = element('p', `${answered} of ${seats} have answered `, { className: 'count' });
  count.append(button(open ? 'Hide' : 'Show', open ? 'hide' : 'show', { question }));
  box.append(element('h2', question), count);
  if (!open) return box;
  const list = element('ol', '', { className: 'bars' });
  for (const { label, count, right } of bars) {
    const row = element('li', '', { className: right ? 'right' : '' });
    const bar = element('span', count, { className: 'bar' });
    bar.style.setProperty('--share', count / Math.max(answered, 1)); // of nobody: 0
    row.append(element('span', `${right ? '✓ ' : ''}${label}`, { className: 'label' }), bar);
    if (count && !right && label !== 'other') {
      const remove = button('×', 'remove', { question, answer: label });
      remove.title = `Take ${label} out of sight`;
      remove.className = 'remove';
      row.append(remove);
    }
    list.append(row);
  }
  box.append(list);
  if (by) box.append(element('p', `Measured in the last run of ${by === 1 ? 'one student' : `each of ${by} students`}: ${measured.join('; ')}`, { className: 'measured' }));
  return box;
}

// A name may be written from right to left: it turns nothing beside it.
function seatOf(seat, name) {
  const row = element('li');
  if (name) row.append(element('bdi', name), ` (seat ${seat}) `);
  else row.append(`Seat ${seat} `);
  return row;
}

function end() {
  live.close();
  document.body.replaceChildren(element('p', 'The class is over. What it was told is deleted.'));
}

function show(state) {
  if (state.over) return end();
  const [, cell, dark] = location.hash.match(/^#cell=([\w-]+)(&dark)?/) ?? [];
  document.documentElement.style.colorScheme = cell ? (dark ? 'dark' : 'light') : '';
  document.body.className = cell ? `slide${drawn ? ' drawn' : ''}` : location.hash === '#wall' ? 'wall' : '';
  find('trouble').textContent = '';
  const { planned, own, all, gone } = state;
  const left = minutes => (minutes < 0 ? `0 (${-minutes} over)` : minutes);
  const who = state.seats === 1 ? 'student' : 'students';
  // What was not used before is not more time for this step.
  const texts = { ...state, who, of_step: left(Math.min(planned - gone, own)), of_lesson: left(all - gone) };
  for (const id of ['seats', 'who', 'of_step', 'of_lesson', 'step']) find(id).textContent = texts[id];
  put('lessons', state.lessons, ({ name, title, here, now }) =>
    element('option', here ? `${title} (${here})` : title, { value: name, selected: now }));
  const { name } = state.lessons.find(lesson => lesson.now);
  put('steps', state.steps.map(step => ({ ...step, name })), ({ title, here, now }, number) => {
    const step = element('li');
    const go = button(title, 'go', { lesson: name, step: number });
    if (now) go.setAttribute('aria-current', 'step');
    go.prepend(element('b', here || ''));
    step.append(go);
    return step;
  });
  const guesses = state.guesses.filter(one => !cell || one.cells.includes(cell));
  put('guesses', guesses.map(one => ({ ...one, seats: state.seats })), one => guess(one, state.seats));
  put('people', state.people, ({ seat, name }) => {
    const person = seatOf(seat, name);
    const out = button('×', 'send_away', { seat });
    out.title = `Take ${name || `seat ${seat}`} out of the class`;
    person.append(out);
    return person;
  });
  find('door').textContent = state.closed ? 'Let new students join' : 'Let nobody new join';
  find('door').onclick = () => ask(state.closed ? 'open_door' : 'close_door');
  put('hands', state.hands, ({ seat, name }) => {
    const hand = seatOf(seat, name);
    hand.append(button('Done', 'lower', { seat }));
    return hand;
  });
  find('tasks').tBodies[0].replaceChildren(...state.tasks.map(one => {
    const row = element('tr');
    row.append(element('th', `Task ${one.number}`));
    for (const key of ['solved', 'tried', 'open']) row.append(element('td', one[key]));
    return row;
  }));
  put('about', state.about, ({ about, tasks }) =>
    element('li', `${about}: ${tasks.map(({ number, who }) => `task ${number}: ${who.join(', ')}`).join('; ')}`));
  find('joins').textContent = state.joins.join('\n');
  const here = location.href.replace(/[?#].*/, '');
  find('slides').textContent = state.secret && `Slides on your machine: make present LESSON=02 CLASS=${here}${state.secret}/`;
  if (cell) tellDeck(guesses);
  if (shown.notes !== state.notes) find('notes').innerHTML = shown.notes = state.notes; // the lesson's
}

// The deck draws the numbers into the picture.
let told;
function tellDeck(guesses) {
  told = guesses.map(({ question, values = [] }) => ({ question, values }));
  parent.postMessage({ height: document.documentElement.offsetHeight, guesses: told }, '*');
}
new ResizeObserver(() => told && tellDeck(told)).observe(document.documentElement);

const live = new EventSource(address('live'));
let last;
live.onmessage = message => show((last = JSON.parse(message.data)));
live.onerror = () => (find('trouble').textContent = 'No connection to the class: is `make class` running?');
onhashchange = () => {
  for (const id in shown) delete shown[id];
  show(last);
};
onmessage = ({ source, data }) => {
  if (source !== parent) return;
  if (data === 'show') return document.querySelector('.count button')?.click();
  drawn = data === 'drawn';
  if (last) show(last);
};
find('lessons').onchange = event => ask('go', { lesson: event.target.value, step: 0 });
find('end').onclick = async () => {
  if (!confirm('End the class, and delete what it was told?')) return;
  await ask('end');
  end();
};
