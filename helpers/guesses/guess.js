// A guess on a page: its picture, which its kind draws, and what one says with it. What came out is
// drawn into it, if the record has it.

function show(root, record) {
  const kind = { place: () => placeKind, level: () => levelKind, options: () => optionsKind, rows: () => rowsKind }[record.kind]();
  const kept = memory(root, record);
  const says = element('p', { 'aria-live': 'polite', class: 'guess-says' });
  const shown = kind.draw(record, root.querySelector('img'), kept.set);

  function tell(value) {
    root.classList.toggle('guess-new', value === null);
    if (record.outcome) says.textContent = kind.gap(record, value, record.outcome).says;
    else if (value === null) says.textContent = record.asks;
    else says.replaceChildren('You say: ', element('b', {}, kind.said(record, value)));
  }

  root.classList.add('replay-on');
  root.setAttribute('role', 'group');
  root.setAttribute('aria-label', record.question);
  // What is typed here is no command of JupyterLab: but Escape, Tab, and Shift+Enter, which goes on.
  root.addEventListener('keydown', event => {
    const { key, ctrlKey, metaKey, altKey, shiftKey } = event;
    if (ctrlKey || metaKey || altKey || (shiftKey && key === 'Enter') || ['Tab', 'Escape'].includes(key) || key.startsWith('Page')) return;
    event.stopPropagation();
  });
  root.querySelector('figure')?.remove();
  root.querySelector('.replay-static').replaceWith(
    says, shown.node,
    ...(document.querySelector('.jp-LabShell, .jp-NotebookShell') && !record.outcome ? [element('p', { class: 'guess-typed' }, record.forms)] : []));
  const value = kept.get();
  shown.put(value);
  tell(value);
  document.addEventListener('guess', ({ detail }) => {
    if (detail.question !== record.question || !root.isConnected || (record.outcome && record.value !== null)) return;
    shown.put(detail.value);
    tell(detail.value);
  });
}

const root = document.currentScript.closest('.guess');
show(root, JSON.parse(root.dataset.guess));
