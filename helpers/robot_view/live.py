"""A robot while it drives: a picture in the cell's output, which is told of the drive.

The picture is that of the replay (drive.js). live.js lets it follow: twelve times a second a second
output of the cell, which is not seen, is drawn again, and its script tells the page what is new.
"""

from __future__ import annotations

import json
import threading
from html import escape
from itertools import count
from pathlib import Path

from rclpy.subscription import Subscription

from helpers.guesses import CSS, MEMORY, Guess
from helpers.notebook import somebody_watches
from helpers.replay import Replay, attribute, picture_of, script, style
from helpers.robot import RATE_HZ, Pose, Robot
from helpers.robot_view.picture import DRIVE_CSS, LANE_M, floor_in_words, floor_picture, is_lane
from helpers.robot_view.replay import bumps, outcome, rays, replay_drive
from helpers.robot_view.scans import ScanRecording
from helpers.ros import current_session

HERE = Path(__file__).parent
PERIOD_S = 1 / 12
EVERY = 5  # steps of the robot: a point of its path
AGAIN = 20  # rows of each kind that are told again: a telling may be lost
OLD_S = 0.5  # a scan that is older is worth a sentence
NEWS_S = 3.0  # so long an event is shown
NUMBERS = count()  # of the pictures of a kernel


def watch(
    robot: Robot,
    subscription: Subscription | None = None,
    name: str = '',
    guess: Guess | None = None,
) -> ScanRecording | None:
    """Show a robot while this cell runs, and its replay when the session closes.

    The replay is also there after an Interrupt, and alone where nobody watches, as under nbval.

    With a subscription to the robot's scans one sees, too, which scan its callback works on, how
    old it is, and which ones wait. `name` is what the replay calls the drive. A `guess` of a place
    is drawn, and the replay measures its gap. Returns the recording.

    Raises TypeError for anything but a robot and a subscription, ValueError for one that does not
    hear the scans, RuntimeError where no session is open.
    """
    if not isinstance(robot, Robot):
        raise TypeError(f'Only a robot can be watched, not {robot!r}.')
    session = current_session()
    recording = ScanRecording(robot, subscription) if subscription is not None else None
    view = LiveView(robot, recording, guess)

    def end() -> None:
        # A person who has watched sees the robot stay where it stopped.
        opens = 'end' if view.is_shown else 'bump'
        try:
            shown = replay_drive(robot.record, recording, name, opens, guess)
        except ValueError:  # interrupted where it does not add up, or heard by several threads
            shown = replay_drive(robot.record, name=name, opens=opens, guess=guess)
        if guess is not None:
            guess.run = shown.runs[0]
        view.stop(shown)

    view.start()
    session.at_close(end)
    return recording


class LiveView:
    """The picture of a drive, from `start` to `stop`, told by a thread of its own.

    To update a display, unlike to make one, needs no cell: it moves, whatever the cell waits for.
    """

    def __init__(
        self, robot: Robot, recording: ScanRecording | None, guess: Guess | None = None
    ) -> None:
        self._record, self._recording, self._guess = robot.record, recording, guess
        self._id = next(NUMBERS)
        self._display = self._feed = None
        self._as_lane = self._is_lane()
        self._told: dict[str, int] = {}  # how many rows of each kind
        self._took: int | None = None  # the scan of the last callback
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name='robot view', daemon=True)

    @property
    def is_shown(self) -> bool:
        return self._display is not None

    def start(self) -> None:
        """Show the first picture, in the output of the cell that runs, where somebody watches."""
        if somebody_watches():
            from IPython.display import display

            self._display = display({'text/html': self.html()}, raw=True, display_id=True)
            self._feed = display({'text/html': self.telling()}, raw=True, display_id=True)
            self._thread.start()

    def _run(self) -> None:
        while not self._over.wait(PERIOD_S):
            if self._as_lane and not self._is_lane():  # it has turned away: the strip is too narrow
                self._as_lane = False
                self._display.update({'text/html': self.html()}, raw=True)
            self._feed.update({'text/html': self.telling()}, raw=True)

    def stop(self, shown: Replay) -> None:
        """End the pictures, and show this in their place."""
        from IPython.display import display

        if not self.is_shown:
            display(shown)
            return
        self._over.set()
        self._thread.join()
        self._feed.update({'text/html': ''}, raw=True)
        self._display.update(shown)

    def html(self) -> str:
        """Return the picture and its script, with all that is known until now."""
        floor, start = self._record.floor, self._record.floor.start
        svg = floor_picture(floor, [start[:2]], Pose(*start), as_lane=self._as_lane)
        self._told.clear()
        record = {
            'id': self._id,
            'step': EVERY / RATE_HZ,
            **{kind: told['added'] for kind, told in self._rows().items()},
            'events': [],
            **({'strip': LANE_M} if self._as_lane else {}),
            **({'depth': self._recording.depth} if self._recording else {}),
            **({'guess': self._guess.record()} if self._guess else {}),
        }
        guessed = (*self._guess.kind.scripts, MEMORY) if self._guess else ()
        return (
            f'<div class="replay robot-live" data-live={attribute(record)}>'
            f'{style(DRIVE_CSS, CSS)}{picture_of(svg, floor_in_words(floor))}'
            f'<p>A drive on the floor {escape(floor.name)}.</p>'
            f'<script>{script(*guessed, HERE / "live.js")}</script></div>'
        )

    def telling(self) -> str:
        """Return a script that tells the picture what is new."""
        detail = json.dumps({'id': self._id, **self.news()}).replace('</', '<\\/')
        return (
            '<i class="robot-feed"></i><script>'
            f"document.dispatchEvent(new CustomEvent('drive', {{ detail: {detail} }}));</script>"
        )

    def news(self) -> dict:
        """Return the time (ms), the new rows, what is said, and which scans run, wait, are lost."""
        record = self._record
        now_s = record.poses[-1].t_s if record.poses else 0.0
        told = {'ms': round(1000 * now_s), 'rows': self._rows()}
        works = ''
        if self._recording is not None:
            recording = self._recording
            runs, waits = recording.now(recording.depth)
            self._took = min(runs, default=self._took)
            taken = None if self._took is None else record.scans[self._took]
            if taken and now_s - taken.t_s > OLD_S:
                works = f'The brake works on scan {self._took}, and {len(waits)} newer ones wait.'
            lost = max(recording.published - recording.heard - len(waits), 0)
            told |= {'busy': [*runs] or [None], 'waits': waits, 'lost': lost, 'took': self._took}
        news = [event.text for event in record.events[-1:] if now_s - event.t_s < NEWS_S]
        says = outcome(record) if bumps(record) else news[0] if news else works
        return told | {'says': says}

    def _rows(self) -> dict[str, dict]:
        """Return what drive.js needs, of each kind the newest rows, and how many come before."""
        record = self._record
        found = {
            'poses': (record.poses[::EVERY], lambda one: [round(n, 3) for n in one[1:]]),
            'commands': (
                record.commands,
                lambda one: [round(1000 * one.t_s), *(round(n, 3) for n in one[1:]), -1, 0],
            ),
            'scans': (
                record.scans,
                lambda one: [round(1000 * one.t_s), one.seq, *rays(one)],
            ),
            'bumps': (bumps(record), lambda one: round(1000 * one.t_s)),
        }
        told = {}
        for kind, (rows, row) in found.items():
            first = max(self._told.get(kind, AGAIN) - AGAIN, 0)
            told[kind] = {'from': first, 'added': [row(one) for one in rows[first:]]}
            self._told[kind] = len(rows)
        return told

    def _is_lane(self) -> bool:
        return is_lane(self._record.floor, [row[1:3] for row in self._record.poses])
