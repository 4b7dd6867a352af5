// Whether the reader wants no motion. To ask the page each time would lay it out.
const query = matchMedia('(prefers-reduced-motion: reduce)');
let calm = query.matches;
query.onchange = () => { calm = query.matches; };

export const isCalm = () => calm;
