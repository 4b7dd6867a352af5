"""Guesses that one makes in a picture: by keys, with a finger, in JupyterLab and without it."""

import re

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook
from support.lab_page import WIDER, printed

from helpers.guesses import Gap, Guess, Level, Options, kind_of
from helpers.robot import CORRIDOR, ROOMS, DriveRecord
from helpers.robot.record import Step
from helpers.robot_view import Place, Point, replay_drive
from tools.lessons.clean import EXPLAINS, NOTEBOOK_METADATA

PLACE = Guess('Where does it end?', Place(CORRIDOR, 0.6))
POINT = Guess('Where is it?', Point(ROOMS, {'GPS': (3.0, 0.0)}))
LEVEL = Guess('How many are received?', Level(0, 41, 'messages'))
OPTIONS = Guess('Which three wait?', Options({str(n): n for n in range(5)}, 3))
ONE = Guess('Does it stop?', Options({'yes': True, 'no': False}))
ANY = Guess('Which are lost?', Options({name: name for name in 'ABC'}, True))
ROWS = Guess('How many are lost?', kind_of({'depth 1': range(4), 'depth 2': range(4)}))
FEW = Guess('How many threads?', kind_of(range(1, 5), unit='threads'))
CELLS = {'one thread': {'exclusive': 'A', 'reentrant': 'B'}, 'two': {'exclusive': 'C'}}
TICKS = Guess('Which lose none?', kind_of(CELLS))
# What the deck tells the pictures of a slide: what the class has guessed.
TELL = "told => document.dispatchEvent(new CustomEvent('class', { detail: told }))"


def group(page, guess):
    return page.get_by_role('group', name=guess.question)


def says(page, guess):
    return group(page, guess).locator('.guess-says').inner_text()


def test_all_kinds_by_keys_alone_on_a_phone(phone, artefacts):
    page = phone(PLACE, LEVEL, OPTIONS, ONE)
    assert says(page, PLACE) == PLACE.kind.asks
    robot = group(page, PLACE).get_by_role('slider')
    assert robot.get_attribute('aria-valuetext') == 'not yet'
    page.keyboard.press('Tab')
    page.keyboard.press('Tab')
    assert robot.evaluate('robot => robot === document.activeElement')
    page.keyboard.press('End')
    assert says(page, PLACE) == 'You say: it hits the wall.'
    for _ in range(10):
        page.keyboard.press('ArrowLeft')
    assert says(page, PLACE) == 'You say: it stops 0.61 m before the wall.'
    assert robot.get_attribute('aria-valuetext') == 'it stops 0.61 m before the wall.'
    page.keyboard.press('Tab')
    page.keyboard.press('Home')
    page.keyboard.press('ArrowUp')
    assert says(page, LEVEL) == 'You say: 1 message.'
    page.keyboard.press('Tab')
    for _ in range(4):
        page.keyboard.press('Space')
        page.keyboard.press('ArrowRight')
    assert says(page, OPTIONS) == 'You say: 1, 2, 3.'  # the fourth takes the place of the first
    group(page, ONE).get_by_role('radio', name='no').click()
    assert says(page, ONE) == 'You say: no.'
    assert not page.evaluate(WIDER)
    page.screenshot(path=artefacts / 'guess_phone.png', full_page=True)
    # The browser keeps them: no kernel is there.
    page.wait_for_function("() => localStorage.getItem('guess: Does it stop?') === '1'")
    page.reload()
    assert says(page, PLACE) == 'You say: it stops 0.61 m before the wall.'
    assert says(page, ONE) == 'You say: no.'


def test_a_row_for_each_thing_and_none_of_the_options(phone, artefacts):
    page = phone(ROWS, ANY)
    first, second = (group(page, ROWS).get_by_role('radiogroup', name=f'depth {n}') for n in (1, 2))
    first.get_by_role('radio', name='3').click()
    assert says(page, ROWS) == ROWS.kind.asks  # there is another row
    second.get_by_role('radio', name='0').press('ArrowRight')
    assert says(page, ROWS) == 'You say: depth 1: 3, depth 2: 1.'
    group(page, ANY).get_by_role('checkbox', name='none of them').click()
    assert says(page, ANY) == 'You say: none.'
    group(page, ANY).get_by_role('checkbox', name='B', exact=True).click()
    assert says(page, ANY) == 'You say: B.'
    # On a slide each option says how many of the class have chosen it.
    told = [
        {'question': ROWS.question, 'values': [['depth 1: 3', 'depth 2: 0']] * 2},
        {'question': ANY.question, 'values': [['A', 'B'], ['B'], []]},
    ]
    page.evaluate(TELL, told)
    shown = page.locator('[data-class]').evaluate_all(
        'nodes => nodes.map(one => `${one.ariaLabel ?? one.textContent} ${one.dataset.class}`)'
    )
    assert shown == ['3 2', '0 2', 'A 1', 'B 2', 'none of them 1']
    assert not page.evaluate(WIDER)
    page.screenshot(path=artefacts / 'guess_rows.png', full_page=True)


def test_cells_of_the_coming_table_are_ticked(phone, artefacts):
    page = phone(TICKS, FEW)
    heads = group(page, TICKS).locator('th').all_inner_texts()
    assert heads == ['exclusive', 'reentrant', 'one thread', 'two']
    for name in 'BC':
        group(page, TICKS).get_by_role('checkbox', name=name, exact=True).click()
    assert says(page, TICKS) == 'You say: B, C.'
    group(page, FEW).get_by_role('radio', name='3').click()
    assert says(page, FEW) == 'You say: 3 threads.'
    assert not page.evaluate(WIDER)
    came = {'A': 'some', 'B': 'none', 'C': 'some'}
    table = TICKS.kind.came(
        {row: {n: came[v] for n, v in one.items()} | {'runs': '7'} for row, one in CELLS.items()}
    )
    page = phone(Gap(Guess(TICKS.question, TICKS.kind, [1, 2]), {'at': [1], 'table': table}))
    assert says(page, TICKS) == 'It is B: you said B, C.'
    cells = [' '.join(cell.split()) for cell in group(page, TICKS).locator('td').all_inner_texts()]
    assert cells == ['', 'A some', 'B none', '7', 'C some', '', '7']
    page.screenshot(path=artefacts / 'guess_ticks.png', full_page=True)


def lights(page, selector):
    """Return whether each dot of the class lights up."""
    return page.locator(selector).evaluate_all(
        "dots => dots.map(dot => Boolean(dot.closest('.right, .guess-true')))"
    )


@pytest.mark.parametrize(
    ('guess', 'outcome', 'values', 'right'),
    [
        (LEVEL, {'at': 14, 'tolerance': 0}, [14] * 12 + [41] * 18, 12),
        (FEW, {'at': 2, 'tolerance': 0}, [2] * 11 + [4] * 19, 11),
        (ONE, {'at': 0}, ['yes'] * 10 + ['no'] * 20, 10),
        (OPTIONS, {'at': [0, 1, 2]}, [['0', '1', '2']] * 9 + [['2', '3', '4']] * 21, 3 * 9 + 21),
        (ROWS, {'at': [3, 0]}, [['depth 1: 3', 'depth 2: 1']] * 30, 30),
        (
            POINT,
            {'at': [2, 1], 'path': [[2, 1]], 'tolerance': 0.3},
            [[2, 1]] * 7 + [[2, 0]] * 23,
            7,
        ),
        (TICKS, {'at': [1]}, [['B']] * 8 + [['A', 'C']] * 22, 8),
    ],
    ids=['level', 'few', 'choose', 'pick', 'rows', 'point', 'tick'],
)
def test_thirty_ghosts_of_which_those_who_were_right_light_up(phone, guess, outcome, values, right):
    page = phone(Guess(guess.question, guess.kind))
    page.evaluate(TELL, [{'question': guess.question, 'values': values}])
    dots = '.class circle, .guess-class i'
    each = lights(page, dots)
    # A dot for each student, wherever one has put something.
    many = guess is not POINT
    assert len(each) == sum(len(one) if many and isinstance(one, list) else 1 for one in values)
    assert not any(each)  # nothing tells before the run
    page = phone(Gap(Guess(guess.question, guess.kind), outcome))
    page.evaluate(TELL, [{'question': guess.question, 'values': values}])
    assert sum(lights(page, dots)) == right
    assert not page.evaluate(WIDER)


def test_thirty_robots_light_up_if_the_real_one_stands_where_they_are(phone):
    # It ends 0.5 m before the wall.
    poses = [Step(0.0, 1.25, 1.25, 0.0, 0.5, 0.0), Step(6.0, 4.0, 1.25, 0.0, 0.0, 0.0)]
    page = phone(replay_drive(DriveRecord(CORRIDOR, poses=poses), guess=PLACE))
    values = [0.5] * 7 + [0.9] * 23
    page.evaluate(TELL, [{'question': PLACE.question, 'values': values}])
    robots = page.locator('.class circle')
    looks = "robots => robots.map(one => one.getAttribute('fill'))"
    assert robots.count() == 30
    assert robots.evaluate_all(looks).count('var(--look-robot)') == 7
    page.locator('.replay').focus()
    page.keyboard.press('Home')
    assert robots.evaluate_all(looks) == ['var(--look-you)'] * 30


def test_a_point_on_a_floor_by_keys(phone, artefacts):
    page = phone(POINT)
    assert says(page, POINT) == POINT.kind.asks
    point = group(page, POINT).get_by_role('slider')
    assert point.get_attribute('aria-valuetext') == 'not yet'
    assert group(page, POINT).get_by_text('GPS', exact=True).is_visible()
    point.focus()
    page.keyboard.press('Home')
    assert says(page, POINT) == 'You say: it is where the robot starts.'
    for key in ['ArrowRight'] * 4 + ['ArrowDown'] * 2 + ['ArrowUp'] * 3:
        page.keyboard.press(key)
    said = 'it is 0.20 m ahead of the start, 0.05 m to its left.'
    assert says(page, POINT) == f'You say: {said}'
    assert point.get_attribute('aria-valuetext') == said
    for _ in range(40):
        page.keyboard.press('ArrowLeft')  # not beyond the wall
    assert says(page, POINT) == 'You say: it is 0.90 m behind the start, 0.05 m to its left.'
    page.wait_for_function("() => localStorage.getItem('guess: Where is it?') === '[-0.9,0.05]'")
    assert not page.evaluate(WIDER)
    page.screenshot(path=artefacts / 'guess_point.png', full_page=True)
    # The answer, saved without a guess, is drawn through that of the browser.
    out = {'at': [2.17, -1.25], 'path': [[0, 0], [2.17, -1.25]], 'tolerance': 0.3}
    page = phone(Gap(POINT, out))
    page.evaluate("() => localStorage.setItem('guess: Where is it?', '[2.0, 0.0]')")
    page.reload()
    answer = 'It is 2.17 m ahead of the start, 1.25 m to its right'
    assert says(page, POINT) == f'{answer}: 1.26 m from your point.'
    assert group(page, POINT).locator('.gap').get_attribute('d')
    assert group(page, POINT).locator('.came-path').get_attribute('d') == 'M1.250 1.750L3.420 0.500'
    group(page, POINT).locator('svg').click()  # it is over
    assert says(page, POINT) == f'{answer}: 1.26 m from your point.'
    assert not page.evaluate(WIDER)
    page.screenshot(path=artefacts / 'guess_point_gap.png', full_page=True)
    page.evaluate('() => localStorage.clear()')
    page.reload()
    assert says(page, POINT) == f'{answer}.'
    assert not group(page, POINT).locator('.you').is_visible()


def test_guess_and_drive_beside_each_other_are_no_wider_than_a_phone(phone):
    poses = [Step(0.0, 1.25, 1.25, 0.0, 0.5, 0.0), Step(6.0, 4.0, 1.25, 0.0, 0.0, 0.0)]
    page = phone(PLACE, replay_drive(DriveRecord(CORRIDOR, poses=poses), guess=PLACE))
    assert not page.evaluate(WIDER)


def test_a_finger_puts_the_robot_there(file_page, tmp_path):
    with file_page(390, 844, has_touch=True, color_scheme='dark') as page:
        file = tmp_path / 'page.html'
        file.write_text(PLACE._repr_mimebundle_()['text/html'], encoding='utf-8')
        page.goto(file.as_uri())
        box = group(page, PLACE).locator('svg').bounding_box()
        page.touchscreen.tap(box['x'] + 0.9 * box['width'], box['y'] + box['height'] / 2)
        metres = float(says(page, PLACE).split()[4])
        assert 0.11 < metres < 0.6


def test_what_came_out_is_drawn_beside_it(phone, artefacts):
    level = Guess(LEVEL.question, LEVEL.kind, 41)
    three = Guess(OPTIONS.question, OPTIONS.kind, [0, 1, 2])
    page = phone(Gap(level, {'at': 14, 'tolerance': 0}), Gap(three, {'at': [2, 3, 4]}))
    assert says(page, LEVEL) == 'It is 14 messages: you said 27 too many.'
    assert says(page, OPTIONS) == 'It is 2, 3, 4: you said 0, 1, 2.'
    # It is over: nothing is moved any more.
    group(page, LEVEL).locator('svg').click()
    assert says(page, LEVEL) == 'It is 14 messages: you said 27 too many.'
    assert group(page, OPTIONS).get_by_role('checkbox', name='2').is_disabled()
    page.screenshot(path=artefacts / 'guess_gap.png', full_page=True)


ASK = """from helpers.checks import compare_prediction, guess
from helpers.robot import CORRIDOR, Robot
from helpers.robot_view import watch
from helpers.ros import ros_session
my_end = guess('Where does it end?', ..., on=CORRIDOR, line_m=0.6)"""
DRIVE = """with ros_session():
    robot = Robot(CORRIDOR)
    watch(robot, guess=my_end)
    robot.drive(1.0, 0.0, 5.0)
compare_prediction('Where does it end?', my_end, robot)"""


def test_the_drive_goes_through_it_in_jupyterlab(lab):
    cells = [new_markdown_cell('# 96 Guess'), new_code_cell(ASK), new_code_cell(DRIVE)]
    cells.append(new_markdown_cell(f'{EXPLAINS}Nobody told it to stop.'))
    path = lab.server.folder / 'notebooks' / '96_guess.ipynb'
    nbformat.write(new_notebook(cells=cells, metadata=NOTEBOOK_METADATA), path)
    lab.open(path.name)
    page = lab.page
    lab.run(1)
    why = page.get_by_text('Nobody told it to stop.', exact=True)
    assert not why.is_visible()
    lab.screenshot('guess_why')
    assert 'No guess yet. Put your robot' in lab.run(2)
    before = [(c['cell_type'], c['source']) for c in lab.cells()]
    lab.show(1)
    robot = page.locator('.guess .you')
    robot.focus()
    page.keyboard.press('End')
    for key in ['ArrowLeft'] * 10 + ['d', 'd', 'b', 'x']:  # no command of JupyterLab
        page.keyboard.press(key)
    assert page.locator('.guess-says').inner_text() == 'You say: it stops 0.61 m before the wall.'
    assert [(c['cell_type'], c['source']) for c in lab.cells()] == before
    page.wait_for_function("""() => document.querySelector('.guess-line input').value === '0.61'""")
    lab.start(2)
    page.wait_for_selector('.robot-live')
    assert not why.is_visible()
    lab.wait_until_ran(2)
    assert why.is_visible()
    said = printed(lab.cells()[2])
    assert 'You say: it stops 0.61 m before the wall.' in said
    assert 'It is in the wall, 0.50 m further than you said.' in said
    shown = page.locator('.replay:not(.guess)')
    assert shown.locator('.you').is_visible()
    assert shown.locator('.gap').get_attribute('d')
    assert shown.locator('.replay-says').inner_text().startswith('It is in the wall, 0.50 m')
    lab.screenshot('guess_drive')
    # At its start nothing is measured yet.
    shown.focus()
    page.keyboard.press('Home')
    assert not shown.locator('.gap').get_attribute('d')


POINT_ASK = """from helpers.checks import compare_prediction, guess
from helpers.robot import ROOMS
my_point = guess('Where does the beam end?', ..., on=ROOMS, point=True)"""
POINT_CAME = "compare_prediction('Where does the beam end?', my_point, [(0, 0), (2.2, -1.2)])"


def test_a_point_is_put_and_answered_in_jupyterlab(lab):
    cells = [new_markdown_cell('# 96 Guess'), new_code_cell(POINT_ASK), new_code_cell(POINT_CAME)]
    path = lab.server.folder / 'notebooks' / '96_guess.ipynb'
    nbformat.write(new_notebook(cells=cells, metadata=NOTEBOOK_METADATA), path)
    lab.open(path.name)
    page = lab.page
    lab.run(1)
    lab.show(1)
    floor = page.locator('.guess svg').bounding_box()
    page.mouse.click(floor['x'] + 0.5 * floor['width'], floor['y'] + 0.5 * floor['height'])
    page.keyboard.press('ArrowRight')
    said = page.locator('.guess-says').inner_text()
    assert re.fullmatch(r'You say: it is \d\.\d\d m ahead of the start, .* left\.', said)
    page.wait_for_function("""() => document.querySelector('.guess-line input').value !== ''""")
    lab.screenshot('guess_point_lab')
    assert said in lab.run(2)
    assert 'It is 2.20 m ahead of the start, 1.20 m to its right' in printed(lab.cells()[2])
    lab.show(2)
    assert page.locator('.guess .came-path').last.get_attribute('d')
    lab.screenshot('guess_point_lab_came')
