"""Answers to the tasks of the lesson `test_a_node`: wrong ones, and right ones of another form."""

SPEED = '%%write src/brake_pkg/brake_pkg/speed.py\nimport math\n\n\n'
CONFTEST = '%%write src/brake_pkg/test/conftest.py part 2\n@pytest.fixture\ndef bench():\n'
WAITING = '%%write src/brake_pkg/test/waiting.py\nimport time\n\n\n'
FLAKY = '%%write src/brake_pkg/test/test_brake.py\nimport time\nfrom waiting import wait_until\n\n'
WAIT = 'def wait_until(executor, holds, timeout_s=5.0):\n'
TABLE = """%%write src/brake_pkg/test/test_speed.py
import math
import pytest
from brake_pkg.speed import safe_speed

"""

ANSWERS = {
    1: {
        'wrong': [
            SPEED + 'def safe_speed(distance_m, full_mps=0.25):\n'
            '    return full_mps if distance_m > 0.5 else 0.0\n',
            SPEED + 'def safe_speed(distance_m, full_mps=0.25):\n'
            '    return full_mps * min(1, max(0, distance_m - 0.5))\n',
            SPEED + 'def safe_speed(distance_m, full_mps=0.25):\n'
            '    return min(0.25, max(0, distance_m / 2 - 0.25))\n',
            SPEED + 'def safe_speed(distance_m, full_mps=0.25):\n    return None\n',
        ],
        'right': [
            SPEED + 'def safe_speed(distance_m, full_mps=0.25):\n'
            '    if math.isnan(distance_m):\n        return 0\n'
            '    return full_mps * min(1, max(0, 2 * distance_m - 1))\n',
        ],
    },
    2: {
        'wrong': [
            TABLE + 'def test_one():\n    assert safe_speed(2.0) == 0.25\n'
            '    assert safe_speed(0.2) == 0.0\n',
            TABLE + 'def test_one():\n    assert False\n',
            TABLE + 'def test_one():\n    assert safe_speed(2.0) == 9\n',
            TABLE + 'def try_one():\n    assert safe_speed(2.0) == 0.25\n',
        ],
        'right': [
            TABLE + 'def test_all():\n'
            '    for far in (1.0, 3.0, math.inf):\n'
            '        assert safe_speed(far) == pytest.approx(0.25)\n'
            '    assert safe_speed(0.75) == pytest.approx(0.125)\n'
            '    for near in (0.1, 0.5, math.nan):\n'
            '        assert safe_speed(near) == 0\n',
        ],
    },
    3: {
        'wrong': [
            CONFTEST + '    rclpy.init(domain_id=42)\n    yield Bench()\n    rclpy.shutdown()\n',
            CONFTEST + '    rclpy.init()\n    yield Bench()\n    rclpy.shutdown()\n',
            CONFTEST + '    with domain_id() as number:\n        rclpy.init(domain_id=number)\n'
            '        yield Bench()\n',
            CONFTEST + '    with domain_id() as number:\n        rclpy.init(domain_id=number)\n'
            '    yield Bench()\n    rclpy.shutdown()\n',
        ],
        'right': [
            CONFTEST + '    with domain_id() as mine, rclpy.init(domain_id=mine):\n'
            '        yield Bench()\n',
        ],
    },
    4: {
        'wrong': [
            WAITING
            + WAIT
            + '    while not holds():\n        executor.spin_once(timeout_sec=0.1)\n',
            WAITING + WAIT + '    time.sleep(timeout_s)\n',
            WAITING + WAIT + '    end = time.monotonic() + timeout_s\n'
            '    while not holds() and time.monotonic() < end:\n'
            '        executor.spin_once(timeout_sec=0.1)\n',
        ],
        'right': [
            WAITING + WAIT + '    start = time.monotonic()\n    while True:\n'
            '        if holds():\n            return\n'
            '        if time.monotonic() - start > timeout_s:\n'
            '            raise AssertionError("in vain")\n'
            '        executor.spin_once(timeout_sec=0.05)\n',
        ],
    },
    5: {
        'wrong': [
            FLAKY + 'def test_stops(bench):\n    bench.send(0.25)\n'
            '    wait_until(bench.executor, lambda: bench.speeds)\n'
            '    assert bench.speeds == [0.0]\n',
            FLAKY + 'def test_stops(bench):\n'
            '    wait_until(bench.executor, bench.sensor.get_subscription_count)\n'
            '    bench.send(0.25)\n    bench.executor.spin_once(timeout_sec=0.2)\n'
            '    assert bench.speeds == [0.0]\n',
            FLAKY + 'def test_stops(bench):\n'
            '    wait_until(bench.executor, bench.sensor.get_subscription_count)\n'
            '    bench.send(0.25)\n    wait_until(bench.executor, lambda: bench.speeds)\n',
        ],
        'right': [
            FLAKY + 'def test_stops(bench):\n'
            '    wait_until(bench.executor, lambda: bench.sensor.get_subscription_count() == 1)\n'
            '    bench.send(0.25)\n    wait_until(bench.executor, lambda: len(bench.speeds) == 1)\n'
            '    assert bench.speeds[0] == 0\n',
        ],
    },
    8: {
        'wrong': [
            '%%terminal\nros2 lifecycle set /brake activate\n',
            '%%terminal\nros2 lifecycle set /brake configure\n',
        ],
        'right': [
            '%%terminal\nros2 lifecycle set /brake 3\n',
        ],
    },
}
