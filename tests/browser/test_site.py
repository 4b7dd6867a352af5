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
SERIOUS = """async () => (await axe.run({ resultTypes: ['violations'] })).violations
    .filter(found => ['serious', 'critical'].includes(found.impact))
    .map(found => `${found.id}: ${found.nodes[0].html.slice(0, 100)}`)"""
CUT_OFF = """[...document.querySelectorAll('pre')]
    .filter(part => part.scrollWidth > part.clientWidth + 1)
    .map(part => part.innerText.slice(0, 80))"""
# Of the free drive: where the robot is, and where a place of its floor is on the screen.
DRIVEN = """document.querySelector('.free-drive .robot').getAttribute('transform')
    .match(/[-\\d.]+/g).map(Number)"""
ON_SCREEN = """([x, y]) => {
    const floor = document.querySelector('.free-drive .robot').parentNode.getScreenCTM();
    const at = new DOMPoint(x, y).matrixTransform(floor);
    return [at.x, at.y];
}"""
SCREENS = {1280: 'light', 360: 'dark'}
WORDS = ['deadlock', 'KEEP_LAST', 'durabilité', 'قطار', 'hàng đợi']


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


@pytest.mark.parametrize('name', ['index.html', *LESSONS, 'messages.html', 'teaching.html'])
def test_a_page_fits_its_screens(file_page, artefacts, axe, name):
    with file_page(1280, 740) as tab:
        tab.goto((SITE / name).as_uri())
        tab.add_script_tag(path=axe)
        assert tab.evaluate("[...document.images].every(image => image.alt || image.closest('a'))")
        for width, scheme in SCREENS.items():
            tab.set_viewport_size({'width': width, 'height': 740})
            tab.emulate_media(color_scheme=scheme)
            assert not tab.evaluate(WIDER)
            assert tab.evaluate(SERIOUS) == []
            tab.screenshot(path=artefacts / f'site_{Path(name).stem}_{width}.png')


def test_a_finger_drives_to_a_place_and_two_keys_make_a_curve(file_page, artefacts):
    with file_page(1280, 900) as tab:
        tab.goto((SITE / 'index.html').as_uri())
        drive = tab.get_by_role('group', name='free drive')
        drive.evaluate("drive => drive.scrollIntoView({ behavior: 'instant' })")
        drive.focus()
        for key in ('ArrowUp', 'ArrowLeft'):
            tab.keyboard.down(key)
        tab.wait_for_function(f'() => {DRIVEN}[0] > 1.4 && {DRIVEN}[1] > 1.9')
        for key in ('ArrowUp', 'ArrowLeft'):
            tab.keyboard.up(key)
        drive.get_by_role('button', name='Again', exact=True).click()
        for place in ((2.2, 2.2), (2.2, 3.9), (1.25, 5.75)):  # through the door, to A
            tab.mouse.move(*tab.evaluate(ON_SCREEN, place))
            tab.mouse.down()
            tab.wait_for_function(
                f'([x, y]) => Math.hypot({DRIVEN}[0] - x, {DRIVEN}[1] - y) < 0.3', arg=place
            )
            tab.mouse.up()
        says = drive.locator('[aria-live=polite]')
        assert says.inner_text() == 'A is done, B and C to go.'
        tab.screenshot(path=artefacts / 'free_drive.png')


def test_the_first_picture_plays_again(file_page):
    with file_page(1280, 900) as tab:
        for page in ('index.html', LESSONS[2]):
            tab.goto((SITE / page).as_uri())
            picture = tab.locator('img[src*="_images"]').first
            before = picture.get_attribute('src')
            tab.get_by_role('button', name='▶ Play again').click()
            assert picture.get_attribute('src') != before
            tab.wait_for_function(
                'document.querySelector(\'img[src*="_images"]\').naturalWidth > 0'
            )


def test_the_list_of_lessons_shows_the_one_that_is_open(file_page):
    with file_page(1280, 700) as tab:
        tab.goto((SITE / LESSONS[20]).as_uri())
        assert 0 < tab.locator('.sidebar-tree .current-page').last.bounding_box()['y'] < 650


def test_check_and_solution_are_one_line_until_one_is_opened(file_page):
    with file_page(1280, 740) as tab:
        tab.goto((SITE / LESSONS[9]).as_uri())
        check, solution = (
            tab.locator(f'.cell.tag_{kind} > details').first for kind in ('check', 'solution')
        )
        assert not check.locator('.cell_output').is_visible()
        assert check.bounding_box()['y'] == solution.bounding_box()['y']
        solution.locator('summary').click()
        assert solution.locator('.cell_output').is_visible()
        assert check.bounding_box()['y'] < solution.bounding_box()['y']


def test_a_guess_comes_before_its_answer(file_page):
    with file_page(1280, 740) as tab:
        tab.goto((SITE / LESSONS[5]).as_uri())
        replay = tab.locator('.replay[data-opens]').first
        slider, says = replay.get_by_label('step'), replay.locator('.replay-says')
        assert (slider.input_value(), says.inner_text()) == ('0', 'Have you guessed? Then play it.')
        display = 'getComputedStyle(node.querySelector(name)).display'
        # The whole way, and what covers the chart.
        ends = f'node => [".all", ".later"].map(name => {display})'
        assert replay.evaluate(ends) == ['none', 'inline']
        slider.press('End')
        assert 'The robot hit the wall' in says.inner_text()
        assert replay.evaluate(ends) == ['inline', 'none']

        tab.goto((SITE / LESSONS[6]).as_uri())
        answer = tab.locator('.cell.tag_answer > details').first
        explains = tab.get_by_text('The robot drives into the wall, without an error')
        assert not explains.is_visible()
        answer.locator('summary').click()
        assert explains.is_visible()
        assert 'The answer is in the wall.' in answer.inner_text()


def test_questions_from_memory_need_no_kernel(file_page):
    with file_page(1280, 740) as tab:
        tab.goto((SITE / LESSONS[5]).as_uri())
        right = tab.locator('#from-memory details', has_text='Right.')
        assert right.count() == 2
        right.first.locator('summary').click()
        assert 'shows it.' in right.first.inner_text()


def test_on_paper_answers_are_open(file_page):
    with file_page(794, 1123) as tab:
        tab.goto((SITE / LESSONS[2]).as_uri())
        tab.evaluate("dispatchEvent(new Event('beforeprint'))")
        tab.emulate_media(media='print')
        assert tab.get_by_text('The answer is 4, 5, 6, 7.').is_visible()


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


def test_a_message_with_names_of_mine_is_found(file_page):
    mine = 'RCLError: Failed to create publisher: topic rt/scan with incompatible type'
    with file_page(1280, 740) as tab:
        tab.goto((SITE / 'messages.html').as_uri())
        tab.get_by_label('Your message').fill(mine)
        assert '01 Publish and subscribe' in tab.locator('tbody tr').first.inner_text()
        tab.get_by_label('Your message').fill('all is well')
        assert tab.locator('tbody tr').count() == 0
        assert 'No lesson has this message' in tab.locator('.find-message output').inner_text()
