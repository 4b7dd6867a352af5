// Who waits for whom, of the runs that can never go on: each waits for another, in a circle.

// Return of each such run its id and callback, and a sentence that says for what it waits.
function circleOf(setup, state) {
  const runs = model.going(state);
  const free = new Set();
  const can = run => !run || free.has(run.id);
  const isOpen = callback => can(model.holder(setup, state, callback));
  const hasThread = () => state.runs.some(can);

  // Where the answer for a run is: it waits for its client, somebody works on it, or the request waits.
  function search(run) {
    const { client, ...asks } = model.step(setup, run);
    const service = asks.call ?? asks.await;
    const asked = item => item.from?.run === run.id;
    const answered = runs.some(item => asked(item) && item.callback === client);
    return {
      client,
      service,
      taken: answered,
      there: state.queues[client].some(asked),
      working: answered ? undefined : runs.find(asked),
      waiting: state.queues[service].some(asked),
    };
  }

  function canGo(run) {
    if (run.waits === 'thread') return hasThread();
    if (run.waits !== 'answer')
      return !model.blocked(setup, state, run) || can(ownerOf(run));
    const { client, service, taken, there, working, waiting } = search(run);
    if (taken) return true; // to take an answer waits for nothing
    if (!hasThread() || !isOpen(client)) return false;
    return there || (working ? can(working) : waiting && isOpen(service));
  }

  const lockOf = run => model.step(setup, run).lock;
  const ownerOf = run => model.runOf(state, state.locks[lockOf(run)]);
  const name = run => model.named(setup, run);
  const group = callback => model.groupOf(setup, callback).name;
  const holder = callback => name(model.holder(setup, state, callback));

  function why(run) {
    if (run.waits === 'thread') return 'has its answer, but no thread is free.';
    if (run.waits !== 'answer') return `waits for ${lockOf(run)}, which ${name(ownerOf(run))} has.`;
    const { client, service, there, working, waiting } = search(run);
    const what = there ? 'The answer is there' : `The request waits for ${setup.callbacks[service].name}`;
    const needed = there ? client : service;
    let says = 'It never comes.';
    if (working && !can(working)) says = `${model.capital(name(working))} must give it, and waits itself.`;
    else if ((there || waiting) && !hasThread()) says = `${what}, but no thread is free.`;
    else if ((there || waiting) && !isOpen(needed))
      says = `${what}, but ${setup.callbacks[needed].name} is in ${group(needed)}, which ${holder(needed)} holds.`;
    else if (working || waiting)
      says = `${setup.callbacks[client].name} must take it, but is in ${group(client)}, which ${holder(client)} holds.`;
    return `waits for an answer. ${says}`;
  }

  for (let grown = true; grown; ) {
    const before = free.size;
    runs.filter(canGo).forEach(run => free.add(run.id));
    grown = free.size > before;
  }
  return runs.filter(run => !can(run)).map(run => ({
    run: run.id,
    callback: run.callback,
    says: `${model.capital(name(run))} ${why(run)}`,
  }));
}
