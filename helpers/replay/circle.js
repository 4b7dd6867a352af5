// Who waits for whom, of the runs that can never go on: each waits for another, in a circle.

// Return of each such run its id, and a sentence that says for what it waits.
function circleOf(setup, state) {
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

  const name = run => model.named(setup, run);
  const group = callback => model.groupOf(setup, callback).name;
  const holder = callback => name(model.holder(setup, state, callback));

  function why(run) {
    const { client, service, there, working, waiting } = search(run);
    const what = there ? 'The answer is there' : `The request waits for ${setup.callbacks[service].name}`;
    const needed = there ? client : service;
    if (working && !can(working)) return `${model.capital(name(working))} must give it, and waits itself.`;
    if ((there || waiting) && !hasThread()) return `${what}, but no thread is free.`;
    if ((there || waiting) && !isOpen(needed))
      return `${what}, but ${setup.callbacks[needed].name} is in ${group(needed)}, which ${holder(needed)} holds.`;
    if (working || waiting)
      return `${setup.callbacks[client].name} must take it, but is in ${group(client)}, which ${holder(client)} holds.`;
    return 'It never comes.';
  }

  for (let grown = true; grown; ) {
    const before = free.size;
    runs.filter(canGo).forEach(run => free.add(run.id));
    grown = free.size > before;
  }
  return runs.filter(run => !can(run)).map(run => ({
    run: run.id,
    says: `${model.capital(name(run))} waits for an answer. ${why(run)}`,
  }));
}
