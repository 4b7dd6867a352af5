"""The first error in what a build, a program or a launch prints: its file, its line, its text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from helpers.notebook import is_students
from helpers.workspace.build_output import BuildResult, lines_that_matter
from helpers.workspace.processes import DIED

LONGEST = 600  # characters of a reason
# What CMake adds to its reason: advice for somebody who installs packages.
ADVICE = re.compile(r' (?:Possible reasons include|Add the installation prefix|See also).*')
TRACEBACK = 'Traceback (most recent call last)'
FRAME = re.compile(r'\s*File "(.*?)", line (\d+)')
CHAINED = re.compile(r'During handling of|The above exception')
OF_A_PROGRAM = re.compile(r'\[[^\]\s]+-\d+\] ')  # what launch writes before a program's lines


# --- Builds


def why_it_failed(result: BuildResult) -> str:
    """Return the package of a build that failed, and its first error: what, file, line."""
    if result.ok:
        return 'nothing: the build has finished'
    said = ' '.join([*result.errors, *result.warnings])
    unknown = re.findall(r"ignoring unknown package '(.+?)'", said)  # which ends no build
    if unknown and not result.failed:
        return f'there is no package {unknown[0]} in src: has it a package.xml?'
    error = error_of_build(result.errors)
    return f'{result.failed}: {error}' if result.failed else error


def compile_error(output: str) -> str:
    """Return the first error in what a compiler has printed."""
    return error_of_build(lines_that_matter(output))


def error_of_build(lines: Sequence[str]) -> str:
    """Return the first error in the lines that matter of a build, with its file and line."""
    if not lines:
        return 'it failed, and printed no reason'
    first, rest = lines[0], lines[1:]
    if first.startswith('CMake Error'):
        error = _cmake_error(first, rest)
    elif first.startswith('Traceback ('):
        error = _python_error(rest)
    elif compiler := re.match(r'(\S+?):(\d+):(?:\d+:)? (?:fatal )?error: (.*)', first):
        file, number, text = compiler.groups()
        code = re.match(r' *\d* \| *(.*)', rest[0]) if rest else None
        error = _with_line(text, number, file, code[1] if code else '')
    else:  # a linker
        error = re.sub(r'^\S*\bld(?:\.\w+)?: |\(\.\w+\S*\): ', '', first.strip())
        error = re.sub(r'relocation .*?;', '...', error)
    error = ' '.join(error.split())
    return error if len(error) <= LONGEST else f'{error[:LONGEST].rpartition(" ")[0]} ...'


def _cmake_error(first: str, rest: Sequence[str]) -> str:
    """Return the text of an error of CMake, and the line of the CMakeLists.txt that led to it."""
    text: list[str] = []
    place = re.match(r'CMake Error at (CMakeLists\.txt):(\d+) \((\w+)\)', first)
    for line in rest:
        called = re.match(r'  called from (CMakeLists\.txt):(\d+) \((\w+)\)', line)
        if called or not line.startswith(' '):
            place = place or called
            break
        text.append(line)
    said = ' '.join(' '.join(_without_traceback(text)).split())
    said = ADVICE.sub('', said) or re.sub(r'^CMake Error(?: at \S+ \(\w+\))?:\s*', '', first)
    if place is None:
        return said
    file, number, command = place.groups()
    return _with_line(said, number, file, f'{command}(...)')


def _without_traceback(lines: Sequence[str]) -> list[str]:
    """Leave out what stands before an exception that CMake quotes: the command and its frames."""
    kept, margin = [], None
    for line in lines:
        indent = len(line) - len(line.lstrip())
        if 'Traceback (' in line:
            kept, margin = [], indent
        elif margin is None or indent <= margin:
            kept.append(line)
    return kept


def _python_error(lines: Sequence[str]) -> str:
    """Return the exception at the end of a traceback, and the line that is named before it."""
    places = [re.match(r'  File "(.*?)", line (\d+)', line) for line in lines]
    numbers = [index for index, place in enumerate(places) if place]
    exceptions = [line for line in lines if re.match(r'[A-Za-z_][\w.]*(:|$)', line)]
    exception = exceptions[0] if exceptions else lines[-1]
    if not numbers:
        return exception
    last = numbers[-1]
    code = lines[last + 1] if last + 1 < len(lines) else ''
    code = code if code.startswith('    ') else ''
    file = 'setup.py' if places[last][1] == '<string>' else places[last][1]  # colcon reads it
    return _with_line(exception, places[last][2], file, code)


def _with_line(text: str, number: str, file: str, code: str) -> str:
    end = '' if text[-1:] in ('.', '!', '?') else '.'
    line = f'Line {number} of {Path(file).name}'
    return f'{text}{end} {line}: {code.strip()}' if code.strip() else f'{text}{end} {line}'


# --- Programs and launches


def error_in(lines: Sequence[str]) -> str:
    """Return the first error of a program: exception, text, and the line of the workspace.

    Of a program without a traceback it is the last line, or 'it printed nothing'. Lines of a launch
    may have the name of their program in front.
    """
    start = next((number for number, line in enumerate(lines) if TRACEBACK in line), None)
    if start is None:
        said = [line.strip() for line in lines if line.strip()]
        return said[-1] if said else 'it printed nothing'
    program = OF_A_PROGRAM.match(lines[start])
    prefix = program[0] if program else ''
    own = [line.removeprefix(prefix) for line in lines[start:] if line.startswith(prefix)]
    said, place, inside, chained = '', '', False, True
    for number, line in enumerate(own):
        if TRACEBACK in line:
            if not chained:
                break
            inside, place = True, ''
        elif CHAINED.match(line):
            chained = True
        elif inside and (frame := FRAME.match(line)):
            if _is_own(frame[1]):
                code = own[number + 1].strip() if number + 1 < len(own) else ''
                place = f'Line {frame[2]} of {Path(frame[1]).name}: {code}'
        elif inside and line and not line[0].isspace():
            said, inside, chained = line, False, False
    if not said:
        return place or 'it ends with a traceback'
    return f'{said}{"" if not place or said[-1] in ".!?" else "."} {place}'.strip()


def started(text: str) -> list[str]:
    """Return the programs that a launch says it has started, sorted."""
    return sorted(re.findall(r'\[(\S+)-\d+\]: process started', text))


def error_of_launch(text: str) -> str:
    """Return the first error of a launch or of one of its programs, or nothing if there is none."""
    lines = [line for line in text.splitlines() if line.strip()]
    if any(TRACEBACK in line for line in lines):
        return error_in(lines)
    if lines and not started(text):
        return lines[-1]
    if dead := re.search(rf'\[(\S+-\d+)\]: {DIED}', text):
        said = [line for line in lines if line.startswith(f'[{dead[1]}] ')]
        return f'{dead[1]} has died. {said[-1] if said else "It printed nothing"}'
    return ''


def _is_own(file: str) -> bool:
    """Return whether a file is the learner's: no library, no script that colcon has made."""
    if re.search(r'/lib/\w+/\w+$', file) or Path(file).name.startswith('.'):
        return False
    # What a terminal of the workspace prints has no folders of this machine.
    in_workspace = re.match(r'(\w+/)?(src|install|build)/', file)
    return bool(in_workspace) or is_students(file)
