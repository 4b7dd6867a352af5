"""Levels as they are played: by keys alone, on a phone, in JupyterLab."""

from support.lab_page import WIDER

from helpers.replay import level

START = 'Choose what happens next'


def items(root, name):
    return root.get_by_role('list', name=name).get_by_role('listitem').all_inner_texts()


def test_the_first_level_by_keys_alone(phone, artefacts):
    page = phone(level('save'))
    root = page.get_by_role('group', name='level')
    says = root.locator('[aria-live=polite]')
    assert says.inner_text().startswith(START)
    assert 'run the cell' not in root.inner_text()
    page.keyboard.press('Tab')
    page.keyboard.press('Tab')
    assert root.evaluate('root => document.activeElement === root')
    assert root.evaluate('root => getComputedStyle(root).outlineStyle') == 'solid'
    page.keyboard.press('2')
    assert items(root, 'threads') == ['the program: picture 0']
    page.keyboard.press('1')
    page.keyboard.press('2')
    assert says.inner_text() == (
        'No. The program is busy with picture 0: it runs one callback at a time.'
    )
    assert items(root, 'queue') == ['1']
    page.keyboard.press('1')
    # The same by Tab and Enter.
    page.keyboard.press('Tab')
    page.keyboard.press('Enter')
    assert items(root, 'queue') == ['2', '3']
    assert items(root, 'lost') == ['1']
    page.screenshot(path=artefacts / 'level_save.png')
    page.keyboard.press('Escape')
    assert root.evaluate('root => !root.contains(document.activeElement)')


def test_a_deadlock_lights_up(phone, artefacts):
    page = phone(level('save'), level('deadlock'))
    root = page.get_by_role('group', name='level').nth(1)
    threads = root.get_by_label('threads').first
    threads.select_option('2')
    for key in '1111':
        root.focus()
        page.keyboard.press(key)
    says = root.locator('[aria-live=polite]')
    assert 'You: the answer never comes. The best possible: the answer never comes.' in (
        says.inner_text()
    )
    assert root.locator('.replay-stuck').count() == 2
    assert 'MultiThreadedExecutor(num_threads=2)' in root.locator('pre').inner_text()
    page.screenshot(path=artefacts / 'level_deadlock.png', full_page=True)


def test_on_a_phone(phone):
    page = phone(*map(level, ('save', 'starve', 'threads', 'deadlock')))
    assert not page.evaluate(WIDER)
    for button in page.locator('.level button, .level select').all():
        box = button.bounding_box()
        assert box['height'] >= 44
        assert box['width'] >= 44
