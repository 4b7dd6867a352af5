// The notes window. It asks the deck, which has opened it, for what it shows: either of the two may be
// reloaded. The deck also tells by itself when it goes on.
//
//   to the deck     'notes?'
//   from the deck   null, as long as it shows no slide, or what `tell` of presenter.js sends

const ASK_MS = 500;
const SILENT_MS = 3000;

const find = id => document.getElementById(id);
let shown = {};
let heard = -Infinity; // when the deck has last told something

addEventListener('message', ({ origin, source, data }) => {
  if (origin !== location.origin || source !== opener) return;
  heard = performance.now();
  if (data) show(data);
});

function follow() {
  opener?.postMessage('notes?', location.origin);
  find('trouble').textContent = trouble();
  find('clock').textContent = new Date().toLocaleTimeString([], { hour: '2-digit', minute: '2-digit', hourCycle: 'h23' });
  if (shown.lesson) showMinutes();
}

function trouble() {
  if (!opener || opener.closed) return 'The deck is closed. In a new one, press N.';
  if (performance.now() - heard < SILENT_MS) return shown.lesson ? '' : 'Waiting for the deck';
  return shown.lesson ? 'The deck does not answer.' : 'Waiting for the deck';
}

function showMinutes() {
  const { began, planned } = shown;
  const gone = began ? Math.floor((Date.now() / 1000 - began) / 60) : 0;
  find('gone').textContent = gone;
  find('behind').textContent = Math.max(gone - planned, 0);
  find('behind').classList.toggle('late', gone > planned);
}

function show(state) {
  const before = shown;
  shown = state;
  document.title = `Notes: ${state.lesson}`;
  find('slide').textContent = `${state.slide} of ${state.slides}`;
  for (const id of ['own', 'planned', 'all', 'step']) find(id).textContent = state[id];
  showMinutes();
  for (const id of ['rest', 'notes', 'next']) {
    if (state[id] === before[id]) continue; // what is unfolded or scrolled stays so
    find(id).innerHTML = state[id];
    scrollTo(0, 0);
  }
  find('goes-on').hidden = !state.rest;
}

setInterval(follow, ASK_MS);
follow();
