"""The slides of a lesson as PDF: `make slides LESSON=02`.

    python -m classroom.deck.pdf 02

They are those of `make present`, with the saved outputs and without solutions and notes, for who
wants pages to read, or a wall without a kernel. Chromium prints them; a replay shows its first
picture. Without Chromium the pages are HTML, which any browser prints.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from copy import deepcopy
from pathlib import Path

import nbformat
from nbconvert import HTMLExporter
from nbformat import NotebookNode

from classroom.deck.slides import folded, slide_types
from helpers.lesson import ROOT, chosen, tags

PAGE = """
<style>
  @page { size: 33.87cm 19.05cm; margin: 0.8cm 1.2cm; }
  :root { --jp-content-font-size1: 19px; --jp-code-font-size: 16px; }
  .jp-InputPrompt, .jp-OutputPrompt { display: none !important; }
  .jp-Cell { padding: 0 !important; }
  .jp-OutputArea-child, .jp-InputArea, .jp-MarkdownOutput > * { break-inside: avoid; }
  .jp-Cell img, .jp-Cell svg { max-height: 13cm; max-width: 100%; object-fit: contain; }
  pre { white-space: pre-wrap !important; overflow: visible !important; }
  BREAKS { break-before: page; }
  FOLDED { display: none; }
</style>
"""
NAMES = 'chromium', 'chromium-browser', 'google-chrome'
LIMIT_S = 180


def pages(notebook: NotebookNode) -> str:
    """Return the slides of a lesson as HTML: each one begins a page."""
    notebook = deepcopy(notebook)
    types = slide_types(notebook)
    shown, breaks, hidden = [], [], []
    waits = False  # a slide began with a cell that is left out: the next one begins it
    for cell, kind in zip(notebook.cells, types, strict=True):
        starts = kind in ('slide', 'subslide') or waits
        if kind == 'skip' or 'solution' in tags(cell):
            waits = starts
            continue
        waits = False
        cell.metadata.pop('jupyter', None)
        if 'check' in tags(cell):
            cell.outputs = []  # of the starter
        place = f'#page-{len(shown)}'
        if starts and shown:
            breaks.append(place)
        if folded(cell):
            hidden.append(f'{place} .jp-Cell-inputWrapper')
        shown.append(cell)
    notebook.cells = shown
    for number, cell in enumerate(shown):
        cell.id = f'page-{number}'
    text, _ = HTMLExporter(template_name='lab').from_notebook_node(notebook)
    for number in range(len(shown)):  # the template writes ids for what links to a cell
        text = text.replace(f'id="cell-id=page-{number}"', f'id="page-{number}"')
    style = PAGE.replace('BREAKS', ', '.join(breaks) or 'none')
    style = style.replace('FOLDED', ', '.join(hidden) or 'none')
    base = f'<base href="{(ROOT / "notebooks").as_uri()}/">'  # of pictures
    return text.replace('<head>', f'<head>{base}', 1).replace('</head>', f'{style}</head>', 1)


def print_pdf(page: Path, to: Path) -> bool:
    """Let Chromium print a page, and return whether there is a PDF now."""
    found = filter(None, map(shutil.which, NAMES))
    if not (program := os.environ.get('CHROMIUM') or next(found, None)):
        return False
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        command = [program, '--headless', '--disable-gpu', f'--user-data-dir={folder}']
        if os.geteuid() == 0:
            command.append('--no-sandbox')  # Chromium wants it of root; the page is ours
        command += ['--no-pdf-header-footer', f'--print-to-pdf={to}', page.as_uri()]
        subprocess.run(command, capture_output=True, timeout=LIMIT_S)
    return to.exists()


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(prog='make slides', description='Print slides as PDF.')
    parser.add_argument('lessons', help='such as "02 03"')
    parser.add_argument('--output', type=Path, default=ROOT / 'handout/slides')
    options = parser.parse_args(arguments)
    try:
        if not options.lessons.split():
            raise ValueError('Which lesson? LESSON=02, or several: LESSON="02 03".')
        paths = chosen(options.lessons, ROOT / 'notebooks')
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    options.output.mkdir(parents=True, exist_ok=True)
    for path in paths:
        page = (options.output / path.name).with_suffix('.html').resolve()
        page.write_text(pages(nbformat.read(path, as_version=4)), encoding='utf-8')
        pdf = page.with_suffix('.pdf')
        pdf.unlink(missing_ok=True)
        if print_pdf(page, pdf):
            page.unlink()
            print(pdf)
        else:
            print(f'{page}: there is no Chromium, so print this page in a browser.')
    return 0


if __name__ == '__main__':
    sys.exit(main())
