"""Of the project: the functions of logic.py."""

import math

import numpy as np

from helpers.checks.lessons.build_a_robot_program.shared import tasks
from helpers.patrol import DEGREES, LAST, module, steered
from helpers.robot import ROOMS


def scanned(**seen):
    """Return ranges: l10=1.5 means that the beam 10 degrees to the left sees 1.5 m; r: right."""
    ranges = np.full(181, math.inf)
    for beam, metres in seen.items():
        ranges[90 + int(beam[1:]) * (1 if beam[0] == 'l' else -1)] = metres
    return ranges


def scene(seen):
    """Say what `scanned` is given: 1.5 m at 10 degrees to the left."""
    if len(seen) > 6:
        return 'nan from 12 degrees on the right to 12 on the left'
    sides = {'l': 'left', 'r': 'right'}
    beams = [
        f'{metres:g} m at {int(beam[1:])} degrees to the {sides[beam[0]]}'
        for beam, metres in seen.items()
    ]
    return ' and '.join(beams) or 'nothing in sight'


@tasks.add(3)
def reach_and_speed(workspace):
    def reaches(*cases):
        def test():
            function = module(workspace, 'logic').reach
            for seen, degrees, right in cases:
                metres = function(scanned(**seen), np.radians(DEGREES), math.radians(degrees))
                if not isinstance(metres, float | int):
                    kind = 'None' if metres is None else f'the type {type(metres).__name__}'
                    return f'it returns {kind}, and no number'
                if not abs(metres - right) < 0.01:
                    return (
                        f'with {scene(seen)}, the reach at {degrees} degrees is {metres:.2f}, '
                        f'not {right:.2f}'
                    )
            return True

        return test

    def speeds_are(*cases):
        def test():
            function = module(workspace, 'logic').safe_speed
            speeds = [float(function(*arguments)) for *arguments, _ in cases]
            right = [speed for *_, speed in cases]
            return bool(np.allclose(speeds, right)) or f'{speeds}, not {right}'

        return test

    strip = 'along[(along >= 0) & (abs(across) < HALF_M)], and its min(..., default=FAR_M)'
    unknown = 'known = ~np.isnan(ranges), and then ranges[known], angles[known]'
    share = 'np.mean(known[toward]) is the share of known beams: below 0.5, return 0.0.'
    ahead = [({'l0': 2.0, 'r1': 1.5}, 0, 1.5), ({'l45': 0.5}, 0, 99)]
    ahead += [({'r45': 0.5, 'l9': 2.0}, 0, 99)]
    along = [({'l10': 0.5}, 0, 0.492), ({'l17': 0.5}, 0, 0.478)]
    turned = [({'l45': 0.5}, 45, 0.5), ({'r60': 1.0, 'l0': 0.3}, -60, 1.0), ({'l20': 0.3}, 85, 99)]
    behind = [
        ({'r89': 0.1}, 85, 99),
        ({'l85': 0.3}, -85, 99),
        ({'r90': 0.4, 'l80': 1.0}, 85, 0.996),
    ]
    odd = [({'r70': -math.inf}, 10, 0), ({}, 0, 99)]
    few = [({'l3': math.nan}, 0, 99), ({'l0': math.nan, 'r1': 1.5, 'l2': math.nan}, 0, 1.5)]
    blind = {f'{side}{degrees}': math.nan for side in 'lr' for degrees in range(13)}
    many = [(blind, 0, 0), (blind, 60, 99), (blind | {'l0': 2.0}, 0, 0), ({}, 180, 0)]

    def all_around():
        function = module(workspace, 'logic').reach
        angles = np.radians(np.arange(360.0))
        ranges = np.full(360, 3.0)
        ranges[315] = 0.5
        ranges[100:260] = math.nan
        for degrees, right in ((-45, 0.5), (0, 3.0), (170, 0.0)):
            metres = function(ranges, angles, math.radians(degrees))
            if not abs(metres - right) < 0.01:
                return (
                    'with angles from 0 to 2 pi, 0.5 m at 315 degrees and nan from 100 to 259, the '
                    f'reach at {degrees} degrees is {metres:.2f}, not {right:.2f}'
                )
        return True

    return [
        ('straight on: the nearest in the strip', reaches(*ahead), strip),
        ('measured along the strip, not to the beam', reaches(*along), 'min(along[...])'),
        ('another direction', reaches(*turned), 'cos(angles - heading), sin(angles - heading)'),
        ('what is behind does not count', reaches(*behind), 'along >= 0'),
        ('too near, nothing', reaches(*odd), 'np.nan_to_num(..., posinf=FAR_M, neginf=0.0)'),
        ('single unknown beams do not count', reaches(*few), unknown),
        ('too many unknown beams: 0', reaches(*many), share),
        (
            'a laser that looks all around',
            all_around,
            'np.cos(angles - heading) > math.cos(AROUND)',
        ),
        ('near: 0', speeds_are((0.25, 0.5, 0), (0.1, 0.5, 0)), 'max(0.0, ...)'),
        ('far: full speed', speeds_are((1.0, 0.5, 0.5), (99.0, 0.2, 0.2)), 'min(1.0, ...)'),
        (
            'between',
            speeds_are((0.625, 0.5, 0.25), (0.4, 1.0, 0.2)),
            '(reach - STOP_M) / (SLOW_M - STOP_M)',
        ),
    ]


@tasks.add(6)
def a_free_heading(workspace):
    def directions():
        function = module(workspace, 'logic').direction
        cases = [((1, 1, 0, (1, 2)), 90), ((0, 0, 3, (-1, -0.2)), 19.4)]
        cases += [((2, 0, 1.5, (1, 0)), 94.1), ((0, 0, 0, (-1, -0.01)), -179.4)]
        degrees = [round(math.degrees(function(*arguments)), 1) for arguments, _ in cases]
        right = [angle for _, angle in cases]
        return degrees == right or f'{degrees} degrees, not {right}'

    def headings(*cases):
        def test():
            function = module(workspace, 'logic').free_heading
            for seen, wanted, far, right in cases:
                heading = function(scanned(**seen), np.radians(DEGREES), math.radians(wanted), far)
                heading = heading if heading is None else round(math.degrees(heading))
                if heading != right:
                    things = scene(seen) if len(seen) < 2 else 'a box 0.6 m ahead'
                    return f'with {things}, wanted {wanted} degrees: {heading}, not {right}'
            return True

        return test

    box = {f'{side}{degrees}': 0.6 for side in 'lr' for degrees in range(11)}
    turn = 'math.atan2(dy, dx) - yaw, then math.remainder(angle, math.tau)'
    nothing = headings(({}, 31, 0.5, 30), ({}, 170, 0.5, 85))
    around = headings((box, 8, 0.7, 30), (box, -8, 0.7, -30))
    no_way = headings(({'l0': -math.inf}, 0, 0.5, None))
    return [
        ('direction', directions, turn),
        ('nothing in sight', nothing, 'min(free, key=...)'),
        ('around a box', around, 'reach(...) > far_m'),
        ('a box that is farther away', headings((box, 8, 0.5, 10)), 'reach(...) > far_m'),
        ('no way', no_way, 'min(..., default=None)'),
    ]


@tasks.add(7, cpu_s=20)
def steer_to_a_place(workspace):
    def comes_to(floor, *places):
        def test():
            robot, left = steered(workspace, floor, places, 15 * len(places))
            if robot.bumps:
                return 'it hits something'
            return not left or f'of {len(places)} places it does not reach {left}'

        return test

    def returns(wanted, distance_m, *right, full_mps=0.5, **seen):  # degrees, m; m/s and rad/s
        def test():
            steer = module(workspace, 'logic').steer
            angles = np.radians(DEGREES)
            v, w = steer(scanned(**seen), angles, math.radians(wanted), distance_m, full_mps)
            answer = round(float(v), 3), round(float(w), 3)
            return answer == right or f'it returns {answer}, not {right}'

        return test

    turn = 'Speed times cos(heading), and 1.5 * heading. The heading 0.0 is a heading, too.'
    other = 'The speed for straight ahead, with full_mps: safe_speed(reach(..., 0.0), full_mps).'
    door = comes_to(ROOMS, (4.75, 1.75), ROOMS.places['C'])
    unknown = {f'{side}{degrees}': math.nan for side in 'lr' for degrees in range(91)}
    on_the_right = {f'r{degrees}': math.nan for degrees in range(30, 91)}

    def stands_blind():
        blind = returns(0, 3, 0.0, 0.0, **unknown)()
        if blind is not True:
            return f'with all beams unknown {blind}'
        partly = returns(0, 3, 0.5, 0.0, **on_the_right)()
        return partly is True or f'with 61 of 181 beams unknown {partly}'

    return [
        ('nothing in sight: straight on', returns(0, 3, 0.5, 0.0), turn),
        ('nothing in sight: 60 degrees', returns(60, 3, 0.25, 1.571), turn),
        ('another full speed', returns(0, 3, 0.2, 0.0, full_mps=0.2), other),
        ('a wall at 0.4 m, a place beside', returns(60, 3, 0.05, 1.571, l0=0.4), 'reach(..., 0.0)'),
        (
            'a wall at 0.4 m, a place before it',
            returns(0, 0.3, 0.1, 0, l0=0.4),
            'min(0.5, distance_m)',
        ),
        ('a blind laser: it stands', stands_blind, 'np.isnan(ranges).sum(), of len(ranges)'),
        ('no way: it turns', returns(-57, 3, 0.0, 0.9, l0=-math.inf), 'if heading is None:'),
        ('around two boxes', comes_to(LAST, LAST.places['A']), 'free_heading, then cos(heading)'),
        ('through a door', door, 'The speed for straight ahead.'),
    ]
