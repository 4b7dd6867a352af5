"""The locks of what only a class needs."""

import json
import re
from pathlib import Path

CLASSROOM = Path(__file__).resolve().parents[1]


def test_the_locks_name_no_package_index():
    [lock] = CLASSROOM.glob('*.lock')
    assert not re.search(r'://|--(extra-)?index|--find-links|file:|@', lock.read_text())
    [lock] = CLASSROOM.glob('hub/package-lock.json')
    packages = json.loads(lock.read_text())['packages']
    assert not any('resolved' in package for package in packages.values())
    assert all(package['integrity'] for name, package in packages.items() if name)
