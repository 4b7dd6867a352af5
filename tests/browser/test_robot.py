"""The robot, watched and driven in JupyterLab: live pictures, keys, Interrupt, and its replay."""

import nbformat
from nbformat.v4 import new_code_cell, new_notebook
from support.lab_page import complaints

from tools.lessons.clean import NOTEBOOK_METADATA

IMPORTS = """from helpers.robot import ROOMS, Robot
from helpers.robot_view import drive_by_hand, watch
from helpers.ros import ros_session"""
BY_HAND = """with ros_session():
    robot = Robot(ROOMS)
    watch(robot)
    drive_by_hand(robot, 600)
print(robot.record.commands[-1].v)"""
ENDLESS = """with ros_session():
    robot = Robot(ROOMS)
    watch(robot)
    while True:
        robot.drive(0.0, 1.0, 1.0)"""
# A live picture may be replaced while it is looked for: so in one go.
WIDTH = "() => document.querySelector('.replay-floor svg').getBoundingClientRect().width"
# How the robot is drawn: each picture has a place and a heading.
ROBOT = '.robot-live .robot'
PICTURES = """count => new Promise(resolve => {
    const area = document.querySelector('.robot-live').closest('.jp-OutputArea');
    let seen = 0;
    const observer = new MutationObserver(() => {
        if (!area.querySelector('.robot-live svg')?.getBoundingClientRect().height) resolve(-1);
        seen += 1;
        if (seen < count) return;
        observer.disconnect();
        resolve((seen * 1000) / (performance.now() - start));
    });
    const start = performance.now();
    observer.observe(area, { childList: true, subtree: true });
})"""


def place(page):
    return page.locator(ROBOT).get_attribute('transform')


def wait_for_another(page, what, before):
    page.wait_for_function(
        """([what, before]) => {
            const found = document.querySelector(what)?.getAttribute('transform');
            return found && found !== before;
        }""",
        arg=[what, before],
    )


def wait_until_it_drove(page, sign, before):
    """Wait until the robot is further to the right, or with -1 to the left, than it was."""
    page.wait_for_function(
        """([robot, sign, before]) => {
            const x = place => Number(place?.match(/translate\\((\\S+)/)?.[1]);
            const now = document.querySelector(robot)?.getAttribute('transform');
            return sign * (x(now) - x(before)) > 0;
        }""",
        arg=[ROBOT, sign, before],
    )


def wait_until_it_stands(page):
    """Wait until the robot has been in one place for half a second."""
    page.wait_for_function(
        """robot => {
            const [before, now] = [window.placeBefore, document.querySelector(robot)];
            window.placeBefore = now?.getAttribute('transform');
            return now && window.placeBefore === before;
        }""",
        arg=ROBOT,
        polling=500,
    )


def test_watched_driven_and_replayed(lab):
    cells = [new_code_cell(source) for source in (IMPORTS, BY_HAND, ENDLESS)]
    path = lab.server.folder / 'notebooks' / '97_robot.ipynb'
    nbformat.write(new_notebook(cells=cells, metadata=NOTEBOOK_METADATA), path)
    lab.open(path.name)
    lab.run(0)
    page = lab.page

    # By hand, while the cell runs: keys, then the mouse. The robot stops when they are let go.
    lab.start(1)
    page.wait_for_selector('.by-hand-keys:focus')
    for sign, press, release in (
        (1, lambda: page.keyboard.down('ArrowUp'), lambda: page.keyboard.up('ArrowUp')),
        (-1, page.mouse.down, page.mouse.up),
    ):
        page.locator('.hand-back').scroll_into_view_if_needed()
        page.locator('.hand-back').hover()
        before = place(page)
        press()
        # A picture may come late: the rest of the first drive is not the second one.
        wait_until_it_drove(page, sign, before)
        release()
        wait_until_it_stands(page)
    # A click into the picture takes no key away.
    page.locator('.robot-live').click()
    page.wait_for_selector('.by-hand-keys:focus')
    lab.screenshot('robot_by_hand')
    width = page.evaluate(WIDTH)
    stopped = place(page)
    page.locator('.by-hand-keys').focus()
    page.keyboard.press('End')
    lab.wait_until_ran(1)
    assert complaints(lab.cells()[1]) == []
    assert page.locator('.robot-live, .by-hand').count() == 0
    assert page.evaluate("document.activeElement.closest('.jp-Notebook') !== null")

    # The replay stays where the robot stopped, as large as it was. Stepped through with keys.
    shown = page.locator('.replay-on')
    robot = shown.locator('.robot')
    assert abs(page.evaluate(WIDTH) - width) < 1  # pixel
    assert robot.get_attribute('transform') == stopped
    assert shown.get_by_role('button', name='Watch again').is_visible()
    shown.focus()
    says = shown.locator('.replay-says')
    page.keyboard.press('Home')
    start = robot.get_attribute('transform')
    page.keyboard.press('ArrowRight')
    assert 'drive' in says.inner_text()
    page.keyboard.press('ArrowRight')
    assert 'stop' in says.inner_text()
    driven = robot.get_attribute('transform')
    page.keyboard.press('End')
    assert robot.get_attribute('transform') == stopped
    # As far back as it went ahead, the robot stops where it started.
    assert driven not in (start, stopped)
    page.keyboard.press('Home')
    assert robot.get_attribute('transform') == start
    shown.get_by_role('button', name='Play').click()
    wait_for_another(page, '.replay-on .robot', start)
    lab.screenshot('robot_replay')

    # Pictures come, none is empty, and Interrupt ends the run and leaves its replay.
    lab.start(2)
    page.wait_for_selector('.robot-live')
    rate = page.evaluate(PICTURES, 30)
    print(f'{rate:.1f} pictures a second')
    assert rate > 0
    page.keyboard.press('Escape')
    lab.command('notebook:interrupt-kernel')
    lab.wait_until_ran(2)
    outputs = lab.cells()[2]['outputs']
    assert [one['ename'] for one in outputs if 'ename' in one] == ['KeyboardInterrupt']
    assert 'A drive on the floor rooms.' in outputs[0]['data']['text/plain']
    assert page.locator('.robot-live').count() == 0
