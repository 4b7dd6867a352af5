"""The law of the ordeal: did the robot do what it must? Nothing here needs ROS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

STILL = 1e-3  # m/s and rad/s: slower than this it stands


@dataclass(frozen=True)
class Seen:
    """What was seen of a trial. Times are seconds of the robot.

    `moves` are (t, v, w), `commands` the times of commands, `bumps` those of bumps. The trouble was
    there from `begun_s` to `ended_s`. `must_stand` as in its `Trouble`; `within_s`: so soon it must
    stand. `from_start`: the trouble was there before the program.
    """

    moves: Sequence[tuple[float, float, float]]
    commands: Sequence[float]
    bumps: Sequence[float]
    begun_s: float
    ended_s: float
    must_stand: bool
    within_s: float
    from_start: bool = False
    promised: bool | None = None  # whether it does what it promises afterwards; None: not asked


def broken(seen: Seen) -> str:
    """Return which part of the law was broken, in words; empty if it stood."""
    if seen.bumps:
        return f'hits something {seen.bumps[0] - seen.begun_s:.1f} s after the trouble began'
    since = seen.begun_s if seen.from_start else seen.begun_s + seen.within_s
    during = [
        (t, v, w)
        for t, v, w in seen.moves
        if since <= t <= seen.ended_s and max(abs(v), abs(w)) > STILL
    ]
    if seen.must_stand and during:
        t, v, w = during[-1]
        return f'still moves {t - seen.begun_s:.1f} s after the trouble began ({v:.2f} m/s)'
    commands, place = sorted(seen.commands), 0
    for t, v, _ in during:
        while place < len(commands) and commands[place] <= t:
            place += 1
        last = commands[place - 1] if place else float('-inf')
        if t - last > seen.within_s:
            late_s = t - max(last, seen.begun_s)
            return f'moves at {v:.2f} m/s, {late_s:.1f} s after its last command'
    if seen.promised is False:
        return 'does not do what it promises after the trouble'
    return ''
