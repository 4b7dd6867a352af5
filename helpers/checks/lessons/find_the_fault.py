"""What the tasks of the lesson "Find the fault" are judged by."""

import random
import re
import time
from collections import Counter

from helpers.checks import progress
from helpers.checks.errors import Failed
from helpers.checks.first_error import error_of_launch
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks
from helpers.faults import FAULTS, KINDS, OTHER, forget, mend_in_words, take
from helpers.faults import drive as drive_apart

tasks = Tasks()
check = tasks.check

CORE = {'ada': 'deaf_brake', 'bo': 'unread_limit', 'cleo': 'slow_look', 'dan': 'second_voice'}
OTHERS = 'eve', 'finn', 'gus', 'hana', 'ivo', 'joy', 'kim', 'leo', 'mia', 'noa', 'oli', 'pia'
OTHER_ROBOT = 'the_next'  # the tasks about one of the others
UP_S = 60.0
NODES = '/brake', '/manager', '/robot', '/route'
STOP_M = 0.9  # in the file of the drive that judges
NEARER_M, FARTHER_M = 0.35, 0.15  # it may stop so far from that: it is heard late, and measured
TURNED = 0.3  # rad, to both sides
LEAST = 3  # letters of a line


# --- Robots


def robot(workspace, name):
    """Return the robot ada, bo, cleo or dan; its package is in src."""
    return take(workspace, FAULTS[CORE[name]], name)


def next_robot(workspace, seed):
    """Return the next robot: the number decides in which order they come.

    First those come that have not been mended yet, without those of the core. Then all of them,
    again and again. Until it is mended, a robot stays as it was left.
    """
    known = progress.about(f'mend_{OTHER_ROBOT}')
    name = OTHERS[len(known) % len(OTHERS)]
    forget(workspace, {*OTHERS} - {name})  # a later one of this name may have the same fault
    return take(workspace, FAULTS[order_of(seed, known)[0]], name)


def order_of(seed, known=()):
    """Return the faults that are left in this round, in the order that a number gives them.

    `known` are those that were mended, in all rounds. The first round is without the core.
    """
    times = Counter([*CORE.values(), *known])
    least = min(times[fault] for fault in FAULTS)
    order = sorted(fault for fault in FAULTS if least or fault not in CORE.values())
    random.Random(seed).shuffle(order)
    left = [fault for fault in order if times[fault] == least]
    # The last one of a round does not begin the next: progress keeps none twice in a row.
    return sorted(left, key=lambda fault: fault in known[-1:])


def drive(case):
    """Drive a robot in the page, and say what it did."""
    end = drive_apart(case, name=case.name)
    print(case.name, did(end))


def did(end):
    """Return what a robot did, in words that do not move."""
    if end.how in ('stops', 'hits', 'goes on') and abs(end.turned) > TURNED:
        return 'turns away.'
    if end.how == 'stops':
        near = end.free_m < 0.8
        return 'stops near the wall.' if near else 'stops far away from the wall.'
    if end.how == 'died':
        return f'cannot be launched: {error_of_launch(end.said)}'
    return {
        'stands': 'does not move.',
        'hits': 'hits the wall.',
        'goes on': 'drives on and on.',
    }[end.how]


def wait_until_up(case):
    """Wait until the robot and the three nodes of its package are there."""
    end_s = time.monotonic() + UP_S
    while not set(NODES) <= set(case.workspace.terminal('ros2 node list').splitlines()):
        if time.monotonic() > end_s:
            raise TimeoutError(f'Of {case.name} not all nodes have come: does its launch run?')


def seen(case):
    """Run the command that shows what is wrong. Return the kind, the command and its line."""
    fault, look = case.fault, case.named(case.fault.look)
    if look.startswith('ros2 launch'):
        case.workspace.terminals[case.name].wait_for(fault.line, UP_S)
        return fault.kind, look, fault.line
    end_s = time.monotonic() + UP_S
    while time.monotonic() < end_s:  # what a robot commands takes some time to show it
        said = case.workspace.terminal(f'source install/setup.bash\n{look}').splitlines()
        for one in said:
            if fault.line in one or proves(case, look, words(one)):
                return fault.kind, look, one
    return fault.kind, look, fault.line


def proves(case, command, line):
    """Return whether a line of what a command printed shows the fault."""
    return any(
        re.search(case.named(pair.command), command) and re.search(pair.line, line)
        for pair in case.fault.evidence
    )


def mend(case):
    """Begin with the robot as it was, and mend it."""
    case.write(case.fault.files)
    case.mend(case.fault.right[0])


def give_up(case):
    """Say what is wrong with a robot, how it is seen, and what mends it."""
    fault = case.fault
    print(f'{fault.broken}\nSeen by: {case.named(fault.look)}\nIts line: {fault.line}')
    print(*(case.named(line) for line in mend_in_words(fault)), sep='\n')


# --- Tasks


def found(case, kind, command, line):
    """Judge what somebody says is wrong, and by what it is seen."""

    def outputs():
        wanted = words(command)
        if wanted in ('', 'None'):
            raise Failed('no command yet')
        printed = [said for ran, said in case.commands() if wanted in words(ran)]
        if not printed:
            raise Failed(f'since {case.name} is here, no cell with %%terminal has run: {wanted}')
        return printed

    def lines():
        wanted = words(line)
        if wanted in ('', 'None'):
            raise Failed('no line yet')
        printed = [words(one) for said in outputs() for one in said.splitlines()]
        same = [one for one in printed if wanted == one]
        same = same or [one for one in printed if wanted in one and len(wanted) >= LEAST]
        if not same:
            raise Failed(f'{words(command)} has printed no line with: {wanted}')
        return same

    def was_run():
        return bool(outputs())

    def was_printed():
        return bool(lines())

    def shows_the_fault():
        if any(proves(case, words(command), one) for one in lines()):
            return True
        return 'this line alone does not show it: a good robot could print it, too'

    def is_of_this_kind():
        if kind in (None, ...):
            return 'no kind yet'
        if word not in KINDS:
            return f'{kind!r} is none of the kinds'
        if shown() is not True:
            return 'it is judged when the line shows the fault'
        return word in (case.fault.kind, *case.fault.also) or f'{kind}: no'

    word, shown = words(kind).lower(), cached(shows_the_fault)
    return [
        ('the command was run', was_run, 'Run it in a cell that begins with %%terminal.'),
        ('it has printed the line', was_printed, 'Copy the line from its output.'),
        ('the line shows the fault', shown, case.fault.hint),
        ('the kind of the fault', is_of_this_kind, case.fault.hint),
    ]


def mended(case):
    """Judge a robot that somebody has mended, on another floor and with another limit."""
    title = f'on another floor {case.name} drives off'
    missing = case.lost() if case.is_changed else f'the files of {case.name} are as you got them'
    if missing:  # nothing to drive for
        return [(title, lambda: missing, '')]

    @cached
    def driven():
        return drive_apart(case, OTHER, trouble=case.fault.trouble, params=params(case))

    def drives_off():
        end = driven()
        if end.how == 'died':
            raise Failed(error_of_launch(end.said) or 'the launch has ended, and said nothing')
        return end.how != 'stands' or with_mends(case, end, 'it does not move')

    def minds_its_laser():
        end = driven()
        if end.braked is None:
            return 'it did not come so far'
        if not end.braked:
            return with_mends(case, end, 'it drives on')
        return end.went_on or with_mends(case, end, 'it stops, and never goes on')

    def arrives():
        end = driven()
        if end.how in ('stands', 'died'):
            return 'it did not come so far'
        if end.how == 'hits':
            return with_mends(case, end, 'it hits something')
        if end.voices > 1:
            return with_mends(case, end, f'{end.voices} programs publish on cmd_vel')
        if end.how == 'goes on':
            return with_mends(case, end, 'it does not come to an end')
        if abs(end.turned) > TURNED:
            return with_mends(case, end, 'it does not keep its direction')
        away_m = end.free_m - STOP_M
        if -NEARER_M <= away_m <= FARTHER_M:
            return True
        found = f'it stops {end.free_m:.1f} m before something, and stop_m was {STOP_M}'
        return with_mends(case, end, found)

    def rests():
        end = driven()
        if end.how in ('stands', 'died'):
            return 'it did not come so far'
        return end.stands_at_exit or 'its last command was to drive'

    trouble = {
        'blind': 'while its laser sees nothing it stops, then it goes on',
        'push': 'while its laser sees nothing it stops, then it goes on',
        'clock': 'while the stamps of its scans are wrong it stops, then it goes on',
    }[case.fault.trouble]
    return [
        (title, drives_off, case.fault.hint),
        (trouble, minds_its_laser, case.fault.hint),
        ('it stops where its file says, and hits nothing', arrives, case.fault.hint),
        ('Ctrl+C leaves it at rest', rests, 'How does brake.py end?'),
    ]


def fault_of(case, *answer):
    """Return which fault a task is about."""
    return case.fault.name


for one in (*CORE, OTHER_ROBOT):
    tasks.add(found, name=f'find_{one}', about=fault_of)
    tasks.add(mended, name=f'mend_{one}', limit_s=120, cpu_s=60, about=fault_of)


def words(text):
    """Return a text without what white space means nothing."""
    return ' '.join(str(text).split()) if text is not ... else ''


def params(case):
    """Write the robot's own file of parameters with another limit, and return how it is given."""
    file = f'install/{case.name}/share/{case.name}/config/{case.name}.yaml'
    try:
        text = case.workspace.file(file).read_text(encoding='utf-8')
    except OSError:
        raise Failed(f'{file} cannot be read: is config/{case.name}.yaml still there?') from None
    text, count = re.subn(r'(\bstop_m["\']?\s*:\s*)[-\d.]+', rf'\g<1>{STOP_M}', text)
    if not count:
        raise Failed(f'config/{case.name}.yaml says no stop_m any more')
    case.workspace.write('judged.yaml', text)
    return 'params_file:=judged.yaml'


def with_mends(case, end, found):
    """Return what was found, and what is said of each tempting mend that is seen."""
    mends = case.wrong_mends()
    said = [mend.says for mend in mends if not mend.ends or end.how in mend.ends]
    return ' '.join([f'{found}.', *said]) if said else found
