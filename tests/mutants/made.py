"""The mutants of a solution, each once, what each is called, and a drawn part of them."""

from __future__ import annotations

import ast
import difflib
import functools
import random
import re
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from hashlib import blake2s

import libcst as cst
from support.answers import source_of

from helpers.lesson import magic_of
from mutants import files
from mutants.program import Program
from mutants.rules import RULES
from mutants.simple import SIMPLE

FRAME = 'class _:\n'  # around the part of a file that begins in a class
LOGGER = 'self.get_logger().'  # what it says is not what it does
HIDDEN = '_hidden_line_'  # in place of `!command`, while the rest is read as Python


@dataclass(frozen=True)
class Mutant:
    """A wrong answer: the rule that made it, its source, and the solution that it was."""

    rule: str
    source: str = field(repr=False)
    solution: str = field(repr=False)
    number: int = 0  # of those with the same rule, and the same lines around the change

    @property
    def difference(self) -> str:
        """The unified difference, with two lines around each change."""
        lines = (one.splitlines() for one in (self.solution, self.source))
        return '\n'.join(
            [*difflib.unified_diff(*lines, 'solution', self.rule, lineterm='', n=2)][2:]
        )

    @property
    def id(self) -> str:
        """Six characters that stay while the rule and the lines around the change do."""
        lines = (one.splitlines() for one in (self.solution, self.source))
        near = [*difflib.unified_diff(*lines, lineterm='', n=1)][2:]
        text = '\n'.join(line[0] + line[1:].strip() for line in near if not line.startswith('@@'))
        return blake2s(f'{self.rule} {self.number}\n{text}'.encode(), digest_size=3).hexdigest()


def mutants_of(solution: str, starters: Iterable[str], known: Iterable[str] = ()) -> list[Mutant]:
    """Return the mutants of a solution that differ, as programs, from it and from each other.

    They differ from `known` as well, answers that are judged anyway. What is no program is not
    among them.
    """
    seen = {_program(source) for source in (solution, *known)}
    found: dict[str, Mutant] = {}
    for rule, source in _made(solution, written_lines(solution, starters)):
        program = _program(source)
        if program is not None and program not in seen:
            seen.add(program)
            mutant, number = Mutant(rule, source, solution), 0
            while mutant.id in found:
                number += 1
                mutant = Mutant(rule, source, solution, number)
            found[mutant.id] = mutant
    return [*found.values()]


def drawn(mutants: list, count: int | None, seed: int) -> list:
    """Return so many of the mutants, in their order, or all: the same for the same seed."""
    if count is None or count >= len(mutants):
        return mutants
    places = random.Random(seed).sample(range(len(mutants)), count)
    return [mutants[place] for place in sorted(places)]


def same_program(one: str, other: str) -> bool:
    """Return whether two answers are the same, but for comments and spaces."""
    program = _program(one)
    return program is not None and program == _program(other)


def is_program(source: str) -> bool:
    """Return whether an answer has no syntax error, as far as it is Python."""
    return _program(source) is not None


def written_lines(solution: str, starters: Iterable[str]) -> set[int]:
    """Return the numbers, from 0, of the lines of a solution that are in no starter.

    A line of a starter is also given in a comment, which the learner only makes a line.
    """
    given = [_bare(line) for one in starters for line in one.splitlines()]
    lines = [_bare(line) for line in solution.splitlines()]
    matched = difflib.SequenceMatcher(None, given, lines, autojunk=False).get_matching_blocks()
    kept = {at for block in matched for at in range(block.b, block.b + block.size)}
    return {at for at, line in enumerate(lines) if line and at not in kept}


def _bare(line: str) -> str:
    """Return a line without indentation, and without the sign of a comment."""
    return re.sub(r'^\s*(#|//)?\s*', '', line).rstrip()


def entry_of(mutant: Mutant) -> tuple[str, str]:
    """Return the edit that makes this mutant of the solution, as tests/answers writes it.

    That is the smallest piece of the solution that is there once, and what stands in its place.
    """
    old, new = mutant.solution.splitlines(), mutant.source.splitlines()
    changes = [
        place
        for place in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes()
        if place[0] != 'equal'
    ]
    begin, end = changes[0][1], changes[-1][2]
    new_begin, new_end = changes[0][3], changes[-1][4]
    while True:
        lines = [old[begin:end], new[new_begin:new_end]]
        for narrow in (_without_common_ends, _from_to, _as_lines):
            texts = narrow(*lines)
            if texts[0] and _makes(mutant, *texts):
                return texts
        if begin == 0 and end == len(old):
            return mutant.solution, mutant.source
        if begin:
            begin, new_begin = begin - 1, new_begin - 1
        if end < len(old) and (not begin or (end - begin) % 2):
            end, new_end = end + 1, new_end + 1


def _as_lines(old: list[str], new: list[str]) -> tuple[str, str]:
    """Return both as texts, where new lines are indented by what the first old line has."""
    indent = len(old[0]) - len(old[0].lstrip()) if old else 0
    return ' '.join(' '.join(old).split()), '\n'.join(line[indent:] for line in new).rstrip()


def _from_to(old: list[str], new: list[str]) -> tuple[str, str]:
    """Return both as texts, the old one as `first line ... last line`."""
    if len(old) < 2:
        return '', ''
    return f'{old[0].strip()} ... {old[-1].strip()}', _as_lines(old, new)[1]


def _without_common_ends(old: list[str], new: list[str]) -> tuple[str, str]:
    """Return both without the words that they begin and end with, if each is one line."""
    if len(old) != 1 or len(new) != 1:
        return '', ''
    words = [re.findall(r'\w+|\s+|[^\w\s]', line[0]) for line in (old, new)]
    while len(words[0]) > 1 and words[1] and words[0][0] == words[1][0]:
        words = [words[0][1:], words[1][1:]]
    while len(words[0]) > 1 and words[1] and words[0][-1] == words[1][-1]:
        words = [words[0][:-1], words[1][:-1]]
    texts = [''.join(part).strip() for part in words]
    is_read_easily = all(
        text.count(one) == text.count(other) for text in texts for one, other in ('()', '[]')
    ) and re.search(r'\w\w\w', texts[0])
    return tuple(texts) if is_read_easily else ('', '')


def _makes(mutant: Mutant, old: str, new: str) -> bool:
    try:
        return same_program(source_of({old: new}, mutant.solution), mutant.source)
    except ValueError:
        return False


# --- How a source is read -------------------------------------------------------------------------


def _made(source: str, written: set[int]) -> Iterator[tuple[str, str]]:
    """Yield the name of each rule and a source with its mistake, of each kind of cell."""
    magics, body, kind = _parts(source)
    lines = body.splitlines()
    own = {at - magics.count('\n') for at in written if at >= magics.count('\n')}
    if kind == 'python':
        for rule, made in _of_python(body, own):
            yield rule, magics + made
    else:
        for rule, made in _of_lines(lines, own, kind):
            yield rule, magics + '\n'.join(made) + '\n' * body.endswith('\n')


def _parts(source: str) -> tuple[str, str, str]:
    """Return the magic that a cell begins with, the rest, and its kind."""
    magic = magic_of(source)
    if not magic.name:
        return '', source, 'python'
    kind = files.kind_of(magic.file) if magic.file else 'commands'
    return source.removesuffix(magic.body), magic.body, kind


def _of_lines(lines: list[str], written: set[int], kind: str) -> Iterator[tuple[str, list[str]]]:
    for rule in files.RULES:
        for made in rule(lines, written, kind):
            yield rule.__name__, made


def _of_python(body: str, written: set[int]) -> Iterator[tuple[str, str]]:
    python, frame, hidden = _as_python(body)
    try:
        program = Program(python, {at + 1 + frame for at in written})
    except cst.ParserSyntaxError:
        for rule, made in _of_lines(body.splitlines(), written, 'commands'):
            yield rule, '\n'.join(made)
        return
    for rule in (*RULES, *SIMPLE):
        for module in rule(program):
            yield rule.__name__, _from_python(module.code, frame, hidden)
    for node in program.each(cst.SimpleString):
        for rule, text in _of_text(program, node):
            yield rule, _from_python(program.changed(node, text).code, frame, hidden)
    commands = {at for at, line in enumerate(body.splitlines()) if line.strip()[:1] in ('!', '%')}
    for rule, made in _of_lines(body.splitlines(), written & commands, 'commands'):
        yield rule, '\n'.join(made)


def _of_text(program: Program, node: cst.SimpleString) -> Iterator[tuple[str, cst.SimpleString]]:
    """Yield texts of several lines or words with a mistake: files, commands."""
    text = node.raw_value
    if not isinstance(node.evaluated_value, str) or not re.search(r'\s', text.strip()):
        return
    parent = program.parent(node)
    if isinstance(parent, cst.Expr | cst.Assert):  # a docstring, what an assertion says
        return
    if isinstance(parent, cst.Arg) and program.code(program.parent(parent).func).startswith(LOGGER):
        return
    start = program.line_of(node)
    lines = text.split('\n')
    written = {at for at in range(len(lines)) if start + at in program.written}
    for rule, made in _of_lines(lines, written, files.kind_of_text(text)):
        quote = node.quote
        yield rule, node.with_changes(value=f'{node.prefix}{quote}{chr(10).join(made)}{quote}')


def _as_python(body: str) -> tuple[str, int, list[str]]:
    """Return a body as Python, how many lines were put above it, and the lines that are none."""
    lines, hidden = [], []
    for line in body.splitlines():
        if line.strip()[:1] in ('!', '%'):
            indent = line[: len(line) - len(line.lstrip())]
            lines.append(f'{indent}{HIDDEN}{len(hidden)}')
            hidden.append(line.strip())
        else:
            lines.append(line)
    text = '\n'.join(lines) + '\n'
    first = next((line for line in lines if line.strip()), '')
    return (FRAME + text, 1, hidden) if first.startswith(' ') else (text, 0, hidden)


def _from_python(code: str, frame: int, hidden: list[str]) -> str:
    code = code.removeprefix(FRAME) if frame else code
    return re.sub(rf'{HIDDEN}(\d+)', lambda found: hidden[int(found[1])], code).rstrip('\n')


@functools.lru_cache(maxsize=10_000)  # each mutant is compared with each written answer
def _program(source: str) -> str | None:
    """Return what a source says, whatever its spaces and comments; None if it is no program."""
    magics, body, kind = _parts(source)
    if kind != 'python':
        return (
            magics
            + '\n'.join(' '.join(one.split()) for one in body.splitlines() if one.strip())
            + (
                ''
                if kind != 'yaml'
                else str([len(one) - len(one.lstrip()) for one in body.splitlines()])
            )
        )
    python, _, hidden = _as_python(body)
    try:
        with warnings.catch_warnings(action='ignore', category=SyntaxWarning):
            compile(python, 'answer', 'exec', dont_inherit=True)
        return magics + ast.dump(ast.parse(python)) + repr(hidden)
    except (SyntaxError, ValueError):
        return None
