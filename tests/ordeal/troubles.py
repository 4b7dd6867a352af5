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
NUMBERS = (float('nan'), -1.0, 0.0, 100.0)


@dataclass(frozen=True)
class Trouble:
    """A trouble: of what, which, whether the robot must stand, and numbers that a seed has drawn.

    `of` is a topic, a process, `node.callback`, `node.parameter`, 'clock' or 'network'. `ends`: it
    ends again, and the program must go on. `values`: `after_m`, so far from its start the robot is
    when it begins; `lasts_s`; `age_s`, `ahead_s` and `jump_s` of stamps and clocks; `value`.
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
    found = [
        *((topic, what, stand and needed, True, {})
          for topic, needed in declared['inputs'].items()
          for what, stand in OF_INPUTS.items()),
        *((process, what, False, what == 'SIGSTOP', {})
          for process in seen['processes']
          for what in SIGNALS),
        *((callback, 'raises', False, False, {}) for callback in seen['callbacks']),
        *((parameter, f'becomes {value:g}', False, True, {'value': value})
          for parameter in seen['parameters']
          for value in NUMBERS),
        ('clock', 'jumps', False, True, {}),
        ('cmd_vel', 'a second voice', False, True, {}),
        ('network', 'is cut', bool(declared['inputs']), True, {}),
    ]  # fmt: skip
    made = []
    for of, what, must_stand, ends, values in found:
        drawn = random.Random(f'{seed} {program} {base} {of} {what}')
        values |= {
            'after_m': round(drawn.uniform(*declared['after_m']), 2),
            'lasts_s': round(declared['within_s'] + drawn.uniform(2.0, 4.0), 1),
            'age_s': round(drawn.uniform(1.0, 4.0), 1),
            'ahead_s': drawn.choice([1.0, 5.0, 3600.0]),
            'jump_s': drawn.choice([-3600.0, -5.0, 5.0, 3600.0]),
        }
        made.append(Trouble(of, what, must_stand, ends, values))
    return made
