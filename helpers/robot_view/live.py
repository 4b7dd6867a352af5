"""A robot while it drives: a picture in the cell's output, drawn again twelve times a second."""

from __future__ import annotations

import threading
from html import escape

from rclpy.subscription import Subscription

from helpers.guesses import Guess
from helpers.notebook import somebody_watches
from helpers.replay import Replay, style
from helpers.robot import Pose, Robot
from helpers.robot_view.picture import DRIVE_CSS, Seen, floor_in_words, floor_picture, is_lane
from helpers.robot_view.replay import bumps, outcome, place, replay_drive, seconds
from helpers.robot_view.scans import ScanRecording
from helpers.ros import current_session

PERIOD_S = 1 / 12
EVERY = 5  # steps of the robot: a point of its path
OLD_S = 0.5  # a scan that is older is worth a sentence
NEWS_S = 3.0  # so long an event is shown
# Those of view.js, in their places: nothing moves when the replay comes.
CONTROLS = (
    '<div class="replay-controls" aria-hidden="true"><button disabled>‹</button>'
    '<button disabled>›</button><button class="replay-play" disabled>● Live</button>'
    '<button class="replay-rate" disabled>1×</button>'
    '<input type="range" disabled min="0" max="1" value="1"></div>'
)


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
        # Who has watched sees the robot stay where it stopped.
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
    """The picture of a drive, from `start` to `stop`, sent by a thread of its own.

    To update a display, unlike to make one, needs no cell: it moves, whatever the cell waits for.
    """

    def __init__(
        self, robot: Robot, recording: ScanRecording | None, guess: Guess | None = None
    ) -> None:
        self._record, self._recording, self._guess = robot.record, recording, guess
        self._display = None
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

            data = {'text/html': self.html()}
            self._display = display(data, raw=True, display_id=True)
            self._thread.start()

    def _run(self) -> None:
        while not self._over.wait(PERIOD_S):
            self._display.update({'text/html': self.html()}, raw=True)

    def stop(self, shown: Replay) -> None:
        """End the pictures, and show this in their place."""
        from IPython.display import display

        if not self.is_shown:
            display(shown)
            return
        self._over.set()
        self._thread.join()
        self._display.update(shown)

    def html(self) -> str:
        """Return the picture of now, and what the robot and its callback do."""
        record = self._record
        poses, scans, commands = record.poses, record.scans, record.commands
        now, hit = poses[-1], bumps(record)
        svg = floor_picture(
            record.floor,
            [row[1:3] for row in [*poses[::EVERY], now]],
            Pose(now.x, now.y, now.yaw),
            scans[-1] if scans else None,
            [place(record, bump.t_s) for bump in hit],
            seconds(record, now.t_s),
            scan_pose=place(record, scans[-1].t_s) if scans else None,
            ring_s=now.t_s - hit[-1].t_s if hit else None,
            as_lane=is_lane(record.floor, [row[1:3] for row in poses]),
            guess=self._guess,
            seen=(seen := self._seen(hit[0].t_s if hit else now.t_s)),
        )
        lane = ' replay-lane' if is_lane(record.floor, [row[1:3] for row in poses]) else ''
        told = 'nothing yet'
        if commands:
            _, v, w = commands[-1]
            told = f'{v:.2f} m/s' + (f' and {w:.2f} rad/s' if w else '')
        news = record.events[-1:]
        event = news[0].text if news and now.t_s - news[0].t_s < NEWS_S else ''
        if not event and seen is not None and seen.age_s > OLD_S:
            event = f'The brake works on a scan that is {seen.age_s:.1f} s old.'
        if hit:
            event = outcome(record)
        return (
            f'<div class="replay replay-on robot-live">{style(DRIVE_CSS)}{CONTROLS}'
            f'<p class="replay-says">{escape(event)}</p><div class="replay-runs">'
            f'<div class="replay-floor{lane}">'
            f'<span role="img" aria-label="{escape(floor_in_words(record.floor))}">{svg}</span>'
            f'{_row("time", f"{now.t_s:.2f} s")}{_row("robot", speeds(now.v, now.w))}'
            f'{_row("told", told)}</div>{self._queue(now.t_s)}</div>'
            f'<p>A drive on the floor {escape(record.floor.name)}.</p></div>'
        )

    def _seen(self, now_s: float) -> Seen | None:
        """Return the scan that a callback works on, or the last one that it worked on."""
        if self._recording is None:
            return None
        runs, _ = self._recording.now(self._recording.depth)
        if runs:
            self._took = min(runs)
        if self._took is None:
            return None
        scan = self._record.scans[self._took]
        return Seen(scan, place(self._record, scan.t_s), now_s - scan.t_s)

    def _queue(self, now_s: float) -> str:
        """Return which message has a callback, and which wait."""
        if self._recording is None:
            return ''
        runs, waits = self._recording.now(self._recording.depth)
        busy = [
            f'<li class="replay-busy">message <b>{seq}</b>, {age_s:.2f} s old</li>'
            for seq, age_s in runs.items()
        ]
        waiting = ''.join(f'<li><b>{seq}</b></li>' for seq in waits)
        busy = busy or ['<li class="replay-free">free</li>']
        rows = (
            _row('time', f'{now_s:.3f} s')
            + _row('callback', ''.join(busy))
            + _row('queue', waiting, 'replay-queue')
        )
        return f'<div class="replay-run">{rows}</div>'


def speeds(v: float, w: float) -> str:
    return f'{v:.2f} m/s, {w:.2f} rad/s'


def _row(name: str, content: str, kind: str = '') -> str:
    items = f'<ul class="{kind}">{content}</ul>'
    return f'<div class="replay-row"><b>{name}</b><div>{items}</div></div>'
