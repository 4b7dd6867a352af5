"""What a lesson is, read from its notebook. Nothing else in Python reads a notebook as a lesson.

    for task in read(path.read_text(), path.name).tasks:
        print(task.number, task.name, task.title, task.star)

The grammar of a lesson:

    file       `02_lose_messages.ipynb`: the number is its place today, `lose_messages` its name for
               ever. 00 is the start, 99 the glossary, and neither is a lesson.
    opening    the first cell: `# 02 Lose messages`, `**Time** 40 minutes`, `**At the end you can**`
    step       a cell of text that begins with `## 1. ...`
    task       below a heading `### ✎ Task 3: ...`, or `### ✎ Task 3 ★: ...` if it may be left out,
               code cells with the tags `exercise`, `check`, `solution`. The check is the line
               `check('be_the_queue', MyQueue)`: this name, which is that of its judge, is the
               task's name for ever. Its number is its place. The solution begins with
               `%%solution be_the_queue`.
    guess      a code cell with the tag `predict` that ends in `my_guess = guess('How many?', ...)`
    memory     below `## From memory` a cell `remember(one_name=..., other_name=...)`
    question   a cell of text that begins with `### Question `
    note       a raw cell with the tag `notes` that begins with `For the instructor: 4 minutes`; the
               first one also says `Part: nodes`, and perhaps `When time runs out, leave out: ...`
    workspace  `Workspace('lose_messages')`
    magic      `%%write PATH`, or `%%write PATH part 2`, writes the rest of a code cell to a file of
               the workspace; `%%terminal`, or `%%terminal NAME`, runs it there
    mention    a link: `[lesson 05](05_keep_what_is_fresh.ipynb)`, `[task 3](#✎-Task-3:-A-driver)`.
               `with_mentions` writes the numbers of today into it.

    cells      cells of a notebook, also of one that a student has changed, and their tags
    lesson     `Lesson`, `Task`, `Guess`
    files      the notebooks of a folder, and those that somebody names
    mentions   how texts mention lessons and tasks
    messages   the messages of errors that a lesson makes or names
    moved      tasks and guesses that have moved to another lesson
    earlier    the names of tasks that version 0.3 knew by their numbers
"""

from helpers.lesson.cells import (
    FOLD,
    Magic,
    Node,
    called,
    cells_of,
    first_heading,
    has_heading,
    is_folded,
    is_for_instructors,
    is_question,
    keep_solution,
    kept_solution,
    magic_of,
    path_and_part,
    tags,
)
from helpers.lesson.earlier import earlier_name
from helpers.lesson.files import (
    FOLDER,
    PICTURES,
    ROOT,
    chosen,
    chosen_tasks,
    lessons,
    outline,
    outlines,
    path_of,
    paths,
    read,
)
from helpers.lesson.lesson import (
    CHECK_BEGINS,
    FOLDED,
    GLOSSARY,
    NOTE,
    PARTS,
    START,
    TAGS,
    TASK,
    WRITTEN,
    Guess,
    Lesson,
    Task,
    beside_time,
    check_call,
    code_of_solution,
    compares,
    guess_of,
    is_check,
    is_solution,
    minutes_of_note,
    name_of_solution,
    names_of_memory,
    starts_memory,
    step_number,
)
from helpers.lesson.mentions import (
    bare_mentions,
    links_to_tasks,
    slug_of_myst,
    with_mentions,
    with_slugs,
    without_links,
    write_next,
    write_numbers,
)
from helpers.lesson.messages import Message, messages
from helpers.lesson.moved import home_of_cell, home_of_guess, home_of_task

__all__ = [
    'CHECK_BEGINS',
    'FOLD',
    'FOLDED',
    'FOLDER',
    'GLOSSARY',
    'NOTE',
    'PARTS',
    'PICTURES',
    'ROOT',
    'START',
    'TAGS',
    'TASK',
    'WRITTEN',
    'Guess',
    'Lesson',
    'Magic',
    'Message',
    'Node',
    'Task',
    'bare_mentions',
    'beside_time',
    'called',
    'cells_of',
    'check_call',
    'chosen',
    'chosen_tasks',
    'code_of_solution',
    'compares',
    'earlier_name',
    'first_heading',
    'guess_of',
    'has_heading',
    'home_of_cell',
    'home_of_guess',
    'home_of_task',
    'name_of_solution',
    'is_check',
    'is_folded',
    'is_for_instructors',
    'is_question',
    'is_solution',
    'keep_solution',
    'kept_solution',
    'lessons',
    'links_to_tasks',
    'magic_of',
    'messages',
    'minutes_of_note',
    'names_of_memory',
    'outline',
    'outlines',
    'path_and_part',
    'path_of',
    'paths',
    'read',
    'slug_of_myst',
    'starts_memory',
    'step_number',
    'tags',
    'with_mentions',
    'with_slugs',
    'without_links',
    'write_next',
    'write_numbers',
]
