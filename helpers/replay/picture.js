// A run as one picture: a row for each message, and why it waited. It is SVG as text: Python draws it
// for pages without scripts, free play in the page. Its ink is currentColor.

import { stories } from './stories.js';
import { walk } from './walk.js';

const ROWS = 120; // at most
const [RIGHT, LINE, LETTER] = [14, 20, 7.6]; // pixels; letters are about so wide
const WIDTH = 370; // so letters have 12 pixels on a phone, too
// Why a message waits, and a callback, as model.js calls it: dashes, and the legend's words.
const WAITS = {
  '': ['9 2 2 2', 'waits, a thread is free'],
  'thread busy': ['', 'waits, thread busy'],
  'group busy': ['6 2', 'waits, group busy'],
  'no executor': ['2 2', 'waits, no executor'],
  answer: ['4 2', 'waits, for one that waits'],
};
const RUNS = {
  '': ['', 'callback runs'],
  answer: ['2 2', 'callback waits for an answer'],
};
const CROSS = 'm-3-3l6 6m0-6l-6 6';

// When the last message of a run is lost (s), if one is.
function lastLoss(run) {
  const step = walk(run).scan().at(-1);
  return step && run.moves[step - 1][0] / 1e6;
}

// Return the picture of each run, of the same span of seconds, all on one scale. The cursor stands at
// a time, else at the last loss, else at the end.
export function pictures(runs, span, at) {
  const losses = runs.map(lastLoss).filter(loss => loss !== undefined);
  const cursor = at ?? (losses.length ? Math.max(...losses) : span[1]);
  const seen = runs.map(run => {
    const messages = stories(run, ROWS);
    const { callbacks } = run.setup;
    const names = messages.map(({ callback, seq }) =>
      (callbacks.length > 1 ? `${callbacks[callback].name} ${seq}` : `${seq}`));
    return { ...run, messages, names };
  });
  const longest = Math.max(...seen.flatMap(({ names }) => names.map(name => name.length)));
  const rows = Math.max(1, ...seen.map(({ messages }) => messages.length));
  const left = Math.max(36, 12 + LETTER * longest);
  // Pictures beside each other have legends of one height.
  const draw = least => seen.map(run => picture(run, span, rows, left, cursor, least));
  const least = Math.max(...draw(0).map(([, legend]) => legend));
  return draw(least).map(([svg]) => svg);
}

function picture({ messages, names, time }, [from, until], rows, left, cursor, least) {
  const step = Math.max(1.7, Math.min(15, 200 / rows));
  const bottom = step * rows;
  const wide = WIDTH - left - RIGHT;
  const x = at => +(left + wide * (Math.max(at, from) - from) / (until - from)).toFixed(1);
  const y = row => +(step * (row + 0.5)).toFixed(1);
  const path = (d, colour, width, dashes) => {
    const dashed = dashes ? ` stroke-dasharray="${dashes}"` : '';
    return `<path d="${d}" stroke="${colour}" stroke-width="${width}"${dashed}/>`;
  };
  const text = (words, at, down) => `<text x="${at}" y="${down}">${words}</text>`;
  const anchored = (anchor, texts) => `<g text-anchor="${anchor}">${texts}</g>`;

  const found = { waits: {}, runs: {} };
  const row = new Map(messages.map(({ callback, seq }, index) => [`${callback} ${seq}`, index]));
  let [crosses, pushed] = ['', ''];
  messages.forEach((one, index) => {
    const { callback, left: gone = until, ended = until, by } = one;
    [['waits', gone], ['runs', ended]].forEach(([kind, end]) => {
      one[kind].forEach(([begin, cause], i) => {
        const stop = Math.min(one[kind][i + 1]?.[0] ?? end, end);
        if (begin >= stop) return;
        const least = kind === 'runs' ? x(begin) + 1.5 : 0; // a short callback is seen, too
        found[kind][cause] = `${found[kind][cause] ?? ''}M${x(begin)} ${y(index)}H${Math.max(x(stop), least)}`;
      });
    });
    if (by === undefined) return;
    crosses += `M${x(gone)} ${y(index)}${CROSS}`;
    const other = row.get(`${callback} ${by}`);
    if (other !== undefined) pushed += `M${x(gone)} ${y(index)}V${y(other)}`;
  });

  // The legend grows with what is drawn.
  let [drawn, legend, at, down] = ['', '', RIGHT, 16];
  function add(d, mark, words, ...looks) {
    drawn += path(d, ...looks);
    const needed = Math.round(42 + LETTER * words.length);
    if (at > RIGHT && at + needed > WIDTH) [at, down] = [RIGHT, down + LINE];
    legend += path(`M${at} ${down - 5}${mark}`, ...looks) + text(words, at + 28, down);
    at += needed;
  }
  const looks = [['waits', WAITS, LOOK.waiting, 0.3, 1.5], ['runs', RUNS, LOOK.heard, 0.75, 3]];
  looks.forEach(([kind, causes, colour, part, thin]) => {
    const thick = +Math.max(thin, part * step).toFixed(1);
    Object.entries(causes).forEach(([cause, [dashes, words]]) => {
      if (found[kind][cause]) add(found[kind][cause], 'h22', words, colour, thick, dashes);
    });
  });
  if (pushed) drawn += path(pushed, LOOK.lost, 0.8, '1 2');
  if (crosses) add(crosses, 'm9-3l6 6m0-6l-6 6', 'pushed out', LOOK.lost, 1.6);
  down = Math.max(down, least);

  // The ticks of a short run would be too long for their places.
  const isShort = until - from < 0.01 && time.endsWith('(s)');
  const rough = (until - from) / 5;
  const power = 10 ** Math.floor(Math.log10(rough));
  const tick = power * [1, 2, 5, 10].find(n => n * power >= rough);
  let line = `M${left} ${bottom}h${wide}`;
  let below = text(isShort ? time.replace('(s)', '(ms)') : time, left + wide / 2, bottom + 40);
  for (let n = Math.ceil(from / tick); n * tick <= until; n += 1) {
    line += `M${x(n * tick)} ${bottom}v5`;
    below += text(+((isShort ? 1000 : 1) * n * tick).toPrecision(6), x(n * tick), bottom + 20);
  }
  const every = [1, 2, 5, 10].find(n => n * step >= 14);
  let beside = '';
  for (let i = 0; i < names.length; i += every) beside += text(names[i], left - 6, y(i) + 5);
  let axes = path(line, 'currentColor', 1) + anchored('middle', below) + anchored('end', beside);
  axes += `<path class="cursor" d="M${left} 0V${bottom}" transform="translate(${+(x(Math.min(cursor, until)) - left).toFixed(1)})" stroke="currentColor" stroke-width="1.5"/>`;
  const places = messages.map(({ callback, seq }) => [callback, seq].join(' '));
  const [top, height] = [down + 12, down + bottom + 60];
  return [`<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${WIDTH} ${height}" width="${WIDTH}" `
    + `height="${height}" font-family="system-ui, sans-serif" font-size="14" color="${LOOK.ink}" `
    + `fill="currentColor" preserveAspectRatio="xMinYMin" data-wide="${wide}" data-left="${left}" data-row="${step}" data-top="${top}" data-rows="${places}">${legend}`
    + `<g transform="translate(0 ${top})">${drawn}${axes}</g></svg>`, down];
}
