"""Write the lessons and the documents as a web site: site/index.html, which needs no network.

    python -m tools.site

Sphinx and myst-nb make the pages from the saved outputs: nothing runs. What they read is prepared
in .site/pages: the documents, and the notebooks as `page.py` changes them.
"""

import os
import re
import shutil
import sys
from pathlib import Path

import nbformat
from sphinx.cmd.build import build_main

from helpers.lesson import (
    FOLDER,
    GLOSSARY,
    PARTS,
    PICTURES,
    ROOT,
    START,
    Lesson,
    lessons,
    with_slugs,
)
from helpers.notebook import LOOK_CSS
from helpers.replay import level
from tools.site import free_drive, messages
from tools.site.page import PLAY_AGAIN, page_of

HERE = Path(__file__).parent
WORK = ROOT / '.site'
CLASSROOM = ('classroom/README', 'classroom/HOSTING', 'classroom/UNIVERSITY')
DOCUMENTS = (
    'README',
    'environment',
    'teaching',
    *CLASSROOM,
    'CONTRIBUTING',
    'ros2/README',
    'tools/UPGRADING',
)
MARKDOWN_LINK = re.compile(r'\[(?P<text>[^\]\n]*)\]\((?P<path>[\w./]+)\.md(?:#[\w-]*)?\)')
LINK = re.compile(r'\]\((?:\.\./)?([\w./]+)\)')
CONTENTS = """
```{{toctree}}
:hidden:
:caption: {part}

{pages}
```
"""


def prepare(pages: Path) -> None:
    """Write what Sphinx reads into a folder. Raises ValueError for a lesson that was not run."""
    known = lessons()
    for lesson in known:
        if any(c.cell_type == 'code' and not c.execution_count for c in lesson.cells):
            raise ValueError(
                f'{lesson.file} has not been run: `make notebooks LESSON={lesson.number}`.'
            )
    shutil.rmtree(pages, ignore_errors=True)
    static, notebooks = pages / 'static', pages / 'notebooks'
    downloads, figures = pages / 'downloads' / 'notebooks', static / 'figures'
    for folder in (figures, notebooks, downloads):
        folder.mkdir(parents=True)
    for lesson in known:
        shutil.copy(FOLDER / lesson.file, downloads)
        page = page_of(lesson, figures)
        nbformat.write(page, notebooks / lesson.file)
    shutil.copytree(FOLDER / PICTURES, notebooks / PICTURES)
    for name in DOCUMENTS:
        (pages / name).parent.mkdir(parents=True, exist_ok=True)
        text = (ROOT / f'{name}.md').read_text(encoding='utf-8')
        (pages / f'{name}.md').write_text(_as_page(text, Path(name).parent), encoding='utf-8')
    (pages / f'{messages.NAME}.md').write_text(messages.page(known), encoding='utf-8')
    for file in _linked(pages):
        (pages / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, pages / file)
    shutil.copy(HERE / 'conf.py', pages)
    for name in ('icon.svg', 'preview.png', 'sidebar.js', 'paper.js'):
        shutil.copy(HERE / name, static)
    shutil.copytree(HERE / 'fonts', static / 'fonts')
    (static / 'site.css').write_text(LOOK_CSS + (HERE / 'site.css').read_text('utf-8'), 'utf-8')
    parts = _parts(known)
    toctrees = (CONTENTS.format(part=part, pages='\n'.join(parts[part])) for part in parts)
    (pages / 'index.md').write_text(_first_page() + ''.join(toctrees), encoding='utf-8')


def _as_page(text: str, folder: Path) -> str:
    """Return a document whose links lead to headings as the site calls them, and to pages only.

    `folder` is that of the document in the checkout.
    """

    def without_link(found: re.Match) -> str:
        is_page = os.path.normpath(folder / found['path']) in DOCUMENTS
        return found[0] if is_page else found['text']

    return MARKDOWN_LINK.sub(without_link, with_slugs(text))


def _linked(pages: Path) -> set[str]:
    """Return the files of the checkout to which the pages link and which are no pages."""
    texts = (path.read_text(encoding='utf-8') for path in pages.rglob('*.[mi]*'))
    links = {link for text in texts for link in LINK.findall(text)}
    is_page = ('.md', '.ipynb', '.png')
    return {link for link in links if (ROOT / link).is_file() and not link.endswith(is_page)}


def _parts(known: list[Lesson]) -> dict[str, list[str]]:
    parts: dict[str, list[str]] = {'Start': []} | {part.capitalize(): [] for part in PARTS}
    names = {START: 'Start', GLOSSARY: 'Terms'}
    for lesson in known:
        part = names.get(lesson.number) or lesson.part.capitalize()
        parts.setdefault(part, []).append(f'notebooks/{Path(lesson.file).stem}')
    parts['Terms'].append(messages.NAME)
    return parts | {'Documents': list(DOCUMENTS)}


def _first_page() -> str:
    text = (HERE / 'index.md').read_text('utf-8')
    parts = {'level': level('save').html(), 'drive': free_drive.html(), 'again': PLAY_AGAIN}
    for place, html in parts.items():
        text = text.replace(f'{{{place}}}', f'```{{raw}} html\n{html}\n```')
    return text


def main() -> int:
    pages, built, site = WORK / 'pages', WORK / 'built', ROOT / 'site'
    try:
        prepare(pages)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    shutil.rmtree(built, ignore_errors=True)
    options = ['-q', '-W', '--keep-going', '-E', '-d', f'{WORK}/trees', '-b', 'html']
    if status := build_main([*options, str(pages), str(built)]):
        return status
    shutil.rmtree(site, ignore_errors=True)
    built.rename(site)
    print('site/index.html is written. It needs no network.')
    return 0


if __name__ == '__main__':
    sys.exit(main())
