"""A drive to step through, as the runs of `helpers.replay` are, and beside it the queue."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from helpers.guesses import CSS, MEMORY, Guess
from helpers.replay import Replay, replay
from helpers.robot import RADIUS_M, RANGE_MAX, Command, DriveRecord, Event, Pose, Scan
from helpers.robot_view.picture import (
    BEAMS,
    DRIVE_CSS,
    LANE_M,
    floor_in_words,
    floor_picture,
    is_lane,
)
from helpers.robot_view.scans import ScanRecording

if TYPE_CHECKING:
    from helpers.robot_view.place import Place

HERE = Path(__file__).parent
# What a notebook keeps of a drive, at most: so it stays below 60 kB.
POSES, SCANS, COMMANDS, EVENTS = 400, 50, 150, 50
EVERY_S = 0.1  # a pose
NEAR_M = 2.0  # so near, a robot stands before what it sees
TIMES = ['published_s', 'started_s', 'finished_s']
HELD_S = 0.5  # a callback that runs longer than this is worth a sentence
LATE_S = 0.3  # so is a command that was the last one for longer
TIME_LABEL = "time since the robot's start (s)"


@dataclass(frozen=True)
class Drive:
    """A drive as it is replayed: of a `Replay` one of the `runs`, with a floor for its picture."""

    record_: DriveRecord
    summary: str
    recording: ScanRecording | None = None
    name: str = ''
    setup: None = None
    opens: str = 'bump'  # where it opens: at its first bump, if there is one, or at its 'end'
    guess: Guess | None = None  # of a place on this floor
    label: str = ''  # what it is called beside other drives of the same cell

    @property
    def scripts(self) -> tuple[Path, ...]:
        """The files that view.js needs for it."""
        guessed = (*self.guess.kind.scripts, MEMORY) if self.guess else ()
        beside = (HERE / 'timeline.js',) if self.recording and self.as_lane else ()
        return (*guessed, HERE / 'drive.js', HERE / 'floor.js', *beside)

    @property
    def styles(self) -> tuple[Path, ...]:
        return (DRIVE_CSS, CSS) if self.guess else (DRIVE_CSS,)

    @property
    def span_s(self) -> tuple[float, float]:
        """From when to when it was recorded."""
        return 0.0, self.record_.poses[-1].t_s if self.record_.poses else 0.0

    def sampled(self) -> tuple[float, np.ndarray]:
        """Return the time between two poses (s), and the poses (n, 5): x, y, yaw, v, w."""
        rows = np.array(self.record_.poses or [(0.0, *self.record_.floor.start, 0.0, 0.0)], float)
        end = rows[-1, 0]
        count = min(math.ceil(end / EVERY_S), POSES) + 1
        columns = (*rows.T[1:3], np.unwrap(rows[:, 3]), *rows.T[4:6])
        times = np.linspace(0, end, count)
        poses = np.stack([np.interp(times, rows[:, 0], column) for column in columns], axis=1)
        return end / (count - 1) if end else EVERY_S, poses.round(3)

    @property
    def as_lane(self) -> bool:
        """Whether its picture is the strip of a corridor."""
        return is_lane(self.record_.floor, [row[1:3] for row in self.record_.poses])

    @property
    def telling_s(self) -> float:
        """The time at which it opens."""
        hit = bumps(self.record_) if self.opens == 'bump' else []
        return hit[0].t_s if hit else self.span_s[1]

    def picture(self, at_s: float | None = None) -> str:
        """Return the floor as an SVG, at the time at which it opens."""
        record = self.record_
        now = self.telling_s if at_s is None else at_s
        step, poses = self.sampled()
        points = poses[:, :2].tolist()
        pose = place(record, now)
        before = [scan for scan in record.scans if scan.t_s <= now + 1e-9]
        return floor_picture(
            record.floor,
            [*points[: int(now / step) + 1], pose[:2]],
            pose,
            before[-1] if before else None,
            [place(record, bump.t_s) for bump in bumps(record) if bump.t_s <= now + 1e-9],
            seconds(record, now),
            scan_pose=place(record, before[-1].t_s) if before else None,
            whole=points,
            as_lane=self.as_lane,
        )

    @property
    def words(self) -> str:
        return f'{self.summary} {floor_in_words(self.record_.floor)}'

    def record(self) -> dict:
        """Return what drive.js needs: m and rad, and whole ms and cm (of ranges)."""
        step, poses = self.sampled()
        return {
            'name': self.name,
            **({'label': self.label} if self.label else {}),
            'outcome': self.headline,
            **({'guess': self._guessed()} if self.guess else {}),
            'step': round(step, 4),
            **({'strip': LANE_M} if self.as_lane else {}),
            'poses': poses.tolist(),
            'scans': [
                [
                    round(1000 * scan.t_s),
                    scan.seq,
                    *rays(scan),
                ]
                for scan in thinned(self.record_.scans, SCANS)
            ],
            'commands': self.commands(),
            'events': [
                [round(1000 * event.t_s), event.text] for event in self.record_.events[:EVENTS]
            ],
            'bumps': [round(1000 * bump.t_s) for bump in bumps(self.record_)],
            **({'works': works} if (works := self.works()) else {}),
        }

    def _guessed(self) -> dict:
        return {**self.guess.record(), 'outcome': self.ended(self.guess.kind)}

    @property
    def headline(self) -> str:
        """What came out, and why, if one knows which scan the robot acted on."""
        what = outcome(self.record_)
        because = ''
        if (acted := self.acted_on()) is not None:
            because = f'the scan was {acted[0]:.1f} s old.'
        elif (held_s := self.held_s) is not None:
            because = f'the callback had not returned for {held_s:.1f} s.'
        return f'{what.partition(" after ")[0].rstrip(".")}: {because}' if because else what

    @property
    def held_s(self) -> float | None:
        """For how long (s) a callback had not returned when the robot hit something, if it had not.

        None, too, if the node commands the robot itself: then its last command says more.
        """
        for bump in bumps(self.record_)[:1]:
            began = [at_s for at_s, end_s, _ in self._callbacks() if at_s <= bump.t_s < end_s]
            if began and bump.t_s - began[0] > HELD_S:
                return bump.t_s - began[0]
        return None

    def _callbacks(self) -> list[tuple[float, float, int]]:
        """Return of each callback when it began and ended (s), and its scan.

        Only of a node that does not command the robot itself: commands of others say nothing of it.
        """
        recording = self.recording
        if recording is None or recording.sent:
            return []
        table = recording.table().dropna(subset='started_s')
        table[TIMES] += recording.started_s - self.record_.started_s
        ends_s = table['finished_s'].fillna(math.inf)
        return list(zip(table['started_s'], ends_s, table['seq'], strict=True))

    def works(self) -> list[list[int]]:
        """Return of each callback [when it began, its scan, when that was made], in ms."""
        scans = self.record_.scans
        return [
            [round(1000 * began), seq, round(1000 * scans[seq].t_s)]
            for began, _, seq in self._callbacks()
        ]

    def late_s(self) -> tuple[float, float] | None:
        """Return how long (s) the robot drove on after its last command, and how fast (m/s).

        That is until it hit something, or its watchdog stopped it. None if it was not late.
        """
        stops = [event for event in self.record_.events if event.kind == 'watchdog']
        for end in bumps(self.record_)[:1] or stops[-1:]:
            before = [command for command in self.record_.commands if command.t_s <= end.t_s]
            if before and before[-1].v and end.t_s - before[-1].t_s > LATE_S:
                return end.t_s - before[-1].t_s, before[-1].v
        return None

    def acted_on(self) -> tuple[float, float] | None:
        """Return the age (s) of the scan that decided the end, and the speed until then (m/s).

        It is that of the last command before the bump, at the bump; or that of the first command
        after which the robot stood, when it came. None if no scan is known.
        """
        rows, hit = self._rows(), bumps(self.record_)
        if hit:
            rows = [row for row in rows if row[0].t_s <= hit[0].t_s]
            decided = rows[-1:]
            at_s = hit[0].t_s
        else:
            drives = [i for i, (command, _) in enumerate(rows) if command.v or command.w]
            decided = rows[drives[-1] + 1 :][:1] if drives else []
            at_s = decided[0][0].t_s if decided else 0.0
        if not decided or decided[0][1] < 0:
            return None
        speeds = [command.v for command, _ in rows if command.v and command.t_s <= at_s]
        return at_s - self.record_.scans[decided[0][1]].t_s, speeds[-1] if speeds else 0.0

    def ended(self, guessed: Place) -> dict:
        """Return where the robot ended: how far before what is ahead (m), what it hit, and why."""
        hit = bumps(self.record_)
        x, y, _ = place(self.record_, hit[0].t_s if hit else self.span_s[1])
        what = ahead_of(self.record_, x, y)
        cause = ''
        if (acted := self.acted_on()) is not None:
            did = 'acted' if hit else 'braked'
            cause = f'It {did} on a scan that was {_times(*acted, "s old")}'
        elif (held_s := self.held_s) is not None:
            speed = next(row.v for row in reversed(self.record_.poses) if row.v)
            cause = f'The callback had not returned for {_times(held_s, speed)}'
        elif (late := self.late_s()) is not None:
            cause = f'After the last command it drove on for {_times(*late)}'
        at = RADIUS_M if hit else round(guessed.distance_m(x, y), 2)
        return {'at': at, 'hit': bool(hit), 'what': what, 'cause': cause}

    def _rows(self) -> list[tuple[Command, int]]:
        """Return each command with the number of the scan whose callback sent it, or -1.

        Commands arrive in the order in which they are sent, also if several are late.
        """
        rows = []
        sent = deque([] if self.recording is None else self.recording.sent)
        for command in self.record_.commands:
            message = -1
            own = [k for k, speeds in enumerate(sent) if speeds[1:3] == command[1:3]]
            if own and sent[own[0]][0] <= self.record_.started_s + command.t_s:
                for _ in range(own[0]):  # they never arrived
                    sent.popleft()
                *_, message = sent.popleft()
            rows.append((command, message))
        return rows

    def commands(self) -> list[list[float]]:
        """Return of each command [when, speed, turning, message, its age]; -1 is no message."""
        rows, before = [], None
        for command, seq in self._rows():
            message = -1, 0
            if seq >= 0:
                message = seq, round(1000 * (command.t_s - self.record_.scans[seq].t_s))
            told = round(command.v, 3), round(command.w, 3)
            rows.append(((told != before), [round(1000 * command.t_s), *told, *message]))
            before = told
        if len(rows) > COMMANDS:
            rows = [row for row in rows if row[0]]
        return [row for _, row in thinned(rows, COMMANDS)]


def replay_drive(
    record: DriveRecord,
    recording: ScanRecording | None = None,
    name: str = '',
    opens: str = 'bump',
    guess: Guess | None = None,
) -> Replay:
    """Return a drive to step through: the floor, and when `recording` is given, its queue beside.

    `record` is `robot.record`, `recording` what `watch` returned for the subscription that commands
    the robot, in one thread. With the mouse, keys or Play one sees what the robot saw, what it was
    told, and which scan it acted on. `name` is what this drive is called in words, so that one
    tells it from others of the page. It opens at the first bump, if there is one, or at the 'end'.
    `guess`, of a place, is drawn, and the gap at the end.

    Raises TypeError for anything else, ValueError for a recording beside a drive in sim time, and
    what `helpers.replay.replay` raises.
    """
    if not isinstance(record, DriveRecord):
        raise TypeError(f'A drive is replayed from robot.record, not from {record!r}.')
    hit = bumps(record)
    moved = any(row.v or row.w for row in record.poses)
    end = 'hit something' if hit else 'hit nothing' if moved else 'did not move'
    called = f'{name}: ' if name else ''
    summary = f'{called}A drive on the floor {record.floor.name}. The robot {end}.'
    if recording is None:
        return Replay((Drive(record, summary, opens=opens, guess=guess, label=name),))
    if record.started_s is None:
        raise ValueError(
            'In sim time a drive and a recording share no clock: replay the drive alone.'
        )
    table = recording.table()
    table[TIMES] += recording.started_s - record.started_s
    (run,) = replay(table, recording.depth).runs
    # How many messages there were differs from run to run.
    words = run.summary.partition(', ')[2]
    drive = Drive(record, summary, recording, opens=opens, guess=guess, label=name)
    after_s = drive.span_s[1] - run.moves[-1][0] / 1e6
    words = called + words[0].upper() + words[1:]
    run = replace(run, summary=words, time_label=TIME_LABEL, after_s=after_s)
    return Replay((drive, run))


def _times(seconds: float, speed: float, unit: str = 's') -> str:
    """Return how far one comes in some seconds: `1.2 s old: 1.2 s × 0.5 m/s = 0.6 m.`"""
    seconds, speed = round(seconds, 1), round(speed, 2)
    return f'{seconds:g} {unit}: {seconds:g} s × {speed:g} m/s = {seconds * speed:.2g} m.'


def rays(scan: Scan) -> tuple[float, float, list[int]]:
    """Return the angles of the first and the last ray that is drawn (rad), and all ranges (cm)."""
    angles, ranges = scan.drawn(BEAMS, RANGE_MAX)
    whole = (100 * ranges).round().astype(int).tolist()
    return round(float(angles[0]), 4), round(float(angles[-1]), 4), whole


def seconds(record: DriveRecord, end_s: float) -> list[Pose]:
    """Return where the robot was in each second until `end_s`."""
    return [place(record, second) for second in range(min(int(end_s), POSES) + 1)]


def place(record: DriveRecord, t_s: float) -> Pose:
    """Return where the robot was at a time, after its last step."""
    after = bisect_right(record.poses, t_s + 1e-9, key=lambda row: row.t_s) - 1
    return Pose(*record.poses[after][1:4]) if after >= 0 else record.floor.start


def outcome(record: DriveRecord) -> str:
    """Return how a drive ended, in one sentence.

    How far a wall is away is what the laser says straight ahead: measured from the middle.
    """
    floor = record.floor
    if hit := bumps(record):
        what = ahead_of(record, *place(record, hit[0].t_s)[:2])
        return f'The robot hit {what} after {hit[0].t_s:.1f} s.'
    if not any(row.v or row.w for row in record.poses):
        return 'The robot did not move.'
    *_, x, y, yaw, v, w = record.poses[-1]
    (distance,), (seen,) = floor.ranges(x, y, np.array([yaw]))
    if v or w or distance > NEAR_M:
        return 'Nothing was hit.'
    kind = floor.walls[seen].kind
    what = 'the wall' if kind == 'wall' else f'a {kind}'
    return f'The robot stands, {distance:.2f} m before {what}.'


def ahead_of(record: DriveRecord, x: float, y: float) -> str:
    """Return the words for the nearest wall or box."""
    kind = min(record.floor.walls, key=lambda wall: wall.distance(x, y)).kind
    return 'the wall' if kind == 'wall' else f'a {kind}'


def bumps(record: DriveRecord) -> list[Event]:
    return [event for event in record.events if event.kind == 'bump'][:EVENTS]


def thinned(rows: list, most: int) -> list:
    """Return at most so many of the rows, evenly, with the first and the last."""
    if len(rows) <= most:
        return list(rows)
    return [rows[index] for index in np.linspace(0, len(rows) - 1, most).round().astype(int)]
