"""What can be given to the filter and to a drive: each refusal is one sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from helpers.values import MOST, is_number, shown


def number(name: str, value) -> float:
    """Return a number. Raises ValueError for anything else, NaN, or a number beyond MOST."""
    if not is_number(value):
        raise ValueError(f'{name} must be a number, at most {MOST:g}, not {shown(value)}.')
    return float(value)


def positive(name: str, value) -> float:
    """Return a number that is more than zero."""
    if number(name, value) <= 0:
        raise ValueError(f'{name} must be positive, not {shown(value)}.')
    return float(value)


def not_negative(name: str, value) -> float:
    """Return a number that is zero or more."""
    if number(name, value) < 0:
        raise ValueError(f'{name} must be zero or more, not {shown(value)}.')
    return float(value)


def chosen(name: str, given: Mapping | None, allowed: Iterable[str]) -> dict:
    """Return a dict (None: an empty one) whose keys are all allowed."""
    if not isinstance(given, Mapping | None):
        raise TypeError(f'{name} must be a dict, not {shown(given)}.')
    for key in given or {}:
        if key not in allowed:
            raise ValueError(f'{name} can name {", ".join(allowed)}, not {shown(key)}.')
    return dict(given or {})


def variances(
    name: str,
    given: Mapping | None,
    defaults: Mapping[str, float],
    check: Callable[[str, object], float] = positive,
) -> dict[str, float]:
    """Return the default variances, some of them replaced."""
    changed = chosen(name, given, defaults)
    return defaults | {key: check(f'{name}[{key!r}]', changed[key]) for key in changed}
