"""How a text mentions lessons and tasks: by links, in which a tool writes the numbers of today.

    [lesson 05](05_keep_what_is_fresh.ipynb), lessons [05](05_keep_what_is_fresh.ipynb) and ...
    [task 3](#✎-Task-3:-A-driver), [task 3](05_keep_what_is_fresh.ipynb#✎-Task-3:-A-driver)

A lesson is known by its name, a task by its title. The numbers in the text of the link and in its
target follow.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from helpers.lesson.lesson import Lesson, heading_of

LINK = re.compile(
    r'\[(?P<text>[^\]\n]*)\]\('
    r'(?:(?P<folder>(?:[\w.-]+/)*)\d\d_(?P<name>[a-z0-9_]+)(?P<ending>\.ipynb|\.html))?'
    r'(?P<task>#✎-Task-\d+(?:-★)?:-(?P<title>[^)\s]+))?\)'
)
ANY_LINK = re.compile(r'\[([^\]\n]*)\]\([^)\s]*\)')
# The number in the words of a link.
OF_LESSON = re.compile(r'^((?:[Ll]essons? )?|.* of lesson )\d\d\b')
OF_TASK = re.compile(r'^((?:[Tt]asks? )?)\d+\b')
NEXT = re.compile(r'\n*^Next: \[.*\]\(\S+\.ipynb\)$', re.MULTILINE)
BARE = re.compile(
    r'\b[Ll]essons? \d\d(?:(?:,| and| or| to)+ \d\d)*'
    r'|(?<!✎ )\b[Tt]asks? \d+(?:(?:,| and| or| to)+ \d+)*'
)


def with_mentions(text: str, lessons: Iterable[Lesson], here: Lesson | None = None) -> str:
    """Return a text whose links to lessons and tasks have the numbers of today.

    `here` is the lesson in which the text stands. A link to what is not there stays as it is.
    """
    by_name = {lesson.name: lesson for lesson in lessons}

    def written(link: re.Match) -> str:
        lesson = by_name.get(link['name']) if link['name'] else here
        if lesson is None or not (link['name'] or link['task']):
            return link[0]
        said, target = link['text'], ''
        if link['name']:
            target = f'{link["folder"]}{lesson.number}_{lesson.name}{link["ending"]}'
            said = OF_LESSON.sub(rf'\g<1>{lesson.number}', said)
        if link['task']:
            task = next((t for t in lesson.tasks if slug(t.title) == link['title']), None)
            if task is None:
                return link[0]
            target += task.anchor
            said = OF_TASK.sub(rf'\g<1>{task.number}', said)
        return f'[{said}]({target})'

    return LINK.sub(written, text)


def slug(title: str) -> str:
    """Return the title of a task as it stands in a link."""
    return title.replace(' ', '-')


def without_links(text: str) -> str:
    """Return a text with the words of its links to lessons and tasks in place of the links."""
    return LINK.sub(lambda link: link['text'] if link['name'] or link['task'] else link[0], text)


def slug_of_myst(heading: str) -> str:
    """Return what MyST, which makes the site, calls a heading in the address of a page."""
    return re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-')


def with_slugs(text: str) -> str:
    """Return a text whose links to tasks are as MyST, which makes the site, calls headings."""

    def written(link: re.Match) -> str:
        if not link['task']:
            return link[0]
        return link[0].replace(link['task'], f'#{slug_of_myst(link["task"][1:])}')

    return LINK.sub(written, text)


def links_to_tasks(text: str) -> list[str]:
    """Return the targets of the links to tasks of the same notebook."""
    return [link['task'] for link in LINK.finditer(text) if link['task'] and not link['name']]


def bare_mentions(text: str) -> Iterator[str]:
    """Yield what calls a lesson or a task by its number outside a link, where no tool follows."""
    yield from BARE.findall(ANY_LINK.sub('[]()', text))


def write_numbers(lesson: Lesson) -> None:
    """Write the number of a lesson into its title, and the place of each task into its heading."""
    if lesson.cells:
        opening = lesson.cells[0]
        opening.source = re.sub(r'^# \d\d ', f'# {lesson.number} ', opening.source)
    for number, task in enumerate(lesson.tasks, 1):
        old, task.number = heading_of(task), number
        task.heading.source = task.heading.source.replace(old, heading_of(task), 1)


def write_next(lesson: Lesson, following: Lesson | None) -> None:
    """Let a notebook lead to the next one: where its link stands, or at its end."""
    cells = [cell for cell in lesson.cells if cell.cell_type == 'markdown']
    cell = next((cell for cell in cells if NEXT.search(cell.source)), cells[-1] if cells else None)
    if cell:
        rest = NEXT.sub('', cell.source)
        cell.source = f'{rest}\n\nNext: {following.next_link}' if following else rest
