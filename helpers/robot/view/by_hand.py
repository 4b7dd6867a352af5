"""Drive the robot by hand, while the cell runs: with the arrow keys, the mouse or a finger.

A press comes as a message of a widget. The kernel reads it in a thread of its own, a subshell
(ipykernel 7, JupyterLab 4.4): so it comes although the cell still runs.
"""

from __future__ import annotations

from html import escape
from pathlib import Path

from helpers.notebook import hear_while_a_cell_runs, somebody_watches
from helpers.replay import script, style
from helpers.robot.robot import Robot
from helpers.robot.view.picture import DRIVE_CSS
from helpers.ros import current_session

BY_HAND_JS = Path(__file__).with_name('by_hand.js')
SPEED, TURN = 0.5, 1.2  # m/s, rad/s
EVERY_S = 0.1  # a command: the robot stops 0.5 s after the last one
BUTTONS = {'▲': 'forward', '▼': 'back', '◀': 'left', '▶': 'right', '■': 'stop', 'End': 'end'}
SPEEDS = {
    'forward': (SPEED, 0.0),
    'back': (-SPEED, 0.0),
    'left': (0.0, TURN),
    'right': (0.0, -TURN),
}
HELP = 'Hold a button, or click here and hold an arrow key. End ends the drive, as Interrupt does.'


def drive_by_hand(robot: Robot, seconds: float = 60.0) -> None:
    """Let a person drive the robot for some seconds, or until End. Call `watch(robot)` before.

    While a button or key is held, ten commands a second go to `cmd_vel`. Where nobody watches, as
    under nbval, it returns at once.

    Raises TypeError for anything but a robot.
    """
    if not isinstance(robot, Robot):
        raise TypeError(f'Only a robot can be driven by hand, not {robot!r}.')
    if not somebody_watches():
        return
    from IPython.display import HTML, display
    from ipywidgets import Button, HBox, Layout

    wanted, over = (0.0, 0.0), False

    def press(button: Button) -> None:
        nonlocal wanted, over
        over = over or button.tooltip == 'end'
        wanted = SPEEDS.get(button.tooltip, (0.0, 0.0))

    pad = []
    for face, name in BUTTONS.items():
        button = Button(description=face, tooltip=name, layout=Layout(width='56px', height='44px'))
        button.add_class(f'hand-{name}')  # which is sent, too
        button.on_click(press)
        hear_while_a_cell_runs(button)
        pad.append(button)
    box = HBox(pad)
    box.add_class('by-hand')
    shown = display(box, display_id=True)
    keys = display(
        HTML(
            f'{style(DRIVE_CSS)}<p class="by-hand-keys" tabindex="0">'
            f'{escape(HELP)}</p><script>{script(BY_HAND_JS)}</script>'
        ),
        display_id=True,
    )
    sent, sent_s = wanted, -EVERY_S
    end_s = robot.t_s + seconds

    def go_on() -> bool:
        nonlocal sent, sent_s
        if wanted != sent or any(wanted) and robot.t_s - sent_s >= EVERY_S:
            robot.command(*wanted)
            sent, sent_s = wanted, robot.t_s
        return over or robot.t_s >= end_s

    try:
        current_session().wait_until(go_on, 10 * seconds + 60)
    finally:
        for output in (shown, keys):
            output.update({'text/html': ''}, raw=True)
        box.close()
