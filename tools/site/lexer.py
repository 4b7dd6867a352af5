"""Colours of a cell: Python, or the language of the file that `%%write FILE` makes."""

from ipython_pygments_lexers import IPython3Lexer
from pygments.lexers import TextLexer, get_lexer_for_filename
from pygments.token import Comment
from pygments.util import ClassNotFound

from helpers.lesson import magic_of


class CellLexer(IPython3Lexer):
    def get_tokens_unprocessed(self, text):
        """Yield (index, token, value) of a cell's source."""
        magic = magic_of(text)
        if not magic.file:
            yield from super().get_tokens_unprocessed(text)
            return
        first = text.removesuffix(magic.body)
        yield 0, Comment.Special, first
        try:
            lexer = get_lexer_for_filename(magic.file.replace('.urdf', '.xml'))
        except ClassNotFound:  # of an interface
            lexer = TextLexer()
        for index, token, value in lexer.get_tokens_unprocessed(magic.body):
            yield len(first) + index, token, value
