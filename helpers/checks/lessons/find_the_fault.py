"""What the tasks of the lesson "Find the fault" are judged by."""

import re

from helpers.checks.errors import Failed
from helpers.checks.points import all_of, cached, needs
from helpers.checks.tasks import Tasks
from helpers.faults import CORE, FRESH_S, KINDS, OTHER, TURNED, proves, words
from helpers.faults import drive as drive_apart
from helpers.workspace import error_of_launch

tasks = Tasks()
check = tasks.check

STOP_M = 0.9  # in the file of the drive that judges
NEARER_M, FARTHER_M = 0.35, 0.15  # it may stop so far from that: it is heard late, and measured
LEAST = 3  # letters of a line
IDLE = ': the route is not active'
SLOW_MPS = 0.1  # as far as a drive may last, it comes near nothing
NOT_SO_FAR = 'it did not come so far'
NOTHING = '', 'None'


def found(case, kind, command, line):
    """Judge what somebody says is wrong, and by what it is seen."""
    kind_said, command_said, line_said = words(kind).lower(), words(command), words(line)

    @cached
    def printed():
        """Return the lines that the command has printed, in all of its runs."""
        runs = [said for ran, said in case.commands() if command_said in words(ran)]
        return [words(one) for said in runs for one in said.splitlines()] if runs else None

    @cached
    def lines():
        """Return the lines that are meant: equal ones, or else those that have it in them."""
        same = [one for one in printed() if line_said == one]
        return same or [one for one in printed() if line_said in one and len(line_said) >= LEAST]

    def was_run():
        if command_said in NOTHING:
            return 'no command yet'
        return printed() is not None or (
            f'since {case.name} is here, no cell with %%terminal has run: {command_said}'
        )

    def was_printed():
        if line_said in NOTHING:
            return 'no line yet'
        needs(was_run)
        return bool(lines()) or f'{command_said} has printed no line with: {line_said}'

    def shows_the_fault():
        needs(was_printed)
        shows = any(proves(case, command_said, one, line_said) for one in lines())
        return shows or 'this line alone does not show it: a good robot could print it, too'

    def is_of_this_kind():
        if kind in (None, ...):
            return 'no kind yet'
        if kind_said not in KINDS:
            return f'{kind!r} is none of the kinds'
        needs(shows_the_fault, 'it is judged when the line shows the fault')
        return kind_said in (case.fault.kind, *case.fault.also) or f'{kind}: no'

    return [
        ('the command was run', was_run, 'Run it in a cell that begins with %%terminal.'),
        ('it has printed the line', was_printed, 'Copy the line from its output.'),
        ('the line shows the fault', shows_the_fault, case.fault.hint),
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

    def came_so_far():
        return driven().how not in ('stands', 'died')

    def wrong(text):
        """Return what is wrong, and what is said of each tempting mend that is seen."""
        mends = case.wrong_mends()
        said = [mend.says for mend in mends if not mend.ends or driven().how in mend.ends]
        return ' '.join([f'{text}.', *said]) if said else text

    def drives_off():
        end = driven()
        if end.how == 'died':
            return error_of_launch(end.said) or 'the launch has ended, and said nothing'
        return end.how != 'stands' or wrong('it does not move')

    def minds_its_laser():
        end = driven()
        if end.braked is None:
            return NOT_SO_FAR
        return all_of(
            end.braked or wrong('it drives on'),
            end.went_on or wrong('it stops, and never goes on'),
        )

    def arrives():
        end = driven()
        if not came_so_far():
            return NOT_SO_FAR
        if end.how == 'hits':
            return wrong('it hits something')
        for topic, voices in end.voices.items():
            if voices > 1:
                return wrong(f'{voices} programs publish on {topic}')
        if end.how == 'goes on':
            return wrong('it does not come to an end')
        if abs(end.turned) > TURNED:
            return wrong('it does not keep its direction')
        if end.simulated:
            return wrong(f'{end.simulated[0]} has use_sim_time, and nobody publishes /clock')
        if end.freshest_s > FRESH_S:
            age = f'{end.freshest_s:.1f} s'
            return wrong(f'its brake works on scans of which even the newest is {age} old')
        if -NEARER_M <= end.free_m - STOP_M <= FARTHER_M:
            return True
        return wrong(f'it stops {end.free_m:.1f} m before something, and stop_m was {STOP_M}')

    def stands_with_an_idle_route():
        """Let nobody activate the route, and somebody else say where to go."""
        asleep = params(case, autostart='false')
        end = drive_apart(case, OTHER, params=asleep, wanted_mps=SLOW_MPS)
        if IDLE not in end.said:
            return wrong(f'nobody activates the route, and the brake never says: I stop{IDLE}')
        # Until its brake has found the route, it may ask nobody, and drive.
        is_at_rest = end.how in ('stands', 'stops')
        return is_at_rest or wrong('the route is not active, and it drives on')

    def rests():
        end = driven()
        if not came_so_far():
            return NOT_SO_FAR
        return end.stands_at_exit or 'its last command was to drive'

    def is_right_there():
        if case.fault.asks_route and came_so_far():
            return all_of(arrives(), stands_with_an_idle_route())
        return arrives()

    sees = 'while its laser sees nothing it stops, then it goes on'
    trouble = {
        'blind': sees,
        'push': sees,
        'clock': 'while the stamps of its scans are wrong it stops, then it goes on',
    }[case.fault.trouble]
    return [
        (title, drives_off, case.fault.hint),
        (trouble, minds_its_laser, case.fault.hint),
        ('it stops where its file says, and hits nothing', is_right_there, case.fault.hint),
        ('Ctrl+C leaves it at rest', rests, 'How does brake.py end?'),
    ]


def fault_of(case, *answer):
    """Return which fault a task is about."""
    return case.fault.name


for one in (*CORE, 'the_next'):
    tasks.add(found, name=f'find_{one}', about=fault_of)
    tasks.add(mended, name=f'mend_{one}', limit_s=120, cpu_s=60, about=fault_of)


def params(case, autostart=''):
    """Write the robot's own file of parameters with another limit, and return how it is given.

    With `autostart` that parameter of the manager gets this value, too.
    """
    file = f'install/{case.name}/share/{case.name}/config/{case.name}.yaml'
    try:
        text = case.workspace.file(file).read_text(encoding='utf-8')
    except OSError:
        raise Failed(f'{file} cannot be read: is config/{case.name}.yaml still there?') from None
    text, count = re.subn(r'(\bstop_m["\']?\s*:\s*)[-\d.]+', rf'\g<1>{STOP_M}', text)
    if not count:
        raise Failed(f'config/{case.name}.yaml says no stop_m any more')
    if autostart:
        text = re.sub(r'(\bautostart["\']?\s*:\s*)\w+', rf'\g<1>{autostart}', text)
    case.workspace.write('judged.yaml', text)
    return 'params_file:=judged.yaml'
