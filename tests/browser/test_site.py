"""The web site, opened from its folder without a network. `make test-browser` has written it."""

import re
from pathlib import Path

import pytest
from support.lab_page import WIDER
from support.lab_server import ROOT

SITE = ROOT / 'site'
PAGES = sorted(path.relative_to(SITE).as_posix() for path in SITE.rglob('*.html'))
LESSONS = [name for name in PAGES if re.match(r'notebooks/\d\d_', name)]
FOUND = "[...document.querySelectorAll('#search-results li a')].map(link => link.href)"
SERIOUS = """async () => (await axe.run()).violations
    .filter(found => ['serious', 'critical'].includes(found.impact))
    .map(found => `${found.id}: ${found.nodes[0].html.slice(0, 100)}`)"""
CUT_OFF = """[...document.querySelectorAll('pre')]
    .filter(part => part.scrollWidth > part.clientWidth + 1)
    .map(part => part.innerText.slice(0, 80))"""
on_screens = pytest.mark.parametrize(
    ('width', 'scheme'), [(1280, 'light'), (360, 'dark')], ids=['desktop', 'phone']
)
WORDS = ['deadlock', 'KEEP_LAST', 'durabilité', 'قطار', 'hàng đợi']


@pytest.fixture
def tab(file_page, width, scheme):
    with file_page(width, 740, color_scheme=scheme) as opened:
        yield opened


def test_nothing_is_loaded_from_elsewhere():
    for name in PAGES:
        loads = r'<(?:script|link|img)\b[^>]*(?:src|href)="((?:https?:)?//[^"]*)'
        assert re.findall(loads, (SITE / name).read_text(encoding='utf-8')) == []


def test_a_lesson_is_downloaded_as_it_is():
    lessons = sorted((ROOT / 'notebooks').glob('*.ipynb'))
    assert [f'notebooks/{path.stem}.html' for path in lessons] == LESSONS
    for path in lessons:
        page = (SITE / 'notebooks' / f'{path.stem}.html').read_text(encoding='utf-8')
        assert f'href="{path.name}" download' in page
        assert (SITE / 'notebooks' / path.name).read_bytes() == path.read_bytes()


@on_screens
@pytest.mark.parametrize('name', ['index.html', *LESSONS, 'teaching.html'])
def test_a_page_fits_its_screen(tab, artefacts, axe, name):
    tab.goto((SITE / name).as_uri())
    assert not tab.evaluate(WIDER)
    assert tab.evaluate("[...document.images].every(image => image.alt || image.closest('a'))")
    tab.add_script_tag(path=axe)
    assert tab.evaluate(SERIOUS) == []
    tab.screenshot(path=artefacts / f'site_{Path(name).stem}_{tab.viewport_size["width"]}.png')


def test_search_finds_a_term_in_each_language(file_page):
    # It also wants a piece of each page that it finds, which a browser does not read from a file.
    with file_page(1280, 740, expected=('Failed to fetch',)) as tab:
        for word in WORDS:
            tab.goto(f'{(SITE / "search.html").as_uri()}?q={word}')
            tab.wait_for_function(f'{FOUND}.length > 0')
            assert any('/notebooks/' in link for link in tab.evaluate(FOUND)), word


def test_paper_has_the_text_and_nothing_else(file_page, artefacts):
    with file_page(794, 1123) as tab:  # A4
        tab.goto((SITE / LESSONS[2]).as_uri())
        tab.emulate_media(media='print')
        for part in ('.sidebar-drawer', '.toc-drawer', '.related-pages', '.lesson-file'):
            assert not tab.locator(part).first.is_visible()
        assert tab.locator('h1').first.is_visible()
        assert tab.evaluate(CUT_OFF) == []
        tab.screenshot(path=artefacts / 'site_print.png')
