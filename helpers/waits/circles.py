"""The circle of waits that has closed, as boxes and arrows: plain data, for a picture of it.

Of each wait it takes what keeps it from ending, and who holds that, and what that one waits for. A
chain that ends where nobody waits, as at a server that is missing, is no circle.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

from .blockers import Blocker, Ender, name_of_activity, place_of
from .finding import Finding
from .snapshot import Activity

RUN = re.compile(r'run (\d+)')
MOST_NAMES, AND = 3, ' and '  # of runs in one box
Waits = dict[Activity, Finding]


def circle(findings: Iterable[Finding]) -> dict | None:
    """Return the first circle of these waits, None if no chain of them closes.

    It has `boxes`, {id, name}; `arrows`, {from, to, label, says, hot}, in the order in which they
    turn; `stuck`, the numbers of the boxes `run NUMBER`; and `says`, a sentence. Where several
    circles hang together, the shortest has arrows, and the sentence tells of all.
    """
    waits = _closed(findings)
    starts = sorted(waits, key=_order)
    return next((found for one in starts if (found := _Turn(waits, one).data())), None)


def _order(activity: Activity) -> tuple:
    """Return where a run comes in an order that is the same each time: callbacks are the first."""
    return activity.task is None, name_of_activity(activity), place_of(activity)


def _closed(findings: Iterable[Finding]) -> Waits:
    """Return the waits that only others of them could end: whatever may still come is taken out."""
    waits = {one.activity: one for one in findings if one.stuck}
    while free := [activity for activity in waits if not _ends_of(waits, activity)]:
        for activity in free:
            del waits[activity]
    return waits


def _ends_of(waits: Waits, activity: Activity) -> list[tuple[Ender, Blocker]]:
    """Return what could end a wait, each with what keeps it from that; nothing if one is free."""
    finding = waits[activity]
    found = [(ender, stop) for ender in finding.enders if (stop := _stop(waits, ender))]
    if finding.needs_all:
        return found[:1]  # without one of them it does not end
    return found if len(found) == len(finding.enders) else []


def _stop(waits: Waits, ender: Ender) -> Blocker | None:
    """Return what keeps it from running as long as these waits last."""
    return next(
        (
            stop
            for stop in ender.blockers
            if stop.holders and all(_inner(waits, one) for one in stop.holders)
        ),
        None,
    )


def _inner(waits: Waits, holder: Activity) -> Activity | None:
    """Return what waits there: the holder, or a callback that it runs while it spins."""
    if holder in waits:
        return holder
    same = (one for one in waits if one.thread is not None and one.thread is holder.thread)
    return next(same, None)


class _Turn:
    """Goes from one wait to those that it waits for, until it comes back."""

    def __init__(self, waits: Waits, start: Activity) -> None:
        self.waits = waits
        self.boxes: dict[object, dict] = {}  # by what they stand for
        self.arrows: list[dict] = []
        self.names = Counter()
        self.gone: set[str] = set()  # the runs from which the way went on
        self.together = self._together()
        self._from(start)

    def data(self) -> dict | None:
        """Return the circle on which the start is, None if it only leads to one."""
        first = next(iter(self.boxes.values()))['id']
        says = [one['says'] for one in self.arrows if first in self._behind(one['to'])]
        if not says:
            return None
        arrows = self._back_to(first)
        on_it = {one['from'] for one in arrows}
        boxes = [box for box in self.boxes.values() if box['id'] in on_it]
        return {
            'stuck': [int(number) for box in boxes for number in RUN.findall(box['id'])],
            'boxes': boxes,
            'arrows': arrows,
            'says': f'Nobody can go on: {"; ".join(says)}.',
        }

    def _back_to(self, first: str) -> list[dict]:
        """Return the shortest way from a box back to it."""
        ways = [[one] for one in self.arrows if one['from'] == first]
        for way in ways:  # it grows meanwhile
            if way[-1]['to'] == first:
                return way
            ways += [[*way, one] for one in self.arrows if one['from'] == way[-1]['to']]
        raise ValueError('No arrow leads back.')

    def _behind(self, start: str) -> set[str]:
        """Return a box, and all that the arrows from it lead to."""
        found, ways = {start}, [start]
        while ways:
            here = ways.pop()
            new = {one['to'] for one in self.arrows if one['from'] == here} - found
            found |= new
            ways += new
        return found

    # --- Boxes and arrows

    def _box(self, key: object, kind: str, name: str) -> dict:
        if key not in self.boxes:
            name = name.replace('`', '')
            self.names[name] += 1
            alike = f' ({self.names[name]})' if self.names[name] > 1 else ''
            self.boxes[key] = {'id': f'{kind} {len(self.boxes) + 1}', 'name': f'{name}{alike}'}
        return self.boxes[key]

    def _run(self, activity: Activity) -> dict:
        runs = self.together.get(activity, (activity,))
        names = list(dict.fromkeys(map(name_of_activity, runs)))
        if len(names) > MOST_NAMES:
            names[MOST_NAMES - 1 :] = [f'{len(names) - MOST_NAMES + 1} more']
        return self._box(runs, 'run', AND.join([', '.join(names[:-1]), names[-1]][-len(names) :]))

    def _arrow(self, start: dict, end: dict, label: str, says: str) -> None:
        one = {'from': start['id'], 'to': end['id'], 'label': label, 'says': says, 'hot': True}
        if one not in self.arrows:
            self.arrows.append(one)

    def _together(self) -> dict[Activity, tuple[Activity, ...]]:
        """Return the runs that hold threads of one executor, and wait for the same: one box."""
        found = {}
        for stop in (stop for one in self.waits for _, stop in _ends_of(self.waits, one)):
            alike: dict[object, list[Activity]] = {}
            for one in sorted(stop.holders, key=_order):
                alike.setdefault(self._awaited(one), []).append(one)
            groups = [tuple(group) for group in alike.values() if len(group) > 1]
            found |= {one: group for group in groups for one in group}
        return found

    def _awaited(self, activity: Activity) -> object:
        """Return a key of what is waited for: two that wait for the same answers have one."""
        finding = self.waits.get(activity)
        if finding is None:
            return activity
        return finding.what, *((ender.text, ender.activity) for ender in finding.enders)

    # --- The way

    def _from(self, activity: Activity) -> None:
        """Go from what runs to what it waits for, and on to what keeps that from coming."""
        run = self._run(activity)
        if run['id'] in self.gone:
            return
        self.gone.add(run['id'])
        inner = _inner(self.waits, activity)
        if inner is not activity:
            self._arrow(run, self._run(inner), 'waits for', f'{run["name"]} runs it')
            self._from(inner)
            return
        finding = self.waits[activity]
        thing = self._box(self._awaited(activity), 'thing', finding.short or finding.what)
        how = _of('awaits' if activity.suspended else 'waits for', run)
        self._arrow(run, thing, how, f'{run["name"]} {how} {thing["name"]}')
        for ender, stop in _ends_of(self.waits, activity):
            self._from_thing(thing, ender, stop)

    def _from_thing(self, thing: dict, ender: Ender, stop: Blocker) -> None:
        if stop.thing:
            held = self._box((stop.thing, frozenset(stop.holders)), 'held', stop.thing)
            needs = f'one of {held["name"]}' if len(stop.holders) > 1 else held['name']
            says = f'{ender.name} {ender.does}, but needs {needs}'
            self._arrow(thing, held, f'{ender.name} needs', says)
            runs = {self._run(one)['id']: one for one in stop.holders}
            what = held['name'] if len(runs) == 1 else 'one of them'
            for one in sorted(runs.values(), key=_order):
                run = self._run(one)
                label = 'held by' if len(runs) == 1 else 'one held by'
                self._arrow(held, run, label, f'{run["name"]} {_of("holds", run)} {what}')
                self._from(one)
        elif stop.cause == 'itself':
            (waiter,) = stop.holders
            line = self._box((thing['id'], ender.name), 'line', ender.name)
            self._arrow(thing, line, 'needs', f'{ender.name} {ender.does}')
            self._arrow(line, self._run(waiter), 'comes after', 'that comes only afterwards')
        else:
            one = ender.activity or stop.holders[0]
            run = self._run(one)
            self._arrow(thing, run, ender.label, f'{run["name"]} {ender.does}')
            self._from(one)


def _of(verb: str, run: dict) -> str:
    """Return a verb as its person needs it: one run, or several."""
    return re.sub(r's\b', '', verb) if AND in run['name'] else verb
