// Who holds what, and who waits for what, as boxes and arrows. If they close to a circle, and nobody
// can open it, the runs on it can never go on. ring.js draws it.

import { model } from './model.js';
import { walk } from './walk.js';

// Return {stuck, boxes, arrows, says}: the ids of the runs that can never go on; {id, name}; {from,
// to, label, says, hot}, where `hot` is on the circle; and the circle as one sentence, '' if there is
// none. An arrow goes from who waits, and from what is held to who holds it: so a circle turns.
export function circleOf(setup, state) {
  const runs = model.going(state);
  const free = new Set();
  const can = run => !run || free.has(run.id);
  const isOpen = callback => can(model.holder(setup, state, callback));
  const hasThread = () => state.runs.some(can);

  // Where the answer for a run is: its client has it, or it waits there; somebody works on it; or the
  // request waits.
  function search(run) {
    const { client, call: service } = model.step(setup, run);
    const asked = item => item.from?.run === run.id;
    const taken = runs.some(item => asked(item) && item.callback === client);
    return {
      client,
      service,
      taken,
      there: state.queues[client].some(asked),
      working: taken ? undefined : runs.find(asked),
      waiting: state.queues[service].some(asked),
    };
  }

  function canGo(run) {
    if (!run.waits) return true;
    const { client, service, taken, there, working, waiting } = search(run);
    if (taken) return true; // to take an answer waits for nothing
    if (!hasThread() || !isOpen(client)) return false;
    return there || (working ? can(working) : waiting && isOpen(service));
  }

  for (let grown = true; grown; ) {
    const before = free.size;
    runs.filter(canGo).forEach(run => free.add(run.id));
    grown = free.size > before;
  }
  const stuck = runs.filter(run => !can(run)).map(({ id }) => id);

  const boxes = new Map();
  const arrows = [];
  const box = (id, name) => boxes.set(id, { id, name }).get(id);
  const called = callback => setup.callbacks[callback].name;
  const arrow = (from, to, label, says) => arrows.push({ from: from.id, to: to.id, label, says });
  const alike = run => runs.filter(({ callback }) => callback === run.callback).length > 1;
  const person = run => box(`run ${run.id}`, alike(run) ? model.named(setup, run) : called(run.callback));

  const pool = box('threads', setup.threads.length > 1 ? ['', '', 'both threads'][setup.threads.length] ?? `all ${setup.threads.length} threads` : setup.threads[0]);
  const rooms = setup.groups.map(({ name }, i) => box(`group ${i}`, name));
  const roomOf = callback => rooms[setup.callbacks[callback].group];
  const holds = (run, what, text) => arrow(what, person(run), 'held by', `${person(run).name} holds ${text}`);
  runs.forEach(run => {
    holds(run, pool, setup.threads.length > 1 ? setup.threads[run.thread] : pool.name);
    if (model.groupOf(setup, run.callback).exclusive) holds(run, roomOf(run.callback), roomOf(run.callback).name);
  });

  runs.filter(({ waits }) => waits).forEach(run => {
    const { client, service, taken, there, working, waiting } = search(run);
    const answer = box(`answer ${run.id}`, `the answer of ${called(service)}`);
    arrow(person(run), answer, 'waits for', `${person(run).name} waits for ${answer.name}`);
    const needs = (what, whose) => arrow(answer, what, whose ? 'request waits for' : 'waits for',
      `${whose ? 'its request' : 'it'} waits for ${what.name}`);
    const needed = there ? client : service;
    if (taken) return;
    if (working) arrow(answer, person(working), 'comes from', `${answer.name} comes from ${person(working).name}`);
    if (there || waiting) {
      if (!state.runs.includes(null)) needs(pool, waiting);
      else if (model.holder(setup, state, needed)) needs(roomOf(needed), waiting);
      else if (!isOpen(client)) needs(roomOf(client));
    } else if (working && can(working) && !isOpen(client)) needs(roomOf(client));
  });

  const on = id => !id.startsWith('run ') || stuck.includes(+id.slice(4));
  const next = id => arrows.filter(({ from, to }) => from === id && on(from) && on(to));

  // Return the shortest way from a box to another, as arrows.
  function way(from, to) {
    const ways = [[from, []]];
    const been = new Set();
    for (const [at, gone] of ways) {
      if (at === to && gone.length) return gone;
      if (been.has(at) && gone.length) continue;
      been.add(at);
      next(at).forEach(one => ways.push([one.to, [...gone, one]]));
    }
    return undefined;
  }

  if (stuck.length) arrows.forEach(one => { one.hot = on(one.from) && on(one.to) && Boolean(way(one.to, one.from)); });
  const turns = stuck.map(id => way(`run ${id}`, `run ${id}`)).find(Boolean);
  return {
    stuck, boxes: [...boxes.values()], arrows,
    says: stuck.length ? `Nobody can go on: ${(turns ?? []).map(({ says }) => says).join(', ')}.` : '',
  };
}

// Return the sentence of the circle in which a run ends, '' if there is none.
export function circleAtEnd(record) {
  const { state } = walk(record).seek(record.moves.length);
  return circleOf(record.setup, state).says;
}

// An arrow is the same in two states if it leads from and to the same.
export const sameArrow = ({ from, to }) => `${from} > ${to}`;

// The boxes of a circle, in the order in which its arrows turn; of a chain that is open, all of them.
export function placed({ stuck, boxes, arrows, isOpen }) {
  if (isOpen) return boxes;
  const found = new Set();
  const follow = id => {
    if (found.has(id)) return;
    found.add(id);
    arrows.filter(({ from, hot }) => from === id && hot).forEach(({ to }) => follow(to));
  };
  stuck.forEach(id => follow(`run ${id}`));
  return [...found].map(id => boxes.find(box => box.id === id));
}

// Return a circle that did not close: of a run that waits and will go on, what it holds, its answer,
// and what the answer needs, which is free. undefined if nobody waits.
export function openOf(setup, state) {
  const run = model.going(state).find(({ waits }) => waits);
  if (!run) return undefined;
  const { client, call: service } = model.step(setup, run);
  const { name } = setup.callbacks[run.callback];
  const group = at => setup.groups[setup.callbacks[at].group];
  const isGroup = group(run.callback).exclusive;
  const spare = setup.threads.find((_, thread) => thread !== run.thread);
  const held = isGroup ? group(run.callback).name : setup.threads[run.thread];
  const free = isGroup ? group(client).name : spare;
  const answer = `the answer of ${setup.callbacks[service].name}`;
  const boxes = [['held', held], [`run ${run.id}`, name], ['answer', answer], ['free', free]];
  const arrow = (from, to, label, says) => ({ from: boxes[from][0], to: boxes[to][0], label, says });
  return {
    stuck: [],
    isOpen: true,
    boxes: boxes.map(([id, box]) => ({ id, name: box })),
    arrows: [
      arrow(0, 1, 'held by', `${name} holds ${held}`),
      arrow(1, 2, 'waits for', `${name} waits for ${answer}`),
      arrow(2, 3, 'needs', `it needs ${free}, which is free`),
    ],
  };
}

// Give a run that asks, and can never go on, its circle. Its arrows come one at a time, each with a step of its
// own. `circle(step)` is what circleOf returns then, and `end` that of the last step. `says` has the
// sentences that are not those of the run, `almost` is the step before the circle closes.
export function close(run, { setup }) {
  const at = move => circleOf(setup, run.seek(move).state);
  const end = at(run.times.length);
  if (!end.stuck.length) return run;
  const here = new Set(placed(end).map(({ id }) => id));
  const steps = [{ move: 0, circle: at(0) }];
  let known = new Set();
  run.times.forEach((_, i) => {
    const circle = at(i + 1);
    const seen = circle.arrows.filter(({ from, to }) => here.has(from) && here.has(to));
    const late = seen.filter(one => !known.has(sameArrow(one))).slice(1);
    const closes = circle.stuck.length && !steps.at(-1).circle.stuck.length;
    // Until the last arrow has come, the circle is not closed.
    late.forEach((one, k) => steps.push({
      move: i + 1,
      circle: {
        ...circle,
        ...(closes ? { stuck: [], says: '' } : {}),
        arrows: circle.arrows.filter(it => !late.slice(k).includes(it)).map(it => ({ ...it, hot: it.hot && !closes })),
      },
      says: k ? `${model.capital(late[k - 1].says)}.` : undefined,
    }));
    const told = late.length ? `${model.capital(late.at(-1).says)}.` : undefined;
    steps.push({ move: i + 1, circle, says: closes ? circle.says : told });
    known = new Set(seen.map(sameArrow));
  });
  const closing = steps.findIndex(({ circle }) => circle.stuck.length);
  return {
    ...run, end,
    times: steps.slice(1).map(({ move }) => run.times[move - 1]),
    seek: step => run.seek(steps[step].move),
    scan: () => run.scan().map(move => steps.findLastIndex(one => one.move === move)),
    circle: step => steps[step].circle,
    says: step => steps[step].says,
    ranks: steps.slice(1).map((_, i) => (i + 1 === closing ? 2 : 0)),
    almost: closing - 1,
  };
}
