"""What is judged, one file for a student and a lesson, so that a second run goes on."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from pathlib import Path

from classroom.grade import limits
from classroom.grade.answers import SEED, Answers, Handed
from classroom.grade.judge import ENDLESS, LIMIT_MET
from classroom.grade.runner import LATE, Said
from classroom.grade.source import code_only
from classroom.grade.uses import digest_of_uses
from classroom.handout import lesson_for_students
from helpers.checks.verdict import verdict_in
from helpers.lesson import ROOT, Task, tags
from tools.lessons.clean import text_of

TAKES_STARTER = 'its check also takes the starter: what judges was changed. Read the answers'
FORM = 6  # of the files
INTERRUPTED = re.compile(r'Interrupted after (\d+) s\.')  # as judge.py says it
UNKNOWN = re.compile(r"NameError: name '(\w+)' is not defined")
FILE = re.compile(r'\((\d+\.py|<tokenize>), line')  # a cell of a kernel is no file for a reader
EMPTY = '{"cells": [], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}'
CELL_S = 100.0  # as `make notebooks` gives a cell


@dataclass
class Outcome:
    """What became of a task. `met` of `of` points of its check; `why` if there is no verdict."""

    solved: bool = False
    met: int = 0
    of: int = 0
    why: str = ''
    forged: bool = False  # what judges was changed
    did: list[str] = field(default_factory=list)  # by the student's code, and no answer needs it


@dataclass
class Result:
    """A lesson of a student, judged: its tasks by their names, and the outputs of their cells."""

    digest: str
    tasks: dict[str, Outcome] = field(default_factory=dict)
    outputs: dict[str, list[dict]] = field(default_factory=dict)
    minutes: float = 0.0
    trouble: str = ''
    form: int = FORM


def digest_of(handed: Handed, answers: Answers, files: dict[str, bytes]) -> str:
    """Return what changes if an answer, the lesson or what judges it does."""
    digest = hashlib.sha256()
    code = [cell for cell in handed.cells if cell.cell_type == 'code']
    for part in (
        digest_of_uses(ROOT, handed.module, [cell.source for cell in code]),
        [[cell.id, code_only(cell.source)] for cell in code],
        sorted(answers.sources.items()),
        sorted(answers.looks.items()),
        answers.seed,
        [[name, hashlib.sha256(data).hexdigest()] for name, data in sorted(files.items())],
    ):
        digest.update(json.dumps(part).encode())
    return digest.hexdigest()


def job_of(
    handed: Handed, answers: Answers, files: dict[str, bytes], cell_s: float = CELL_S
) -> dict | None:
    """Return what `judge` runs, or None if the student has written nothing.

    The cells after the last task with an answer are left out: no verdict depends on them.
    """
    of_cell = {}
    for task in handed.tasks.values():
        for kind in ('exercises', 'checks', 'solutions'):
            of_cell |= {cell.id: (kind[:-1], task.name) for cell in getattr(task, kind)}
    wanted = [task for task in handed.tasks.values() if files or answers.changed(task)]
    if not wanted:
        return None
    cells, last = [], 0
    for cell in handed.cells:
        if cell.cell_type != 'code':
            continue
        kind, task = of_cell.get(cell.id, ('', ''))
        for count, look in enumerate(answers.looks.get(cell.id, ())):
            cells.append({'id': f'{cell.id}-look-{count}', 'source': look, 'kind': '', 'task': ''})
        one = {'id': cell.id, 'source': cell.source, 'kind': kind, 'task': task}
        if kind == 'exercise':
            one |= {'source': answers.sources.get(cell.id, cell.source), 'starter': cell.source}
        elif answers.seed:
            one['source'] = SEED.sub(f'SEED = {answers.seed}', cell.source)
        cells.append(one)
        if task == wanted[-1].name and 'check' in tags(cell):
            last = len(cells)
    encoded = {name: base64.b64encode(data).decode() for name, data in files.items()}
    return {
        'cells': cells[:last],
        'lesson': edition_of(handed),
        'module': handed.module,
        'files': encoded,
        'overlay': [
            name for name, task in handed.tasks.items() if files and not answers.changed(task)
        ],
        'answered': [task.name for task in wanted],
        'cell_s': cell_s,
    }


def edition_of(handed: Handed) -> dict[str, str]:
    """Return the lesson as the helpers need it beside the kernel: without notes and solutions."""
    notebook = lesson_for_students(deepcopy(handed.lesson.notebook), {'notes', 'solution'})
    # By a lesson 00 the helpers know that the lessons are here.
    first = {'00_no_lesson.ipynb': EMPTY} if not handed.lesson.file.startswith('00_') else {}
    return {handed.lesson.file: text_of(notebook), **first}


def result_of(
    handed: Handed, answers: Answers, files: dict[str, bytes], said: Said, digest: str
) -> Result:
    """Return the result of what `judge` said."""
    cells = {cell.id for task in handed.tasks.values() for cell in (*task.exercises, *task.checks)}
    outputs = {id: found for id, found in said.outputs.items() if id in cells}
    result = Result(digest, outputs=outputs, minutes=said.seconds / 60, trouble=said.trouble)
    for name, task in handed.tasks.items():
        outcome = Outcome()
        if not files and not answers.changed(task):
            outcome.why = 'not answered'
        elif name in said.given_up:
            outcome.why = said.given_up[name]
        else:
            found = [_verdict(name, outputs.get(cell.id, [])) for cell in task.checks]
            if found and all(found):
                outcome.solved = all(one['solved'] is True for one in found)
                points = [point for one in found for point in one['points']]
                outcome.met, outcome.of = sum(p.get('ok') is True for p in points), len(points)
                outcome.why = next((str(one['note'])[:200] for one in found if 'note' in one), '')
            else:
                outcome.why = _error(task, outputs) or said.trouble or 'no verdict'
        if name in said.canaries:
            outcome.solved, outcome.why, outcome.forged = False, TAKES_STARTER, True
        elif name in said.forged:
            outcome.solved, outcome.forged = False, True
            outcome.why = f'{said.forged[name]}. Read the answers'
        outcome.did = sorted(said.did.get(name, ()))
        result.tasks[name] = outcome
    return result


def _verdict(task: str, outputs: list[dict]) -> dict | None:
    """Return the one verdict of a check's outputs. If there are two, one is forged: none counts."""
    found = []
    for output in outputs:
        data = verdict_in(output)
        if data is not None:
            points = data.setdefault('points', [])
            if not isinstance(points, list) or not all(isinstance(p, dict) for p in points):
                return None
            found.append(data)
    if len(found) != 1 or found[0].get('task') != task or found[0].get('of') != 'answer':
        return None
    data = found[0]
    met = bool(data['points']) and all(point.get('ok') is True for point in data['points'])
    return data | {'solved': data.get('solved') is True and met}


def _error(task: Task, outputs: dict[str, list[dict]]) -> str:
    """Return the error of a task's own cells, or else that of its check."""
    for cell in (*task.exercises, *task.checks):
        whose = 'its check' if cell in task.checks else 'its cell'
        for output in outputs.get(cell.id, []):
            text = str(output.get('text', ''))
            for limit in limits.NOTICED:
                if LIMIT_MET.format(limit) in text:
                    return f'{whose} {limit}'
            if ENDLESS in text:
                return f'{whose} printed without end'
            if late := INTERRUPTED.search(text):
                return f'{whose} did not end in {late[1]} s'
            if output.get('output_type') == 'error':
                said = f'{output.get("ename")}: {output.get("evalue")}'.strip(': ').splitlines()[0]
                unknown = UNKNOWN.match(said)
                if unknown and cell in task.checks:
                    return f'its cell defines no {unknown[1]}'
                for limit, pattern in limits.ERRORS.items():
                    if pattern.search(said):
                        return f'{whose} {limit}'
                return f'{whose} ended with {FILE.sub("(line", said)[:200]}'
    return ''


class Kept:
    """The results of earlier runs, in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def get(self, key: str, digest: str, limit_min: float) -> Result | None:
        """Return the result of this student and lesson, if it is that of the same answers.

        One whose time was over counts if it had as much time as now.
        """
        try:
            data = json.loads((self._folder / f'{key}.json').read_text(encoding='utf-8'))
            if (data['form'], data['digest']) != (FORM, digest):
                return None
            tasks = {name: Outcome(**task) for name, task in data['tasks'].items()}
            result = Result(**(data | {'tasks': tasks}))
            too_short = result.trouble.startswith(LATE) and result.minutes < limit_min * 0.99
            return None if too_short else result
        except (OSError, ValueError, LookupError, TypeError):
            return None

    def put(self, key: str, result: Result) -> None:
        path = self._folder / f'{key}.json'
        new = path.with_suffix('.new')
        new.write_text(json.dumps(asdict(result)), encoding='utf-8')
        new.replace(path)
