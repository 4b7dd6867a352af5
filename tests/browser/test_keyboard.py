"""The first hour without a mouse: every step is a key that a person presses."""

from support.lab_page import HAS_FOCUS, PANEL, LabPage, printed

from helpers.lesson import lessons

START, NEXT = lessons()[:2]
FOCUSED = '() => document.activeElement.innerText'
FOLDED = f'() => {PANEL}.content.activeCell.inputHidden'


def run_to(lab: LabPage, index: int) -> None:
    """Press Shift+Enter until this cell is the active one, and wait for each cell that runs."""
    cells = lab.cells()
    while (active := lab.active()) < index:
        reached = lab.leave_with('Shift+Enter')
        assert cells[reached]['cell_type'] != 'raw', 'It leads to a note, which nobody sees.'
        if cells[active]['cell_type'] == 'code':
            lab.wait_until_ran(active)


def tab_to(lab: LabPage, text: str) -> None:
    """Press Tab until what has this text is chosen, without leaving the active cell."""
    while lab.page.evaluate(FOCUSED) != text:
        lab.page.keyboard.press('Tab')
        assert lab.page.evaluate(HAS_FOCUS), f'Tab does not lead to {text!r}'


def test_a_student_solves_and_goes_on(lab):
    lab.page.goto(lab.server.address)
    lab.wait_for_notebook(f'notebooks/{START.file}')
    lab.command('notebook:clear-all-cell-outputs')
    starter, check, solution = (lab.find(tag=tag) for tag in ('exercise', 'check', 'solution'))
    run_to(lab, starter)
    lab.write('speed = 0.5\nshow(speed)')
    run_to(lab, solution)
    assert 'All done.' in printed(lab.cells()[check])
    assert lab.page.evaluate(FOLDED)
    lab.page.keyboard.press('Enter')
    assert not lab.page.evaluate(FOLDED)
    lab.screenshot('keyboard_solution')
    run_to(lab, solution + 1)
    assert 'goes on with your code' in printed(lab.cells()[solution])
    while NEXT.next_link not in lab.cells()[lab.active()]['source']:
        lab.leave_with('ArrowDown')
    tab_to(lab, f'{NEXT.number} {NEXT.title}')
    lab.page.keyboard.press('Enter')
    lab.wait_for_notebook(f'notebooks/{NEXT.file}')
    run_to(lab, 4)
