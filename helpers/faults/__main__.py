"""For a teacher: what is wrong with each robot, how it is seen, and what mends it.

python -m helpers.faults [NAME ...]
python -m helpers.faults --drive NAME ...     how it drives, and what the command that finds it says
"""

import argparse
import sys
import time

from helpers.faults import FAULTS, Fault, drive, mend_in_words, take
from helpers.notebook import wrap
from helpers.workspace import Workspace

LAUNCH = 'source install/setup.bash\nros2 launch ada bringup.launch.xml'
SEEN_S = 30.0  # so long a robot has to show its fault


def show_drive(fault: Fault) -> None:
    """Drive a robot with the fault, then launch it again and run the command that finds it."""
    workspace = Workspace('faults')
    try:
        case = take(workspace, fault, 'ada', anew=True)
        end = drive(case)
        print(f'fails: {end.how} (the file says {" or ".join(fault.fails)})', end.said, sep='\n')
        look, said = case.named(fault.look), ''
        with workspace.start(LAUNCH, 'ada') as launch:
            end_s = time.monotonic() + SEEN_S
            while fault.line not in said and time.monotonic() < end_s:
                is_launch = look.startswith('ros2 launch')
                said = (
                    '\n'.join(launch.lines)
                    if is_launch
                    else workspace.terminal(f'source install/setup.bash\n{look}')
                )
        print(f'{look}\n{said}')
        if fault.line not in said:
            sys.exit(f'{fault.name}: the line is not there: {fault.line}')
    finally:
        workspace.close()


def main() -> None:
    """Print the faults with these names, or all, or drive them."""
    parser = argparse.ArgumentParser(description='Say what is wrong with each robot.')
    parser.add_argument('names', nargs='*', metavar='NAME', help='of a folder in helpers/faults')
    parser.add_argument('--drive', action='store_true', help='drive the robot, and look at it')
    options = parser.parse_args()
    names = options.names or [*FAULTS]
    for name in names:
        if name not in FAULTS:
            sys.exit(f'There is no fault {name}. There are {", ".join(FAULTS)}.')
        fault = FAULTS[name]
        print(f'{name} ({fault.kind})')
        if options.drive:
            show_drive(fault)
            continue
        for text in (
            fault.broken,
            f'Seen by: {fault.look}',
            f'Its line: {fault.line}',
            *mend_in_words(fault),
            *(f'Tempting, and wrong: {mend.says}' for mend in fault.wrong),
        ):
            print(*wrap(f'    {text}', rest=' ' * 8), sep='\n')
        print()


if __name__ == '__main__':
    main()
