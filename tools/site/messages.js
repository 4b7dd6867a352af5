// Show the messages that share words with what was pasted, the nearest one first.
const field = document.querySelector('.find-message input');
const told = document.querySelector('.find-message output');
const body = document.querySelector('table tbody');
const words = text => new Set(text.toLowerCase().match(/[\p{L}\d_]{3,}/gu) ?? []);
const rows = [...body.rows].map(row => ({ row, words: words(row.cells[0].textContent) }));

field.addEventListener('input', () => {
  const asked = words(field.value);
  const shared = entry => [...entry.words].filter(word => asked.has(word)).length;
  const part = entry => shared(entry) / entry.words.size;
  const found = rows.filter(entry => !asked.size || part(entry) >= 0.5)
    .sort((a, b) => asked.size ? part(b) - part(a) : 0);
  body.replaceChildren(...found.map(entry => entry.row));
  told.textContent = asked.size && !found.length
    ? 'No lesson has this message. Try its first words, without names of yours.' : '';
});
