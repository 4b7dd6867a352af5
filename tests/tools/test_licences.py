"""licences.md is complete, and says what the packages and the lock files say."""

import re
from importlib.metadata import PackageNotFoundError

import pytest

from tools import licences

HINT = 'run `make licences`'
ROWS = re.findall(
    r'^\| `([^`]+)` \| ([^|]+) \| ([^|]+) \| (\S+) \|$', licences.TABLE.read_text(), re.MULTILINE
)


def test_every_locked_package_has_its_row_and_no_other():
    wanted = {
        (name, ', '.join(sorted(versions)), file.endswith('.json'))
        for file in licences.LOCKS
        for name, versions in licences.locked(file).items()
    }
    assert {(name, versions, file.endswith('.json')) for name, versions, _, file in ROWS} == wanted
    assert licences.text_of(ROWS) == licences.TABLE.read_text(), HINT


def test_the_licences_are_what_the_packages_say():
    looked_at = 0
    for name, versions, licence, file in ROWS:
        if file.endswith('.json'):
            assert set(licences.locked(file)[name].values()) == {licence}, HINT
        elif ',' not in versions:  # otherwise another Python has another version
            try:
                assert licences.licence_of(name) == licence, HINT
                looked_at += 1
            except PackageNotFoundError:  # of another Python, or of a group that is not installed
                continue
    assert looked_at > 200


def test_a_package_without_a_licence_is_not_passed_over(monkeypatch):
    monkeypatch.setattr(licences, 'STATED', {})
    with pytest.raises(ValueError, match='ros-fastcdr names no licence'):
        licences.licence_of('ros-fastcdr')


def test_copyleft_is_named_above_the_table():
    rows = [
        (name, '1', licence, 'x') for name, licence in (('a', 'MIT'), ('b', 'LGPL'), ('c', 'MPL'))
    ]
    assert '\n\n`b`, `c`\n\n' in licences.text_of(rows)
