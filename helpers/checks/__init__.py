"""Guesses and tasks: what is right, what the student's code did, and a hint."""

from helpers.checks.carry_on import carry_on
from helpers.checks.classroom import join_class, leave_class, lower_hand, raise_hand
from helpers.checks.guesses import compare_prediction, guess
from helpers.checks.memory import questions, remember
from helpers.checks.missing_names import explain_missing_name
from helpers.checks.other_robots import next_robot

__all__ = [
    'carry_on',
    'compare_prediction',
    'explain_missing_name',
    'guess',
    'join_class',
    'leave_class',
    'lower_hand',
    'next_robot',
    'questions',
    'raise_hand',
    'remember',
]
