// Where the value of a guess is: `get()`, `set(value)`. In JupyterLab a hidden input, of a widget, takes
// it to the kernel; elsewhere the browser keeps it. The picture that answers a guess, elsewhere on the
// page, hears of it by the event 'guess'.
function memory(root, { question, value }) {
  const key = `guess: ${question}`;
  const inLab = document.querySelector('.jp-LabShell, .jp-NotebookShell') !== null;
  const area = inLab && root.closest('.jp-OutputArea');
  const line = () => area && area.querySelector('.guess-line input');
  let own = value;
  let sent;

  function send() {
    const text = JSON.stringify(own);
    const input = line();
    if (input) {
      input.value = text;
      input.dispatchEvent(new Event('change', { bubbles: true }));
      return;
    }
    try {
      localStorage.setItem(key, text);
    } catch { /* no storage */ }
  }

  return {
    see(value) { own = value; },
    get() {
      if (own !== null || inLab) return own;
      try {
        return JSON.parse(localStorage.getItem(key));
      } catch { // no storage, as in a private window
        return null;
      }
    },
    set(now) {
      own = now;
      clearTimeout(sent);
      sent = setTimeout(send, 100); // not each pixel of a drag
      document.dispatchEvent(new CustomEvent('guess', { detail: { question, value: now } }));
    },
  };
}

// On a slide, `see` gets what the class has guessed, as soon as it is shown: [] before.
function classOf({ question }, see) {
  document.addEventListener('class', ({ detail }) => see(detail.find(one => one.question === question)?.values ?? []));
  document.dispatchEvent(new CustomEvent('class-wanted'));
}
