// What `make present` adds to jupyterlab-slideshow 0.3.4: editing stays editing, keys that change
// the notebook do nothing, a clicker walks and steps through replays, and the deck is where it was
// after a reload. It also keeps that place for the notes window and for the class page, and shows
// the guesses of the class below the cells that ask for them and that compare them.
//
// JupyterLab loads this file as it is. It has the form of a prebuilt extension, so that neither
// webpack nor npm is needed.

const STATE = 'deck'; // a workspace of JupyterLab's server: it outlives the tab and the server
const LESSON_S = 4 * 3600; // a deck that was left open longer begins anew
// Of JupyterLab's keys in command mode, those that leave the notebook as it is.
const HARMLESS =
  /^(Arrow(Left|Right|Up|Down)|(Control|Shift) Enter|(Shift )?Tab|Enter|Control s|i|0)$/;
const STEPS = ['PageDown', 'ArrowRight']; // a replay on the slide takes these before the deck
const ACTIONS = {
  ' ': 'next',
  PageDown: 'next',
  'Shift  ': 'back',
  PageUp: 'back',
  Home: 'first',
  End: 'last',
  b: 'black',
  '.': 'black',
  n: 'notes',
  Escape: 'leave',
};

let baseUrl; // of JupyterLab's server

async function extension() {
  // The slideshow's plugin object is the only way to the token of its manager.
  const slideshow = await window._JUPYTERLAB['jupyterlab-slideshow'].get('./extension');
  const { provides } = slideshow().default.find(plugin => plugin.id.endsWith(':plugin'));
  const plugin = { id: 'presenter:plugin', autoStart: true, requires: [provides], activate };
  return () => ({ __esModule: true, default: plugin });
}

function activate(app, manager) {
  ({ baseUrl } = app.serviceManager.serverSettings);
  const style = document.createElement('link');
  style.rel = 'stylesheet';
  style.href = `${baseUrl}lab/extensions/presenter/deck.css`;
  document.head.append(style);
  // The slideshow waits for `started`, too, and for more: this comes before its first slide.
  void app.started.then(() => {
    const presenter = manager._presenters.find(one => one.id === 'notebooks');
    keepEditing(presenter);
    keepPlace(presenter, app.serviceManager.workspaces);
    // The slideshow remembers that it was left. A page of `make present` begins with slides.
    void manager._settings.then(settings => settings.set('active', true));
    // Of a page that was loaded with slides, JupyterLab keeps other open notebooks back, and puts
    // them in the place of this one when the slides are left.
    void app.restored.then(() => (app.shell._layoutRestorer._deferred.length = 0));
    window.addEventListener('message', ({ source, data }) => {
      const frame = document.getElementById('deck-guesses');
      if (source !== frame?.contentWindow) return;
      frame.style.height = `${Number(data)}px`;
      frame.scrollIntoView({ block: 'nearest' }); // many bars are more than the slide has room for
      // A click on "Show" took the focus: the keys of the deck want it back.
      if (document.activeElement === frame) manager.activeWidget.content.activeCell.node.focus();
    });
    // A replay takes its keys first. At its ends it lets the walking ones go on to the deck. Escape
    // leads out of it: a level does that itself.
    const inReplay = ({ key, target }) =>
      target.closest?.(key === 'Escape' ? '.level' : '.replay-on');
    const walk = event => onKey(event, manager, presenter);
    window.addEventListener('keydown', event => inReplay(event) || walk(event), true);
    window.addEventListener('keydown', event => inReplay(event) && walk(event));
  });
}

// The slideshow takes the focus out of the editor, and out of a replay, at each change of the state
// of the document: at the first key after a save, because that makes it unsaved again.
function keepEditing(presenter) {
  const show = presenter._onActiveCellChanged;
  presenter._onActiveCellChanged = async function (notebook) {
    const { activeCell, mode } = notebook;
    const editing = mode === 'edit';
    const focus = document.activeElement;
    const inside = editing || (focus !== activeCell?.node && activeCell?.node.contains(focus));
    if (inside && activeCell.hasClass('jp-deck-mod-visible')) return;
    await show.call(this, notebook);
    if (editing) notebook.mode = 'edit';
  };
}

function keepPlace(presenter, workspaces) {
  const start = presenter.start;
  const empty = { places: {}, began: {} }; // by the notebook's path; `began` in seconds
  const fetched = workspaces.fetch(STATE).then(({ data }) => ({ ...empty, ...data }), () => empty);
  const known = new WeakSet();
  let saved = fetched;
  presenter.start = async function (panel) {
    await start.call(this, panel);
    const [deck] = await Promise.all([fetched, panel.context.ready]);
    const { path } = panel.context;
    const keep = notebook => {
      deck.current = path;
      deck.places[path] = notebook.activeCellIndex;
      const now = Date.now() / 1000;
      if (notebook.activeCellIndex > 0 && !(now - deck.began[path] < LESSON_S))
        deck.began[path] = now;
      const state = { data: deck, metadata: { id: STATE } };
      saved = saved.then(() => workspaces.save(STATE, state)).catch(console.warn);
      void showGuesses(notebook);
    };
    if (!known.has(panel)) {
      known.add(panel);
      saveInTurn(panel.context);
      followOutputs(panel.content);
      panel.content.widgets.forEach(showNumber);
      if (path in deck.places) panel.content.activeCellIndex = deck.places[path];
      panel.content.activeCellChanged.connect(keep);
    }
    presenter.beginAnew = () => delete deck.began[deck.current];
    keep(panel.content);
  };
}

// JupyterLab takes the file of a save that has not ended for somebody else's, and asks about "File
// Changed", where a second save begins: Ctrl+S during an autosave.
function saveInTurn(context) {
  const save = context.save.bind(context);
  let last = Promise.resolve();
  context.save = options => (last = last.catch(() => {}).then(() => save(options)));
}

// The number of a cell is folded with its code, and with it what says that the cell runs.
function showNumber({ model, node }) {
  const show = () => {
    const place = node.querySelector('.jp-InputPlaceholder > .jp-Placeholder-prompt');
    const number = model.executionState === 'running' ? '*' : (model.executionCount ?? ' ');
    if (place) place.textContent = `[${number}]:`;
  };
  model.stateChanged.connect(show);
  show();
}

// The end of an output comes into view when it is below the slide, as that of a traceback is. Who
// has scrolled keeps the place until a cell is run or another slide is shown.
function followOutputs(notebook) {
  const { node } = notebook;
  let scrolled = false;
  const setScrolled = value => () => (scrolled = value);
  for (const kind of ['wheel', 'touchmove'])
    node.addEventListener(kind, setScrolled(true), { passive: true });
  node.addEventListener('keydown', ({ key }) => key === 'Enter' && setScrolled(false)(), true);
  notebook.activeCellChanged.connect(setScrolled(false));
  const follow = changed => {
    const place = changed.closest ? changed : changed.parentElement;
    const output = place?.closest('.jp-Deck .jp-deck-mod-onscreen .jp-OutputArea');
    if (!output || scrolled) return;
    if (output.getBoundingClientRect().bottom > innerHeight) output.scrollIntoView({ block: 'end' });
  };
  const observer = new MutationObserver(changes => changes.forEach(({ target }) => follow(target)));
  observer.observe(node, { childList: true, characterData: true, subtree: true });
  node.addEventListener('load', ({ target }) => follow(target), true); // of a picture
}

async function showGuesses(notebook) {
  document.getElementById('deck-guesses')?.remove();
  const cell = notebook.activeCell;
  const asks = cell?.model.getMetadata('tags')?.includes('predict');
  if (!asks && !cell?.model.sharedModel.getSource().includes('compare_prediction(')) return;
  const page = await fetch(`${baseUrl}class`).then(answer => answer.text());
  const reached = page && (await fetch(page, { mode: 'no-cors' }).catch(() => null));
  if (!reached || notebook.activeCell !== cell) return;
  const frame = document.createElement('iframe');
  frame.id = 'deck-guesses';
  frame.title = 'Guesses of the class';
  frame.src = `${page}#cell=${cell.model.id}`;
  document.getElementById('deck-guesses')?.remove(); // of a second call
  cell.node.append(frame);
}

function onKey(event, manager, presenter) {
  const notebook = manager.activeWidget?.content;
  const nowhere = event.target === document.body; // as after a reload
  if (
    document.body.dataset.jpDeckMode !== 'presenting' ||
    !notebook?.activeCell ||
    !(nowhere || notebook.node.contains(event.target)) ||
    notebook.node.matches('.jp-mod-readWrite') ||
    (notebook.mode === 'edit' && !nowhere)
  ) {
    return;
  }
  if (nowhere) notebook.activeCell.node.focus();
  const modifiers = ['Control', 'Alt', 'Shift', 'Meta'].filter(key => event.getModifierState(key));
  const key = [...modifiers, event.key].join(' ');
  const black = document.body.classList.contains('deck-black');
  const replay = notebook.activeCell.node.querySelector('.replay-on:not(.level)');
  if (replay && !black && !replay.contains(event.target) && STEPS.includes(key)) {
    event.stopImmediatePropagation();
    event.preventDefault();
    replay.focus();
    replay.dispatchEvent(new KeyboardEvent('keydown', event));
    return;
  }
  if (key === 'Escape' && replay?.contains(event.target)) {
    event.stopImmediatePropagation();
    notebook.activeCell.node.focus(); // the next Escape leaves the slides
    return;
  }
  const action = black ? 'black' : ACTIONS[key];
  if (!action && HARMLESS.test(key) && !nowhere) return;
  event.stopImmediatePropagation(); // the browser's own keys, such as F5 and F11, still work
  if (action) {
    event.preventDefault();
    act(action, manager, presenter);
  } else if (HARMLESS.test(key)) {
    event.preventDefault();
    notebook.activeCell.node.dispatchEvent(new KeyboardEvent('keydown', event));
  }
}

function act(action, manager, presenter) {
  const { content } = manager.activeWidget;
  switch (action) {
    case 'next':
      return manager.go('down', 'forward');
    case 'back':
      return manager.go('up', 'back');
    case 'first':
      presenter._extents.delete(content.model); // each slide begins with its first part again
      presenter.beginAnew();
      content.activeCellIndex = 0;
      return;
    case 'last': {
      const leadsOn = ({ model }) => /^Next: \[/m.test(model.sharedModel.getSource());
      const link = content.widgets.findLastIndex(leadsOn);
      content.activeCellIndex = link < 0 ? content.widgets.length - 1 : link;
      return;
    }
    case 'black':
      document.body.classList.toggle('deck-black');
      return;
    case 'notes':
      return void window.open(`${baseUrl}notes/`, 'notes', 'popup');
    case 'leave':
      return leave(manager, content);
  }
}

async function leave(manager, notebook) {
  await manager.stop();
  // JupyterLab lays the notebook out in the next frame, and knows the heights of its cells then.
  await new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
  await notebook.scrollToItem(notebook.activeCellIndex, 'center');
}

window._JUPYTERLAB ??= {};
window._JUPYTERLAB.presenter = { init: () => {}, get: extension };
