// Put what items make into a node, in their order. Most items stay as they are, and so do their nodes: what
// has gone is taken out, and only what is new is made.
export function keep(node, items, make) {
  const before = node.kept ?? new Map();
  const after = new Map();
  for (const item of items) {
    let text = JSON.stringify(item);
    while (after.has(text)) text += ' '; // another one that is alike
    after.set(text, before.get(text) ?? make(item));
  }
  for (const [text, one] of before) {
    if (!after.has(text)) one.remove();
  }
  let next = node.firstChild;
  for (const one of after.values()) {
    if (one === next) next = next.nextSibling;
    else node.insertBefore(one, next);
  }
  node.kept = after;
}
