"""Mistakes in files that are no Python: package.xml, CMakeLists.txt, YAML, launch, C++, commands.

A rule gets the lines, the numbers of those that the learner writes, counted from 0, and the kind of
the file; it yields the lines with one mistake.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import PurePath

Lines = list[str]
LineRule = Callable[[Lines, set[int], str], Iterator[Lines]]
RULES: list[LineRule] = []
# The last part of a file's name, and what its rules are called by.
KINDS = {
    '.xml': 'xml', '.urdf': 'xml', '.xacro': 'xml', '.yaml': 'yaml', '.yml': 'yaml',
    '.cpp': 'c++', '.hpp': 'c++', '.txt': 'cmake', '.cmake': 'cmake',
    '.srv': 'interface', '.msg': 'interface', '.action': 'interface', '.py': 'python',
}  # fmt: skip
C_WORDS = (
    ('<', '<=', '>'), ('<=', '<'), ('>', '>=', '<'), ('>=', '>'), ('==', '!='), ('!=', '=='),
    ('&&', '||'), ('||', '&&'), ('+', '-'), ('-', '+'), ('*', '/'), ('/', '*'), ('++', '--'),
    ('isnan', 'isinf'), ('isfinite', 'isnan'), ('true', 'false'), ('false', 'true'),
    ('min', 'max'), ('max', 'min'), ('front', 'back'), ('back', 'front'),
    ('MutuallyExclusive', 'Reentrant'), ('Reentrant', 'MutuallyExclusive'),
    ('best_effort', 'reliable'), ('reliable', 'best_effort'),
    ('steady_clock', 'system_clock'), ('nullopt', '0'), ('break', 'continue'),
    ('PRIVATE', 'INTERFACE'), ('PUBLIC', 'PRIVATE'),
)  # fmt: skip
C_TOKEN = re.compile(r'"[^"]*"|\w+|[<>=!]=|&&|\|\||\+\+|--|->|<<|>>|::|[-+*/<>]')
OPTIONS = (
    ('--packages-up-to', '--packages-select'), ('-p', '-r'), ('--once', '--times 2'),
    ('--start-offset', '--delay'),
)  # fmt: skip
# Commands that change nothing when they run a second time, or only tell something.
ONCE_IS_ENOUGH = r'\s*(sed -i|cp -r|mkdir -p|ros2 (topic|param|node) (info|get|list))\b'
DEPENDS = ('depend', 'exec_depend', 'build_depend', 'test_depend', 'buildtool_depend')
TYPES = {
    'float64': 'float32', 'float32': 'int32', 'int32': 'float64', 'int64': 'int32',
    'bool': 'string', 'string': 'bool', 'uint8': 'int8', 'uint16': 'uint8',
}  # fmt: skip


def kind_of(path: str) -> str:
    """Return by which rules a file is changed: those of its name's last part."""
    return KINDS.get(PurePath(path).suffix, 'text')


def kind_of_text(text: str) -> str:
    """Return by which rules a text in a Python program is changed: what it looks like."""
    if re.search(r'^\s*(project|find_package|add_library|install|add_executable)\(', text, re.M):
        return 'cmake'
    if re.search(r'^\s*#include|^\s*(int|void) \w+\(', text, re.M):
        return 'c++'
    if re.search(r'^\s*<\w', text, re.M):
        return 'xml'
    if re.search(r'^\s*[\w-]+:( |$)', text, re.M):
        return 'yaml'
    return 'commands'


def rule(function: LineRule) -> LineRule:
    RULES.append(function)
    return function


def _with(lines: Lines, at: int, *new: str, count: int = 1) -> Lines:
    return [*lines[:at], *new, *lines[at + count :]]


def _is_code(line: str) -> bool:
    """Return whether a line is more than brackets or a comment."""
    return bool(re.search(r'\w', line)) and not line.strip().startswith(
        ('#pragma', '//', '<!--', '<?')
    )


def _balanced(line: str) -> bool:
    """Return whether a line opens as many brackets as it closes."""
    return all(line.count(one) == line.count(other) for one, other in ('()', '{}', '[]'))


def _elements(lines: Lines) -> Iterator[tuple[int, int]]:
    """Yield where each element of XML, and each statement of lines, begins and ends."""
    for at, line in enumerate(lines):
        if opened := re.match(r'\s*<(\w+)\b', line):
            for end in range(at, len(lines)):
                text = '\n'.join(lines[at : end + 1])
                single = re.match(r'\s*<[^<]*/>\s*$', text, re.S)
                if single or re.search(rf'</{opened[1]}>\s*$', text):
                    yield at, end + 1
                    break


def _pieces(lines: Lines, kind: str) -> list[tuple[int, int]]:
    """Return what can be taken away or moved: lines, elements, calls of CMake, lines of C++."""
    if kind == 'xml':
        return [*_elements(lines)]
    pieces, begin = [], None
    for at, line in enumerate(lines):
        if begin is None and not _is_code(line):
            continue
        begin = at if begin is None else begin
        text = '\n'.join(lines[begin : at + 1])
        if _balanced(text) or at - begin > 12:
            pieces.append((begin, at + 1))
            begin = None
    if kind == 'c++':  # also the statements in the braces of others
        pieces += [
            (at, at + 1)
            for at, line in enumerate(lines)
            if re.search(r';\s*(//.*)?$|\}\s*$', line) and _balanced(line) and _is_code(line)
        ]
        pieces = [one for one in pieces if re.search(r'[;}]\s*$', lines[one[1] - 1])]
    return sorted({*pieces})


@rule
def a_line_gone(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    for begin, end in _pieces(lines, kind):
        if begin in written:
            yield _with(lines, begin, count=end - begin)


@rule
def lines_in_the_other_order(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    """Order says something in C++, CMake, commands and interfaces."""
    if kind not in ('c++', 'cmake', 'commands', 'interface'):
        return
    pieces = _pieces(lines, kind)
    for (begin, middle), (then, end) in zip(pieces, pieces[1:], strict=False):
        if _order_says_nothing(lines[begin], lines[then]):
            continue
        if middle <= then and not lines[middle:then] and not written.isdisjoint(range(begin, end)):
            yield [*lines[:begin], *lines[then:end], *lines[begin:middle], *lines[end:]]


def _order_says_nothing(first: str, second: str) -> bool:
    """Return whether two lines find packages, or give values that do not need each other."""
    if all(line.strip().startswith('find_package(') for line in (first, second)):
        return True
    given = [re.match(r'\s*(?:[\w:<>]+ )*(\w+)(?: = [^=(]*)?;', line) for line in (first, second)]
    if not all(given) or any(re.match(r'\s*(return|using)\b', one) for one in (first, second)):
        return False
    return not any(
        re.search(rf'\b{found[1]}\b', other)
        for found, other in zip(given, (second, first), strict=True)
    )


@rule
def a_line_twice(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    if kind in ('c++', 'commands'):
        for begin, end in _pieces(lines, kind):
            # What gets the same value twice has it.
            is_call = re.match(r'\s*(?!return)([\w.:>-]+(\(| [+-]= )|[+-]{2}\w)', lines[begin])
            again = is_call or (kind == 'commands' and not re.match(ONCE_IS_ENOUGH, lines[begin]))
            if end - begin == 1 and begin in written and again:
                yield _with(lines, begin, lines[begin], lines[begin])


@rule
def out_of_a_block(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    """A key of YAML one level further out; the last statement of a block of C++ below it."""
    for at in sorted(written):
        line = lines[at] if at < len(lines) else ''
        is_key = re.match(r'\s+(- )?[^\s\[\]{},]+:( |$)', line)
        if kind == 'yaml' and line.startswith('  ') and is_key:
            yield _with(lines, at, line[2:])
        below = lines[at + 1] if at + 1 < len(lines) else ''
        if kind == 'c++' and line.rstrip().endswith(';') and below.strip() == '}':
            yield _with(lines, at, below, line, count=2)


@rule
def another_value(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    """Another number, text, name or kind of dependency."""
    for at in sorted(written):
        line = lines[at] if at < len(lines) else ''
        if not _is_code(line) or line.strip().startswith('#include'):
            continue
        for found in re.finditer(r'(?<![\w.:-])-?\d+(\.\d+)?(?![\w.])', line):
            number = float(found[0]) if found[1] else int(found[0])
            for other in (number + 1, number * 2 if number else -1):
                yield _with(lines, at, line[: found.start()] + str(other) + line[found.end() :])
        for found in re.finditer(r'\b(true|false|True|False)\b', line) if kind != 'c++' else ():
            other = {'t': 'f', 'f': 't', 'T': 'F', 'F': 'T'}[found[0][0]]
            word = {'f': 'false', 't': 'true', 'F': 'False', 'T': 'True'}[other]
            yield _with(lines, at, line[: found.start()] + word + line[found.end() :])
        if kind == 'xml':
            yield from _other_xml(lines, at)
        elif kind == 'yaml' and (found := re.search(r'(?<=: )[^\d\s\[{"\'][^#]*$', line)):
            yield _with(lines, at, f'{line.rstrip()}_2')
        elif kind == 'interface':
            for old, new in TYPES.items():
                if re.search(rf'\b{old}\b', line):
                    yield _with(lines, at, re.sub(rf'\b{old}\b', new, line, count=1))


def _other_xml(lines: Lines, at: int) -> Iterator[Lines]:
    line = lines[at]
    for found in re.finditer(r' [\w:]+="([^"]*)"', line):
        if found[1] and not re.search(r'\d', found[1]):
            other = found[0][:-1] + '_2"'
            yield _with(lines, at, line[: found.start()] + other + line[found.end() :])
        yield _with(lines, at, line[: found.start()] + line[found.end() :])
    if found := re.search(r'<(\w+)>([^<]+)</\1>', line):
        if found[1] in DEPENDS:
            for other in DEPENDS:
                if other != found[1]:
                    new = f'<{other}>{found[2]}</{other}>'
                    yield _with(lines, at, line.replace(found[0], new))
        yield _with(lines, at, line.replace(found[0], f'<{found[1]}>{found[2]}_2</{found[1]}>'))


@rule
def a_word_gone(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    """An argument of a command, or of a call of CMake."""
    if kind not in ('commands', 'cmake'):
        return
    for at in sorted(written):
        line = lines[at] if at < len(lines) else ''
        for found in re.finditer(r'(?<=[\s(])[^\s()]+', line):
            is_there = found[0] == 'REQUIRED'  # which says something of another computer only
            if _is_code(found[0]) and line[: found.start()].strip() and not is_there:
                yield _with(lines, at, (line[: found.start()].rstrip(' ') + line[found.end() :]))


@rule
def another_option(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    """An option of a command that sounds nearly the same."""
    for at in sorted(written) if kind == 'commands' else ():
        line = lines[at] if at < len(lines) else ''
        for found in re.finditer(r'(?<=\s)-[\w-]+(?=\s)', line):
            for pair in OPTIONS:
                if found[0] in pair:
                    other = pair[1 - pair.index(found[0])]
                    yield _with(lines, at, line[: found.start()] + other + line[found.end() :])


@rule
def in_another_folder(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    """A build in src, where its folders do not belong."""
    for at in sorted(written) if kind == 'commands' else ():
        line = lines[at] if at < len(lines) else ''
        if line.lstrip().startswith('colcon '):
            yield _with(lines, at, f'cd src; {line.lstrip()}')


@rule
def another_word_of_c(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    """Another operator or name of the same kind in C++, or a condition turned round."""
    for at in sorted(written) if kind in ('c++', 'cmake') else ():
        line = lines[at] if at < len(lines) else ''
        if not _is_code(line) or line.strip().startswith(('#', 'template')):
            continue
        for found in C_TOKEN.finditer(line):
            alone = line[found.start() - 1 : found.end() + 1] == f' {found[0]} '
            for word, *others in C_WORDS:
                if found[0] == word and (alone or word.isalpha() or word in ('++', '--')):
                    for other in others:
                        yield _with(lines, at, line[: found.start()] + other + line[found.end() :])
        if kind == 'c++' and (found := re.search(r'\b(if|while) \((.*)\) ?\{', line)):
            for other in (f'!({found[2]})', 'true', 'false'):
                if found[1] == 'if':
                    new = line[: found.start(2)] + other + line[found.end(2) :]
                    yield _with(lines, at, new)
            for half in re.split(r' && | \|\| ', found[2]):
                if half != found[2] and _balanced(half):
                    yield _with(lines, at, line[: found.start(2)] + half + line[found.end(2) :])


@rule
def a_local_name(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    """What must live as long as the node has a local name: C++ ends it with the constructor."""
    for at in sorted(written) if kind == 'c++' else ():
        line = lines[at] if at < len(lines) else ''
        if found := re.match(r'(\s*)\w+_ = (.*create_\w+.*)', line):
            yield _with(lines, at, f'{found[1]}auto local = {found[2]}')


@rule
def a_lock_that_ends_at_once(lines: Lines, written: set[int], kind: str) -> Iterator[Lines]:
    """A lock without a name, or in braces of its own."""
    for at in sorted(written) if kind == 'c++' else ():
        line = lines[at] if at < len(lines) else ''
        if re.search(r'(lock_guard|unique_lock|scoped_lock)', line) and line.strip().endswith(';'):
            yield _with(lines, at, f'{{{line}}}')
