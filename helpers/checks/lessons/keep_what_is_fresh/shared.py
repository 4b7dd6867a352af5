"""Of the lesson "Keep what is fresh": the tasks that its modules add to."""

from helpers.checks.tasks import Tasks

tasks = Tasks()
