"""What the tasks of the lesson "Find the fault" are judged by."""

import re

from helpers.checks.errors import Failed
from helpers.checks.points import cached
from helpers.checks.tasks import Tasks
from helpers.faults import CORE, KINDS, OTHER, TURNED, proves, words
from helpers.faults import drive as drive_apart
from helpers.workspace import error_of_launch

tasks = Tasks()
check = tasks.check

STOP_M = 0.9  # in the file of the drive that judges
NEARER_M, FARTHER_M = 0.35, 0.15  # it may stop so far from that: it is heard late, and measured
LEAST = 3  # letters of a line


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


for one in (*CORE, 'the_next'):
    tasks.add(found, name=f'find_{one}', about=fault_of)
    tasks.add(mended, name=f'mend_{one}', limit_s=120, cpu_s=60, about=fault_of)


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
