"""The sentences: what waits, who could end it, why that one cannot, and what helps."""

from __future__ import annotations

from .blockers import Ender, name_of_activity, place_of
from .finding import Finding

NOTHING = 'Nothing waits for anything that is known.'
ASK = 'Call a service from a callback'
PARALLEL = 'Run callbacks in parallel'
PUBLISH = 'Publish and subscribe'
TIME = 'Keep what is fresh'
STOP = 'Run a long job'
# What helps: for a cause, and for the kinds of waits that it holds for (none: for all).
CURES = (
    (
        'spin in callback',
        (),
        'Do not spin in a callback: its executor spins already. Use call_async() and a done '
        'callback, or `await` with a callback group of its own for the client.',
        ASK,
    ),
    (
        'taken out',
        (),
        'Do not spin in a callback: give the node back with executor.add_node(node), '
        'or better, use call_async() and a done callback.',
        ASK,
    ),
    (
        'thread',
        ('service', 'action'),
        'Hold no thread: call_async() and a done callback, or `await`. Or give the executor one '
        'thread more, MultiThreadedExecutor(num_threads=...), and the client a group of its own.',
        ASK,
    ),
    (
        'group',
        ('service', 'action'),
        'Give the client a group of its own: create_client(..., callback_group='
        'MutuallyExclusiveCallbackGroup()). Or use call_async() and a done callback.',
        ASK,
    ),
    (
        'thread',
        ('rate',),
        'In a callback use a timer in place of a Rate. A Rate needs a thread that spins meanwhile.',
        PARALLEL,
    ),
    (
        'thread',
        (),
        'Let the callback return, and do the rest in another one; or give the executor one thread '
        'more, MultiThreadedExecutor(num_threads=...), and each of the two a group of its own.',
        PARALLEL,
    ),
    ('group', (), 'Give the two callbacks a group each, or let the first one return.', PARALLEL),
    (
        'not spun',
        (),
        'Spin it: an executor in a thread of its own, or rclpy.spin(node) in the main thread and '
        'the wait in another one. spin_until_future_complete() does both, outside of callbacks.',
        PARALLEL,
    ),
    (
        'no peer',
        ('service', 'action', 'peer'),
        'Start the server, and compare the two names: '
        'ros2 service list, ros2 action list. Give each wait a time-out.',
        ASK,
    ),
    (
        'no peer',
        (),
        'Start the other side, and compare the two names: ros2 topic list, ros2 topic info -v.',
        PUBLISH,
    ),
    ('qos', (), 'Ask for what the publisher offers: ros2 topic info -v shows both.', PUBLISH),
    ('type', (), 'Use one type on both sides: ros2 topic info shows it.', PUBLISH),
    ('clock', (), 'Publish /clock, or set use_sim_time to false.', TIME),
    ('canceled', (), 'Start the timer again: timer.reset().', TIME),
    (
        'circle',
        ('lock',),
        'Take two locks in the same order everywhere, or use one.',
        PARALLEL,
    ),
    (
        'itself',
        ('lock',),
        'Leave the first `with` before, or use threading.RLock(); '
        'release in a `with`, so that no way out forgets it.',
        PARALLEL,
    ),
    (
        'spins',
        ('thread', 'end'),
        'Call rclpy.shutdown() or executor.shutdown() before join(), '
        'or make the thread a daemon: Thread(..., daemon=True).',
        STOP,
    ),
    ('spins', (), 'Do not spin in a callback: its executor spins already.', ASK),
    (
        'endless',
        (),
        'Give the loop an end: a flag or an Event that it asks, and that is set before join().',
        STOP,
    ),
    (
        'itself',
        (),
        'What would end the wait comes after it, in the same thread. Let the callback '
        'return and do the rest in another one, or wait in another thread.',
        PARALLEL,
    ),
    (
        'gone',
        (),
        'Keep the node and what it has made until nobody waits for it any more.',
        PARALLEL,
    ),
)


def sentences(finding: Finding) -> list[str]:
    """Return the lines that explain a wait."""
    activity = finding.activity
    name = name_of_activity(activity)
    place = place_of(activity) or 'the end of the program'
    how = 'asks again and again for' if finding.loops else 'waits for'
    if activity.suspended:
        how = 'awaits'
    if finding.kind == 'spin':
        how = 'spins, and so waits for'
    lines = [f'{_capital(name)} {how} {finding.what}.', f'  {place}']
    if finding.limited:
        lines.append('  This wait has a time-out.')
    if not finding.enders:
        lines.append('  Who could end this wait cannot be seen.')
    for enders in _alike(finding.enders):
        lines += _of_enders(enders, finding.limited)
    if finding.stuck:
        lines += cures(finding)
    elif finding.enders and not finding.limited and finding.kind != 'spin':
        lines.append('  Nothing was found that keeps this from coming.')
    return lines


def _capital(name: str) -> str:
    """Begin a sentence; a name of code keeps its letters."""
    return name if name.endswith('()') else f'{name[0].upper()}{name[1:]}'


def _alike(enders: list[Ender]) -> list[list[Ender]]:
    """Return the enders in groups: those that the same keeps from running are told together."""
    groups: list[list[Ender]] = []
    for ender in enders:
        alike = [group for group in groups if group[0].blockers and _same(group[0], ender)]
        if alike:
            alike[0].append(ender)
        else:
            groups.append([ender])
    return groups


def _same(one: Ender, other: Ender) -> bool:
    return {blocker.text for blocker in one.blockers} == {b.text for b in other.blockers}


def _of_enders(enders: list[Ender], limited: bool) -> list[str]:
    lines = [f'  - {ender.text}{f": {ender.now}" if ender.now else ""}.' for ender in enders]
    if enders[0].blockers:
        lines = [f'  - {ender.text}.' for ender in enders]
        why = '; '.join(dict.fromkeys(blocker.text for blocker in enders[0].blockers))
        cannot = 'It cannot' if len(enders) == 1 else 'They cannot'
        lines.append(f'    {"Not now" if limited else cannot}: {why}.')
    return lines


def cures(finding: Finding) -> list[str]:
    """Return what helps, one line for each cause that is known, two at most."""
    return [f'  What helps: {text} (lesson "{lesson}")' for text, lesson in _applying(finding)[:2]]


def _applying(finding: Finding) -> list[tuple[str, str]]:
    causes = finding.causes
    if 'spin in callback' in causes:
        causes = {'spin in callback'}
    if {'thread', 'group'} <= causes:
        causes = causes - {'group'}  # what frees the thread frees the group
    found = {}
    for cause, kinds, text, lesson in CURES:
        if cause in causes and (not kinds or finding.kind in kinds):
            found.setdefault(cause, (text, lesson))
    return list(found.values())
