"""The list of links: each external address with the words that it backs."""

from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from tools.lessons.lesson import Lesson
from tools.lessons.sources import listing

TEXT = """\
# 90 Link

It waits. It [answers once](https://a.org/b_(c)#d), see https://e.org. It ends ([so](99_x.ipynb)).

- First. Then [it](https://f.org) goes, [and](https://g.org) comes.

```
https://no.org
```
"""
LISTED = """\
90 Link
  https://a.org/b_(c)#d
    It [answers once], see https://e.org.
  https://e.org
    It answers once, see https://e.org.
  https://f.org
    - First. Then [it] goes, and comes.
  https://g.org
    - First. Then it goes, [and] comes."""


def test_each_link_stands_beside_the_words_that_it_backs():
    cells = [new_markdown_cell(TEXT), new_code_cell('get("https://no.org")')]
    plain = Lesson('91_say.ipynb', new_notebook(cells=[new_markdown_cell('# 91 Say')]))
    assert listing([Lesson('90_link.ipynb', new_notebook(cells=cells)), plain]) == LISTED
