// What may happen next, decided in one place: messages wait in KEEP_LAST queues, the threads of an
// executor take them and run their callbacks, groups and locks let one in at a time, and a call
// waits for its answer. No page and no clock: what a page shows, and when, is not decided here.
//
// A setup is what the learner writes:
//   threads    names of the executor's threads; none if no executor spins
//   groups     [{name, exclusive}]
//   callbacks  [{name, group, depth, does, word}]: `group` is an index, `depth` that of the queue,
//              `word` what waits in it ('message', 'tick', 'request', 'answer'), `does` its steps:
//                {work: seconds}; without a number it ends when the record says so. `adds`, the
//                name of a number, is one more after it; `unless`, see `set`
//                {read: name}, {write: name}     reads a number; writes what was read plus one
//                {lock: name}, {unlock: name}
//                {says: text}         is seen in the sentence, and nothing else
//                {set: name}          from now on, a work with `unless` of this name does not begin
//                {call: callback, client: callback}     waits, and holds thread and group
//              Without `does` it is one work without a number.
//   arrivals   [{at, callback, seq}] in their order, if a schedule says what arrives and when
// Callbacks, threads and groups are named by their index. Times are seconds.
//
// A move is {do, at, ...}; `at` is left out for "now":
//   {do: 'arrive', callback, seq}   a message comes; a full queue loses its oldest
//   {do: 'take', callback, thread}  a thread takes the oldest message and starts the callback; `seq`
//                                   may say which one is meant
//   {do: 'go', thread}              the callback on the thread does its next step
//   {do: 'end', thread}             the callback ends, and an answer goes to the client

export const model = queueModel();

function queueModel() {
  const WORDS = ['No', 'One', 'Two', 'Three', 'Four', 'Five', 'Six', 'Seven', 'Eight', 'Nine', 'Ten'];
  const count = n => WORDS[n] ?? `${n}`;
  const capital = text => text[0].toUpperCase() + text.slice(1);
  const stepsOf = (setup, run) => setup.callbacks[run.callback].does ?? [{ work: undefined }];
  const step = (setup, run) => stepsOf(setup, run)[run.step];
  const groupOf = (setup, callback) => setup.groups[setup.callbacks[callback].group];

  function named(setup, { callback, seq }) {
    const { name, word = 'message' } = setup.callbacks[callback];
    return setup.callbacks.length > 1 ? `${word} ${seq} of ${name}` : `${word} ${seq}`;
  }

  // States

  // runs: of threads[i] the run that it has, or null. lost: {callback, seq, by}. locks: name -> id of
  // the run that holds it. values: name -> number.
  function start(setup) {
    return {
      now: 0,
      queues: setup.callbacks.map(() => []),
      runs: setup.threads.map(() => null),
      lost: [],
      locks: {},
      values: {},
      arrived: 0,
      started: 0,
    };
  }

  // All runs that have begun and not ended: they hold their groups.
  const going = state => state.runs.filter(Boolean);

  // Who is in a group that lets one in at a time.
  function holderOf(setup, state, group) {
    if (!setup.groups[group].exclusive) return undefined;
    return going(state).find(run => setup.callbacks[run.callback].group === group);
  }

  const holder = (setup, state, callback) =>
    holderOf(setup, state, setup.callbacks[callback].group);

  const runOf = (state, id) => going(state).find(run => run.id === id);

  // Return why no thread takes the oldest of a queue: '' if a thread may take it at once.
  function cause(setup, state, callback) {
    if (!setup.threads.length) return 'no executor';
    if (!state.runs.includes(null))
      return state.runs.every(run => run.waits) ? 'answer' : 'thread busy';
    const held = holder(setup, state, callback);
    if (!held) return '';
    return held.waits ? 'answer' : 'group busy';
  }

  // Moves

  // Do a move to the state, and return the sentence that says which rule made it happen. It is
  // one that is allowed: see rules.js.
  function advance(setup, state, move) {
    state.now = move.at ?? state.now;
    switch (move.do) {
      case 'arrive':
        state.arrived += 1;
        return `${capital(named(setup, move))} arrives. ${push(setup, state, move)}`;
      case 'take':
        return take(setup, state, move);
      case 'go':
        return go(setup, state, move.thread);
      case 'end':
        return end(setup, state, move.thread);
    }
  }

  function push(setup, state, { callback, seq, from }) {
    const queue = state.queues[callback];
    const { depth } = setup.callbacks[callback];
    let says = '';
    if (queue.length >= depth) {
      const out = queue.shift();
      state.lost.push({ callback, seq: out.seq, by: seq });
      says = depth === 1
        ? `One waits already, ${out.seq}, and is pushed out.`
        : `${count(depth)} wait, so the oldest, ${out.seq}, is pushed out.`;
    }
    queue.push({ seq, from });
    const why = {
      '': says || 'A thread is free to take it.',
      'no executor': 'No executor takes it.',
      'thread busy': `It waits: ${setup.threads.length > 1 ? 'every thread' : setup.threads[0]} is busy.`,
      'group busy': 'It waits: a thread is free, but its group is busy.',
      answer: 'It waits for a callback that waits for an answer.',
    };
    return says || why[cause(setup, state, callback)];
  }

  function take(setup, state, { callback, thread }) {
    const { seq, from } = state.queues[callback].shift();
    const run = { id: state.started, callback, seq, from, thread, step: -1, waits: false };
    state.started += 1;
    state.runs[thread] = run;
    nextStep(setup, state, run);
    const one = capital(`${setup.threads[thread]} is free and takes the oldest that waits, ${seq}.`);
    const { exclusive, name } = groupOf(setup, callback);
    const says = setup.callbacks.length > 1
      ? capital(`${setup.threads[thread]} is free and takes ${named(setup, run)}.`) : one;
    return exclusive && setup.threads.length > 1 ? `${says} Nobody else may run in ${name} now.` : says;
  }

  // Return a sentence about it: '' if it is simply the next step.
  function nextStep(setup, state, run) {
    run.step += 1;
    const { work, unless } = step(setup, run) ?? {};
    const stops = Boolean(state.values[unless]);
    if (stops) run.step = stepsOf(setup, run).length;
    run.until = stops || work === undefined ? undefined : state.now + work;
    if (stops) return ` It looks, sees ${unless}, and stops.`;
    return unless ? ` It looks, and does not see ${unless}.` : '';
  }

  // Of a work that is done. Return what is to be said of it.
  function add(setup, state, run) {
    const { adds } = step(setup, run) ?? {};
    if (!adds) return '';
    state.values[adds] = (state.values[adds] ?? 0) + 1;
    return `: ${adds} ${state.values[adds]}`;
  }

  function go(setup, state, thread) {
    const run = state.runs[thread];
    const who = capital(named(setup, run));
    const now = step(setup, run);
    const added = add(setup, state, run);
    let says = `${who} goes on${added}.`;
    if (now.read !== undefined) {
      run.seen = state.values[now.read] ?? 0;
      says = `${who} reads ${now.read}: ${run.seen}.`;
    } else if (now.write !== undefined) {
      const lost = (state.values[now.write] ?? 0) > run.seen;
      state.values[now.write] = run.seen + 1;
      says = `${who} writes ${now.write}: ${run.seen} + 1 = ${run.seen + 1}.`
        + (lost ? ' Another callback had written since it read: that update is lost.' : '');
    } else if (now.lock !== undefined) {
      state.locks[now.lock] = run.id;
      says = `${who} takes ${now.lock}. Nobody else can have it now.`;
    } else if (now.unlock !== undefined) {
      delete state.locks[now.unlock];
      says = `${who} gives ${now.unlock} back.`;
    } else if (now.set !== undefined) {
      state.values[now.set] = 1;
      says = `${who} is received: from now on, a look sees ${now.set}.`;
    } else if (now.says !== undefined) {
      says = `${who} ${now.says}.`;
    } else if (now.client !== undefined) {
      return ask(setup, state, run, now);
    }
    return says + nextStep(setup, state, run);
  }

  function ask(setup, state, run, now) {
    push(setup, state, { callback: now.call, seq: run.seq, from: { run: run.id, client: now.client } });
    run.waits = true;
    const holds = groupOf(setup, run.callback).exclusive ? 'and its group wait' : 'waits';
    return `${capital(named(setup, run))} asks ${setup.callbacks[now.call].name} and waits: `
      + `its thread ${holds} with it.`;
  }

  function end(setup, state, thread) {
    const run = state.runs[thread];
    add(setup, state, run);
    state.runs[thread] = null;
    const ends = `The callback of ${named(setup, run)} ends. ${capital(setup.threads[thread])} is free.`;
    const { from } = run;
    if (from && run.callback !== from.client) {
      push(setup, state, { callback: from.client, seq: run.seq, from });
      return `${ends} Its answer waits for ${setup.callbacks[from.client].name}.`;
    }
    const asker = from && runOf(state, from.run);
    if (!asker?.waits) return ends;
    asker.waits = false;
    nextStep(setup, state, asker);
    return `${ends} ${capital(named(setup, asker))} has its answer.`;
  }

  return { start, cause, advance, named, capital, step, stepsOf, going, holderOf, holder, groupOf, runOf };
}
