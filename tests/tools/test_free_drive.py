"""Free drive: its body, in a JavaScript engine, moves as that of the lessons."""

import json
import random

import pytest
import quickjs

from helpers.replay import source
from helpers.robot.body import Body
from helpers.robot.floor import ROOMS
from helpers.robot.record import Command
from tools.site.free_drive import SCRIPT, record

GLUE = """function driven(floor, speeds) {
    const { now, step } = body(floor);
    return speeds.map(([v, w]) => {
        step(v, w);
        return [now.x, now.y, now.bumps.length];
    });
}"""


def test_it_moves_as_the_body_of_the_lessons():
    rng, speeds = random.Random(0), []
    for _ in range(40):
        speeds += 50 * [rng.choice([(1, 0), (-0.5, 0), (0, 1.2), (0, -1.2), (1, 0)])]
    context = quickjs.Context()
    context.eval(source(SCRIPT.with_name('body.js')) + GLUE)
    given = f'{json.dumps(record())}, {json.dumps(speeds)}'
    seen = json.loads(context.eval(f'JSON.stringify(driven({given}))'))
    one = Body(ROOMS)
    for (v, w), (x, y, bumps) in zip(speeds, seen, strict=True):
        one.step([Command(one.t_s, v, w)])
        assert (one.pose.x, one.pose.y) == pytest.approx((x, y), abs=1e-6)
        assert one.bumps == bumps
    assert one.bumps > 0
