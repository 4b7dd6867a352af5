// On paper, nobody opens the answer of a guess, and nobody plays what came out.
addEventListener('beforeprint', () => {
  document.querySelectorAll('.tag_answer > details').forEach(answer => { answer.open = true; });
  const end = () => new KeyboardEvent('keydown', { key: 'End' });
  document.querySelectorAll('[data-opens]').forEach(replay => replay.dispatchEvent(end()));
});
