"""The result of a build, and those of its many lines that say what is wrong."""

from __future__ import annotations

import re
import sys
import sysconfig
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from helpers.notebook import wrap

STANDARD_LIBRARY = '.../lib/python3/'


@dataclass(frozen=True, repr=False)
class BuildResult:
    """What `colcon build` did. Its text has no times and no machine's folders, so it is comparable.

    `packages` holds 'finished', 'failed' or 'aborted' for each package, in the order of their
    dependencies. `errors` are the lines that matter, `warnings` are colcon's own. `log` is the file
    in the workspace with every line that the failed package printed (or the last package).
    """

    command: str
    ok: bool
    failed: str | None = None
    packages: dict[str, str] = field(default_factory=dict)
    errors: Sequence[str] = ()
    warnings: Sequence[str] = ()
    log: str = ''

    def __str__(self) -> str:
        lines = [self.command, *self.warnings]
        for package, state in self.packages.items():
            if package == self.failed:
                lines += [f'--- stderr: {package}', *self.errors, '---']
            lines.append(f'{state.capitalize():<8} <<< {package}')
        if not self.packages:
            lines += self.errors
        lines.append('')
        for state in ('finished', 'failed', 'aborted'):
            names = [name for name, its_state in self.packages.items() if its_state == state]
            count = f'{len(names)} package{"" if len(names) == 1 else "s"} {state}'
            if state == 'finished':
                lines.append(f'Summary: {count}')
            elif names:
                lines.append(f'  {count}: {" ".join(names)}')
        if self.failed:
            lines.append(f'Every line: {self.log}')
        return '\n'.join(lines)

    __repr__ = __str__


def read_result(
    workspace: Path, command: str, asked: Sequence[str], output: Sequence[str]
) -> BuildResult:
    """Return what a build of the packages in `asked` did, from its output and colcon's logs."""
    log = workspace / 'log' / 'latest_build'
    packages = _packages(log / 'events.log')
    failed = next((name for name, state in packages.items() if state == 'failed'), None)
    warnings = [
        warning
        for warning in _warnings(without_folders('\n'.join(output), workspace))
        # The prefix of the wheels is no colcon workspace, and need not be.
        if "doesn't contain any 'local_setup.*' files" not in warning
    ]
    errors = []
    if failed:
        errors = _errors(workspace, log / failed / 'stderr.log', output)
    elif not packages:
        errors, warnings = warnings or ['Nothing was built: src/ has no package.'], []
    log_file = log / (failed or next(reversed(packages), '')) / 'stdout_stderr.log'
    return BuildResult(
        command,
        ok=set(asked) <= set(packages) and set(packages.values()) == {'finished'},
        failed=failed,
        packages=packages,
        errors=errors,
        warnings=warnings,
        log=log_file.relative_to(workspace).as_posix(),
    )


def _errors(workspace: Path, stderr: Path, output: Sequence[str]) -> list[str]:
    """Return the lines that matter of what a package that failed has printed."""
    text = stderr.read_text(encoding='utf-8', errors='replace')
    errors = lines_that_matter(without_folders(text, workspace))
    if any('CalledProcessError' in line for line in errors):
        # colcon asks setup.py in a process whose output it does not give to the package.
        _, start, rest = '\n'.join(output).partition('Traceback (most recent')
        text = start + rest.partition('Traceback (most recent')[0]
        errors = lines_that_matter(without_folders(text, workspace)) or errors
    return errors


def _warnings(text: str) -> list[str]:
    """Return colcon's own warnings and errors. One that ends in a colon has more lines."""
    # Since Python 3.13 colcon's seconds are negative.
    more = r'(?:(?<=:)\n(?:(?!\[-?\d|Starting >>>).*\n?)*)?'
    found = re.findall(rf'^\[-?\d[\d.]*s\] ((?:WARNING|ERROR):.*{more})', text, re.M)
    return [warning.strip() for warning in found]


def _packages(events: Path) -> dict[str, str]:
    """Return 'finished', 'failed' or 'aborted' for each package in colcon's log of events.

    colcon and Python write there, for example: [1.12] (my_package) JobEnded: {..., 'rc': 0}
    """
    text = events.read_text(encoding='utf-8', errors='replace') if events.is_file() else ''
    packages = dict.fromkeys(re.findall(r'^\[.*?\] \((.+?)\) JobQueued', text, re.M), 'aborted')
    for package, code in re.findall(r"^\[.*?\] \((.+?)\) JobEnded: .*'rc': (.+)\}", text, re.M):
        packages[package] = {'0': 'finished', "'SIGINT'": 'aborted'}.get(code, 'failed')
    return packages


def without_folders(text: str, workspace: Path) -> str:
    """Write this machine's folders as they are the same everywhere: '...' for a prefix."""
    folders = {
        f'{workspace}/': '',
        str(workspace): '.',
        f'{workspace.parent}/': '../',  # an overlay is in its underlay
        sysconfig.get_path('purelib') + '/': '',
        sysconfig.get_path('stdlib') + '/': STANDARD_LIBRARY,
        sys.prefix: '...',
        sys.base_prefix: '...',
    }
    for folder, name in folders.items():
        # CMake may break a line at a space in a folder's name.
        pattern = r'\s+'.join(re.escape(part) for part in folder.split(' '))
        text = re.sub(pattern, lambda _, name=name: name, text)
    return text


# --- The lines that matter -----------------------------------------------------------------------


class _Message(NamedTuple):
    """A kind of message: its first line, the lines that belong to it, and its short form."""

    first: str
    more: str
    shorten: Callable[[list[str]], list[str]]


def _cmake_error(block: list[str]) -> list[str]:
    """Shorten one error of CMake: its text, and the line of the CMakeLists.txt that led to it."""
    stack = next((i for i, x in enumerate(block) if x.startswith('Call Stack')), len(block))
    body = textwrap.dedent('\n'.join(block[1:stack])).strip('\n')
    # The length of folders' names decides where CMake breaks lines: join, and break again. CMake
    # leaves indented lines as they are, such as the frames of a traceback.
    said: list[str] = []
    for paragraph in re.split(r'\n\s*\n', body):
        if paragraph.startswith(' '):
            said += paragraph.splitlines()
        elif text := ' '.join(paragraph.split()):
            said.append(text)
    # It ran a program, which failed: what the program said is what matters.
    program = [i for i, x in enumerate(said) if re.search(r'returned error code \d+', x)]
    if program:
        said = said[program[0] + 1 :]
        tracebacks = [i for i, x in enumerate(said) if x.startswith('Traceback (')]
        if tracebacks:
            said = _traceback(said[tracebacks[-1] :])
        if not said:
            return []
    short = [part for x in said for part in ([x] if x.startswith(' ') else wrap(x))]
    mine = [x.strip() for x in block[stack + 1 :] if x.strip().startswith('CMakeLists.txt')]
    return [block[0], *(f'  {x}' for x in short), *(f'  called from {x}' for x in mine[-1:])]


def _traceback(block: list[str]) -> list[str]:
    """Shorten a traceback to the last frame outside Python's own library, and the exception."""
    frames = [i for i, x in enumerate(block) if x.startswith('  File "')]
    if not frames:
        return block
    last = next((i for i in reversed(frames) if STANDARD_LIBRARY not in block[i]), frames[-1])
    end = last + 1
    while end < len(block) and block[end].startswith('   '):
        end += 1
    # Python 3.11 and newer underline the expression, others do not.
    frame = [x for x in block[last:end] if not re.fullmatch(r'[\s^~]+', x)]
    exception = next((i for i in range(frames[-1], len(block)) if block[i][:1] != ' '), len(block))
    return [block[0], *(['  ...'] if len(frames) > 1 else []), *frame, *block[exception:]]


def _without_notes(block: list[str]) -> list[str]:
    return [line for line in block if ': note: ' not in line]


MESSAGES = (
    # "Call Stack" is at the margin, and has its own indented lines.
    _Message(r'CMake Error', r' |\s*$|Call Stack', _cmake_error),
    # An exception's text may have more lines. It ends at the next message of another program.
    _Message(
        r'Traceback \(most recent call last\)',
        r'(?!CMake |Traceback |g?make(\[\d+\])?: |error: )\s*\S',
        _traceback,
    ),
    # A compiler shows the line of code below its error.
    _Message(
        r'\S.*?:\d+:(\d+:)? (fatal )?error: ', r' *\d* \| |\S.*: note: ', _without_notes
    ),
    # A linker, and what setup.py says at its end. One line each.
    _Message(
        r'error: |ERROR|\S*ld(\.\w+)?: .*(undefined|cannot find|recompile)|.*: undefined ref',
        r'(?!)',
        list,
    ),
)  # fmt: skip


def lines_that_matter(text: str) -> list[str]:
    """Return the lines of a failed build's stderr that say what is wrong, as a short list.

    Kept are: CMake's errors with the line of your CMakeLists.txt; of a Python traceback the last
    frame and the exception; the compiler's and linker's errors; what setup.py says at its end.
    Lines that only report an earlier failure are not kept. If none of these is found, the last
    eight lines are kept.
    """
    lines = text.splitlines()
    kept: list[str] = []
    index = 0
    while index < len(lines):
        start, index = index, index + 1
        kind = next((kind for kind in MESSAGES if re.match(kind.first, lines[start])), None)
        if kind is None:
            # The jobs beside it may end or not: what the first one printed is what is sure.
            if kept and re.match(r'(g?make)(\[\d+\])?: \*\*\* ', lines[start]):
                break
            continue
        while index < len(lines) and re.match(kind.more, lines[index]):
            index += 1
        if re.match(r'\s*(During handling of|The above exc)', '\n'.join(lines[index : index + 2])):
            continue  # of several tracebacks, the last one is what ended the program
        short = kind.shorten(lines[start:index])
        if not set(short) <= set(kept):
            kept += short
    return kept or [line for line in lines if line.strip()][-8:]
