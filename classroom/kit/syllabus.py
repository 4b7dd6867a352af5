"""`make syllabus`: what a study programme wants to know of this course, made from the lessons.

The goals that can be examined and the weeks are in course.yaml; titles, hours, what a student does
and what a lesson needs are those of the notebooks.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

import yaml

from helpers.lesson import ROOT, Lesson, lessons

COURSE = Path(__file__).with_name('course.yaml')
# Verbs of what one can see a student do: not "know", "understand", "learn about".
VERBS = {
    *('change', 'check', 'choose', 'compare', 'compute', 'decide', 'declare', 'define', 'diagnose'),
    *('distinguish', 'explain', 'fill', 'bring', 'inspect', 'install', 'justify', 'match'),
    *('measure', 'mend', 'predict', 'protect', 'record', 'show', 'start', 'use', 'write'),
}
LINK = re.compile(r'\[([^\]]+)\]\([^)]*\)')
CLASS_HOURS, UNIT_MINUTES = 1.5, 90


def course() -> dict:
    """Return the weeks and the goals. Raises ValueError if they do not fit the lessons."""
    found = yaml.safe_load(COURSE.read_text(encoding='utf-8'))
    known = {one.name for one in lessons() if one.tasks}
    planned = {
        name for week in found['weeks'] for part in ('class', 'home') for name in week.get(part, ())
    }
    if unknown := (planned | {*found['goals']}) - known:
        raise ValueError(
            f'There is no lesson called {", ".join(sorted(unknown))}: look at course.yaml.'
        )
    if missing := known - {*found['goals']}:
        raise ValueError(f'course.yaml has no goals of {", ".join(sorted(missing))}.')
    for name, goals in found['goals'].items():
        for goal in goals:
            if goal.split()[0].rstrip(',') not in VERBS:
                raise ValueError(f'A goal of {name} begins with no verb of VERBS: {goal!r}.')
    return found


def plain(text: str) -> str:
    """Return a text without its links."""
    return LINK.sub(r'\1', text)


def needs(lesson: Lesson) -> str:
    """Return what the opening says that one needs."""
    for cell in lesson.cells:
        if found := re.search(r'^\*\*You need\*\*:? (.+)$', cell.source, re.MULTILINE):
            return plain(found[1])
    return ''


def syllabus(folder: Path = ROOT / 'notebooks') -> str:
    """Return it as Markdown."""
    found = course()
    by_name = {one.name: one for one in lessons(folder) if one.tasks}
    planned = {
        n: None for week in found['weeks'] for n in [*week.get('class', ()), *week.get('home', ())]
    }
    minutes = sum(by_name[name].minutes for name in planned)
    weeks = len(found['weeks'])
    lines = ['# Programming robots with ROS 2', '']
    lines += [
        'Students write nodes, packages and a whole robot program with ROS 2 Jazzy in Python. They '
        'predict what a system of programs does, measure it, explain the difference, and mend '
        'faults by evidence.',
        '',
        f'- **Extent**: {weeks} weeks with {UNIT_MINUTES} minutes in class '
        f'({weeks * CLASS_HOURS:.0f} hours). The lessons of the plan need {minutes / 60:.0f} hours '
        'at the pace of a newcomer, in class and at home; what the exam takes is yours to add.',
        f'- **Prerequisites**: {needs(by_name["publish_and_subscribe"])}',
        '- **Work**: each lesson has tasks that are checked at once; what is solved is handed in.',
        '- **Examination**: robots with faults, found and mended by evidence; a robot program, '
        'judged by machine and by a person (see the rubric).',
        '',
        '## Weeks',
        '',
        '| week | in class | at home |',
        '|---|---|---|',
    ]
    for number, week in enumerate(found['weeks'], 1):
        cells = [
            ', '.join(f'{by_name[n].number} {by_name[n].title}' for n in week.get(part, ()))
            for part in ('class', 'home')
        ]
        if 'exam' in week:
            cells = [f'Exam: {week["exam"]}', '']
        lines.append(f'| {number} | {cells[0]} | {cells[1]} |')
    lines += ['', '## Lessons', '']
    for name, lesson in by_name.items():
        where = '' if name in planned else ', beyond the plan'
        lines += [
            f'### {lesson.number} {lesson.title} ({lesson.minutes} minutes{where})',
            '',
            f'Needs: {needs(lesson)}',
            '',
            'After this lesson a student can:',
            '',
            *(f'- {goal}' for goal in found['goals'][name]),
            '',
        ]
    return '\n'.join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(prog='make syllabus', description=__doc__)
    parser.add_argument('--output', type=Path, default=ROOT / 'handout/syllabus.md')
    options = parser.parse_args(arguments)
    try:
        text = syllabus()
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    options.output.parent.mkdir(parents=True, exist_ok=True)
    options.output.write_text(text, encoding='utf-8')
    print(options.output)
    return 0


if __name__ == '__main__':
    sys.exit(main())
