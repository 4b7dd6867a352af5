"""What checks need for builds and packages: a build, and why it failed."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from pathlib import Path

from helpers.checks.errors import Failed
from helpers.workspace import BuildResult, Workspace, lines_that_matter

LONGEST = 600  # characters of a reason
# What CMake adds to its reason: advice for somebody who installs packages.
ADVICE = re.compile(r' (?:Possible reasons include|Add the installation prefix|See also).*')


def build(workspace: Workspace, *packages: str, anew: bool = False) -> BuildResult:
    """Build packages. Raises Failed with the first error of the build.

    A build takes nothing away, so that what an earlier try has installed stays. With `anew`, the
    installed files and the build folders of these packages are removed before.
    """
    if anew:
        for package in packages:
            for folder in ('build', 'install'):
                shutil.rmtree(workspace.file(f'{folder}/{package}'), ignore_errors=True)
    result = workspace.build(*packages)
    if not result.ok:
        raise Failed(why_it_failed(result))
    return result


def builds(workspace: Workspace, *packages: str, anew: bool = True) -> bool | str:
    """Build packages. Return True, or the first error. A warning of colcon counts as one."""
    try:
        result = build(workspace, *packages, anew=anew)
    except Failed as error:
        return str(error)
    return not result.warnings or ' '.join(result.warnings[-1].split())


def why_it_failed(result: BuildResult) -> str:
    """Return the package of a build that failed, and its first error: what, file, line."""
    if result.ok:
        return 'nothing: the build has finished'
    said = ' '.join([*result.errors, *result.warnings])
    unknown = re.findall(r"ignoring unknown package '(.+?)'", said)  # which ends no build
    if unknown and not result.failed:
        return f'there is no package {unknown[0]} in src: has it a package.xml?'
    error = first_error(result.errors)
    return f'{result.failed}: {error}' if result.failed else error


def compile_error(output: str) -> str:
    """Return the first error in what a compiler has printed."""
    return first_error(lines_that_matter(output))


def first_error(lines: Sequence[str]) -> str:
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
