// Asks the server where the deck is, twice a second, and shows it.

const find = id => document.getElementById(id);
let shown = {};

async function follow() {
  try {
    const answer = await fetch('state');
    if (!answer.ok) throw new Error(answer.statusText);
    const state = await answer.json();
    find('trouble').textContent = state.lesson ? '' : 'Waiting for the deck';
    if (state.lesson) show(state);
  } catch {
    find('trouble').textContent = 'No connection to the deck: is `make present` running?';
  }
  find('clock').textContent = new Date().toLocaleTimeString([], { timeStyle: 'short' });
  setTimeout(follow, 500);
}

function show(state) {
  document.title = `Notes: ${state.lesson}`;
  find('slide').textContent = `${state.slide} of ${state.slides}`;
  find('gone').classList.toggle('late', state.gone > state.planned);
  for (const id of ['gone', 'own', 'planned', 'all', 'step']) find(id).textContent = state[id];
  for (const id of ['notes', 'cells']) {
    if (state[id] === shown[id]) continue; // what is unfolded or scrolled stays so
    find(id).innerHTML = state[id];
    scrollTo(0, 0);
  }
  shown = state;
}

follow();
