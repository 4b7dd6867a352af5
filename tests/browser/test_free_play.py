"""Free play, on a phone and by keys alone, on a page from a file."""

from support.lab_page import WIDER

from helpers.replay import FreePlay


def test_a_slider_draws_the_prediction_again(phone, artefacts):
    page = phone(FreePlay())
    root = page.get_by_role('group', name='free play')
    says, picture = root.locator('[aria-live=polite]'), root.get_by_role('img')
    assert says.inner_text() == '20 of 41 messages are received. The oldest waits 1.80 s.'
    before = picture.inner_html()
    root.get_by_label('depth').focus()
    page.keyboard.press('End')
    assert says.inner_text().startswith('41 of 41 messages are received.')
    assert picture.inner_html() != before
    assert 'pushed out' not in picture.inner_html()
    assert not page.evaluate(WIDER)
    page.screenshot(path=artefacts / 'free_play.png')
