"""The page with the messages of errors that the lessons make or name, each with what it means."""

import re
from pathlib import Path

from helpers.lesson import Lesson, Message, messages

NAME = 'messages'
BAR, ESCAPED = re.compile(r'(?<!\\)\|'), r'\\|'
SCRIPT = Path(__file__).with_suffix('.js')
BEFORE = """# What a message means

The messages of errors that the lessons make or name, and others that people ask about, as the tools
write them. Paste yours: the names in it, of your files and nodes, may differ.

```{{raw}} html
<p class="find-message"><label>Your message <input type="search" autocomplete="off"></label>
<output></output></p>
<script>document.addEventListener('DOMContentLoaded', () => {{
{script}
}});</script>
```

| message | what it means | lesson |
|---|---|---|
"""


def page(known: list[Lesson]) -> str:
    """Return the page in Markdown, in the order of the lessons."""
    rows = [_row(message) for lesson in known for message in messages(lesson)]
    return BEFORE.format(script=SCRIPT.read_text('utf-8')) + '\n'.join(rows) + '\n'


def _row(message: Message) -> str:
    lesson = message.lesson
    text = re.sub(r'\s+', ' ', message.text).replace('`', "'")
    anchor = re.sub(r'[^\w\- ]', '', message.step.lower()).replace(' ', '-')
    does = 'made in' if message.shown else 'named in'
    link = f'[{lesson.number} {lesson.title}, {message.step}](notebooks/{lesson.file}#{anchor})'
    cells = [f'`{text}`', message.meaning, f'{does} {link}']
    return f'| {" | ".join(BAR.sub(ESCAPED, cell) for cell in cells)} |'
