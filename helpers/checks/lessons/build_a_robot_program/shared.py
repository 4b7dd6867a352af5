"""The tasks of this lesson, to which its modules add."""

from helpers.checks.tasks import Tasks

tasks = Tasks()
