"""Bags: a drive into a wall, and below it the messages that were recorded meanwhile."""

import base64
import io
import re
from itertools import takewhile

import numpy as np
from PIL import Image

from helpers.lesson import Lesson
from tools.lessons.first_pictures import lanes
from tools.lessons.first_pictures.lanes import Lane, way_of
from tools.lessons.first_pictures.look import PLAYS_S, WIDTH, output_of, runs_of, svg, text_of

SCAN_S = 0.1  # from one scan to the next
LIMIT_M = 0.5  # where the brake should stop the robot
LANE = Lane(from_m=1.95, height=66)
ROWS_X, ROWS_Y, ROW = 116, 134, 30  # pixels: where rows begin, and the height of one
STYLE = (
    '.tick{stroke:COLOUR(heard);stroke-width:3}'
    '.bar{stroke:COLOUR(wall);fill:COLOUR(way)}'
    '.base{stroke:COLOUR(wall);stroke-opacity:.5}'
    '.value{text-anchor:middle}'
    f'.tape{{animation:tape {PLAYS_S}s linear both}}'
    f'@keyframes tape{{from{{transform:none}}}}'
)


def recorded(lesson: Lesson, counts: str, ticks: str) -> tuple[np.ndarray, np.ndarray]:
    """Return when the scans and the results of a bag came (s), from its first scan on.

    One cell has printed how many there are. The figure of another one has a tick for each.
    """
    count = dict(re.findall(r'Topic: /(\w+) .*Count: (\d+)', text_of(lesson, counts)))
    png = re.search(r'src="data:image/png;base64,([^"]*)"', output_of(lesson, ticks))[1]
    figure = np.asarray(Image.open(io.BytesIO(base64.b64decode(png))).convert('RGB')).astype(int)
    blue = figure[:, :, 2] - figure[:, :, 0] > 60
    rows = [np.flatnonzero(row) for row in np.diff(blue.astype(int), prepend=0) == 1]
    scans, results = (
        next(row for row in rows if len(row) == int(count[topic])) for topic in ('scan', 'wall')
    )
    pixel_s = SCAN_S * (len(scans) - 1) / (scans[-1] - scans[0])
    return (scans - scans[0]) * pixel_s, (results - scans[0]) * pixel_s


def bag_picture(lesson: Lesson, drive: str, counts: str, ticks: str) -> str:
    """Return the drive while it was recorded: on which scan the brake acted is not told.

    The scans alone have ticks. How many messages other topics have would tell what a learner
    guesses: whether the bag lacks scans.
    """
    (run,) = runs_of(output_of(lesson, drive))
    scans_s, results_s = recorded(lesson, counts, ticks)
    sent = [(at / 1000, speed) for at, speed, *_ in run['commands']]
    begins_s = sent[0][0] - results_s[0]  # a result and its command come at the same time
    ends_s = begins_s + scans_s[-1]
    same = list(takewhile(lambda one: one[0] < ends_s and one[1] == sent[0][1], sent))
    bump_s = run['bumps'][0] / 1000

    def plays(t_s: float) -> float:
        return PLAYS_S * (t_s - begins_s) / (ends_s - begins_s)

    def x(t_s: float) -> float:
        return ROWS_X + 4 + (WIDTH - lanes.PAD - ROWS_X - 8) * plays(t_s) / PLAYS_S

    def bar(row: int, says: str, kind: str) -> str:
        left, right = x(same[0][0]), x(same[-1][0])
        return (
            f'<path class="bar" d="M{left:.0f} {row * ROW + 3}H{right:.0f}v24H{left:.0f}z"/>'
            f'<text class="value {kind}" x="{(left + right) / 2:.0f}" y="{row * ROW + 22}">'
            f'{says}</text>'
        )

    way = [(plays(t_s), metres) for t_s, metres in way_of(run, ends_s) if t_s >= begins_s]
    robot, css = LANE.robot('r', way)
    marks = ''.join(f'M{x(begins_s + at_s):.1f} 4v22' for at_s in scans_s)
    bump_x = x(bump_s)
    names = ''.join(
        f'<text class="ink" x="{lanes.PAD}" y="{i * ROW + 22}">{topic}</text>'
        f'<path class="base" d="M{ROWS_X} {(i + 1) * ROW}H{WIDTH - lanes.PAD}"/>'
        for i, topic in enumerate(('scan', 'wall', 'cmd_vel', 'bumper'))
    )
    rows = (
        f'<path class="tick" d="{marks}"/>{bar(1, "?", "asks ink")}'
        f'{bar(2, f"{same[0][1]:g} m/s", "ink")}'
        f'<path class="hit" d="M{bump_x - 8:.0f} {3 * ROW + 7}l16 16m0-16l-16 16"/>'
        f'<path class="ground tape" transform="translate({WIDTH - lanes.PAD - ROWS_X} 0)" '
        f'd="M{ROWS_X} 0H{WIDTH}V{4 * ROW}H{ROWS_X}z"/>{names}'
    )
    body = (
        f'<text class="ink" x="704" y="24" text-anchor="end">{LIMIT_M} m before the wall: brake'
        f'</text>{LANE.at(34, LANE.floor(LIMIT_M) + robot + LANE.hit(plays(bump_s)))}'
        f'<text class="ink" x="{lanes.PAD}" y="{ROWS_Y - 8}">recorded:</text>'
        f'<g transform="translate(0 {ROWS_Y})">{rows}</g>'
        f'<text class="asks ink" x="{lanes.PAD}" y="{ROWS_Y + 4 * ROW + 28}">'
        'On which of these scans did the brake act?</text>'
    )
    about = f'A real drive of {lesson.name}, and the scans of its bag'
    return svg(ROWS_Y + 4 * ROW + 44, about, lanes.STYLE + STYLE + css, body)
