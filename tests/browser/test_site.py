"""The web site, opened from its folder without a network. `make test-browser` has written it."""

import re
from html.parser import HTMLParser
from urllib.parse import unquote, urlparse

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
on_screens = pytest.mark.parametrize(
    ('width', 'scheme'), [(1280, 'light'), (360, 'dark')], ids=['desktop', 'phone']
)
WORDS = ['deadlock', 'KEEP_LAST', 'durabilité', 'قطار', 'hàng đợi']


class Links(HTMLParser):
    """What a page links to, loads, and can be linked to."""

    def __init__(self, text):
        super().__init__()
        self.targets, self.loaded, self.ids = set(), set(), set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.ids |= {attrs[name] for name in ('id', 'name') if attrs.get(name)}
        if tag == 'a' and attrs.get('href'):
            self.targets.add(attrs['href'])
        elif tag != 'a':
            self.loaded |= {attrs[name] for name in ('src', 'href') if attrs.get(name)}


@pytest.fixture(scope='module')
def pages():
    return {name: Links((SITE / name).read_text(encoding='utf-8')) for name in PAGES}


@pytest.fixture
def tab(file_page, width, scheme):
    with file_page(width, 740, color_scheme=scheme) as opened:
        yield opened


def test_each_link_inside_leads_somewhere(pages):
    broken = []
    for name, page in pages.items():
        for link in page.targets:
            parts = urlparse(link)
            if parts.scheme:
                continue
            target = (SITE / name).parent / unquote(parts.path) if parts.path else SITE / name
            file = target.resolve()
            known = pages.get(file.relative_to(SITE).as_posix()) if file.is_file() else None
            if (
                not file.is_file()
                or known
                and parts.fragment
                and unquote(parts.fragment) not in known.ids
            ):
                broken.append(f'{name}: {link}')
    assert broken == []


def test_nothing_is_loaded_from_elsewhere(pages):
    assert [link for page in pages.values() for link in page.loaded if urlparse(link).netloc] == []


def test_a_lesson_is_downloaded_as_it_is(pages):
    lessons = sorted((ROOT / 'notebooks').glob('*.ipynb'))
    assert [f'notebooks/{path.stem}.html' for path in lessons] == LESSONS
    for path in lessons:
        assert path.name in pages[f'notebooks/{path.stem}.html'].targets
        assert (SITE / 'notebooks' / path.name).read_bytes() == path.read_bytes()


@on_screens
@pytest.mark.parametrize('name', ['index.html', *LESSONS, 'teaching.html'])
def test_a_page_fits_its_screen(tab, artefacts, axe, name):
    tab.goto((SITE / name).as_uri())
    assert not tab.evaluate(WIDER)
    assert tab.evaluate("[...document.images].every(image => image.alt || image.closest('a'))")
    tab.add_script_tag(path=axe)
    assert tab.evaluate(SERIOUS) == []
    tab.screenshot(
        path=artefacts / f'site_{name.replace("/", "_")}_{tab.viewport_size["width"]}.png'
    )


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
        wide = (
            "[...document.querySelectorAll('pre')].filter(p => p.scrollWidth > p.clientWidth + 1)"
        )
        assert tab.evaluate(f'{wide}.map(part => part.innerText.slice(0, 80))') == []
        tab.screenshot(path=artefacts / 'site_print.png')
