"""`make grade FOLDER=submissions`: see this package's docstring."""

from __future__ import annotations

import argparse
import sys
import threading
import zipfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

from classroom.grade import alike, tables
from classroom.grade.answers import Answers, Handed, answers_of, handed_out, lesson_of
from classroom.grade.feedback import feedback
from classroom.grade.limits import CPUS
from classroom.grade.marking import Marking
from classroom.grade.results import Kept, Result, digest_of, job_of, result_of
from classroom.grade.runner import Container, Said, Trusted, Where, run
from classroom.grade.submissions import ARCHIVES, Submission, submissions_of, workspace_files
from helpers.lesson import FOLDER, Node, cells_of, chosen

LIMIT_MIN = 20.0
DID = 'its code did what no answer needs:'
DIFFERED = 'it failed beside the other answers, and passed when it was judged alone: it counts'
# What mod/assign/feedback/offline/locallib.php skips: grades that are newer in Moodle.
TO_MOODLE = (
    'Moodle: first moodle.csv (Upload grading worksheet), then feedback.zip. For a second '
    'moodle.csv tick "Allow updating records that have been modified more recently in Moodle than '
    'in the spreadsheet", or Moodle skips them.'
)
NO_WORKSHEET = (
    'No grading worksheet of Moodle lies beside the submissions: moodle.csv counts to {most}, so '
    'the maximum grade in Moodle must be {most}, too.'
)
HIDDEN = (
    'Canvas takes no grades of anonymous students from a file: type those of grades.csv in '
    'SpeedGrader, or post the grades, which shows the names, and download again. These are {names}.'
)
FOREIGN = (
    '{name} is a grading worksheet in another language than English. Choose English in Moodle, and '
    'download it again: Moodle takes it back in that language only.'
)
# A browser, or a system that hides endings, adds one.
NOTEBOOKS = ('.ipynb', '.ipynb.txt', '.ipynb.json', '.json')


@dataclass
class Work:
    """A student's submission as it is read: answers and files for each lesson."""

    row: tables.Row
    answers: dict[str, Answers] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)
    paths: dict[str, str] = field(default_factory=dict)  # of the notebooks, in the download


@dataclass
class Read:
    """A notebook of a student."""

    path: str
    cells: list[Node]
    lesson: Handed | None


def read(student: Submission, known: list[Handed]) -> tuple[Work, list[Read]]:
    """Return what can be read of a submission, with one sentence for each file that cannot."""
    work, notebooks, others = Work(tables.Row(student)), [], []
    said = work.row.said

    def take(path: str, data: bytes) -> None:
        cells = cells_of(data)
        notebooks.append(Read(path, cells, lesson_of(cells, known)))

    for file in student.files:
        name = file.name.lower()
        try:
            if name.endswith(NOTEBOOKS):
                take(file.path, file.read())
            elif name.endswith(ARCHIVES):
                for inside, data in workspace_files(file).items():
                    if inside.endswith(NOTEBOOKS):
                        # What goes back has a name of the download: so its owner is known.
                        take(f'{file.path}-{Path(inside).name}', data)
                    else:
                        work.files[inside] = data
            elif name:
                others.append(Path(file.name).name)
        except (OSError, RuntimeError, NotImplementedError, ValueError, zipfile.BadZipFile) as why:
            said.append(f'{file.name} cannot be read: {why}')
    for one in notebooks:
        if one.lesson is None:
            said.append(f'{Path(one.path).name} is no lesson of this course')
    if not notebooks and not said:
        said.append(', but '.join(['no notebook', *(', '.join(others[:3]) for _ in others[:1])]))
    return work, [one for one in notebooks if one.lesson]


def choose(work: Work, notebooks: list[Read], wanted: list[Handed]) -> None:
    """Take for each lesson the notebook with the most answers, and say what is left out."""
    best: dict[str, tuple[int, Answers]] = {}
    said = work.row.said
    for one in notebooks:
        lesson = one.lesson
        if lesson not in wanted:
            said.append(f'{Path(one.path).name} is lesson {lesson.lesson.number}, not asked for')
            continue
        answers = answers_of(one.cells, lesson)
        count = sum(map(answers.changed, lesson.tasks.values()))
        name = lesson.lesson.name
        twice = name in best
        if name not in best or count >= best[name][0]:
            best[name] = count, answers
            work.paths[name] = one.path
        if twice:
            which = Path(work.paths[name]).name
            said.append(f'lesson {lesson.lesson.number} is there twice: {which} counts')
    for name, (_, answers) in best.items():
        work.answers[name] = answers
        said += answers.said
    for lesson in wanted:
        if notebooks and lesson.lesson.name not in best:
            said.append(f'lesson {lesson.lesson.number} is not there')


def judge_all(
    works: list[Work], wanted: list[Handed], kept: Kept, where: Where, options: object
) -> int:
    """Judge what is not judged yet, and print a line for each student. Return how many failed."""
    writing = threading.Lock()
    failed = 0

    def one(work: Work) -> None:
        try:
            judge_one(work)
        except Exception as error:  # whatever is wrong with one, the others are judged
            fail(work, f'it could not be judged: {type(error).__name__}: {error}')

    def fail(work: Work, why: str) -> None:
        nonlocal failed
        with writing:
            failed += 1
            work.row.said.append(why)
            print(f'{work.row.student.name}: {"; ".join(work.row.said)}', flush=True)

    def judge_one(work: Work) -> None:
        student, lines = work.row.student, []
        for lesson in wanted:
            number, name = lesson.lesson.number, lesson.lesson.name
            answers = work.answers.get(name)
            if answers is None:
                continue
            if options.seed:
                answers.seed = options.seed
            key = f'{student.key}-{lesson.lesson.name}'
            digest = digest_of(lesson, answers, work.files)
            anew = is_named(student, options.retry)
            result, again = None if anew else kept.get(key, digest, options.limit), ''
            if result is None:
                job = job_of(lesson, answers, work.files)
                said = run(job, where, options.limit * 60) if job else Said()
                if said.is_ours:
                    fail(work, said.trouble)
                    return
                result = result_of(lesson, answers, work.files, said, digest)
                trouble = judge_again(lesson, answers, work.files, result, where, options.limit)
                if trouble:
                    fail(work, trouble)
                    return
                kept.put(key, result)
            else:
                again = ', judged before'
            work.row.results[name] = result
            if all(outcome.why == 'not answered' for outcome in result.tasks.values()):
                work.row.said.append(f'nothing is written in lesson {number}')
            if result.trouble:
                work.row.said.append(result.trouble)
            for task, outcome in result.tasks.items():
                told = not outcome.of or outcome.forged or outcome.why == DIFFERED
                if outcome.why not in ('', 'not answered', result.trouble) and told:
                    work.row.said.append(f'task {lesson.tasks[task].number}: {outcome.why}')
                if outcome.did:
                    place, did = lesson.tasks[task].number, ', '.join(outcome.did)
                    work.row.said.append(f'task {place}: {DID} {did}. Read the answers')
            marking = options.marking
            work.row.points = round(work.row.points + marking.points(lesson, result), 2)
            lines.append(f'lesson {number}: {marking.said(lesson, result)}{again}')
        with writing:
            print(f'{student.name}: {"; ".join([*lines, *work.row.said])}', flush=True)

    with ThreadPoolExecutor(options.jobs) as pool:
        try:
            for _ in pool.map(one, works):
                pass
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            where.stop()
            raise
    return failed


def is_named(student: Submission, names: str) -> bool:
    """Whether RETRY= names a student: by the name, a part of it, or the number."""
    wanted = [name.strip().casefold() for name in names.split(',') if name.strip()]
    return any(one in student.name.casefold() or one == student.number for one in wanted)


def judge_again(
    lesson: Handed,
    answers: Answers,
    files: dict[str, bytes],
    result: Result,
    where: Where,
    limit_min: float,
) -> str:
    """Judge each answer that has failed once more, alone, before it costs a point.

    The tasks before it are then as the lesson has them: neither another answer nor a busy machine
    takes a point away. If it passes now, it counts, and the table says that the two differ.
    Return why this could not be done, or nothing.
    """
    for name, task in lesson.tasks.items():
        outcome = result.tasks[name]
        if outcome.solved or outcome.forged or outcome.why == 'not answered':
            continue
        ids = {cell.id for cell in task.exercises}
        alone = replace(answers, sources={k: v for k, v in answers.sources.items() if k in ids})
        job = job_of(lesson, alone, files)
        if job is None:
            continue
        said = run(job, where, limit_min * 60)
        if said.is_ours:
            return said.trouble
        again = result_of(lesson, alone, files, said, result.digest)
        if again.tasks[name].solved:
            result.tasks[name] = replace(again.tasks[name], why=DIFFERED)
            cells = {cell.id for cell in (*task.exercises, *task.checks)}
            result.outputs |= {id: found for id, found in again.outputs.items() if id in cells}
        result.minutes += again.minutes
    return ''


def write(
    output: Path,
    works: list[Work],
    wanted: list[Handed],
    sheets: list[tables.Sheet],
    title: str,
    marking: Marking,
) -> tuple[list[str], list[str]]:
    """Write all tables and the feedback.

    Return the files with what could not be written, and what you do with them.
    """
    rows = [work.row for work in works]
    most = sum(map(marking.most, wanted))
    systems = {row.student.system for row in rows}
    said, then = [], []
    worksheet = next(filter(tables.is_moodle, sheets), None)
    tables.note_late(rows, worksheet)

    def put(name: str, text: str) -> None:
        (output / name).write_text(text, encoding='utf-8')
        said.append(name)

    put('grades.csv', tables.grades(rows, wanted, marking))
    if 'moodle' in systems:
        text, absent = tables.moodle(rows, most, worksheet)
        put('moodle.csv', text)
        for name in absent:
            print(
                f'{name} is not in {worksheet.name}, by number and name: write the grade yourself.'
            )
        then.append(TO_MOODLE)
        if worksheet is None:
            then.append(NO_WORKSHEET.format(most=f'{most:.10g}'))
    hidden = [row.student.name for row in rows if row.student.anonymous and not row.student.number]
    if hidden:
        then.append(HIDDEN.format(names=', '.join(hidden)))
    if any(row.student.system == 'canvas' and not row.student.anonymous for row in rows):
        sheet = next(filter(tables.is_canvas, sheets), None)
        try:
            put('canvas.csv', tables.canvas(rows, most, sheet, title))
        except ValueError as why:
            said.append(f'no canvas.csv: {why}')
    # Under the names of the download: so Moodle and Canvas know whose file it is.
    with zipfile.ZipFile(output / 'feedback.zip', 'w', zipfile.ZIP_DEFLATED) as archive:
        for work in works:
            for lesson in wanted:
                name = lesson.lesson.name
                if result := work.row.results.get(name):
                    text = feedback(lesson, work.answers[name], result, marking)
                    archive.writestr(work.paths[name], text)
    said.append('feedback.zip')
    table = [('lesson', 'task', 'students', 'what is alike', 'statements of their own')]
    for lesson in wanted:
        number, key = lesson.lesson.number, lesson.lesson.name
        students = [(w.row.student.name, w.answers[key]) for w in works if key in w.answers]
        for one in alike.alike(lesson, students):
            task, names = lesson.tasks[one.task].number, ', '.join(one.students)
            table.append((number, task, tables.harmless(names), one.how, one.statements))
            print(f'Alike: lesson {number}, task {task}: {names}: {one.how}')
    put('alike.csv', tables.text_of(table))
    return said, then


def main(arguments: list[str] | None = None, where: Where | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(description='Grade what students hand in.')
    parser.add_argument('folder', type=Path, help='the download: a folder, or a zip')
    parser.add_argument('--lesson', default='', help='which lessons are asked for: "02 03"')
    parser.add_argument('--output', type=Path, help='where the tables go: FOLDER_graded')
    parser.add_argument('--jobs', type=int, default=1, help='how many are judged at once')
    parser.add_argument('--trust', action='store_true', help='without a container, as you')
    parser.add_argument('--limit', type=float, default=LIMIT_MIN, help='minutes for a lesson')
    parser.add_argument('--cpus', type=float, default=CPUS, help='cores for one that is judged')
    parser.add_argument('--seed', default='', help='of a lesson that has one, for all students')
    parser.add_argument('--tasks', default='', help='only these give points: "a_driver 4"')
    parser.add_argument('--no-stars', action='store_true', help='tasks with ★ give no points')
    parser.add_argument('--partial', action='store_true', help='points for what a check has met')
    parser.add_argument('--weights', default='', help='of tasks: "a_driver=2 4=0.5"')
    parser.add_argument('--retry', default='', help='judge these students anew: names, by commas')
    parser.add_argument('--assignment', default='', help='its name or id in Canvas')
    parser.add_argument('--notebooks', type=Path, default=FOLDER, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    try:
        if options.jobs < 1 or not (options.seed or '0').isdecimal():
            raise ValueError('JOBS= is a number from 1 on, and SEED= is a number.')
        if not options.cpus > 0:
            raise ValueError('CPUS= is a number above 0, such as 2 or 0.5.')
        students, files = submissions_of(options.folder)
        if not students:
            raise ValueError(f'Nobody has handed in anything in {options.folder}.')
        sheets = [tables.read_sheet(file.name, file.read()) for file in files]
        for sheet in sheets:
            if tables.is_foreign(sheet, students):
                raise ValueError(FOREIGN.format(name=sheet.name))
        for is_sheet in (tables.is_moodle, tables.is_canvas):
            if len(same := [sheet.name for sheet in sheets if is_sheet(sheet)]) > 1:
                raise ValueError(
                    f'{" and ".join(same)} are of two assignments: each one has a folder of its '
                    'own, such as FOLDER=submissions_02.'
                )
        known = handed_out(options.notebooks, stars=not options.no_stars, only=options.tasks)
        reads = [read(student, known) for student in students]
        if options.lesson:
            names = {path.name for path in chosen(options.lesson, options.notebooks)}
            wanted = [one for one in known if one.lesson.file in names]
        else:
            count = Counter(one.lesson.lesson.file for _, found in reads for one in found)
            most = {name for name, _ in count.most_common(1)}
            wanted = [one for one in known if one.lesson.file in most]
        if not wanted:
            raise ValueError(f'There is no notebook of a lesson in {options.folder}.')
        if not any(one.counted for one in wanted):
            number = wanted[0].lesson.number
            raise ValueError(f'No task of lesson {number} would count: look at TASKS= and STARS=.')
        options.marking = Marking.of(options.weights, options.partial, wanted)
        if not sum(map(options.marking.most, wanted)) > 0:
            raise ValueError('All tasks that count have the weight 0: look at WEIGHTS=.')
        if options.retry and not any(is_named(one, options.retry) for one in students):
            raise ValueError(f'No student is called {options.retry}: look at RETRY=.')
        where = where or (Trusted if options.trust else Container)(options.cpus)
        if why := where.ready():
            raise ValueError(
                f'{why.rstrip(".")}; or TRUST=yes, which runs the code of students as you.'
            )
        name = options.folder.resolve()
        output = options.output or name.with_name(f'{name.stem}_graded')
        kept = Kept(output / 'judged')
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    works = [work for work, _ in reads]
    for work, notebooks in reads:
        choose(work, notebooks, wanted)
    for sheet in sheets:
        if not tables.is_moodle(sheet) and not tables.is_canvas(sheet):
            print(
                f'{sheet.name} is neither a grading worksheet of Moodle nor a gradebook of Canvas.'
            )
    title = options.assignment or wanted[0].lesson.title
    status = 0
    try:
        status = judge_all(works, wanted, kept, where, options) and 1
    except KeyboardInterrupt:
        print('Interrupted: the same command goes on from here.', file=sys.stderr)
        status = 130
        for work in works:
            if work.answers and not work.row.results and not work.row.said:
                work.row.said.append('not judged yet')
    said, then = write(output, works, wanted, sheets, title, options.marking)
    print(f'{output}: {", ".join(said)}', *then, sep='\n')
    return status


if __name__ == '__main__':
    sys.exit(main())
