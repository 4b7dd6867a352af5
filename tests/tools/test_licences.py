"""licences.md has each locked package, and says what the packages say."""

import re
from contextlib import suppress
from importlib.metadata import PackageNotFoundError

from tools import licences

TEXT = licences.TABLE.read_text()
ROWS = dict(re.findall(r'^\| `([^`]+)` \| (.+) \|$', TEXT, re.MULTILINE))


def test_the_table_is_what_the_packages_say():
    assert list(ROWS) == licences.locked(), 'run `make licences`'
    assert licences.text_of(ROWS) == TEXT, 'run `make licences`'
    found = {}
    for name in ROWS:
        with suppress(PackageNotFoundError):  # of another Python, or of a group not installed here
            found[name] = licences.licence_of(name)
    assert len(found) > 200
    assert found.items() <= ROWS.items()


def test_copyleft_is_named_above_the_table():
    assert '\n\n`b`, `c`\n\n' in licences.text_of({'a': 'MIT', 'b': 'LGPL', 'c': 'MPL'})
