"""A class of three pages of JupyterLab, the instructor's page, and the slides with the guesses."""

import re

import nbformat
from support.lab_server import ROOT, made, server
from support.processes import running
from support.students import student

from classroom.tests.support.deck_page import DeckPage
from helpers.lesson import path_of

LESSON = path_of('lose_messages').name
NAMES = {'ada': 41, 'bob': 14, 'cyd': 14}
CELLS = nbformat.read(ROOT / 'notebooks' / LESSON, as_version=4).cells
[GUESS] = [cell for cell in CELLS if 'my_guess = guess(' in cell.source]
[COMPARED] = [cell for cell in CELLS if 'my_guess, ' in cell.source]
QUESTION = re.search(r"guess\('(.*)', ", GUESS.source)[1]
# The line for the wall, and the address of the page.
STARTED = r"(join_class\('.*', '.*'\))[\s\S]*?(http://localhost:\d+/\w+/)[\s\S]*Ctrl\+C"
# A task that everybody solves.
TASK = """
from helpers.checks.tasks import Tasks

tasks = Tasks()
tasks.add(lambda: [('it is so', lambda: True, '')], name='publish_numbers')
tasks.check('publish_numbers')
raise_hand()
"""


def write_lesson_of(folder, name, join):
    """Write a lesson whose first cell makes its kernel a student of its own, who joins."""
    notebook = nbformat.read(ROOT / 'notebooks' / LESSON, as_version=4)
    cells = [cell for cell in notebook.cells if cell.id == GUESS.id]
    own = f'{folder / name / "progress.txt"}'
    cells[0].source = f'my_guess = guess({QUESTION!r}, {NAMES[name]})'
    sources = [
        f"import os\nos.environ['ROS2_NOTEBOOKS_PROGRESS'] = {own!r}\n"
        f'from helpers.checks import *\n{join}',
        f'compare_prediction({QUESTION!r}, my_guess, 14)',
        TASK,
    ]
    made = [nbformat.v4.new_code_cell(source) for source in sources]
    notebook.cells = [made[0], *cells, *made[1:]]
    (folder / name).mkdir()
    nbformat.write(notebook, folder / name / LESSON)


def test_from_join_to_the_end(lab_page, tabs, student_server, artefacts):
    folder = student_server.folder
    with made(folder, STARTED, 'class') as (process, started):
        join, address = started.groups()
        page = tabs.new_page()
        asked = []
        page.on('request', lambda request: asked.append(request.url))
        page.goto(address)
        page.on('dialog', lambda dialog: dialog.accept())
        for number, name in enumerate(NAMES, 1):
            write_lesson_of(folder, name, join)
            with lab_page(student_server, f'class_{name}') as lab:
                lab.goto(f'lab/tree/{name}/{LESSON}')
                lab.wait_for_notebook(f'{name}/{LESSON}')
                said = ' '.join(lab.run(0).split())
                assert f'on seat {number}. Sent to it: your guesses' in said
                assert lab.run(1).startswith('Your guess is saved')
                page.get_by_text(f'{number} of {number} have answered').wait_for()
                if name != 'cyd':
                    assert 'Verdict' in lab.run(2)
                if name == 'ada':
                    assert lab.run(3).endswith('Your hand is up. lower_hand() takes it down.\n')
                    page.locator('#hands').get_by_text('Seat 1').wait_for()
        assert page.locator('#seats').inner_text() == '3'
        assert page.locator('[aria-current] b').inner_text() == '3'
        assert page.locator('#tasks td').first.inner_text() == '1'
        assert page.locator('.bars').count() == 0
        page.get_by_role('button', name='Show').first.click()
        page.locator('.bars').wait_for()
        rows = [row.split() for row in page.locator('.bars li').all_inner_texts()]
        assert rows == [['✓', '14', '2'], ['41', '1', '×']]
        page.screenshot(path=artefacts / 'class_page.png')
        page.get_by_text('For the wall').click()
        page.locator('.wall').wait_for()
        assert not page.locator('#notes').is_visible()
        assert not page.locator('.bars').is_visible()
        assert join in page.locator('#joins').inner_text()
        page.screenshot(path=artefacts / 'class_wall.png')
        page.go_back()
        page.get_by_role('button', name='Done').click()
        page.locator('#hands').get_by_text('Seat 1').wait_for(state='detached')
        page.get_by_role('button', name='End the class').click()
        page.get_by_text('The class is over.').wait_for()
        assert process.wait(60) == 0
        assert [url for url in asked if not url.startswith((address, 'data:'))] == []
        page.close()


def test_a_class_sees_the_last_slide_though_an_earlier_one_is_told_late(lab_page, tabs, tmp_path):
    with (
        server(tmp_path, 'present', 'LESSON=lose_messages') as presenter,
        made(tmp_path, STARTED, 'class') as (_, started),
        lab_page(presenter, 'class_last_slide', DeckPage) as deck,
    ):
        held = []
        deck.page.route('**/slide', lambda route: held.append(route), times=1)
        with deck.page.expect_request('**/slide'):
            deck.present(LESSON)
        deck.walk_to(GUESS.id)
        held[0].continue_()
        assert held[0].request.response().ok
        page = tabs.new_page()
        page.goto(started[2])
        page.locator('#guesses').get_by_text('0 of 0 have answered').wait_for()
        page.close()


def test_a_slide_shows_the_guesses_of_the_class(lab_page, tmp_path):
    with (
        server(tmp_path, 'present', 'LESSON=lose_messages') as presenter,
        made(tmp_path, STARTED, 'class') as (_, started),
    ):
        tell = f"""
import sys
from helpers.checks import *
from helpers.lesson import path_of
{started[1]}
guess({QUESTION!r}, 14)
print('guessed', flush=True)
sys.stdin.read()
"""
        with (
            running(tell, **student(tmp_path / 'ada', LESSON)) as ada,
            lab_page(presenter, 'class_deck', DeckPage) as deck,
        ):
            deck.present(LESSON)
            deck.walk_to(GUESS.id)
            assert 'guessed\n' in iter(ada.stdout.readline, '')
            frame = deck.page.frame_locator('#deck-guesses')
            frame.get_by_text('1 of 1 have answered').wait_for()
            deck.screenshot('class_deck_hidden')
            deck.page.keyboard.press('s')
            frame.locator('.bars').wait_for()
            deck.page.keyboard.press('s')
            frame.locator('.bars').wait_for(state='detached')
            frame.get_by_role('button', name='Show').click()
            frame.locator('.bars').wait_for()
            deck.page.wait_for_function(
                "() => document.activeElement.id !== 'deck-guesses'"
                " && document.querySelector('#deck-guesses').clientHeight > 80"
            )
            deck.screenshot('class_deck_shown')
            # Its picture draws the class, so bars are left out.
            deck.write(f'from helpers.checks import guess\n{GUESS.source}')
            deck.run_here()
            deck.page.keyboard.press('Escape')
            deck.page.locator('.deck-on .guess .class circle').wait_for()
            frame.locator('.bars').wait_for(state='hidden')
            deck.screenshot('class_deck_drawn')
            deck.page.keyboard.press('j')
            deck.page.frame_locator('#deck-joins').get_by_text(started[1]).wait_for()
            deck.screenshot('class_deck_joins')
            deck.page.keyboard.press('Space')
            assert deck.page.locator('#deck-joins').count() == 0
            deck.press('Home')
            assert deck.page.locator('#deck-guesses').count() == 0
            deck.walk_to(COMPARED.id)
            frame.locator('.bars').wait_for()
            deck.screenshot('class_deck_compared')
