"""The rules of model.js, for Python: what became of each message of a run, and why it waited."""

from __future__ import annotations

import json

# Not from `quickjs`: importing that starts a thread, which stays in the kernel.
from _quickjs import Context

from helpers.replay.script import source

SCRIPT = 'model.js', 'walk.js', 'circle.js', 'stories.js'


def stories(record: dict, most: int) -> dict:
    """Return what became of the first `most` messages of a record, as stories.js says it."""
    context = Context()
    for name in SCRIPT:
        context.eval(source(name))
    return json.loads(context.eval(f'JSON.stringify(stories({json.dumps(record)}, {most}))'))
