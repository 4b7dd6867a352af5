// The circle of waits in a program that hangs, as a page shows it: drawn as the one of a recorded run.

import { seen } from '../replay/element.js';
import { ring } from '../replay/ring.js';

const root = document.currentScript.closest('.replay');
const circle = JSON.parse(root.dataset.circle);
const { node, draw } = ring();
draw(circle);
seen(node.firstChild, circle.says);
root.classList.add('replay-on');
root.querySelector('p').replaceWith(node);
