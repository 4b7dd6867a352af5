"""Queues: messages that wait, and threads that take them, from saved replays."""

from typing import NamedTuple

from helpers.lesson import Lesson
from tools.lessons.first_pictures.look import PLAYS_S, WIDTH, moving, output_of, runs_of, svg

ARRIVE, TAKE, END = range(3)  # moves of a replay
# Pixels: the width of a place of the queue, and where the first one and the callback are.
PLACE, FIRST_X, CALLBACK_X = 26, 186, 132
SHIFTS_S = 0.05  # until the queue has moved up by one place
LANE, LANES_X = 28, 116  # pixels: the height of a thread's lane, and where lanes begin

STYLE = """
rect{y:1px;width:22px;height:22px;rx:4px}
.place{fill:none;stroke:COLOUR(wall)}
.scan{fill:COLOUR(waiting);animation:in .12s both,gone .16s forwards}
.out{animation-name:in,out}
.look{fill:COLOUR(heard);opacity:0;animation:look .126s linear}
.busy{fill:COLOUR(heard)}
.last{fill:COLOUR(heard);animation:gone .01s reverse both}
.tape{animation:PLAYSs linear both}
@keyframes in{from{opacity:0;transform:translateY(-14px)}to{opacity:1}}
@keyframes gone{to{opacity:0}}
@keyframes out{from{fill:COLOUR(lost)}to{fill:COLOUR(lost);opacity:0;transform:translateY(24px)}}
@keyframes look{from{opacity:1;transform:translateX(26px)}40%,to{opacity:1;transform:none}}
""".replace('PLAYS', str(PLAYS_S))
THREADS = """
.run{fill:COLOUR(heard);animation:grow linear both;transform-box:fill-box}
@keyframes grow{from{transform:scaleX(0)}}
.lane{stroke:COLOUR(wall);stroke-opacity:.5}
text.number{fill:COLOUR(ground);font-size:13px}
.thread{font-size:15px}
@media(max-width:560px){.thread{font-size:23px}text.number{font-size:20px}}
"""


class Move(NamedTuple):
    """What happens in a queue or on a thread, and when in the picture (s)."""

    at_s: float
    kind: int
    thread: int = 0


def tape(depth: int, moves: list[Move]) -> tuple[str, str]:
    """Return the messages that wait, and the keyframes of their tape.

    The tape has a place for each message, and moves one place to the left when its first one
    leaves: it is taken, or a new one pushes it out.
    """
    stops, waiting, popped = [(0.0, 0)], [], 0
    came: list[float] = []
    left: dict[int, tuple[float, str]] = {}
    for at_s, kind, _ in moves:
        if kind == ARRIVE:
            waiting.append(len(came))
            came.append(at_s)
        if kind == TAKE or len(waiting) > depth:
            left[waiting.pop(0)] = at_s, 'scan' if kind == TAKE else 'scan out'
            stops += [(at_s, -popped * PLACE), (at_s + SHIFTS_S, -(popped + 1) * PLACE)]
            popped += 1
    waits = ''
    for message, at_s in enumerate(came):
        gone, kind = left.get(message, (99, 'scan'))
        opacity = ' opacity="0"' if message in left else ''
        waits += (
            f'<rect x="{FIRST_X + message * PLACE}" class="{kind}"{opacity} '
            f'style="animation-delay:{at_s:.3f}s,{gone:.4g}s"/>'
        )
    name = f't{depth}'
    waits = (
        f'<g class="tape" style="animation-name:{name}" '
        f'transform="translate({-popped * PLACE} 0)">{waits}</g>'
    )
    return waits, moving(name, _rising(stops))


def looks(moves: list[Move]) -> str:
    """Return the messages that one callback takes, one after the other."""
    return ''.join(
        f'<rect x="{CALLBACK_X}" class="look" style="animation-delay:{move.at_s:.3f}s"/>'
        for move in moves
        if move.kind == TAKE
    )


def _rising(stops: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return stops whose times rise: what begins before the last has ended waits for it."""
    kept = stops[:1]
    for at_s, x in stops[1:]:
        kept.append((max(at_s, kept[-1][0] + 1e-3), x))
    return kept


def places(depth: int) -> str:
    """Return the places of a queue."""
    return ''.join(f'<rect x="{FIRST_X + i * PLACE}" class="place"/>' for i in range(depth))


def until_full(run: dict) -> tuple[int, list[Move]]:
    """Return the depth of a run's queue, and its moves until the first message is lost."""
    (callback,) = run['setup']['callbacks']
    waiting, moves = 0, []
    for at, kind, _, thread in run['moves']:
        waiting += {ARRIVE: 1, TAKE: -1, END: 0}[kind]
        if waiting > callback['depth']:
            break
        moves.append(Move(at, kind, thread))
    return callback['depth'], moves


def queue_picture(lesson: Lesson, cell_id: str) -> str:
    """Return the queue of a slow subscriber, until it is full: what happens then is a guess."""
    (run,) = runs_of(output_of(lesson, cell_id))
    depth, moves = until_full(run)
    slower = PLAYS_S / moves[-1].at_s
    moves = [move._replace(at_s=move.at_s * slower) for move in moves]
    messages, css = tape(depth, moves)
    body = (
        f'<text class="ink" x="{CALLBACK_X + 22}" y="20" text-anchor="end">callback</text>'
        f'<text class="ink" x="{FIRST_X}" y="20">queue of {depth} messages</text>'
        f'<g transform="translate(0 32)"><rect x="{CALLBACK_X}" class="busy"/>{looks(moves)}'
        f'{messages}{places(depth)}</g>'
        f'<text class="says ink" style="animation-delay:{PLAYS_S}s" x="16" y="84">'
        'It is full. What will happen to the next message?</text>'
    )
    return svg(104, f'The real queue of {lesson.name}', STYLE + css, body)


def gate_picture(lesson: Lesson, cell_id: str) -> str:
    """Return threads whose callbacks wait at a gate, and the queue that fills up behind them.

    The messages come within 0.1 s: the picture shows them one by one, at equal distances.
    """
    (run,) = runs_of(output_of(lesson, cell_id))
    depth, moves = until_full(run)
    moves = [move._replace(at_s=PLAYS_S * i / len(moves)) for i, move in enumerate(moves)]
    says = 'The queue is full, and more messages come.'
    return _threads(lesson, run, depth, moves, says)


def threads_picture(lesson: Lesson, cell_id: str, name: str, seconds: float) -> str:
    """Return the threads of a run and the messages that they take, for its first seconds."""
    run = next(run for run in runs_of(output_of(lesson, cell_id)) if run['name'] == name)
    slower = PLAYS_S / seconds / 1e6
    moves = [Move(at * slower, kind, thread) for at, kind, _, thread in run['moves']]
    moves = [move for move in moves if move.at_s < PLAYS_S]
    while moves[-1].kind == ARRIVE:  # it is taken within a millisecond, which is cut off
        moves.pop()
    return _threads(lesson, run, run['setup']['callbacks'][0]['depth'], moves)


def _threads(lesson: Lesson, run: dict, depth: int, moves: list[Move], says: str = '') -> str:
    messages, css = tape(depth, moves)
    right = WIDTH - 16
    scale = (right - LANES_X) / PLAYS_S
    lanes = bars = ''
    for i, name in enumerate(run['setup']['threads']):
        y = i * LANE
        lanes += (
            f'<text class="ink thread" x="{LANES_X - 12}" y="{y + 18}" text-anchor="end">{name}'
            f'</text><path class="lane" d="M{LANES_X} {y + 12.5}H{right}"/>'
        )
    begun: dict[int, tuple[float, int]] = {}
    taken = 0
    # What still runs at the end of the picture is cut off there.
    ends = [Move(PLAYS_S, END, thread) for thread in range(len(run['setup']['threads']))]
    for at_s, kind, thread in [*moves, *ends]:
        if kind == TAKE:
            begun[thread] = at_s, taken
            taken += 1
        elif kind == END and thread in begun:
            from_s, number = begun.pop(thread)
            x, width = LANES_X + scale * from_s, scale * (at_s - from_s)
            bars += (
                f'<g transform="translate({x:.1f} {thread * LANE})">'
                f'<path class="run" d="M0 2H{width:.1f}V23H0z" '
                f'style="animation-delay:{from_s:.2f}s;animation-duration:{at_s - from_s:.2f}s"/>'
                f'<text class="number comes" style="animation-delay:{from_s:.2f}s" x="5" y="17">'
                f'{number}</text></g>'
            )
    height = 74 + LANE * len(run['setup']['threads']) + (34 if says else 0)
    body = (
        f'<text class="ink" x="{FIRST_X - 12}" y="30" text-anchor="end">queue of {depth}</text>'
        f'<g transform="translate(0 12)">{places(depth)}{messages}</g>'
        f'<g transform="translate(0 60)">{lanes}{bars}</g>'
    )
    if says:
        body += (
            f'<text class="says ink" style="animation-delay:{PLAYS_S}s" x="16" y="{height - 16}">'
            f'{says}</text>'
        )
    return svg(height, f'A real run of {lesson.name}', STYLE + THREADS + css, body)
