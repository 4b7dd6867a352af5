// Show the lesson that is open in a list that is longer than the window.
document.addEventListener('DOMContentLoaded', () => {
  const list = document.querySelector('.sidebar-scroll');
  const open = list?.querySelector('.current-page');
  const top = node => node.getBoundingClientRect().top;
  if (open) list.scrollBy({ top: top(open) - top(list) - list.clientHeight / 2, behavior: 'instant' });
});
