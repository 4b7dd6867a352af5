// An element of a page: a function among the attributes is a handler, what is undefined is left out.
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === 'function') made[name] = value;
    else if (value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

const row = (name, ...content) => element('div', { class: 'replay-row' },
  element('b', { 'aria-hidden': 'true' }, name), element('div', {}, ...content));

// A picture has words for everybody who does not see it.
function seen(svg, words) {
  svg.setAttribute('role', 'img');
  svg.setAttribute('aria-label', words);
  return svg;
}

// What replays, levels and free play have of their own on a page.
function wake(root, name) {
  root.classList.add('replay-on');
  root.setAttribute('role', 'group');
  root.setAttribute('aria-label', name);
  root.tabIndex = 0;
}
