// The deck of `make present`: the copies of lessons in the folder `presentation` as slides whose
// cells run. Which cell starts a slide is in the copies (../slides.py), and the deck keeps its place
// there, in the metadata `deck`. It tells its place to the notes window (notes.js), which it opens,
// and to the class page (README.md), if a class is open.
//
// JupyterLab loads this file as it is, in the form of a prebuilt extension. It hands over its own
// packages, so that neither webpack nor npm is needed, and nothing of it that is not public.

const COPIES = 'presentation/';
const LESSON_S = 4 * 3600; // a deck that was left open longer begins anew
const PLAN_S = 12 * 3600;
const SILENT = 'The server does not answer: look at its terminal. A new `make present` goes on here.';
const TWICE_MS = 2000; // I I, 0 0, R R and Escape Escape come within this time
const SAVE_MS = 300;
// Of the letters of a slide: what does not fit in the smallest ones is scrolled.
const SCALES = { texts: [1.6, 1.45, 1.3, 1.15, 1, 0.95, 0.9], code: [1.25, 1.1, 1, 0.95, 0.9] };
const LOG = [12, 54]; // more lines, of fewer letters each: half a slide is wide enough for them
const FIGURES = [42, 38, 34, 30]; // how high a picture is that makes room, in the unit of deck.css
const TYPED = 'textarea, select, [contenteditable], input:not([type=range], [type=number], [type=button])';
// What works with the focus in a replay, a level or a list, too: its other keys are its own.
const EVERYWHERE = ['pagedown', 'pageup', 'b', '.', 'n', 's', 'j', 't', 'escape', 'f5', 'Control s', 'Control r'];

let packages; // of JupyterLab, by name
let server; // { baseUrl, ask, open }
let plan = []; // the rows of the timetable from its first lesson on: { minutes, file, steps }
let markdown; // JupyterLab's parser
let deck; // the notebook's panel that is shown as slides, or nothing
let classGuesses = []; // what the page of the class shows on this slide: { question, values }
let twice = {}; // a key that does something at its second press

async function packageOf(name) {
  const [found] = Object.values(packages[`@jupyterlab/${name}`]);
  return (await found.get())();
}

async function extension() {
  const names = ['notebook', 'services', 'apputils', 'rendermime'];
  const [notebook, services, apputils, rendermime] = await Promise.all(names.map(packageOf));
  const activate = (app, tracker, parser) => {
    markdown = parser;
    begin(app, tracker, notebook.NotebookActions, services.ServerConnection, apputils.Dialog);
  };
  const requires = [notebook.INotebookTracker, rendermime.IMarkdownParser];
  const plugin = { id: 'presenter:plugin', autoStart: true, requires, activate };
  return () => ({ __esModule: true, default: plugin });
}

// --- The page ------------------------------------------------------------------------------------

const element = (tag, properties) => Object.assign(document.createElement(tag), properties);
const head = element('header', { id: 'deck-head', innerHTML: '<b></b><span></span><progress></progress>' });
const line = element('p', { id: 'deck-says', role: 'status' });
const back = element('button', { id: 'deck-back', textContent: 'Slides (F5)' });

function say(text) {
  line.textContent = text;
}

function begin(app, tracker, actions, { makeRequest }, dialogs) {
  const { serverSettings } = app.serviceManager;
  const { baseUrl } = serverSettings;
  const ask = async (what, body) => {
    const init = body === undefined ? {} : { method: 'POST', body: JSON.stringify(body) };
    const answer = await makeRequest(baseUrl + what, init, serverSettings);
    if (!answer.ok) throw new Error(answer.statusText);
    return answer;
  };
  server = { baseUrl, ask, open: path => app.commands.execute('docmanager:open', { path }) };
  for (const file of ['deck/look.css', 'lab/extensions/presenter/deck.css'])
    document.head.append(element('link', { rel: 'stylesheet', href: baseUrl + file }));
  const planKnown = ask('deck/plan').then(async answer => (plan = await answer.json()));
  document.body.append(head, line, back);
  back.onclick = () => show(tracker.currentWidget);
  const open = async panel => {
    if (!panel?.context.path.startsWith(COPIES)) return;
    await Promise.all([planKnown, panel.context.ready, panel.revealed]);
    if (!panel.isDisposed && tracker.currentWidget === panel && deck !== panel) {
      prepare(panel);
      show(panel);
    }
  };
  tracker.currentChanged.connect((_, panel) => void open(panel));
  void app.restored.then(() => open(tracker.currentWidget));
  for (const signal of [actions.executionScheduled, actions.executed])
    signal.connect((_, { notebook }) => {
      if (notebook !== deck?.content) return;
      update();
      deck.deckChanges();
    });
  window.addEventListener('keydown', event => onKey(event, tracker, actions), true);
  window.addEventListener('dblclick', event => {
    // A text would show its Markdown.
    if (deck && event.target.closest?.('.jp-MarkdownCell')) event.stopImmediatePropagation();
  }, true);
  window.addEventListener('message', onGuesses);
  document.addEventListener('class-wanted', () => setTimeout(tellPictures)); // once it is drawn
  window.addEventListener('message', onNotesWindow);
  window.addEventListener('resize', () => deck && fit());
  // A dialog has no place on a projector, and would take the keys: a line says what it says, and its
  // answer is that of Escape. JupyterLab cannot be told to ask elsewhere.
  new MutationObserver(() => {
    const asks = deck && dialogs.tracker.find(({ isAttached }) => isAttached);
    if (!asks) return;
    const parts = asks.node.querySelectorAll('.jp-Dialog-header, .jp-Dialog-body');
    const said = [...parts].map(part => part.textContent).filter(Boolean).join('. ');
    say(said.includes('Failed to fetch') ? SILENT : said);
    asks.reject();
  }).observe(document.body, { childList: true });
}

// --- A notebook ----------------------------------------------------------------------------------

const prepared = new WeakSet();

function prepare(panel) {
  if (prepared.has(panel)) return;
  prepared.add(panel);
  keepSaved(panel);
  const { content } = panel;
  content.activeCellChanged.connect(() => panel === deck && update());
  content.model.contentChanged.connect(() => panel === deck && update());
  // The end of an output comes into view, until somebody scrolls.
  const grown = new ResizeObserver(() => panel === deck && fit());
  grown.observe(content.viewportNode);
  content.outerNode.addEventListener('scroll', () => panel === deck && showMore(), { passive: true });
  for (const kind of ['wheel', 'touchmove'])
    content.node.addEventListener(kind, () => (panel.deckFollows = false), { passive: true });
}

// What was typed or run is saved at once, one save after the other: of two that overlap, JupyterLab
// takes the file of the first one for somebody else's, and asks about "File Changed". So its own
// timer is off (SETTINGS in present.py). After a save JupyterLab takes a notebook for unchanged that
// was changed meanwhile, so what has changed is known here.
function keepSaved(panel) {
  const { context } = panel;
  let last = Promise.resolve();
  let timer = null;
  let changed = false;
  panel.deckSaves = () => {
    clearTimeout(timer);
    timer = null;
    changed = false;
    last = last.then(() => (context.isDisposed ? undefined : context.save())).catch(() => (changed = true));
    return last;
  };
  const now = () => changed && void panel.deckSaves();
  panel.deckChanges = () => {
    changed = true;
    timer ??= setTimeout(panel.deckSaves, SAVE_MS);
  };
  context.model.contentChanged.connect(panel.deckChanges);
  for (const kind of ['beforeunload', 'pagehide', 'blur']) window.addEventListener(kind, now);
  document.addEventListener('visibilitychange', now);
}

// What the copy keeps: `place`, the id of a cell; `began`, since when the minutes run, in seconds;
// `used`, when something was typed or run before the server started.
const kept = (panel = deck) => panel.model.getMetadata('deck') ?? {};

function keep(changes) {
  // What is undefined is not in the file.
  deck.model.setMetadata('deck', JSON.parse(JSON.stringify({ ...kept(), ...changes })));
}

let walks = null; // to another lesson: { file, began, atEnd }

// Open another lesson, at its first slide or at its last. The minutes of a timetable go on.
function walk(file, atEnd = false) {
  walks = { file, atEnd, began: plan.length ? kept().began : undefined };
  say(`Opens ${file}`);
  void server.open(COPIES + file);
}

// The file that is so many lessons further in the timetable, if there is one.
function further(way) {
  const files = [...new Set(plan.map(({ file }) => file))].filter(Boolean);
  const at = files.indexOf(fileOf(deck));
  return at < 0 ? undefined : files[at + way];
}

const fileOf = panel => panel.context.path.replace(COPIES, '');

function show(panel) {
  if (!panel) return;
  if (deck && deck !== panel) deck.removeClass('jp-Deck');
  deck = panel;
  panel.addClass('jp-Deck');
  document.body.dataset.jpDeckMode = 'presenting';
  panel.fit();
  const { place, used } = kept();
  const arrives = walks?.file === fileOf(panel) ? walks : null;
  walks = null;
  say('');
  if (arrives) {
    keep({ began: arrives.began });
    goTo(arrives.atEnd ? Infinity : 0);
  } else {
    const saved = panel.content.widgets.findIndex(({ model }) => model.id === place);
    const index = panel.content.activeCellIndex || Math.max(saved, 0);
    goTo(slideOf(index), index);
  }
  if (used) say(`Used on ${used}, with what was typed and run. R R: a fresh one.`);
}

function leave() {
  const { content } = deck;
  document.body.removeAttribute('data-jp-deck-mode');
  deck.removeClass('jp-Deck');
  deck.fit();
  deck = null;
  say('');
  content.activate();
  void content.scrollToItem(content.activeCellIndex, 'center');
}

// --- Slides --------------------------------------------------------------------------------------

const kindOf = ({ model }) => model.getMetadata('slideshow')?.slide_type;

const isNew = ({ model }) => model.executionCount === null;

const hasRun = ({ model }) => model.executionCount > 0 || model.executionState === 'running';

const isTagged = ({ model }, ...tags) => tags.some(tag => model.getMetadata('tags')?.includes(tag));

const isSolution = cell => isTagged(cell, 'solution');

// What a text says beyond what a slide shows of it (../texts.py): for the notes window, or for T.
const isRest = cell => kindOf(cell) === 'notes';
const isHidden = cell => kindOf(cell) === 'skip' || (isRest(cell) && !deck.deckWhole);

// Return the slides: the indices of their cells.
function slides() {
  const found = [];
  deck.content.widgets.forEach((cell, index) => {
    const kind = kindOf(cell);
    if (isHidden(cell)) return;
    if ((kind && !isRest(cell)) || !found.length) found.push([]);
    found.at(-1).push(index);
  });
  return found;
}

// The whole texts, or what a slide shows of them.
function whole() {
  deck.deckWhole = !deck.deckWhole;
  goTo(here(), deck.content.activeCellIndex);
}

function slideOf(place) {
  return Math.max(slides().findLastIndex(([first]) => first <= place), 0);
}

const here = () => slideOf(deck.content.activeCellIndex);

// A text that follows what has not run would tell too early what comes out. So it is shown after the
// run, or with the next press.
function shownOn(slide) {
  const { widgets } = deck.content;
  const isText = index => widgets[index].model.type !== 'code';
  const waits = index => !isText(index) && !hasRun(widgets[index]) && !isSolution(widgets[index]);
  const opened = slide.findLastIndex(index => deck.deckOpened?.has(widgets[index].model.id));
  const end = slide.findIndex((index, i) => i > opened && isText(index) && slide.slice(0, i).some(waits));
  return end < 0 ? slide : slide.slice(0, end);
}

// A task is one thing at a time: its starter, the check, or the solution. Of those that have run, one is on
// the stage, the last one up to the active cell, and the others stand aside.
function stageOf(slide) {
  const { widgets, activeCellIndex } = deck.content;
  const ran = slide.filter(index => isTagged(widgets[index], 'exercise', 'check', 'solution') && hasRun(widgets[index]));
  const stage = ran.findLast(index => index <= activeCellIndex) ?? ran[0];
  return { stage, aside: ran.filter(index => index !== stage) };
}

// Show a slide, and choose a cell of it: this one, or the first that runs.
function goTo(number, cell) {
  const all = slides();
  const slide = all[Math.min(Math.max(number, 0), all.length - 1)];
  const { content } = deck;
  const runs = shownOn(slide).filter(index => content.widgets[index].model.type === 'code');
  const waits = index => isNew(content.widgets[index]) && !isSolution(content.widgets[index]);
  content.mode = 'command';
  content.activeCellIndex = slide.includes(cell) ? cell : (runs.find(waits) ?? runs[0] ?? slide[0]);
  content.deselectAll();
  deck.deckFollows = false;
  update();
  scroller().scrollTop = 0;
  focusCell();
}

// Out of an editor, a replay or a list.
const focusCell = () => deck.content.activeCell.node.focus({ preventScroll: true });
const scroller = () => deck.content.outerNode;

let shownPlace = '';
let before = 0; // the cell that was active

// The cursor has left an editor, and come to notes, which no slide shows. It goes on to what is shown.
function leaveHidden() {
  const { content } = deck;
  const way = content.activeCellIndex > before ? 1 : -1;
  content.activeCellIndex += way;
}

function update() {
  const { content, context: { path } } = deck;
  const { widgets, activeCellIndex } = content;
  if (isHidden(widgets[activeCellIndex])) return leaveHidden();
  before = activeCellIndex;
  const all = slides();
  const number = here();
  const slide = shownOn(all[number]);
  const { stage, aside } = stageOf(slide);
  widgets.forEach(({ node, model }, index) => {
    node.classList.toggle('deck-on', slide.includes(index));
    node.classList.toggle('deck-stage', index === stage);
    node.classList.toggle('deck-aside', aside.includes(index));
    node.classList.toggle('deck-rest', isRest(widgets[index]) && !deck.deckWhole);
    node.classList.toggle('deck-runs', model.executionState === 'running');
    node.classList.toggle('deck-ran', model.type === 'code' && hasRun(widgets[index]));
  });
  const sourceOf = index => widgets[index].model.sharedModel.getSource();
  const step = all.slice(0, number + 1).map(([first]) => first).findLast(first => widgets[first].model.type === 'markdown' && /^##? /.test(sourceOf(first)));
  const [title, count, progress] = head.children;
  head.classList.toggle('deck-title', number === 0); // the slide says it, larger
  title.textContent = step === undefined ? '' : sourceOf(step).split('\n')[0].replace(/^#+ |[`*]/g, '');
  count.textContent = `${number + 1} / ${all.length}`;
  Object.assign(progress, { max: all.length, value: number + 1 });
  fit();
  const place = `${path} ${activeCellIndex}`;
  if (place === shownPlace) return;
  shownPlace = place;
  const now = Date.now() / 1000;
  const { began } = kept();
  const begins = number > 0 && !(now - began < (plan.length ? PLAN_S : LESSON_S));
  const inPlan = 60 * sumOf(plan.slice(0, rowOf(0))); // later lessons begin later
  keep({ place: widgets[activeCellIndex].model.id, ...(begins ? { began: now - inPlan } : {}) });
  void tell(place);
  const about = [activeCellIndex, ...slide].map(index => widgets[index]).find(hasGuess);
  document.getElementById('deck-guesses')?.remove();
  if (about) void showGuesses(about, place);
}

// Whether a text has many lines, and short ones.
const isLong = text => text.split('\n').length > LOG[0] && text.split('\n').every(row => row.length <= LOG[1]);

// The letters are as large as the slide has room for. If there is none even for small ones, code that
// has run makes room for what came out, then what stands aside is folded, then pictures are smaller: see
// deck-tight, deck-folds and deck-tighter in deck.css. What grows below comes into view.
function fit() {
  const { node, viewportNode, widgets } = deck.content;
  const outer = scroller();
  const on = widgets.filter(cell => cell.node.classList.contains('deck-on'));
  const isText = ({ model, inputHidden }) => model.type !== 'code' || (inputHidden && !model.outputs?.length);
  const hasCode = !on.every(isText);
  for (const { node: cell } of on) {
    cell.classList.toggle('deck-drives', cell.querySelectorAll('.replay:has(.replay-floor)').length > 1);
    for (const log of cell.querySelectorAll('.jp-OutputArea-output > pre')) log.classList.toggle('deck-long', isLong(log.textContent));
  }
  let room = 0;
  viewportNode.style.marginTop = 0;
  node.style.removeProperty('--deck-code');
  const least = SCALES.code.at(-1);
  const staged = on.find(cell => cell.node.classList.contains('deck-stage'))?.node.querySelector('.jp-InputArea-editor');
  const tries = hasCode
    ? [
      ...SCALES.code.filter(scale => scale >= 1).map(scale => [scale]),
      ...SCALES.code.map(scale => [scale, 'deck-tight']),
      ...(staged ? SCALES.code.map(scale => [scale, 'deck-tight deck-folds']) : []),
      ...FIGURES.map(tall => [least, 'deck-tight deck-tighter deck-folds', tall]),
    ]
    : SCALES.texts.map(scale => [scale]);
  for (const [scale, makes = '', tall] of tries) {
    node.style.setProperty('--deck-scale', scale);
    for (const name of ['deck-tight', 'deck-tighter', 'deck-folds']) deck.toggleClass(name, makes.split(' ').includes(name));
    node.style.setProperty('--deck-tall', tall);
    room = outer.clientHeight - viewportNode.getBoundingClientRect().height;
    if (room < 0 && scale === least && staged && makes.includes('deck-folds')) {
      // Of the code on the stage, there is what is left for it.
      node.style.setProperty('--deck-code', `${staged.offsetHeight + room}px`);
      room = outer.clientHeight - viewportNode.getBoundingClientRect().height;
    }
    if (room >= 0) break;
  }
  if (!hasCode) viewportNode.style.marginTop = `${Math.max(room / 2, 0)}px`;
  showMore();
  const cell = deck.content.activeCell?.node;
  const end = cell && cell.getBoundingClientRect().bottom - outer.getBoundingClientRect().bottom;
  if (deck.deckFollows && end > 0) outer.scrollTop += end;
}

// Whether something is below.
function showMore() {
  const { scrollTop, scrollHeight, clientHeight } = scroller();
  deck.toggleClass('deck-more', scrollTop + clientHeight < scrollHeight - 4);
}

// --- The notes window ----------------------------------------------------------------------------

const NOTES = 'lab/extensions/presenter/notes.html';
let told = null; // what the notes window shows
let notesWindow = null; // the last one that has asked

// Each of the two may be reloaded, so the window asks, again and again.
function onNotesWindow({ origin, source, data }) {
  if (origin !== location.origin || data !== 'notes?') return;
  notesWindow = source;
  source.postMessage(told, origin);
}

// --- The minutes of a timetable ------------------------------------------------------------------

const sumOf = rows => rows.reduce((sum, { minutes }) => sum + minutes, 0);

// The index of the row that holds a step of this lesson; 0 for a lesson that is in none.
function rowOf(step) {
  const file = fileOf(deck);
  return Math.max(plan.findIndex(row => row.file === file && (!row.steps || step <= row.steps[1])), 0);
}

// The steps of a lesson, with their notes and minutes: the server reads them from its copy.
const stepsKnown = {};
const stepsOf = file =>
  (stepsKnown[file] ??= server.ask(`deck/steps?file=${encodeURIComponent(file)}`).then(answer => answer.json()));

const htmlOf = ({ type, source }) =>
  type === 'code' ? element('pre', { textContent: source }).outerHTML : markdown.render(source);

// Tell the notes of this step, the next slide, and the minutes, to the notes window and the class.
async function tell(place) {
  const { content, context } = deck;
  const cells = content.widgets.map(({ model }) => ({
    id: model.id,
    type: model.type,
    source: model.sharedModel.getSource(),
  }));
  const at = content.activeCellIndex;
  const all = slides();
  const { began } = kept();
  const { steps, step_of: stepOf } = await stepsOf(fileOf(deck));
  // A cell that was added in front of the class belongs to the step of the one above it.
  const known = cells.slice(0, at + 1).findLast(({ id }) => id in stepOf);
  const step = steps[known ? stepOf[known.id] : 0];
  let { own, planned, all: inAll } = step;
  if (plan.some(({ file }) => file === fileOf(deck))) {
    // In a timetable they are those of all lessons and breaks up to here.
    const row = rowOf(step.number);
    const start = steps.find(({ number }) => number === plan[row].steps?.[0]) ?? steps[0];
    const inRow = planned - start.planned + start.own;
    planned = sumOf(plan.slice(0, row)) + Math.min(inRow, plan[row].minutes);
    inAll = sumOf(plan);
  }
  const minutes = { own, planned, all: inAll };
  const path = context.path;
  tellClass({ lesson: path.match(/\d\d_(\w+)\.ipynb$/)?.[1], cell: cells[at].id, began_s: began ?? null, ...minutes });
  const following = (all[here() + 1] ?? []).map(index => cells[index]);
  const until = all[here() + 1]?.[0] ?? cells.length;
  const rest = cells.filter((_, index) => index > all[here()][0] && index < until && isRest(content.widgets[index]));
  const state = {
    lesson: step.lesson,
    step: step.step,
    slide: here() + 1,
    slides: all.length,
    began,
    ...minutes,
    notes: step.notes,
    rest: (await Promise.all(rest.map(htmlOf))).join(''),
    next: (await Promise.all(following.map(htmlOf))).join(''),
  };
  if (place !== shownPlace) return; // the deck has gone on meanwhile
  told = state;
  notesWindow?.postMessage(told, location.origin);
}

// --- The class page ------------------------------------------------------------------------------

// The address of its page: no text if no class is open.
const pageOfClass = () => server.ask('deck/class').then(answer => answer.text()).catch(() => '');

let wanted; // the slide that the class is to see
let telling = Promise.resolve();

// Of slides that are passed quickly the class sees the last one: one request after the other, because
// of two at once the earlier one may arrive last. The answer of another server cannot be read, and
// need not be.
function tellClass(slide) {
  wanted = slide;
  telling = telling.then(async () => {
    if (slide !== wanted) return;
    const address = await pageOfClass();
    const init = { method: 'POST', mode: 'no-cors', body: JSON.stringify(slide) };
    if (address) await fetch(`${address}slide`, init).catch(() => {}); // it is over
  });
}

function hasGuess({ model }) {
  const source = model.sharedModel.getSource();
  return model.getMetadata('tags')?.includes('predict') || source.includes('compare_prediction(');
}

async function showGuesses({ model, node }, place) {
  const address = await pageOfClass();
  const reached = address && (await fetch(address, { mode: 'no-cors' }).catch(() => null));
  if (!reached || place !== shownPlace) return;
  document.getElementById('deck-guesses')?.remove(); // of a second call
  const dark = document.body.dataset.jpThemeLight === 'false' ? '&dark' : '';
  const src = `${address}#cell=${model.id}${dark}`;
  node.append(element('iframe', { id: 'deck-guesses', title: 'Guesses of the class', src }));
}

// Pictures on the slide draw the numbers that the class has guessed: those of now, and later ones.
// What they draw needs no bars.
function tellPictures() {
  document.dispatchEvent(new CustomEvent('class', { detail: classGuesses }));
  const frame = document.getElementById('deck-guesses');
  const draws = document.querySelector('.deck-on :is(.guess-class, .class > *)') ? 'drawn' : 'bars';
  if (!frame || draws === frame.dataset.draws) return;
  frame.dataset.draws = draws;
  frame.contentWindow.postMessage(draws, new URL(frame.src).origin);
}

function onGuesses({ source, data }) {
  const frame = document.getElementById('deck-guesses');
  if (!deck || source !== frame?.contentWindow) return;
  frame.style.height = `${Number(data.height)}px`;
  classGuesses = data.guesses;
  tellPictures();
  frame.scrollIntoView({ block: 'nearest' }); // many bars are more than the slide has room for
  // A click on "Show" took the focus: the keys of the deck want it back.
  if (document.activeElement === frame) focusCell();
}

// Show or hide the answers, as its button does.
function showAnswers() {
  const frame = document.getElementById('deck-guesses');
  if (!frame) return say('No guesses of a class on this slide.');
  frame.contentWindow.postMessage('show', new URL(frame.src).origin);
}

async function showJoins() {
  const address = await pageOfClass();
  if (!address) return say('No class is open: make class, in another terminal.');
  document.getElementById('deck-joins')?.remove(); // of a second call
  document.body.append(element('iframe', { id: 'deck-joins', title: 'How to join the class', src: `${address}#wall` }));
}

// --- Keys ----------------------------------------------------------------------------------------

const KEYS = {
  ' ': next,
  pagedown: next,
  'Shift  ': previous,
  pageup: previous,
  arrowright: () => toStep(1),
  arrowleft: () => toStep(-1),
  arrowdown: () => byCell(1),
  arrowup: () => byCell(-1),
  home: first,
  end: () => goTo(Infinity),
  enter,
  'Control enter': run,
  'Shift enter': run,
  i: () => again('i', 'I again: interrupt the cell', interrupt),
  0: () => again('0', '0 again: restart the kernel', restart),
  a: actions => again('a', 'A again: run all cells above', () => void runAbove(actions)),
  r: () => again('r', 'R again: throw away what was typed and run in this lesson', fresh),
  s: showAnswers,
  j: () => void showJoins(),
  t: whole,
  b: () => document.body.classList.add('deck-black'),
  '.': () => document.body.classList.add('deck-black'),
  n: () => void window.open(server.baseUrl + NOTES, 'notes', 'popup'),
  escape,
  f5: () => void deck.deckSaves(),
  'Control s': () => void deck.deckSaves(),
  'Control r': () => deck.deckSaves().then(() => location.reload()),
};

function onKey(event, tracker, actions) {
  const modifiers = ['Control', 'Alt', 'Shift', 'Meta'].filter(key => event.getModifierState(key));
  const low = event.key.toLowerCase();
  const letter = low.length === 1 && low !== ' ';
  const key = [...modifiers.filter(name => name !== 'Shift' || !letter && low !== 'f5'), low].join(' ');
  if (!deck) {
    // A clicker's start button is F5, as in other programs for slides.
    const panel = tracker.currentWidget;
    const does = { f5: () => show(panel), 'Control s': () => void panel.deckSaves() }[key];
    if (!does || !prepared.has(panel)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    does();
    return;
  }
  const { target } = event;
  const cell = deck.content.activeCell.node;
  if (target.closest?.('iframe') || !deck.node.contains(target) && target !== document.body) return;
  if (['control', 'shift', 'alt', 'meta', 'altgraph', 'capslock'].includes(low)) return;
  const joins = document.getElementById('deck-joins');
  const covered = joins || document.body.classList.contains('deck-black');
  const edits = target.closest?.('.jp-InputArea-editor');
  const inside = !edits && target !== cell && cell.contains(target);
  if (covered)
    return take(event, () => {
      document.body.classList.remove('deck-black');
      joins?.remove();
    });
  if (edits) {
    const wanted = ['Control enter', 'Shift enter', 'f5', 'Control s', 'Control r'];
    const completes = document.querySelector('.jp-Completer:not(.lm-mod-hidden)');
    if (key === 'escape' && !completes) return take(event, escape);
    // These would make new cells.
    if (['Alt enter', 'Control Shift -', 'Control _', 'Control -'].includes(key)) return take(event);
    if (key === 'pagedown' || key === 'pageup') escape(actions, false, { edits }); // a clicker
    else if (!wanted.includes(key)) return;
  } else if (inside) {
    if (target.matches(TYPED) ? !['pagedown', 'pageup', 'escape', 'f5'].includes(key) : !EVERYWHERE.includes(key)) return;
  }
  // The browser's own keys, such as F11 and Ctrl and +, still work.
  if (!KEYS[key]) return event.stopImmediatePropagation();
  take(event, () => KEYS[key](actions, low === 'enter' && modifiers.includes('Shift'), { edits, inside, key }));
}

function take(event, does) {
  event.preventDefault();
  event.stopImmediatePropagation();
  const before = line.textContent;
  does?.();
  // What was said is over with the next key.
  if (line.textContent === before) say('');
}

function again(key, text, does) {
  if (twice.key === key && Date.now() - twice.at < TWICE_MS) {
    twice = {};
    does();
  } else {
    twice = { key, at: Date.now() };
    say(text);
  }
}

function next() {
  const { content } = deck;
  const number = here();
  const slide = slides()[number];
  const shown = shownOn(slide);
  const outer = scroller();
  // A replay shows its first loss, and then its end.
  for (const index of shown)
    for (const replay of content.widgets[index].node.querySelectorAll('.replay-on:not(.level)'))
      if (!replay.dispatchEvent(new CustomEvent('next-stop', { cancelable: true }))) {
        replay.scrollIntoView({ block: 'nearest' });
        return;
      }
  // If one cell of this slide has run, none of its cells is left out.
  if (hasRun(content.activeCell)) {
    const left = shown.find(index => index > content.activeCellIndex && isNew(content.widgets[index]));
    if (left !== undefined) return toCell(left);
  }
  if (outer.scrollTop + outer.clientHeight < outer.scrollHeight - 4) {
    outer.scrollTop += 0.8 * outer.clientHeight;
  } else if (shown.length < slide.length) {
    (deck.deckOpened ??= new Set()).add(content.widgets[slide[shown.length]].model.id);
    goTo(number);
    scroller().scrollTop = scroller().scrollHeight;
  } else if (number < slides().length - 1) {
    goTo(number + 1);
  } else {
    const file = further(1);
    if (file) walk(file);
    else say(plan.length ? 'The end of the timetable.' : nextFile() ? 'The end. Enter opens the next lesson.' : 'The end.');
  }
  used();
}

function previous() {
  const outer = scroller();
  const file = further(-1);
  if (outer.scrollTop > 4) outer.scrollTop -= 0.8 * outer.clientHeight;
  else if (here() > 0) goTo(here() - 1);
  else if (file) walk(file, true);
  else say('The first slide.');
}

// A copy in which something was typed before is from now on the one that is shown.
function used() {
  if (kept().used) keep({ used: undefined });
}

function toStep(way) {
  const all = slides();
  const starts = [...all.keys()].filter(number => kindOf(deck.content.widgets[all[number][0]]) === 'slide');
  const number = way > 0
    ? starts.find(start => start > here()) ?? all.length - 1
    : starts.findLast(start => start < here()) ?? 0;
  goTo(number);
  used();
}

function byCell(way) {
  const { content } = deck;
  const runs = shownOn(slides()[here()]).filter(index => content.widgets[index].model.type === 'code');
  const at = content.activeCellIndex;
  const index = way > 0 ? runs.find(one => one > at) : runs.findLast(one => one < at);
  if (index === undefined) scroller().scrollTop += 0.2 * way * scroller().clientHeight;
  else toCell(index);
}

function toCell(index) {
  const { content } = deck;
  content.activeCellIndex = index;
  focusCell();
  content.activeCell.node.scrollIntoView({ block: 'nearest' });
}

function first() {
  keep({ began: undefined }); // the minutes begin again
  shownPlace = '';
  deck.deckOpened = new Set();
  goTo(0);
}

function enter() {
  const { content } = deck;
  const cell = content.activeCell;
  if (cell.model.type === 'code') {
    cell.inputHidden = false;
    content.mode = 'edit';
    content.activate();
    return;
  }
  const file = nextFile();
  if (file) walk(file);
  else say('There is no cell to write into on this slide.');
}

// The lesson to which the last cell of this slide leads.
function nextFile() {
  const { widgets } = deck.content;
  const source = widgets[shownOn(slides()[here()]).at(-1)].model.sharedModel.getSource();
  return source.match(/^Next: \[.*\]\((\S+\.ipynb)\)$/m)?.[1];
}

function escape(_actions, _on, from = { edits: true }) {
  const { content } = deck;
  if (from.edits || from.inside) {
    content.mode = 'command';
    focusCell();
  } else {
    again('escape', 'Escape again: to the notebook', leave);
  }
}

const waiting = new Set(); // cells that wait for the kernel

// Without a kernel JupyterLab would start a second one, or ask for one on the projector.
async function run(actions, on) {
  const panel = deck;
  const { content, sessionContext } = panel;
  const cell = content.activeCell;
  if (cell.model.type !== 'code') return on ? next() : undefined;
  const { id } = cell.model;
  content.mode = 'command';
  focusCell();
  if (waiting.has(id)) return;
  if (cell.model.executionState === 'running') return say('It runs already. I I interrupts it.');
  waiting.add(id);
  const isReady = () => Boolean(sessionContext.session?.kernel);
  if (!isReady()) {
    say('The cell runs as soon as the kernel is there.');
    await sessionContext.ready;
  }
  waiting.delete(id);
  if (!isReady()) return say('There is no kernel: press 0 twice.');
  say('');
  panel.deckFollows = true;
  void actions.runCells(content, [cell], sessionContext);
  if (on && panel === deck) byCell(1);
}

// As JupyterLab's "Run All Above Selected Cell".
async function runAbove(actions) {
  const panel = deck;
  const { content, sessionContext } = panel;
  const above = content.widgets.slice(0, content.activeCellIndex).filter(({ model }) => model.type === 'code');
  if (!above.length) return say('There is no cell above.');
  say(`Runs the ${above.length} cells above`);
  await sessionContext.ready;
  const passed = await actions.runCells(content, above, sessionContext);
  if (panel === deck) say(passed ? 'The cells above have run.' : 'One of the cells above has ended with an error.');
}

function interrupt() {
  say('Interrupted.');
  void deck.sessionContext.session?.kernel?.interrupt();
}

async function restart() {
  const { sessionContext, context } = deck;
  say('The kernel is restarted. What was defined is gone.');
  if (sessionContext.session?.kernel) await sessionContext.restartKernel();
  else await sessionContext.changeKernel({ name: context.model.defaultKernelName || 'python3' });
}

async function fresh() {
  const { context, sessionContext } = deck;
  await deck.deckSaves();
  await server.ask('deck/fresh', { path: context.path });
  await context.revert();
  deck.deckOpened = new Set();
  first();
  say('');
  await sessionContext.session?.kernel?.restart();
}

window._JUPYTERLAB ??= {};
window._JUPYTERLAB.presenter = { init: scope => (packages = scope), get: extension };
