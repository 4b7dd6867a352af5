"""Free play and a deadlock, on a phone and by keys alone, on a page from a file."""

from lab_page import WIDER
from support.nodes import LIMIT_S, Answerer, Asker, spin

from helpers.recording import CallbackRecording
from helpers.replay.calls import replay_calls
from helpers.replay.free import FreePlay
from helpers.session import ros_session


def test_a_slider_draws_the_prediction_again(phone, artefacts):
    page = phone(FreePlay())
    root = page.get_by_role('group', name='free play')
    says, picture = root.locator('[aria-live=polite]'), root.get_by_role('img')
    assert says.inner_text() == '20 of 41 messages are heard. The oldest waits 1.80 s.'
    before = picture.inner_html()
    root.get_by_label('depth').focus()
    page.keyboard.press('End')
    assert says.inner_text().startswith('41 of 41 messages are heard.')
    assert picture.inner_html() != before
    assert picture.locator('.free-lost').get_attribute('d') == ''
    root.get_by_label('group').select_option('reentrant')
    root.get_by_label('threads').focus()
    for _ in range(3):
        page.keyboard.press('ArrowRight')
    assert says.inner_text() == '41 of 41 messages are heard. The oldest waits 0.00 s.'
    assert not page.evaluate(WIDER)
    page.screenshot(path=artefacts / 'free_play.png')


def test_a_circle_is_read_where_it_closes(phone, artefacts):
    with ros_session() as session:
        asker, answerer = Asker(), Answerer()
        recording = CallbackRecording(tick=asker.timer, look=answerer.service, client=asker.client)
        executor = spin(session, asker, answerer, threads=2)
        session.wait_until(asker.timer.is_canceled, LIMIT_S)
        session.wait_until_quiet(executor)
        shown = replay_calls(recording, 2)
    page = phone(shown)
    root = page.get_by_role('group', name='replay')
    root.focus()
    circle = root.get_by_role('list', name='circle').get_by_role('listitem')
    for count in (0, 0, 1):
        page.keyboard.press('ArrowRight')
        assert circle.count() == count
    assert 'asks look and waits' in root.locator('[aria-live=polite]').inner_text()
    page.keyboard.press('End')
    assert circle.all_inner_texts() == [
        'Tick 0 of tick waits for an answer. '
        'The answer is there, but client is in the group of tick and client, which tick 0 of tick '
        'holds.'
    ]
    assert root.locator('.replay-stuck').count() == 2
    assert not page.evaluate(WIDER)
    page.screenshot(path=artefacts / 'deadlock.png')
