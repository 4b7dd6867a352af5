// On paper, nobody opens the answer of a guess.
addEventListener('beforeprint', () => {
  document.querySelectorAll('.tag_answer > details').forEach(answer => { answer.open = true; });
});
