// Keys and fingers for the buttons of by_hand.py, which are widgets: a widget knows only clicks.

const KEYS = { ArrowUp: 'forward', ArrowDown: 'back', ArrowLeft: 'left', ArrowRight: 'right', End: 'end', ' ': 'stop' };
const area = document.currentScript.closest('.jp-Cell-outputArea, .jp-OutputArea') ?? document.body;
const click = name => area.querySelector(`.hand-${name}`)?.click();
const isOver = () => !area.querySelector('.by-hand');
let held = null;
let byKey = false;

function press(name) {
  if (held === name) return;
  held = name;
  click(name);
}

function release() {
  if (held === null) return;
  held = null;
  click('stop');
}

function onKey(event) {
  const name = KEYS[event.key];
  if (!name || event.ctrlKey || event.metaKey || event.altKey || event.shiftKey) return;
  if (isOver()) return;
  event.preventDefault();
  event.stopPropagation();
  byKey = true;
  if (event.type === 'keydown') press(name);
  else release();
}

function onPointer(event) {
  const button = event.target.closest?.('.by-hand button');
  const name = button && Object.values(KEYS).find(one => button.classList.contains(`hand-${one}`));
  byKey = false;
  if (name && name !== 'end') press(name);
}

// Wherever one has clicked in the picture, the keys drive: else they would go to JupyterLab, which
// folds the lesson away.
function onEnd() {
  if (!isOver()) setTimeout(focus);
}

function focus() {
  area.querySelector('.by-hand-keys')?.focus({ preventScroll: true });
}

// A press that was held is over when it is let go: its click would begin it again.
function onClick(event) {
  if (event.isTrusted && event.detail && event.target.closest?.('.by-hand button:not(.hand-end)')) event.stopPropagation();
}

area.addEventListener('click', onClick, true);
area.addEventListener('keydown', onKey, true);
area.addEventListener('keyup', onKey, true);
area.addEventListener('pointerdown', onPointer);
area.addEventListener('blur', () => byKey && release(), true);
for (const name of ['pointerup', 'pointercancel']) window.addEventListener(name, release);
area.addEventListener('click', onEnd);
focus();
// JupyterLab has brought the next cell into view, and with it pushed the picture out.
area.scrollIntoView({ block: 'end' });
// When the buttons go, the selected cell gets the keys: Shift+Enter runs it.
new MutationObserver((_, observer) => {
  if (area.querySelector('.by-hand, .by-hand-keys')) return;
  observer.disconnect();
  if (document.activeElement !== document.body) return;
  area.closest('.jp-Notebook')?.querySelector('.jp-Cell.jp-mod-active')?.focus({ preventScroll: true });
}).observe(area, { childList: true, subtree: true });
