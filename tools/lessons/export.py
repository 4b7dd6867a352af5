"""Export the lessons as slides: HTML files that work without a network.

    python -m tools.lessons.export             all lessons, into slides/
    python -m tools.lessons.export 02 03       some of them

reveal.js and MathJax come from npm once, into .venv, and are copied beside the decks. The outputs
are the saved ones. Solutions are left out. The cells with the tag `notes` are the speaker notes: S
opens them in a window of its own.
"""

import re
import shutil
import subprocess
import sys
from copy import deepcopy
from pathlib import Path

import nbformat
from nbconvert.exporters import SlidesExporter
from nbformat import NotebookNode

from tools.lessons.lesson import FOLDER, GLOSSARY, ROOT, chosen, first_heading
from tools.lessons.slides import CODE, folded, heading, slide_types

HERE = Path(__file__).resolve().parents[1]
TEMPLATE = HERE / 'deck_template'
OUTPUT = ROOT / 'slides'
PACKAGES = ROOT / '.venv' / 'deck'
LIBRARY = (
    'reveal.js/dist/reveal.css',
    'reveal.js/dist/reveal.js',
    'reveal.js/plugin/notes/notes.js',
    'mathjax/es5/tex-svg.js',
)
NEEDS_NPM = (
    'Slides need npm, which fetches reveal.js and MathJax once: '
    'install it, on Debian with `sudo apt install npm`, then try again.'
)


def fetch_packages(folder: Path = PACKAGES) -> Path:
    """Let npm install the pinned packages into `folder`, once; return where they are.

    Raises ValueError with one sentence where npm is missing or fails.
    """
    lock = (TEMPLATE / 'package-lock.json').read_bytes()
    done = folder / 'done'
    if done.is_file() and done.read_bytes() == lock:
        return folder / 'node_modules'
    npm = shutil.which('npm')
    if not npm:
        raise ValueError(NEEDS_NPM)
    folder.mkdir(parents=True, exist_ok=True)
    for name in ('package.json', 'package-lock.json'):
        shutil.copy(TEMPLATE / name, folder)
    # Without a network npm would try again and again: what it has is enough, or it says so soon.
    network = ['--prefer-offline', '--fetch-retries=1', '--fetch-retry-mintimeout=1000']
    command = [npm, 'ci', '--ignore-scripts', '--no-audit', '--no-fund', '--silent', *network]
    if subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL).returncode:
        raise ValueError('npm could not fetch reveal.js and MathJax: is there a network?')
    done.write_bytes(lock)
    return folder / 'node_modules'


def for_reveal(notebook: NotebookNode) -> NotebookNode:
    """Return a copy of a notebook as nbconvert's slides want it."""
    notebook = deepcopy(notebook)
    cells, note = [], None
    for cell, slide_type in zip(notebook.cells, slide_types(notebook), strict=True):
        tags = cell.metadata.setdefault('tags', [])
        if 'notes' in tags:
            slide_type, cell.cell_type, note = 'notes', 'markdown', cell
        elif 'solution' in tags:
            slide_type = 'skip'
        cell.metadata.slideshow = {'slide_type': slide_type}
        if cell.cell_type == 'markdown':
            cell.source = re.sub(r'\]\((\d\d_\w+)\.ipynb', r'](\1.html', cell.source)
        else:
            cell.metadata.transient = {'remove_source': folded(cell)}
            lines = len(cell.source.splitlines())
            tags += [f'more-than-{most}-lines' for most in CODE if lines > most]
            cell.outputs = [output for output in cell.outputs if not is_widget(output)]
        if heading(cell, '##? '):  # a step begins, and its note is after the heading
            note = None
        cells.append(cell)
        if note and slide_type in ('slide', 'subslide'):  # the step goes on: so does its note
            cells.append(deepcopy(note))
            cells[-1].id += f'-{len(cells)}'
    notebook.cells = cells
    return notebook


def is_widget(output: NotebookNode) -> bool:
    """Say whether an output is the text of a widget, such as `VBox(children=(...))`."""
    data = output.get('data', {})
    return set(data) == {'text/plain'} and bool(re.match(r'\w+\(children=', data['text/plain']))


def export(path: Path, output: Path) -> Path:
    """Write one lesson as a deck into `output`; return the file."""
    exporter = SlidesExporter(
        template_name=TEMPLATE.name,
        extra_template_basedirs=[str(TEMPLATE.parent)],
    )
    notebook = for_reveal(nbformat.read(path, as_version=4))
    title = first_heading(notebook.cells[0].source)
    resources = {'metadata': {'title': title, 'path': str(path.parent)}}
    html, _ = exporter.from_notebook_node(notebook, resources)
    file = output / path.with_suffix('.html').name
    file.write_text(html, encoding='utf-8')
    return file


def main(arguments: list[str], folder: Path = FOLDER, output: Path = OUTPUT) -> int:
    """Run the tool with the numbers of lessons; return its exit status."""
    try:
        # Every deck has a link to the glossary.
        paths = sorted({*chosen(' '.join(arguments), folder), *folder.glob(f'{GLOSSARY}_*.ipynb')})
        packages = fetch_packages()
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    library = output / 'lib'
    library.mkdir(parents=True, exist_ok=True)
    for source in (*(packages / name for name in LIBRARY), HERE / 'deck.css'):
        shutil.copy(source, library)
    # Beside the decks: nbconvert's `embed_images` would close each HTML tag of the text at once.
    if (images := folder / 'images').is_dir():
        shutil.copytree(images, output / images.name, dirs_exist_ok=True)
    for name in ('reveal.js', 'mathjax'):  # who passes them on must add their licences
        shutil.copy(packages / name / 'LICENSE', library / f'{name}.LICENSE')
    for path in paths:
        print(export(path, output).relative_to(output.parent))
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
