// What replays, levels, guesses and free play have in common on a page.

// An element of the page, and a shape of an SVG.
export const element = (tag, attributes, ...children) => filled(document.createElement(tag), attributes, children);
export const shape = (tag, attributes, ...children) =>
  filled(document.createElementNS('http://www.w3.org/2000/svg', tag), attributes, children);

function filled(node, attributes = {}, children) {
  node.append(...children);
  return change(node, attributes);
}

// Return the node with these attributes: a function among them is a handler, what is undefined is left out.
export function change(node, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === 'function') node[name] = value;
    else if (value !== undefined) node.setAttribute(name, value);
  }
  return node;
}

export const row = (name, ...content) => element('div', { class: 'replay-row' },
  element('b', { 'aria-hidden': 'true' }, name), element('div', {}, ...content));

// A picture has words for everybody who does not see it.
export const seen = (svg, words) => change(svg, { role: 'img', 'aria-label': words });

// The picture of an image, as a part of the page: its ink is that of the page.
export function drawing(image) {
  const text = decodeURIComponent(image.src.slice(image.src.indexOf(',') + 1));
  const svg = new DOMParser().parseFromString(text, 'image/svg+xml').documentElement;
  return seen(svg, image.alt);
}

// Its letters have 16 units, and never less than 14 pixels, however small it is shown. `then` gets its
// scale, pixels of a unit, each time that it changes.
export function legible(svg, then = () => {}) {
  new ResizeObserver(() => {
    const scale = svg.isConnected && svg.getScreenCTM()?.a;
    if (!scale) return;
    svg.style.setProperty('--letters', `${Math.max(16, 14 / scale).toFixed(1)}px`);
    then(scale);
  }).observe(svg);
  return svg;
}

// Give what is played a frame, a name and keys. What is typed in it is no command of JupyterLab, but for
// what leads out of it or runs the cell. `onKey` gets a key and its target, and returns whether it did
// something.
export function wake(root, name, onKey = () => false) {
  root.classList.add('replay-on');
  change(root, { role: 'group', 'aria-label': name, tabindex: 0 });
  root.addEventListener('keydown', event => {
    const { key, target, shiftKey } = event;
    if (event.ctrlKey || event.metaKey || event.altKey || (shiftKey && key === 'Enter') || key === 'Tab' || key.startsWith('Page')) return;
    event.stopPropagation();
    if (!shiftKey && onKey(key, target)) event.preventDefault();
  });
}
