"""The first error in what a program, a launch, a build or pytest has printed: its text, its line.

    first_error(text)         of anything that is printed, or '' if there is no error in it
    error_in(process.lines)   the same of a program; without an error it is its last line
    error_of_launch(text)     of a launch or of one of its programs, or ''
    error_of_build(errors)    in the lines that matter of a build
    error_of_pytest(text)     why pytest cannot read a file

All understand the tracebacks of Python and the errors of CMake, compilers, linkers and setup.py. A
line is shown only if it is the student's: never one of a library. helpers/checks/errors.py does the
same for an exception that a check has in its hands.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from helpers.notebook import is_students
from helpers.workspace.build_output import BuildResult, lines_that_matter
from helpers.workspace.processes import DIED

LONGEST = 600  # characters of an error
LONGEST_OF_PYTEST = 160
TRACEBACK = 'Traceback (most recent call last)'
FRAME = re.compile(r'\s*File "(.*?)", line (\d+)')
CHAINED = re.compile(r'During handling of|The above exception')
OF_A_PROGRAM = re.compile(r'\[[^\]\s]+-\d+\] ')  # what launch writes before a program's lines
COMPILER = re.compile(r'(\S+?):(\d+):(?:\d+:)? (?:fatal )?error: (.*)')
# Of a linker, of setup.py, and of colcon, which says ERROR at the margin.
ONE_LINE = re.compile(
    r'error: |ERROR: |\S*ld(?:\.\w+)?: .*(?:undefined|cannot find|recompile)|.*: undefined ref'
)
# What CMake adds to its reason: advice for somebody who installs packages.
ADVICE = re.compile(r' (?:Possible reasons include|Add the installation prefix|See also).*')


def first_error(printed: str | Sequence[str]) -> str:
    """Return the first error in what was printed, with the student's line, or nothing.

    Lines of a launch may have the name of their program in front.
    """
    lines = printed.splitlines() if isinstance(printed, str) else printed
    for number, line in enumerate(lines):
        program = OF_A_PROGRAM.match(line)
        prefix = program[0] if program else ''
        if _begins_error(line.removeprefix(prefix)):
            own = [one.removeprefix(prefix) for one in lines[number:] if one.startswith(prefix)]
            return _error_of(own)
    return ''


def error_in(printed: str | Sequence[str]) -> str:
    """Return the first error of a program, or else its last line, or 'it printed nothing'."""
    lines = printed.splitlines() if isinstance(printed, str) else printed
    said = ['it printed nothing', *(line.strip() for line in lines if line.strip())]
    return first_error(lines) or said[-1]


def error_of_launch(text: str) -> str:
    """Return the first error of a launch or of one of its programs, or nothing if there is none."""
    lines = [line for line in text.splitlines() if line.strip()]
    if error := _first_traceback(lines):
        return error
    if lines and ': process started' not in text:
        return lines[-1]
    if dead := re.search(rf'\[(\S+-\d+)\]: {DIED}', text):
        said = [line for line in lines if line.startswith(f'[{dead[1]}] ')]
        return f'{dead[1]} has died. {said[-1] if said else "It printed nothing"}'
    return ''


def error_of_build(errors: Sequence[str]) -> str:
    """Return the first error in the lines that matter of a build, with its file and line."""
    if not errors:
        return 'it failed, and printed no reason'
    error = ' '.join(_error_of(errors, build=True).split())
    return error if len(error) <= LONGEST else f'{error[:LONGEST].rpartition(" ")[0]} ...'


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


def error_of_pytest(text: str) -> str:
    """Return the error in what pytest prints of a file that it cannot import."""
    errors = re.findall(r'^(?:E +)?([A-Z]\w*(?:Error|Exception).*|E +.*)$', text, re.MULTILINE)
    places = re.findall(r'^(\S+\.py):(\d+): in <module>', text, re.MULTILINE)
    places += re.findall(r'^E +File "(.+?)", line (\d+)', text, re.MULTILINE)
    own = [(file, number) for file, number in places if is_own(file)]
    where = f' (line {own[0][1]} of {Path(own[0][0]).name})' if own else ''
    lines = errors[-1:] or text.strip().splitlines()[-1:]
    error = re.sub(r'\S+::', '', lines[-1].removeprefix('E').strip())
    return error[:LONGEST_OF_PYTEST] + where


def is_own(file: str) -> bool:
    """Return whether a file that an error names is the student's.

    It is none of a library, and no script that colcon has made. What a terminal of the workspace
    prints has no folders of this machine: it names `src/my_package/...`, and a build `setup.py`.
    """
    if re.search(r'/lib/\w+/\w+$', file) or Path(file).name.startswith('.'):
        return False
    if file.startswith(('/usr/', '/opt/ros/')):
        return False
    if file == 'setup.py' or re.match(r'(?:\.\./)*(?:\w+/)?(?:src|install|build)/', file):
        return True
    return is_students(file)


# --- Each kind of error ---------------------------------------------------------------------------


def _first_traceback(lines: Sequence[str]) -> str:
    return first_error(lines) if any(TRACEBACK in line for line in lines) else ''


def _begins_error(line: str) -> bool:
    return (
        TRACEBACK in line
        or line.startswith('CMake Error')
        or bool(COMPILER.match(line) or ONE_LINE.match(line))
    )


def _error_of(lines: Sequence[str], build: bool = False) -> str:
    """Return the error that begins with the first of these lines."""
    first, rest = lines[0], lines[1:]
    if TRACEBACK in first:
        return _python_error(lines, build)
    if first.startswith('CMake Error'):
        return _cmake_error(first, rest)
    if compiler := COMPILER.match(first):
        return _compiler_error(*compiler.groups(), rest)
    return _one_line(first)


def _python_error(lines: Sequence[str], build: bool) -> str:
    """Return the exception of a traceback, of a chain the last one, and the student's line."""
    said, place, inside, chained = '', '', False, True
    for number, line in enumerate(lines):
        if TRACEBACK in line:
            if not chained:
                break
            inside, place = True, ''
        elif CHAINED.match(line):
            chained = True
        elif inside and (frame := FRAME.match(line)):
            file = frame[1]
            following = lines[number + 1] if number + 1 < len(lines) else ''
            if build and file == '<string>' and not _has_frames(lines[number + 1 :]):
                file = 'setup.py'  # colcon reads it
            if is_own(file):
                code = following.strip() if following.startswith('    ') else ''
                place = _place(frame[2], file, code)
        elif inside and line and not line[0].isspace():
            said, inside, chained = line, False, False
    if not said:
        return place or 'it ends with a traceback'
    return _joined(said, place)


def _has_frames(lines: Sequence[str]) -> bool:
    return any(FRAME.match(line) for line in lines)


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
    return _joined(said, _place(number, file, f'{command}(...)'))


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


def _compiler_error(file: str, number: str, text: str, rest: Sequence[str]) -> str:
    # A compiler is called in a folder of the workspace: main.cpp, ../include/nearest.hpp.
    if not ('/' not in file or file.startswith('../') or is_own(file)):
        return f'{text} (in {Path(file).name}, a file of a library)'
    code = re.match(r' *\d* \| *(.*)', rest[0]) if rest else None
    return _joined(text, _place(number, file, code[1] if code else ''))


def _one_line(line: str) -> str:
    """Return an error that is one line, without what a linker writes before it."""
    error = re.sub(r'^\S*\bld(?:\.\w+)?: |\(\.\w+\S*\): ', '', line.strip())
    return re.sub(r'relocation .*?;', '...', error)


def _place(number: str, file: str, code: str) -> str:
    line = f'Line {number} of {Path(file).name}'
    return f'{line}: {code.strip()}' if code.strip() else line


def _joined(text: str, place: str) -> str:
    end = '' if not place or text[-1:] in ('.', '!', '?') else '.'
    return f'{text}{end} {place}'.strip()


def started(text: str) -> list[str]:
    """Return the programs that a launch says it has started, sorted."""
    return sorted(re.findall(r'\[(\S+)-\d+\]: process started', text))
