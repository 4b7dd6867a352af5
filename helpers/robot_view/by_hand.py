"""Drive the robot by hand, while the cell runs: with the arrow keys, the mouse or a finger.

A press comes as a message of a widget. The kernel reads it in a thread of its own, a subshell
(ipykernel 7, JupyterLab 4.4): so it comes although the cell still runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Protocol

from helpers.notebook import hear_while_a_cell_runs, somebody_watches
from helpers.replay import script, style
from helpers.robot import Robot
from helpers.robot_view.picture import DRIVE_CSS, PLACE_M
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


class Driver(Protocol):
    """A learner's node that sends what a hand wants."""

    def on_key(self, forward: float, turn: float) -> None:
        """Send a speed (m/s) and a turning rate (rad/s)."""


class Tour:
    """The places of a floor, and those to which a robot has come."""

    def __init__(self, places: Mapping[str, tuple[float, float]]) -> None:
        self.places, self.reached = places, []

    @property
    def is_over(self) -> bool:
        return bool(self.places) and len(self.reached) == len(self.places)

    def comes_by(self, x: float, y: float) -> bool:
        """Note the places that are near. Return whether one is new."""
        news = [
            name
            for name, place in self.places.items()
            if name not in self.reached and math.dist(place, (x, y)) < PLACE_M
        ]
        self.reached += news
        return bool(news)

    def sentence(self, seconds: float | None = None, bumps: int = 0) -> str:
        """Return what is done, and at the end how long it took."""
        done, left = sorted(self.reached), sorted(set(self.places) - {*self.reached})
        if seconds is None:
            return f'{listed(done)} done, {listed(left) or "nothing"} to go.'
        bumped = ['without a bump', 'with one bump'][bumps] if bumps < 2 else f'with {bumps} bumps'
        if not left:
            return f'{listed(done)} in {seconds:.1f} s, {bumped}. Run the cell again to be faster.'
        return f'You came to {listed(done)}, {bumped}.' if done else ''


def listed(names: list[str]) -> str:
    return ' and '.join(filter(None, [', '.join(names[:-1]), *names[-1:]]))


def drive_by_hand(robot: Robot, seconds: float = 60.0, driver: Driver | None = None) -> None:
    """Let a person drive the robot for some seconds, or until End. Call `watch(robot)` before.

    While a button or key is held, `driver.on_key(forward, turn)` is called ten times a second (m/s,
    rad/s), and once with zeros when it is let go. Without a driver the commands go to `cmd_vel`.
    If the floor has places, the drive is over when the robot has come to all of them, and the time
    is said. Where nobody watches, as under nbval, it returns at once.

    Raises TypeError for anything but a robot, and for a driver without `on_key`.
    """
    if not isinstance(robot, Robot):
        raise TypeError(f'Only a robot can be driven by hand, not {robot!r}.')
    if driver is not None and not callable(getattr(driver, 'on_key', None)):
        raise TypeError(f'A driver has a method on_key(forward, turn), and {driver!r} has none.')
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
    send = driver.on_key if driver else robot.command
    sent, sent_s = wanted, -EVERY_S
    begun_s = robot.t_s
    tour = Tour(robot.floor.places)
    said = display(HTML('<p>&nbsp;</p>'), display_id=True) if tour.places else None

    def go_on() -> bool:
        nonlocal sent, sent_s
        if wanted != sent or any(wanted) and robot.t_s - sent_s >= EVERY_S:
            send(*wanted)
            sent, sent_s = wanted, robot.t_s
        if said and tour.comes_by(robot.pose.x, robot.pose.y):
            said.update(HTML(f'<p aria-live="polite">{escape(tour.sentence())}</p>'))
        return over or tour.is_over or robot.t_s >= begun_s + seconds

    try:
        current_session().wait_until(go_on, 10 * seconds + 60)
    finally:
        for output in (shown, keys):
            output.update({'text/html': ''}, raw=True)
        box.close()
        if said:
            text = escape(tour.sentence(robot.t_s - begun_s, robot.bumps))
            said.update(HTML(f'<p>{text}</p>'))
