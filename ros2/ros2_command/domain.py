"""Which domain a command is in.

1. The one that ROS_DOMAIN_ID names.
2. That of the process that has started the command, such as the kernel of a cell.
3. That of the only open session of this Python environment; of any other one if this environment
   has none at all.
4. Without any record: domain 0, on this machine only.
"""

from __future__ import annotations

import os
import sys

from ros2_command.commands import CommandError
from ros2_command.records import VARIABLES, Record, ancestors, read_records

_joined: Record | None = None  # the record that this command has followed


def join_domain() -> dict[str, str]:
    """Choose the domain if ROS_DOMAIN_ID does not, set it, and return the variables that count.

    Raises CommandError if it is not clear which session is meant.
    """
    global _joined
    if not os.environ.get('ROS_DOMAIN_ID'):
        records = read_records()
        _joined = _record_of_parent(records) or _record_of_session(records)
        os.environ |= _joined.variables if _joined else {'ROS_DOMAIN_ID': '0'}
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    return {name: os.environ[name] for name in VARIABLES if os.environ.get(name)}


def why_nobody_is_there() -> str | None:
    """Return why a terminal may have found no node in its domain, or None if no record says it."""
    records = read_records()
    if _record_of_parent(records) is not None:
        return None  # a cell knows whether its session is open
    domain = os.environ['ROS_DOMAIN_ID']
    if _joined is not None:
        in_it = [record for record in records if record.pid == _joined.pid]
        return None if any(record.is_open for record in in_it) else _nothing_is_open([_joined])
    opened = [record for record in _of_this_environment(records) if record.is_open]
    if not opened or domain in [record.domain for record in records]:
        return None
    return (
        f'Nobody is in domain {domain}, which ROS_DOMAIN_ID names. Open: {_listed(opened)}. '
        'A notebook whose kernel was restarted has another domain than before: '
        f'`export ROS_DOMAIN_ID={opened[0].domain}`, or `unset ROS_DOMAIN_ID`.'
    )


def _record_of_parent(records: list[Record]) -> Record | None:
    """Return the record of the nearest process above this one, rather that of an open session."""
    for pid in ancestors():
        own = [record for record in records if record.pid == pid]
        if own:
            return max(own, key=lambda record: record.is_open)
    return None


def _record_of_session(records: list[Record]) -> Record | None:
    """Return the only record that can be meant, or None if there is none."""
    records = _of_this_environment(records)
    opened = [record for record in records if record.is_open]
    candidates = opened or records
    if not candidates:
        return None
    if all(record.variables == candidates[0].variables for record in candidates):
        return candidates[0]
    if not opened:
        raise CommandError(_nothing_is_open(candidates))
    raise CommandError(
        f'{len(opened)} notebooks have an open session: {_listed(opened)}. '
        f'Choose one, for example with `export ROS_DOMAIN_ID={opened[0].domain}`.'
    )


def _of_this_environment(records: list[Record]) -> list[Record]:
    """Return the records of this Python environment, or all if it has none.

    A user with two checkouts of a course means the notebooks of the one whose terminal it is.
    """
    own = os.path.realpath(sys.prefix)  # the folder may be reached through a link
    return [record for record in records if os.path.realpath(record.prefix) == own] or records


def _nothing_is_open(records: list[Record]) -> str:
    names = ', '.join(dict.fromkeys(record.name for record in records))
    return f'No session is open in {names}: run the cell of the notebook, and type while it runs.'


def _listed(records: list[Record]) -> str:
    return ', '.join(f'{record.name} ({record.domain})' for record in records)
