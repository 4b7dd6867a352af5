"""licences.md has each locked package."""

import re

from tools.licences import TABLE, locked, made


def test_the_table_has_each_locked_package():
    text = TABLE.read_text()
    rows = dict(re.findall(r'^\| `([^`]+)` \| (.+) \|$', text, re.MULTILINE))
    assert list(rows) == locked(), 'run `make licences`'
    assert text.endswith(made(rows)), 'run `make licences`'


def test_copyleft_is_named_above_the_table():
    assert '\nWith copyleft: `b`, `c`.\n' in made({'a': 'MIT', 'b': 'LGPL', 'c': 'MPL'})
