"""The robot moves as arithmetic says, and sees what geometry says."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from helpers.fusion import simulate
from helpers.robot import CORRIDOR, EMPTY, KIND, ROOMS, Floor, Pose
from helpers.robot.body import (
    MAX_ACCELERATION,
    MAX_SPEED,
    MAX_TURN,
    RADIUS_M,
    RATE_HZ,
    Body,
    arc,
)
from helpers.robot.record import Command
from helpers.robot.sensors import Sensors, without_noise

speeds = st.floats(-MAX_SPEED, MAX_SPEED)
turns = st.floats(-MAX_TURN, MAX_TURN)
angles = st.floats(-math.pi, math.pi) | st.sampled_from([0, math.pi / 2, -math.pi / 2, math.pi])
places = st.tuples(st.floats(0, 10), st.floats(0, 7))


def drive(body, v, w=0.0, seconds=1.0):
    """Drive with a command before each step, and return the poses."""
    poses = []
    for _ in range(round(seconds * RATE_HZ)):
        body.step([Command(body.t_s, v, w)])
        poses.append(body.pose)
    return poses


# --- How it moves


@given(yaw=angles, v=speeds, w=turns.filter(lambda w: w == 0 or abs(w) > 1e-3), s=st.floats(0, 3))
def test_an_arc_is_on_a_circle(yaw, v, w, s):
    x, y, end = arc(Pose(1.0, 2.0, yaw), v, w, s)
    if w == 0:
        dx, dy = v * s * math.cos(yaw), v * s * math.sin(yaw)
    else:
        dx = v / w * (math.sin(yaw + w * s) - math.sin(yaw))
        dy = v / w * (math.cos(yaw) - math.cos(yaw + w * s))
    assert (x, y) == pytest.approx((1 + dx, 2 + dy), abs=1e-9)
    assert math.cos(end - yaw - w * s) == pytest.approx(1)


@pytest.mark.parametrize('v', [0.25, 0.5, 1.0])
def test_start_and_stop_take_half_the_square_of_speed(v):
    body = Body(EMPTY)
    drive(body, v, seconds=v / MAX_ACCELERATION)
    assert body.v == v
    assert body.pose.x - EMPTY.start.x == pytest.approx(v**2 / 2 / MAX_ACCELERATION)
    x = body.pose.x
    drive(body, 0.0, seconds=v / MAX_ACCELERATION)
    assert body.v == 0
    assert body.pose.x - x == pytest.approx(v**2 / 2 / MAX_ACCELERATION)


def test_it_stops_half_a_second_after_the_last_command():
    body = Body(EMPTY)
    drive(body, 0.5)
    last = body.command.t_s
    while not body.watched:
        assert body.v == 0.5
        body.step()
    started_to_brake = body.t_s - 1 / RATE_HZ
    assert started_to_brake - last == pytest.approx(KIND.command_timeout_s)
    while body.v:
        body.step()
    assert body.t_s - started_to_brake == pytest.approx(0.5 / MAX_ACCELERATION)


def test_a_wall_stops_it_and_counts_once():
    body = Body(CORRIDOR)
    drive(body, 0.5, seconds=10)
    wall = CORRIDOR.size_m[0] - 0.5
    assert body.pose.x == pytest.approx(wall - RADIUS_M, abs=1e-12)
    assert (body.v, body.bumps, body.touching) == (0, 1, True)
    drive(body, 0.0, 1.0)
    assert body.touching
    drive(body, -0.2)
    assert not body.touching
    drive(body, 0.5, seconds=3)
    assert body.bumps == 2


@given(commands=st.lists(st.tuples(speeds, turns), max_size=6))
def test_it_is_never_inside_a_wall(commands):
    body = Body(ROOMS)
    for v, w in commands:
        for x, y, _ in drive(body, v, w):
            assert ROOMS.clearance(x, y) >= RADIUS_M


# --- What it sees


@given(place=places, yaw=angles)
def test_at_its_range_is_a_wall_and_before_it_none(place, yaw):
    assume(ROOMS.clearance(*place) > 1e-6)
    # A beam along the edge of a wall touches it, and sees past it.
    assume(abs(math.sin(2 * yaw)) > 1e-9 or all(c % 0.5 for c in place))

    def clearance(r):
        return ROOMS.clearance(place[0] + r * math.cos(yaw), place[1] + r * math.sin(yaw))

    (seen,), (number,) = ROOMS.ranges(*place, np.array([yaw]))
    r = 0.0
    while r < min(seen, 20) - 1e-6:  # nothing is within the clearance: go on by that much
        assert clearance(r) > 0
        r += max(1e-7, clearance(r))
    assert clearance(seen) < 1e-6 if number >= 0 else seen == math.inf


def test_the_beams_go_from_right_to_left():
    scan, first, step = Sensors(0, False, None).scan(Body(CORRIDOR))
    assert (first, step) == pytest.approx((-math.pi / 2, math.radians(1)))
    assert scan[[0, 90, 180]] == pytest.approx([0.75, 3.25, 0.75])
    nothing, _, _ = Sensors(0, True, None).scan(Body(EMPTY))
    assert nothing.dtype == np.float32
    assert np.isposinf(nothing).all()


@pytest.mark.parametrize('slip', [None, (0.5, 1.0)])
def test_errors_of_its_sensors_are_those_of_simulate(slip):
    body, sensors, exact = Body(EMPTY), Sensors(7, True, slip), Sensors(7, False, None)
    rows = []
    for _ in range(101):
        x, y, yaw = body.pose
        assert list(exact.read(body).values())[:3] == [body.v, body.w, yaw]
        truth = {'x': x, 'y': y, 'yaw': yaw, 'vx': body.v, 'vyaw': body.w, 'ax': body.ax}
        slipping = 0.5 if slip and slip[0] <= body.t_s < slip[1] else 0.0
        without = without_noise(truth | {'ay': body.v * body.w}, slipping)
        rows.append(np.subtract(list(sensors.read(body).values()), list(without.values())))
        drive(body, 0.5, 0.3, seconds=1 / RATE_HZ)
    measured, true = simulate(7, 2.0)
    errors = measured.drop(columns='t') - pd.DataFrame(without_noise(true))
    fixes = errors['gps_x'].notna()
    np.testing.assert_allclose(np.array(rows)[fixes], errors[fixes], atol=1e-9)
    np.testing.assert_allclose(np.array(rows)[:, :6], errors.iloc[:, :6], atol=1e-9)


# --- Floors and records


def test_each_character_is_a_square_of_the_floor():
    floor = Floor.from_text('####\n#vA#\n#o #\n####', cell_m=1.0)
    assert floor.size_m == (4, 4)
    assert floor.start == (1.5, 2.5, -math.pi / 2)
    assert floor.places == {'A': (2.5, 2.5)}
    assert floor.clearance(1.5, 1.5) == floor.clearance(0.5, 0.5) == 0
    assert floor.clearance(2.5, 1.5) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('\n \n', 'has no start'),
        ('####\n#> #\n###', 'equally long: line 1 has 4 characters, line 3 has 3'),
        ('###\n# #\n###', 'has no start'),
        ('#####\n#> >#\n#####', 'has 2 starts'),
        ('####\n#>?#\n####', "'\\?' means nothing"),
        ('###\n#>#\n###', 'cannot leave its start'),
        ('######\n#> #A#\n######', 'No way leads from the start to A'),
    ],
)
def test_a_wrong_floor_gets_one_sentence(text, sentence):
    with pytest.raises(ValueError, match=sentence):
        Floor.from_text(text)


def test_a_robot_cannot_start_in_a_wall():
    with pytest.raises(ValueError, match='would start in a wall at 0.2, 1 m'):
        Body(ROOMS, Pose(0.2, 1.0, 0.0))
