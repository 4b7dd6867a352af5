"""Colours of a cell: Python, or the language of the file that `%%write FILE` makes."""

from ipython_pygments_lexers import IPython3Lexer
from pygments.lexers import TextLexer, get_lexer_for_filename
from pygments.token import Comment
from pygments.util import ClassNotFound

from helpers.lesson import magic_of, path_and_part


class CellLexer(IPython3Lexer):
    def get_tokens_unprocessed(self, text):
        """Yield (index, token, value) of a cell's source."""
        name, line, body = magic_of(text)
        if name != 'write':
            yield from super().get_tokens_unprocessed(text)
            return
        first = text.removesuffix(body)
        yield 0, Comment.Special, first
        try:
            lexer = get_lexer_for_filename(path_and_part(line)[0].replace('.urdf', '.xml'))
        except ClassNotFound:  # of an interface
            lexer = TextLexer()
        for index, token, value in lexer.get_tokens_unprocessed(body):
            yield len(first) + index, token, value
