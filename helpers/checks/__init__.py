"""Guesses and tasks: what is right, what the student's code did, and a hint."""

from helpers.checks.checks import check, compare_prediction
from helpers.checks.classroom import guess, join_class, leave_class, lower_hand, raise_hand

__all__ = [
    'check',
    'compare_prediction',
    'guess',
    'join_class',
    'leave_class',
    'lower_hand',
    'raise_hand',
]
