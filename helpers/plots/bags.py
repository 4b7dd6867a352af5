"""What is in a bag: when messages came, and how old they were."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import matplotlib.pyplot as plt

from helpers.plots.alt_text import describe, show


def draw_bag(scans: Sequence, walls: Sequence, age_s: Callable[[int, object], float]) -> None:
    """Draw when messages came, and how old the scans were on which the brake acted.

    `scans` and `walls` are pairs: when a message was recorded (ns), and the message. `age_s` takes
    the time at which a result was recorded, and its header.
    """
    figure, (rows, ages) = plt.subplots(2, 1, figsize=(7, 3.6), sharex=True, layout='constrained')
    scan_s, wall_s = (
        [(recorded_ns - scans[0][0]) / 1e9 for recorded_ns, _ in messages]
        for messages in (scans, walls)
    )
    rows.eventplot([wall_s, scan_s], lineoffsets=[0, 1], linelengths=0.7)
    rows.set_yticks([0, 1], ['wall', 'scan'])
    ages.plot(wall_s, [age_s(recorded_ns, wall.header) for recorded_ns, wall in walls], 'o')
    ages.set(xlabel='time in the bag (s)', ylabel='age (s)', ylim=(0, 2))
    describe(rows, 'A line for each message: twice as many scans as results.', 'Messages')
    describe(ages, 'Each result comes from a scan that is about 1 s old.', 'Ages')
    plt.close(figure)
    show(figure)
