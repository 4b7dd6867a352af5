"""The first hour without a mouse: every step is a key that a person presses."""

from lab_page import HAS_FOCUS, PANEL, LabPage, printed

from tools.lessons.lesson import lessons

START, NEXT = lessons()[:2]
FOCUSED = '() => document.activeElement.innerText'
FOLDED = f'() => {PANEL}.content.activeCell.inputHidden'
OPEN = '() => document.activeElement.parentElement.open'


def run_to(lab: LabPage, index: int) -> None:
    """Press Shift+Enter until this cell is the active one, and wait for each cell that runs."""
    cells = lab.cells()
    while (active := lab.active()) < index:
        lab.leave_with('Shift+Enter')
        if cells[active]['cell_type'] == 'code':
            lab.wait_until_ran(active)


def tab_to(lab: LabPage, text: str) -> None:
    """Press Tab until what has this text is chosen, without leaving the active cell."""
    while lab.page.evaluate(FOCUSED) != text:
        lab.page.keyboard.press('Tab')
        assert lab.page.evaluate(HAS_FOCUS), f'Tab does not lead to {text!r}'


def test_a_student_runs_solves_looks_at_a_solution_and_goes_on(lab):
    lab.page.goto(lab.server.address)
    lab.wait_for_notebook(f'notebooks/{START.file}')
    lab.command('notebook:clear-all-cell-outputs')
    starter, check, solution = (lab.find(tag=tag) for tag in ('exercise', 'check', 'solution'))
    run_to(lab, starter)
    lab.write('robots = 2')
    run_to(lab, solution)
    assert 'All done.' in printed(lab.cells()[check])
    assert lab.page.evaluate(FOLDED)
    lab.page.keyboard.press('Enter')
    assert not lab.page.evaluate(FOLDED)
    lab.screenshot('keyboard_solution')
    run_to(lab, solution + 1)
    while NEXT.next_link not in lab.cells()[lab.active()]['source']:
        lab.leave_with('ArrowUp')
    tab_to(lab, f'{NEXT.number} {NEXT.title}')
    lab.page.keyboard.press('Enter')
    lab.wait_for_notebook(f'notebooks/{NEXT.file}')
    run_to(lab, 4)


def test_an_instructor_walks_and_runs(deck):
    deck.present('01_publish_and_subscribe.ipynb')
    deck.command('notebook:clear-all-cell-outputs')
    cells = deck.cells()
    code = next(i for i, cell in enumerate(cells) if cell['cell_type'] == 'code')
    forth = [deck.active()]
    while forth[-1] < code:
        forth.append(deck.press('Space'))
    deck.run_here()
    back = [deck.active()]
    while back[-1] > 0:
        back.append(deck.press('Shift+Space'))
    # From the first slide of a step, back leads to the first slide of the step before.
    assert back == [
        i
        for i in reversed(forth)
        if i == code or cells[i]['metadata']['slideshow']['slide_type'] == 'slide'
    ]


def test_an_instructor_opens_an_answer_and_goes_on(deck):
    deck.present('01_publish_and_subscribe.ipynb')
    question = deck.find('### Question 1')
    deck.walk_to(question)
    tab_to(deck, deck.page.locator('.jp-Cell.jp-mod-active summary').first.inner_text())
    deck.page.keyboard.press('Enter')
    assert deck.page.evaluate(OPEN)
    deck.screenshot('keyboard_answer')
    assert deck.press('Space') > question
