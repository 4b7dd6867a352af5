// The row above a replay: a step back and forward, play, the speed, and the slider.

import { element } from './element.js';

const PLAYS_S = 10; // about so long a run plays
const SPEEDS = [1, 2, 4, 0.5]; // and how much faster or slower

// How many times as fast as it was a run of so many microseconds plays: a number that is easily read.
function pace(us) {
  const needed = us / 1e6 / PLAYS_S || 1;
  const power = 10 ** Math.floor(Math.log10(needed));
  return +(power * [10, 7, 5, 4, 3, 2, 1.5, 1].find(n => n * power <= 1.2 * needed)).toPrecision(2);
}

// Of a run of so many microseconds and steps. `on` says what they do: `step(way)`, `toggle()`,
// `slide(position)`, and `rest()` when the slider is let go. `rate()` is how fast it plays.
export function controls(length, last, on) {
  const button = (name, onclick, label, kind) =>
    element('button', { type: 'button', onclick, 'aria-label': label, class: kind }, name);
  const back = button('‹', () => on.step(-1), 'back');
  const forth = button('›', () => on.step(1), 'forward');
  const play = button('', on.toggle, undefined, 'replay-play');
  const faster = button('', () => {
    speed = (speed + 1) % SPEEDS.length;
    nameSpeed();
  }, undefined, 'replay-rate');
  const slider = element('input', {
    type: 'range', max: last, 'aria-label': 'step', onchange: on.rest, oninput: () => on.slide(+slider.value),
  });
  const usual = pace(length);
  const rate = () => +(usual * SPEEDS[speed]).toPrecision(2);
  let speed = 0;

  function nameSpeed() {
    const slower = +(1 / rate()).toPrecision(2);
    const exact = slower < 10 ? `${rate()}×` : `1/${slower.toLocaleString('en')}×`;
    faster.textContent = slower < 1000 ? exact : 'slow motion';
    faster.ariaLabel = faster.title = slower < 1000 ? `speed ${exact}` : `slow motion, ${exact}`;
  }

  function put(position) {
    slider.value = position;
    slider.setAttribute('aria-valuetext', `step ${position} of ${last}`);
    back.disabled = position === 0;
    forth.disabled = position === last;
  }

  // What play does next.
  function name(text) {
    if (play.textContent !== text) play.textContent = text;
  }

  nameSpeed();
  return { node: element('div', { class: 'replay-controls' }, back, forth, play, faster, slider), put, name, rate };
}
