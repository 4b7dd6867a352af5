"""Which troubles a program can meet: made from what it hears and what it consists of."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

# Of an input that the program needs: must the robot stand? If not, it may also go on.
OF_INPUTS = {
    'silent from the start': True,
    'silent': True,
    'frozen': True,
    'NaN': True,
    'empty': True,
    'old': True,
    'early stamps': False,
    'stamps of another clock': False,
    'a second node': False,
}
SIGNALS = ('SIGINT', 'SIGTERM', 'SIGKILL', 'SIGSTOP')
HANGS = ('frozen', 'empty')  # what says so takes a while to be seen
NUMBERS = (float('nan'), -1.0, 0.0, 100.0)


@dataclass(frozen=True)
class Trouble:
    """A trouble: of what, which, whether the robot must stand, and numbers that a seed has drawn.

    `of` is a topic, a process, `node.callback`, `node.parameter`, 'clock' or 'network'. `ends`: it
    ends again, and the program must go on. `values`: `within_s`, so soon the robot stands;
    `after_m`, so far from its start the robot is when the trouble begins; `lasts_s`; `age_s`,
    `ahead_s` and `jump_s` of stamps and clocks; `value` of a parameter.
    """

    of: str
    what: str
    must_stand: bool = False
    ends: bool = True
    values: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return f'{self.of}: {self.what}' if self.of else self.what


NOTHING = Trouble('', 'nothing', ends=False)


def troubles(
    declared: dict[str, Any], seen: dict[str, list[str]], program: str, base: str, seed: int
) -> list[Trouble]:
    """Return all troubles of a program. `seen` is what its run without a trouble has shown."""
    found: list[Trouble] = []

    def add(of: str, what: str, stand: bool = False, ends: bool = True, **values: float) -> None:
        drawn = random.Random(f'{seed} {program} {base} {of} {what}')
        slow = of in declared['hangs_s'] and what in HANGS
        within_s = declared['hangs_s'][of] if slow else declared['within_s']
        values |= {
            'within_s': within_s,
            'after_m': round(drawn.uniform(*declared['after_m']), 2),
            'lasts_s': round(within_s + drawn.uniform(2.0, 4.0), 1),
            'age_s': round(drawn.uniform(1.0, 4.0), 1),
            'ahead_s': drawn.choice([1.0, 5.0, 3600.0]),
            'jump_s': drawn.choice([-3600.0, -5.0, 5.0, 3600.0]),
        }
        found.append(Trouble(of, what, stand, ends, values))

    for topic, needed in declared['inputs'].items():
        for what, stand in OF_INPUTS.items():
            seen_at_once = what not in HANGS or needed != 'to turn'
            add(topic, what, stand=stand and bool(needed) and seen_at_once)
    for process in seen['processes']:
        for what in SIGNALS:
            add(process, what, ends=what == 'SIGSTOP')
    for callback in seen['callbacks']:
        add(callback, 'raises', ends=False)
    for parameter in seen['parameters']:
        for value in NUMBERS:
            add(parameter, f'becomes {value:g}', value=value)
    add('clock', 'jumps')
    add('cmd_vel', 'a second voice')
    add('network', 'is cut', stand=bool(declared['inputs']))
    return found
