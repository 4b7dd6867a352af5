"""Print every external link of the lessons, with the words that it backs.

    python -m tools.lessons.sources

No test opens a link: the tests need no network. Who has one compares the pages with this list.
"""

import re
from collections.abc import Iterator

from tools.lessons import rules
from tools.lessons.lesson import Lesson, lessons

# A bracket inside an address is closed again there; a full stop after it is the sentence's.
ADDRESS = re.compile(r'https?://(?:[^\s()<>"\]`]|\([^\s()]*\))+(?<![.,;:])')
LINK = re.compile(rf'\[([^\]]*)\]\(({ADDRESS.pattern}|[^)\s]+)\)')
SENTENCES = re.compile(r'(?<=[.?!])\s+(?=[\[("*`A-Z])')


def links(lesson: Lesson) -> Iterator[tuple[str, str]]:
    """Yield each external address with the sentence, the bullet or the row of a table around it.

    The words that are the link stand in brackets there: `... is [thread safe] ...`.
    """
    for _, line in rules.prose(lesson):
        for text in [line] if re.match(r'\s*[-*|]\s', line) else SENTENCES.split(line):
            for found in ADDRESS.finditer(text):
                yield found[0], LINK.sub(lambda link, url=found[0]: _words(link, url), text).strip()


def _words(link: re.Match, url: str) -> str:
    return f'[{link[1]}]' if link[2] == url else link[1]


def listing(every: list[Lesson]) -> str:
    """Return all links as text: a heading for each lesson, two lines for each link."""
    blocks = [
        [f'{lesson.number} {lesson.title}', *(f'  {url}\n    {text}' for url, text in found)]
        for lesson in every
        if (found := list(links(lesson)))
    ]
    return '\n\n'.join('\n'.join(block) for block in blocks)


if __name__ == '__main__':
    print(listing(lessons()))
