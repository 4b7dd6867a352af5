"""What is given to a function: how a sentence shows it, and whether it can be used."""

from __future__ import annotations

import numbers
from collections.abc import Iterable, Mapping

LONGEST = 200  # characters of a value that a sentence can hold


def shown(value: object) -> str:
    """Return how a value looks, for a sentence: its repr, or its type if that is long."""
    text = repr(value)
    return f'this {type(value).__name__}' if '\n' in text or len(text) > LONGEST else text


def check_count(name: str, value: int) -> None:
    """Raise ValueError unless the value is a whole number from 1 up."""
    if not isinstance(value, numbers.Integral) or value < 1:
        raise ValueError(f'{name} must be a whole number from 1 up, not {shown(value)}.')


def chosen(name: str, given: Mapping | None, allowed: Iterable[str]) -> dict:
    """Return a dict (None: an empty one) whose keys are all allowed."""
    if not isinstance(given, Mapping | None):
        raise TypeError(f'{name} must be a dict, not {shown(given)}.')
    for key in given or {}:
        if key not in allowed:
            raise ValueError(f'{name} can name {", ".join(allowed)}, not {shown(key)}.')
    return dict(given or {})
