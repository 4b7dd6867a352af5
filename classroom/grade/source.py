"""Two sources are the same if they differ in comments and white space only."""

from __future__ import annotations

import io
import tokenize

from helpers.lesson import magic_of

CPP = '.cpp', '.hpp', '.h'
SKIPPED = {tokenize.COMMENT, tokenize.NL, tokenize.ENCODING}
BLOCKS = {tokenize.INDENT: '{', tokenize.DEDENT: '}', tokenize.NEWLINE: '\n'}


def code_only(source: str) -> str:
    """Return a source without comments and white space that means nothing.

    Of a source that is not Python, whole lines of comments are left out, and the ends of lines.
    """
    is_cpp = magic_of(source).file.endswith(CPP)
    try:
        if is_cpp:
            raise ValueError
        tokens = tokenize.generate_tokens(io.StringIO(f'{source.strip()}\n').readline)
        words = [BLOCKS.get(t.type, t.string) for t in tokens if t.type not in SKIPPED]
        return ' '.join(words).strip()
    except (tokenize.TokenError, SyntaxError, ValueError):
        mark = '//' if is_cpp else '#'
        lines = (line.rstrip() for line in source.strip().splitlines())
        return '\n'.join(line for line in lines if line and not line.lstrip().startswith(mark))
