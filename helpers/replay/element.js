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

// The picture of an image, as a part of the page: its ink is that of the page.
function drawing(image) {
  const text = decodeURIComponent(image.src.slice(image.src.indexOf(',') + 1));
  const svg = new DOMParser().parseFromString(text, 'image/svg+xml').documentElement;
  return seen(svg, image.alt);
}

// Its letters have 16 units, and never less than 14 pixels, however small it is shown.
function legible(svg, then = () => {}) {
  new ResizeObserver(() => {
    const scale = svg.isConnected && svg.getScreenCTM()?.a;
    if (!scale) return;
    svg.style.setProperty('--letters', `${Math.max(16, 14 / scale).toFixed(1)}px`);
    then();
  }).observe(svg);
  return svg;
}

// What replays, levels and free play have of their own on a page.
function wake(root, name) {
  root.classList.add('replay-on');
  root.setAttribute('role', 'group');
  root.setAttribute('aria-label', name);
  root.tabIndex = 0;
}
