// Show the messages that share most words with what was pasted, which may be a part or have more.
const field = document.querySelector('.find-message input');
const told = document.querySelector('.find-message output');
const body = document.querySelector('table tbody');
const words = text => new Set(text.toLowerCase().match(/[\p{L}\d_]{3,}/gu) ?? []);
const rows = [...body.rows].map(row => ({ row, words: words(row.cells[0].textContent) }));

field.addEventListener('input', () => {
  const asked = words(field.value);
  const shared = entry => [...entry.words].filter(word => asked.has(word)).length;
  const part = entry => shared(entry) / Math.min(entry.words.size, asked.size);
  const found = rows.filter(entry => !asked.size || part(entry) >= 0.6)
    .sort((a, b) => shared(b) - shared(a));
  body.replaceChildren(...found.map(entry => entry.row));
  told.textContent = asked.size && !found.length
    ? 'No lesson has this message. Try its first words, without names of yours.' : '';
});
