"""The ordeal: its law, its list of programs, and a small part of its trials, drawn by a seed."""

import random
import re
from dataclasses import replace

import pytest
from ordeal.law import Seen, broken
from ordeal.programs import (
    Prepared,
    declared,
    left_out,
    lesson,
    module_of,
    nodes_of,
    publishers,
)
from ordeal.run import differences, known, meet
from ordeal.sentences import MARKED, out_of_date
from ordeal.troubles import troubles

from helpers.lesson import paths

STEPS = [step / 10 for step in range(100)]


def seen(speeds, until_s=10.0, **others):
    """What was seen of a robot with these speeds at these times, and commands until a time."""
    moves = [(t, speeds(t), 0.0) for t in STEPS]
    commands = [t for t in STEPS if t <= until_s]
    plain = Seen(moves, commands, [], begun_s=3.0, ended_s=9.0, must_stand=True, within_s=1.5)
    return replace(plain, **others)


@pytest.mark.parametrize(
    ('what', 'found'),
    [
        (seen(lambda t: 0.5 if t < 4 else 0.0), ''),
        (seen(lambda t: 0.5), 'still moves 6.0 s after the trouble began'),
        (seen(lambda t: 0.5, must_stand=False), ''),
        (seen(lambda t: 0.5, until_s=3.0, must_stand=False), 's after its last command'),
        (seen(lambda t: 0.5 if t < 4 else 0.0, bumps=[3.8]), 'hits something 0.8 s'),
        (seen(lambda t: 0.0 if t < 5 else 0.5, from_start=True), 'still moves'),
        (seen(lambda t: 0.0, promised=False), 'does not do what it promises'),
        (seen(lambda t: 0.5 if t < 4 or t > 9 else 0.0, promised=True), ''),
    ],
)
def test_the_law_finds_what_breaks_it(what, found):
    assert (found in broken(what)) if found else broken(what) == ''


def test_a_seed_draws_the_same_troubles_again():
    said = declared()['watchful_brake']
    shows = {'processes': ['brake'], 'callbacks': ['brake.look'], 'parameters': ['brake.most_s']}
    first, again, other = (
        troubles(said, shows, 'watchful_brake', 'untimed', seed) for seed in (1, 1, 2)
    )
    assert first == again != other
    assert [one.name for one in first] == [one.name for one in other]
    assert len({one.name for one in first}) == len(first)


def lessons_of(program):
    """Return the names of the lessons that write a program: its own, and the one before it."""
    return {program['lesson'], program.get('goes_on_from', program)['lesson']}


def test_every_program_that_drives_is_in_the_ordeal():
    missing = []
    for path in paths():
        name = path.stem[3:]
        tried = [one for one in declared().values() if name in lessons_of(one)]
        nodes = {call.split('(')[0] for one in tried for call in nodes_of(one)}
        classes = re.findall(r'^class (\w+)', module_of(lesson(name), nodes), re.MULTILINE)
        writes = any(one['writes'] for one in tried)
        for cell, what in publishers(lesson(name)):
            is_tried = writes if '.' in what else what in classes
            if not is_tried and what not in left_out().get(name, {}):
                missing.append(f'{path.name} [{cell}]: {what}')
    assert not missing


def test_what_builds_a_program_is_in_its_lesson():
    for name, one in declared().items():
        cells = {cell.id for cell in lesson(one['lesson']).cells}
        assert {*one['also']} <= cells, name
        if earlier := one.get('goes_on_from'):
            cells = {cell.id for cell in lesson(earlier['lesson']).cells}
            assert {*earlier['also']} <= cells, name


def test_what_does_not_stand_is_of_the_programs():
    for name, listed in known().items():
        for trouble, bases in listed.items():
            assert bases, f'{name}, {trouble}'
            assert {*bases} <= {*declared()[name]['bases']}, f'{name}, {trouble}'


def test_the_lessons_say_what_does_not_stand():
    for path in paths():
        here = lesson(path.stem[3:])
        marked = [name for cell in here.cells for _, name, *_ in MARKED.findall(cell.source)]
        assert [declared()[name]['lesson'] for name in marked] == [here.name] * len(marked)
        assert {*marked} <= {*known()}
        assert not out_of_date(here, known()), 'run: make ordeal WRITE=yes'


def test_a_drawn_part_of_the_ordeal_is_as_it_is_known():
    drawn = random.Random(1)
    program = Prepared('watchful_brake')
    shows = {'processes': ['brake'], 'callbacks': ['brake.scan_callback'], 'parameters': []}
    found = troubles(program.declared, shows, program.name, 'untimed', seed=1)
    found = drawn.sample([one for one in found if one.of != 'network'], 3)
    try:
        assert not differences(meet(program, 'untimed', found, seed=1, at_once=2))
    finally:
        program.close()
