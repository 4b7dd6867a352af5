"""What a page of the site shows of a notebook: nothing runs, so what needs a kernel is changed.

Notes for the instructor are left out. Checks, solutions, imports and the answers of guesses are
folded, questions from memory are a quiz, figures and scripts are files that pages share, and a link
leads to the lesson as it is.
"""

import ast
import hashlib
import io
import re
from base64 import b64decode
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import nbformat
from nbformat import NotebookNode
from PIL import Image

from helpers.checks import questions
from helpers.lesson import (
    Lesson,
    beside_time,
    code_of_solution,
    compares,
    first_heading,
    guess_of,
    has_heading,
    is_folded,
    names_of_memory,
    slug_of_myst,
    tags,
    with_slugs,
)
from tools.lessons.clean import EXPLAINS

IMPORTS = ast.Import, ast.ImportFrom
FOLDED_IMPORTS = 3  # and more of them in a cell are folded
FIGURE = re.compile(r'<img (?P<alt>[^>]*?)src="data:image/png;base64,(?P<png>[^"]+)"')
SCRIPT = re.compile(r'<script>(?P<text>\(\(\).*?)</script>', re.DOTALL)
STYLE = re.compile(r'<style>(?P<text>.*?)</style>', re.DOTALL)
FIRST_PICTURE = 'first-picture'  # the cell of a lesson that has it
AT_START = '<div class="replay" ', '<div class="replay" data-opens="start" '  # see view.js
SHOW_ANSWER = 'I have guessed: show the answer'
# A first picture plays once when it is loaded: so it is loaded anew when it comes into view later.
PLAY_AGAIN = """<p class="again"><button type="button">▶ Play again</button></p>
<script>
(() => {
  const picture = [...document.images].find(one => /_images.[^?]*[.]svg/.test(one.src));
  const source = picture.src;
  const play = () => { picture.src = `${source}?${Date.now()}`; };
  document.querySelector('.again button').onclick = play;
  new IntersectionObserver(([{ isIntersecting, time }], observer) => {
    if (!isIntersecting) return;
    observer.disconnect();
    if (time > 1500) play();
  }, { threshold: 0.6 }).observe(picture);
})();
</script>"""


def page_of(lesson: Lesson, figures: Path) -> NotebookNode:
    """Return a notebook as myst-nb shall read it, and write its figures into a folder."""
    notebook, cells = deepcopy(lesson.notebook), []
    for cell in _with_answers_hidden(notebook.cells):
        if cell.cell_type == 'raw':  # a note for the instructor
            continue
        if cell.cell_type == 'markdown':
            cell.source = with_slugs(cell.source)
        if cell.id == FIRST_PICTURE:
            cell.source += f'\n\n{PLAY_AGAIN}'
        if cell.cell_type == 'code':
            _fold(cell)
            cell.outputs = [output for output in cell.outputs if not is_widget(output)]
            for data in (output.get('data', {}) for output in cell.outputs):
                if 'text/html' in data:
                    data['text/html'] = _with_files(data['text/html'], figures)
        cells.append(cell)
        if cell.cell_type == 'code' and (names := names_of_memory(cell.source)):
            cell.outputs = []
            cells.append(_quiz_of(cell, names))
    cells[0].source = _with_download(cells[0].source, lesson)
    notebook.cells = cells
    notebook.metadata['language_info'] = {'name': 'python', 'pygments_lexer': 'cell'}
    return notebook


def _with_download(opening: str, lesson: Lesson) -> str:
    """Return the first cell with links on the line of its time: to its beginning, and its file."""
    first = next(first_heading(c.source) for c in lesson.cells if has_heading(c, '## '))
    links = (
        f'<a class="begin" href="#{slug_of_myst(first)}">Begin</a> · '
        f'<a href="{lesson.file}" download>Download the notebook</a>'
    )
    beside = beside_time(opening, f'<span class="lesson-file"> · {links}</span>')
    return beside or f'{opening}\n\n<span class="lesson-file">{links}</span>'


def is_widget(output: NotebookNode) -> bool:
    """Return whether an output is the text of a widget, such as `VBox(children=(...))`."""
    data = output.get('data', {})
    return set(data) == {'text/plain'} and bool(re.match(r'\w+\(children=', data['text/plain']))


def is_replay(output: NotebookNode) -> bool:
    """Return whether an output is a replay or a drive."""
    return AT_START[0] in output.get('data', {}).get('text/html', '')


def is_guess(output: NotebookNode) -> bool:
    """Return whether an output is a guess that one makes there."""
    return '<div class="replay guess"' in output.get('data', {}).get('text/html', '')


def _fold(cell: NotebookNode) -> None:
    """Fold what is read by few: the check and the solution of a task, and the imports.

    site.css sets the check and the solution that follows it on one line.
    """
    kind = next((tag for tag in ('check', 'solution') if tag in tags(cell)), '')
    if kind:
        cell.metadata['tags'] = ['hide-cell', kind]
        # It runs in JupyterLab. Here it would hide what the code below it is.
        cell.source = code_of_solution(cell.source)
    elif any(is_guess(output) for output in cell.outputs):
        cell.metadata['tags'] = ['remove-input']
    elif _is_plumbing(cell):
        kind = 'imports'
        cell.metadata['tags'] = ['hide-input', kind]
    elif is_folded(cell):
        kind = 'code'
        cell.metadata['tags'] = ['hide-input', kind]
    if kind:
        words = kind.capitalize()
        cell.metadata['mystnb'] = {'code_prompt_show': words, 'code_prompt_hide': words}


def _with_answers_hidden(cells: list[NotebookNode]) -> list[NotebookNode]:
    """Fold what answers a guess: texts and figures, and the paragraph below them.

    Replays are open, at their start: one plays them, and sees.
    """
    guess, kept = None, []
    for cell in cells:
        after_answer = kept and 'answer' in tags(kept[-1])
        kept.append(cell)
        if asked := guess_of(cell):
            guess = asked
        elif after_answer and cell.source.startswith(EXPLAINS):
            cell.source = cell.source.replace(EXPLAINS, '{.explains}\n', 1)
        elif cell.cell_type == 'code' and guess:
            for output in cell.outputs:
                if is_replay(output):
                    output.data['text/html'] = output.data['text/html'].replace(*AT_START)
            if not compares(cell, guess):
                continue
            guess = None
            # One that moves from run to run is not saved: see compare_prediction.
            if any('The answer is' in output.get('text', '') for output in cell.outputs):
                kept.append(_answer_of(cell))
    return kept


def _quiz_of(cell: NotebookNode, names: list[str]) -> NotebookNode:
    """Return the questions that a cell asks from memory as a quiz, which needs no kernel."""
    parts = []
    for name in names:
        question = questions()[name]
        parts += [question.question, '']
        for letter, option in question.options.items():
            verdict = f'**Right.** {question.reason}' if letter == question.right else '**No.**'
            summary = f'<summary>{letter}. {option}</summary>'
            parts += [f'<details>{summary}', '', verdict, '', '</details>']
        parts.append('')
    return nbformat.v4.new_markdown_cell('\n'.join(parts), id=f'{cell.id}-quiz')


def _answer_of(cell: NotebookNode) -> NotebookNode:
    """Take the answer out of a cell, and return it as a folded cell without code."""
    answer = deepcopy(cell)
    answer.id, answer.source = f'{cell.id}-answer', '# myst-nb leaves out a cell without code'
    cell.outputs = [output for output in cell.outputs if is_replay(output)]
    answer.outputs = [output for output in answer.outputs if not is_replay(output)]
    answer.metadata = {
        'tags': ['remove-input', 'hide-output', 'answer'],
        'mystnb': {'code_prompt_show': SHOW_ANSWER, 'code_prompt_hide': 'The answer'},
    }
    return nbformat.from_dict(answer)


def _is_plumbing(cell: NotebookNode) -> bool:
    """Return whether a cell only imports, and perhaps names a folder, and has nothing to show."""
    try:
        body = ast.parse(cell.source).body
    except SyntaxError:  # a magic command
        return False
    imports = [line for line in body if isinstance(line, IMPORTS)]
    rest = [line for line in body if not isinstance(line, (*IMPORTS, ast.Assign))]
    return len(imports) >= FOLDED_IMPORTS and not rest and not cell.outputs


def _with_files(text: str, figures: Path) -> str:
    """Write the figures and scripts of an output into a folder, and link to them in its HTML.

    In a notebook, each replay has all that it needs. Here they share it.
    """

    def share(kind: str, link: str) -> Callable[[re.Match], str]:
        def write(found: re.Match) -> str:
            name = f'{hashlib.sha256(found["text"].encode()).hexdigest()[:16]}.{kind}'
            (figures / name).write_text(found['text'], encoding='utf-8')
            return link.format(f'../_static/figures/{name}')

        return write

    def write(figure: re.Match) -> str:
        png = b64decode(figure['png'])
        image = Image.open(io.BytesIO(png))
        name = f'{hashlib.sha256(png).hexdigest()[:16]}.webp'
        image.save(figures / name, lossless=True)
        size = f'width="{image.width}" height="{image.height}" loading="lazy"'
        return f'<img {figure["alt"]}{size} src="../_static/figures/{name}"'

    text = SCRIPT.sub(share('js', '<script src="{}"></script>'), text)
    text = STYLE.sub(share('css', '<link rel="stylesheet" href="{}">'), text)
    return FIGURE.sub(write, text)
