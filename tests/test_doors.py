"""Each room of helpers has one door, and imports only from the rooms above it."""

import json
import re
from importlib import import_module
from pathlib import Path

import pytest

import helpers

ROOT = Path(__file__).resolve().parents[1]
HELPERS = ROOT / 'helpers'
ORDER = re.findall(r'^    (\w+)  ', helpers.__doc__, re.MULTILINE)
# Doors below a room.
BELOW = {
    'helpers.checks.classroom',  # what the class page and the hub must agree on with a notebook
    'helpers.checks.progress',  # which tasks are solved: lesson 00 and the tools ask
    'helpers.checks.tasks',  # what a lesson of one's own needs, and slow to load
    'helpers.checks.bench',
    'helpers.checks.points',
    'helpers.checks.verdict',  # the data of a verdict, which the rules and the tests read
    'helpers.machine.doctor',  # a program, which runs where no ROS is
}
IMPORT = re.compile(
    r'^[ \t]*(?:from (helpers[.\w]*) import (\([^)]*\)|[^\n#]*)|import (helpers[.\w]*))',
    re.MULTILINE,
)


def imports(text):
    """Yield of each import from helpers its module, and its names."""
    for module, names, alone in IMPORT.findall(text):
        for name in re.findall(r'(\w+)(?: as \w+)?', names) or ['']:
            if module == 'helpers':
                yield f'helpers.{name}', ''
            else:
                yield module or alone, name


def files():
    """Yield each Python file that is no test, and each notebook, with its code."""
    for folder in ('helpers', 'tools', 'classroom'):
        for file in sorted((ROOT / folder).rglob('*.py')):
            yield file, file.read_text()
    for file in sorted((ROOT / 'notebooks').glob('*.ipynb')):
        cells = json.loads(file.read_text())['cells']
        code = (''.join(cell['source']) for cell in cells if cell['cell_type'] == 'code')
        yield file, '\n'.join(code)


def room_of(file):
    """Return the room of a file, '' for one outside of all."""
    parts = file.relative_to(ROOT).parts
    return parts[1] if parts[0] == 'helpers' and len(parts) > 2 else ''


def mistake(room, module, name):
    """Return why a file of this room must not import this, or ''."""
    other = module.split('.')[1]
    if other == room:
        return ''
    if room and ORDER.index(other) >= ORDER.index(room):
        return f'{other} stands below {room}'
    if module.startswith('helpers.checks.lessons.'):  # a door for each lesson
        return ''
    if module in BELOW or f'{module}.{name}' in BELOW:
        return ''
    if module.count('.') > 1:
        return f'the door is helpers.{other}'
    if name and name not in import_module(module).__all__:
        return f'{name} is not at the door of {other}'
    return ''


def test_the_list_names_all_rooms():
    rooms = {file.parent.name for file in HELPERS.glob('*/__init__.py')}
    assert sorted(rooms) == sorted(ORDER)


def test_imports_go_through_doors_and_upwards_in_the_list():
    wrong = [
        f'{file.relative_to(ROOT)}: {module} {name}: {reason}'
        for file, text in files()
        for module, name in imports(text)
        if (reason := mistake(room_of(file), module, name))
    ]
    assert wrong == []


@pytest.mark.parametrize('room', ORDER)
def test_a_door_has_what_it_names(room):
    door = import_module(f'helpers.{room}')
    assert door.__doc__
    for name in door.__all__:
        thing = getattr(door, name)
        assert not callable(thing) or thing.__doc__, f'{name} needs a docstring.'


@pytest.mark.parametrize(
    ('room', 'line', 'reason'),
    [
        ('ros', 'from helpers.notebook.text import wrap', 'the door is helpers.notebook'),
        ('ros', 'from helpers.notebook import (\n    WIDTH,\n)', 'WIDTH is not at the door'),
        ('ros', '    from helpers import robot', 'robot stands below ros'),
        ('', 'import helpers.ros.session', 'the door is helpers.ros'),
    ],
)
def test_a_wrong_import_is_seen(room, line, reason):
    (found,) = imports(line)
    assert reason in mistake(room, *found)


def test_helpers_import_only_the_door_of_the_command():
    doors = {
        module
        for file in HELPERS.rglob('*.py')
        for module in re.findall(r'(?m)^ *(?:from|import) (ros2_command\S*)', file.read_text())
    }
    assert doors == {'ros2_command.api'}
