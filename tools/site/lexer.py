"""Colours of a cell: Python, or the language of the file that `%%write FILE` makes."""

from ipython_pygments_lexers import IPython3Lexer
from pygments.lexers import get_lexer_for_filename
from pygments.token import Comment
from pygments.util import ClassNotFound

OTHER_NAMES = {'.urdf': '.xml', '.srv': '.txt', '.msg': '.txt', '.action': '.txt'}


class CellLexer(IPython3Lexer):
    """A lexer for Pygments."""

    def get_tokens_unprocessed(self, text):
        """Yield (index, token, value) of a cell's source."""
        first, newline, rest = text.partition('\n')
        if not first.startswith('%%write '):
            yield from super().get_tokens_unprocessed(text)
            return
        yield 0, Comment.Special, first + newline
        name = first.split()[1]
        for ending, known in OTHER_NAMES.items():
            name = name.replace(ending, known)
        try:
            lexer = get_lexer_for_filename(name)
        except ClassNotFound:
            lexer = get_lexer_for_filename('any.txt')
        for index, token, value in lexer.get_tokens_unprocessed(rest):
            yield len(first) + len(newline) + index, token, value
