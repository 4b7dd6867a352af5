"""What a reader gives to the filter and to a drive: each refusal is one sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real

from helpers.notebook import chosen, shown


def positive(name: str, value, or_zero: bool = False) -> float:
    """Return a number that is more than zero; with `or_zero`, it may be zero."""
    if not (isinstance(value, Real) and 0 <= value < math.inf and (value or or_zero)):
        kind = 'a number, zero or more' if or_zero else 'a positive number'
        raise ValueError(f'{name} must be {kind}, not {shown(value)}.')
    return float(value)


def some_of(name: str, given: Sequence[str], allowed: Iterable[str]) -> None:
    """Raise ValueError unless each name is allowed, and there is one. A str is no list of names."""
    if isinstance(given, str) or not given or not all(key in allowed for key in given):
        raise ValueError(
            f'{name} must be a list of some of {", ".join(allowed)}, not {shown(given)}.'
        )


def variances(
    name: str, given: Mapping | None, defaults: Mapping[str, float], or_zero: bool = False
) -> dict[str, float]:
    changed = chosen(name, given, defaults)
    return defaults | {key: positive(f'{name}[{key!r}]', changed[key], or_zero) for key in changed}
