"""licences.md is complete, and says what the packages and the lock files say."""

import re
from importlib.metadata import PackageNotFoundError

import pytest
from test_setup import LOCK, wanted_here

from tools import licences

TEXT = licences.TABLE.read_text()
ROWS = [
    licences.Package(*row)
    for row in re.findall(r'^\| `([^`]+)` \| ([^|]+) \| ([^|]+) \| (\S+) \|$', TEXT, re.MULTILINE)
]
HINT = 'run `make licences`'


def test_every_locked_package_has_its_row_and_no_other():
    locked = {
        (name, versions, file.endswith('.json'))
        for file in licences.LOCKS
        for name, versions in licences.pins((licences.ROOT / file).read_text()).items()
    }
    rows = {(row.name, row.versions, row.lock.endswith('.json')) for row in ROWS}
    assert rows == locked, HINT


def test_the_licences_are_what_the_packages_say():
    wanted = {pin.name for pin in wanted_here(LOCK)}
    looked_at = 0
    for row in ROWS:
        if row.lock.endswith('.json'):
            entries = licences.npm_packages((licences.ROOT / row.lock).read_text())
            assert {entry['license'] for name, entry in entries if name == row.name} == {
                row.licence
            }, HINT
            continue
        if ',' in row.versions:  # another Python has another version, and makes another table
            continue
        try:
            assert licences.licence_of(row.name) == row.licence, HINT
        except PackageNotFoundError:  # of another Python, or of a group that is not installed
            assert row.name not in wanted
            continue
        looked_at += 1
    assert looked_at > 200


def test_the_rest_is_what_the_tool_writes():
    assert licences.text_of(ROWS) == TEXT, HINT
    copyleft = {row.name for row in ROWS if licences.COPYLEFT.search(row.licence)}
    assert copyleft == licences.PURPOSES.keys()


def test_copyleft_is_told_apart_and_needs_a_purpose():
    rows = [licences.Package('a', '1', 'MIT', 'x'), licences.Package('b', '1', 'LGPL-2.1+', 'x')]
    with pytest.raises(ValueError, match='what this is for: b'):
        licences.text_of(rows)


def test_a_package_without_a_licence_is_not_passed_over(monkeypatch):
    monkeypatch.setattr(licences, 'STATED', {})
    assert licences.licence_of('empy') == '%LICENSE'
    monkeypatch.setattr(licences, '_in_metadata', lambda package: '')
    with pytest.raises(ValueError, match='names no licence'):
        licences.licence_of('empy')


def test_a_library_that_nobody_knows_is_not_passed_over(monkeypatch):
    monkeypatch.delitem(licences.BUNDLED, 'liburcu')
    with pytest.raises(ValueError, match='is not in BUNDLED'):
        licences.bundled()


def test_npm_may_hold_two_versions_of_a_package():
    lock = '{"packages": {"": {}, "node_modules/a": {"version": "1"}, \
        "node_modules/b/node_modules/a": {"version": "2"}}}'
    assert licences.pins(lock) == {'a': '1, 2'}
