"""Colours of a cell: Python, or the language of the file that `%%write FILE` makes."""

from ipython_pygments_lexers import IPython3Lexer
from pygments.lexers import TextLexer, get_lexer_for_filename
from pygments.token import Comment
from pygments.util import ClassNotFound


class CellLexer(IPython3Lexer):
    def get_tokens_unprocessed(self, text):
        """Yield (index, token, value) of a cell's source."""
        first, newline, rest = text.partition('\n')
        if not first.startswith('%%write '):
            yield from super().get_tokens_unprocessed(text)
            return
        yield 0, Comment.Special, first + newline
        try:
            lexer = get_lexer_for_filename(first.split()[1].replace('.urdf', '.xml'))
        except ClassNotFound:  # of an interface
            lexer = TextLexer()
        for index, token, value in lexer.get_tokens_unprocessed(rest):
            yield len(first) + len(newline) + index, token, value
