"""For a teacher: what is wrong with each robot, how it is seen, and what mends it.

python -m helpers.faults [NAME ...]
"""

import sys

from helpers.faults import FAULTS, mend_in_words
from helpers.notebook import wrap


def main() -> None:
    """Print the faults with these names, or all."""
    names = sys.argv[1:] or [*FAULTS]
    for name in names:
        if name not in FAULTS:
            sys.exit(f'There is no fault {name}. There are {", ".join(FAULTS)}.')
        fault = FAULTS[name]
        print(f'{name} ({fault.kind})')
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
