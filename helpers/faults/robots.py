"""The robots of the lesson: which comes next, what it did, by what its fault is seen."""

from __future__ import annotations

import random
import re
import string
import time
from collections import Counter
from collections.abc import Sequence

from helpers.faults.cases import FAULTS, Case, forget, mend_in_words, take, take_all
from helpers.faults.drives import Drive, drive
from helpers.ros import ros_session
from helpers.workspace import Workspace, error_of_launch

CORE = {'ada': 'deaf_brake', 'bo': 'unread_limit', 'cleo': 'slow_look', 'dan': 'second_voice'}
OTHERS = 'eve', 'finn', 'gus', 'hana', 'ivo', 'joy', 'kim', 'leo', 'mia', 'noa', 'oli', 'pia'
UP_S = 60.0
NODES = 'brake', 'manager', 'robot', 'route'
TURNED = 0.3  # rad, to both sides


def robot(workspace: Workspace, name: str) -> Case:
    """Return the robot ada, bo, cleo or dan; its package is in src.

    All four come with the first one: to build them at once takes half as long.
    """
    return take_all(workspace, {each: FAULTS[fault] for each, fault in CORE.items()})[name]


def take_next(workspace: Workspace, seed: int, known: Sequence[str] = ()) -> Case:
    """Return the next robot: the number `seed` decides in which order they come.

    First those come that have not been mended yet, without those of the core. Then all of them,
    again and again. Until it is mended, a robot stays as it was left. `known` are the faults that
    were mended, in their order.
    """
    name = OTHERS[len(known) % len(OTHERS)]
    forget(workspace, {*OTHERS} - {name})  # a later one of this name may have the same fault
    return take(workspace, FAULTS[order_of(seed, known)[0]], name)


def order_of(seed: int, known: Sequence[str] = ()) -> list[str]:
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


def show_drive(case: Case) -> None:
    """Drive a robot in the page, and say what it did."""
    end = drive(case, name=case.name)
    print(case.name, did(end))


def did(end: Drive) -> str:
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


def wait_until_up(case: Case) -> None:
    """Wait until the robot and the three nodes of its package are there, or raise TimeoutError."""
    with ros_session() as session:
        try:
            session.wait_until(lambda: set(NODES) <= set(session.node.get_node_names()), UP_S)
        except TimeoutError:
            raise TimeoutError(
                f'Of {case.name} not all nodes have come: does its launch run?'
            ) from None
        for record in session.records():  # they stand in the terminal
            record.printed = True


def seen(case: Case) -> tuple[str, str, str]:
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


def proves(case: Case, command: str, line: str, said: str | None = None) -> bool:
    """Return whether a line of what a command printed shows the fault, in the part that is said.

    That part must go as far as what shows it: `Publisher count:` is printed by a good robot, too.
    """
    said_to = len(line) if said is None else line.find(said) + len(said)
    return any(
        re.search(case.named(pair.command), command)
        and (shown := re.search(pair.line, line))
        and said_to >= len(line[: shown.end()].rstrip(f'{string.punctuation} '))
        for pair in case.fault.evidence
    )


def words(text: object) -> str:
    """Return what is there as a text with single spaces, and nothing for dots."""
    return ' '.join(str(text).split()) if text is not ... else ''


def mend(case: Case) -> None:
    """Begin with the robot as it was, and mend it."""
    case.write(case.fault.files)
    case.mend(case.fault.right[0])


def give_up(case: Case) -> None:
    """Say what is wrong with a robot, how it is seen, and what mends it."""
    fault = case.fault
    print(f'{fault.broken}\nSeen by: {case.named(fault.look)}\nIts line: {fault.line}')
    print(*(case.named(line) for line in mend_in_words(fault)), sep='\n')
