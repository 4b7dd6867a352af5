"""An exam of robots with faults that no student has on a disk.

    make exam FAULTS=~/exam_faults STUDENTS=students.csv SEED=4711     what students get
    make exam FAULTS=~/exam_faults STUDENTS=students.csv SEED=4711 FOLDER=submissions     and judged

FAULTS is a private folder: each folder in it is a fault, with a `fault.yaml` as in helpers/faults,
of the same healthy robot (CONTRIBUTING.md says how one is written). STUDENTS has a line for each
student, `number,name`. From SEED and the number follows which faults a student gets.

For each student there is an archive: the packages of robots, built as they are by `colcon build`,
and `answers.yaml` to fill in. Nothing in it names a fault, and no file of FAULTS is in it. What
comes back is judged as text, and nothing of it runs: the kind, and whether the line of the command
is evidence. How a robot was mended stands beside it as a difference, for the talk with the student.
"""

from __future__ import annotations

import argparse
import csv
import difflib
import io
import random
import re
import sys
import tarfile
from dataclasses import dataclass
from pathlib import Path

import yaml

from classroom.grade.submissions import ARCHIVES, Submission, submissions_of, workspace_files
from classroom.grade.tables import harmless, text_of
from helpers.faults import FAULTS, FILE, KINDS, NAME, Fault, read

ROBOTS = ('uma', 'vic', 'wim', 'xia', 'yuri', 'zoe')
EACH = 3
GIVEN = re.compile(r'(\d{3,})(?: ?\(\d+\))?\.tar\.gz')  # a browser may add a number
ANSWERS = 'answers.yaml'
HEAD = """\
# What is wrong with each robot? The kinds are: {kinds}.
# `command` is one that you ran, `line` a line that it printed, which a good robot does not print.
"""


@dataclass(frozen=True)
class Student:
    number: str
    name: str


def faults_of(folder: Path) -> dict[str, Fault]:
    """Return the faults of a private folder. Raises ValueError with one sentence."""
    folder = folder.expanduser()
    found = {path.parent.name: read(path.parent) for path in sorted(folder.glob(f'*/{FILE}'))}
    if not found:
        raise ValueError(f'There is no fault in {folder}: a folder with a {FILE} is one.')
    if known := found.keys() & FAULTS.keys():
        raise ValueError(f'Students have these on their disks: {", ".join(sorted(known))}.')
    for fault in found.values():
        _ = fault.files  # raises ValueError if an edit does not fit
    return found


def students_of(file: Path) -> list[Student]:
    """Return the students of a file. Raises ValueError with one sentence."""
    rows = [row for row in csv.reader(file.read_text(encoding='utf-8-sig').splitlines()) if row]
    found = [Student(row[0].strip(), (row[1] if len(row) > 1 else '').strip()) for row in rows]
    found = [one for one in found if one.number.isdecimal()]
    if not found or len({one.number for one in found}) < len(found):
        raise ValueError(f'{file} has no lines such as `17,Ada Lovelace`, or a number twice.')
    return found


def drawn(faults: dict[str, Fault], seed: str, number: str) -> dict[str, Fault]:
    """Return the robots of a student, by their names: the same for the same seed and number."""
    names = random.Random(f'{seed} {int(number)}').sample(sorted(faults), min(EACH, len(faults)))
    return {robot: faults[name] for robot, name in zip(ROBOTS, names, strict=False)}


def package(fault: Fault, robot: str) -> dict[str, str]:
    """Return the files of a robot's package as a student gets them."""
    return {
        path.replace(NAME, robot): text.replace(NAME, robot) for path, text in fault.files.items()
    }


def archive(faults: dict[str, Fault], seed: str, number: str) -> bytes:
    """Return what a student gets."""
    robots = drawn(faults, seed, number)
    empty = {robot: {'kind': '', 'command': '', 'line': ''} for robot in robots}
    head = HEAD.format(kinds=', '.join(KINDS))
    files = {ANSWERS: head + yaml.safe_dump(empty, sort_keys=False)}
    for robot, fault in robots.items():
        if fault.installed:
            raise ValueError(f'{fault.name} is an old build, which no archive can bring.')
        files |= {f'src/{robot}/{path}': text for path, text in package(fault, robot).items()}
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode='w:gz') as tar:
        for path, text in files.items():
            content = text.encode()
            info = tarfile.TarInfo(f'exam/{path}')
            info.size = len(content)
            tar.addfile(info, io.BytesIO(content))
    return data.getvalue()


def judged(fault: Fault, robot: str, answer: object) -> tuple[int, int, str]:
    """Return whether the kind is right and the line is evidence, and a sentence."""
    answer = answer if isinstance(answer, dict) else {}
    kind, command, line = (
        ' '.join(str(answer.get(key) or '').split()) for key in ('kind', 'command', 'line')
    )
    is_kind = kind in (fault.kind, *fault.also)
    proves = bool(line) and any(
        re.search(pair.command.replace(NAME, robot), command)
        and re.search(pair.line.replace(NAME, robot), line)
        for pair in fault.evidence
    )
    if not (kind or command or line):
        return 0, 0, 'not answered'
    wrong = [] if is_kind else [f'{kind or "nothing"!r} is not its kind']
    wrong += [] if proves else ['this line is no evidence']
    return int(is_kind), int(proves), '; '.join(wrong)


def difference(fault: Fault, robot: str, files: dict[str, bytes]) -> str:
    """Return what a student has changed in a robot's package."""
    given, lines = package(fault, robot), []
    for path, text in sorted(given.items()):
        now = files.get(f'{robot}/{path}', text.encode()).decode(errors='replace')
        lines += difflib.unified_diff(
            text.splitlines(), now.splitlines(), path, path, '', '', 1, ''
        )
    return '\n'.join(lines)


def handed_in(one: Submission) -> tuple[dict, dict[str, bytes], list[str]]:
    """Return the answers and the files of a submission, and what cannot be read of it."""
    answers, files, said = {}, {}, []
    for file in one.files:
        try:
            if file.name.lower().endswith(ARCHIVES):
                files |= workspace_files(file)
            elif file.name.endswith(ANSWERS):
                files[ANSWERS] = file.read()
        except (OSError, ValueError) as why:
            said.append(f'{file.name} cannot be read: {why}')
    for path, data in files.items():
        if path.rpartition('/')[2] == ANSWERS:
            try:
                found = yaml.safe_load(data)
            except (yaml.YAMLError, UnicodeDecodeError, RecursionError):
                said.append(f'{ANSWERS} is no YAML')
                continue
            answers = found if isinstance(found, dict) else {}
    # The archive that students get begins with `exam`.
    return answers, {path.removeprefix('exam/src/'): data for path, data in files.items()}, said


def judge(folder: Path, faults: dict[str, Fault], students: list[Student], seed: str) -> list[list]:
    """Return a table: a row for each robot of each student."""
    found, _ = submissions_of(folder)
    table = [['number', 'name', 'robot', 'fault', 'kind', 'evidence', 'said', 'mend']]
    for student in students:
        same = [one for one in found if number_of(one) == int(student.number)]
        answers, files, said = handed_in(same[0]) if same else ({}, {}, ['nothing is handed in'])
        for robot, fault in drawn(faults, seed, student.number).items():
            kind, proves, why = judged(fault, robot, answers.get(robot))
            sentences = '; '.join(filter(None, [*said, why]))
            mend = difference(fault, robot, files)
            row = [student.number, student.name, robot, fault.name, kind, proves, sentences, mend]
            table.append([harmless(str(one)) for one in row])
    return table


def number_of(one: Submission) -> int | None:
    """Return the number of a student: that of the archive which the student got, if it is kept.

    Else it is the number in Moodle or Canvas, or that in the name of a file.
    """
    names = [GIVEN.fullmatch(file.name.rpartition('/')[2]) for file in one.files]
    found = [match[1] for match in names if match] + re.findall(r'\d+', one.number or one.name)
    return int(found[0]) if found else None


def main(arguments: list[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(prog='make exam', description='Draw an exam, and judge it.')
    parser.add_argument('--faults', type=Path, required=True, help='the private folder')
    parser.add_argument('--students', type=Path, required=True, help='lines `number,name`')
    parser.add_argument('--seed', required=True)
    parser.add_argument('--folder', type=Path, help='what was handed in')
    parser.add_argument('--output', type=Path, default=Path('exam'))
    options = parser.parse_args(arguments)
    try:
        faults, students = faults_of(options.faults), students_of(options.students)
        options.output.mkdir(parents=True, exist_ok=True)
        if options.folder:
            table = judge(options.folder, faults, students, options.seed)
            (options.output / 'judged.csv').write_text(text_of(table), encoding='utf-8')
            print(options.output / 'judged.csv')
            return 0
        key = [['number', 'name', 'robot', 'fault', 'what is wrong', 'seen by', 'its line']]
        for student in students:
            data = archive(faults, options.seed, student.number)
            (options.output / f'{int(student.number):03}.tar.gz').write_bytes(data)
            for robot, fault in drawn(faults, options.seed, student.number).items():
                seen = [one.replace(NAME, robot) for one in (fault.look, fault.line)]
                key.append([student.number, student.name, robot, fault.name, fault.broken, *seen])
        (options.output / 'key.csv').write_text(text_of(key), encoding='utf-8')
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f'{options.output}: {len(students)} archives, and key.csv, which is yours alone')
    return 0


if __name__ == '__main__':
    sys.exit(main())
