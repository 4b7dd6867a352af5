"""A function, the bench, a flaky test, and colcon: with right and wrong versions of each."""

import re

from helpers.checks.builds import build, setup_fits
from helpers.checks.lessons.test_a_node.shared import (
    PACKAGE,
    all_pass,
    is_caught,
    ours_pass,
    run_ours,
    tasks,
)
from helpers.checks.points import cached, needs
from helpers.trials import BRAKE, BUSY, planted, run_tests

# --- Task 1: a function

SPEED = """import math
def safe_speed(distance_m, full_mps=0.25):
    if math.isnan(distance_m):
        return 0.0
    return full_mps * min(1.0, max(0.0, 2 * (distance_m - 0.5)))
"""
WRONG_SPEEDS = {
    'drives on near a wall': planted(
        SPEED, 'max(0.0, 2 * (distance_m - 0.5))', 'abs(2 * distance_m - 1)'
    ),
    'has no slow zone': planted(SPEED, '2 * (distance_m - 0.5)', 'distance_m > 0.5'),
    'treats nan as free': planted(SPEED, 'return 0.0', 'return full_mps'),
    'stops if nothing is in sight': planted(SPEED, 'isnan(distance_m)', 'isfinite(distance_m) - 1'),
    'still moves at 0.5 m': planted(SPEED, 'max(0.0', '(distance_m >= 0.5) * max(0.1'),
}
HINT_FOR = {
    'drives on near a wall': 'A row with a distance below 0.5 m.',
    'has no slow zone': 'A row with a distance between 0.5 and 1.0 m.',
    'treats nan as free': 'A row with math.nan.',
    'stops if nothing is in sight': 'A row with math.inf.',
    'still moves at 0.5 m': 'A row with 0.5 m.',
}


@tasks.add(limit_s=60)
def test_the_function(workspace, tests):
    versions = {'our': '', 'another': SPEED, **WRONG_SPEEDS}
    runs = cached(lambda: run_tests(workspace, PACKAGE, tests, 'brake_pkg.speed', versions))
    right = all_pass(runs, {'our': 'our function', 'another': 'another function'})
    return [
        ('it passes for two right functions', right, 'Is each row what it says?'),
        *(
            (f'it fails for one that {bug}', is_caught(runs, bug, right), HINT_FOR[bug])
            for bug in WRONG_SPEEDS
        ),
    ]


# --- Task 2: a fixture

# Another program may hold any number, so what counts is what the fixture itself holds.
ALONE = """import os, sys
from contextlib import contextmanager

import domain_coordinator
import rclpy

before, numbers, kept, held = [], [], [], []
plain_domain_id, shutdown = domain_coordinator.domain_id, rclpy.shutdown

@contextmanager
def noted_domain_id(*arguments, **options):
    with plain_domain_id(*arguments, **options) as number:
        held.append(number)
        try:
            yield number
        finally:
            held.remove(number)

for module in [*sys.modules.values()]:
    if vars(module).get('domain_id') is plain_domain_id:
        module.domain_id = noted_domain_id

def noted(*arguments, **options):
    kept.extend(number in held for number in numbers)
    shutdown(*arguments, **options)

rclpy.shutdown = noted

def test_alone(bench):
    number = bench.node.context.get_domain_id()
    assert number != int(os.environ['ROS_DOMAIN_ID']), 'it is in the domain of this notebook'
    assert number in held, 'another test can take its domain'

def test_again_begins(bench):
    before.append(bench)
    numbers.append(bench.node.context.get_domain_id())
    for node in bench.brake, bench.node:
        assert list(node.publishers), f'in a test, the node {node.get_name()} is gone already'

def test_again_ends():
    assert not rclpy.ok(), 'after a test, rclpy is not shut down'
    assert all(kept), 'its domain is given back before rclpy is shut down'
    for node in before[0].brake, before[0].node:
        assert not list(node.publishers), f'after a test, the node {node.get_name()} is still there'

def test_again_begins_anew(bench):
    pass
"""


@tasks.add(limit_s=60)
def a_domain_of_its_own(workspace):
    @cached
    def runs():
        versions = {'alone': BRAKE, 'again': BRAKE}
        return run_ours(workspace, 'our_bench.py', ALONE, 'brake_pkg.brake', versions)

    inside = 'with domain_id() as number: all other lines are in it.'
    after = 'After yield, and still in the with: destroy_node() of both, then rclpy.shutdown().'
    return [
        ('its domain is its own', ours_pass(runs, 'alone'), inside),
        ('it clears up after each test', ours_pass(runs, 'again'), after),
    ]


# --- Task 3: a wait

# 600 events come so quickly that who counts calls of spin_once, in place of time, gives up.
WAITS = """import time

import pytest
from rclpy.executors import SingleThreadedExecutor
from waiting import wait_until
import rclpy

CASES = {
    'events_1': (9, 1, 5), 'events_7': (9, 7, 5), 'events_600': (600, 600, 5),
    'at_once': (9, 0, 5), 'in_vain': (3, 4, 1),
}

@pytest.mark.parametrize('ticks, wanted, limit_s', CASES.values(), ids=CASES)
def test_waits(ticks, wanted, limit_s):
    seen, said = [], 'it returned'
    rclpy.init()
    node, executor = rclpy.create_node('ticking'), SingleThreadedExecutor()
    executor.add_node(node)
    period_s = 0.05 if ticks < 10 else 0.0005
    node.create_timer(period_s, lambda: len(seen) < ticks and seen.append(1))
    try:
        wait_until(executor, lambda: len(seen) >= wanted, limit_s)
    except AssertionError:
        said = 'it raised AssertionError'
        begun_s = time.monotonic()
        with pytest.raises(AssertionError):
            wait_until(executor, lambda: False, limit_s)
        took_s = time.monotonic() - begun_s
        assert took_s >= limit_s, f'a second wait of {limit_s} s ended after {took_s:.1f} s'
    node.destroy_node()
    rclpy.shutdown()
    right = 'it returned' if wanted <= ticks else 'it raised AssertionError'
    right = f'{right} after {min(ticks, wanted)} events'
    found = f'{said} after {len(seen)} events'
    assert found == right, f'for {wanted} of {ticks} events, in at most {limit_s} s: {found}'
"""


@tasks.add(limit_s=60)
def wait_for_an_event(workspace):
    @cached
    def runs():
        versions = dict.fromkeys(('events', 'at_once', 'in_vain'), '')
        return run_ours(workspace, 'our_waits.py', WAITS, 'none', versions)

    loop = 'A while loop, as long as holds() is not true and time.monotonic() is before the end.'
    at_once = 'Ask holds() before you spin.'
    end = 'end = time.monotonic() + timeout_s before the loop. After the end: an assert that fails.'
    return [
        ('it waits for 1 and for 7 events', ours_pass(runs, 'events'), loop),
        ('it does not wait for what is true already', ours_pass(runs, 'at_once'), at_once),
        ('after 1 s without it, it raises AssertionError', ours_pass(runs, 'in_vain'), end),
    ]


# --- Task 4: a flaky test

LATE = (
    BRAKE
    + """
Quick = Brake

class Brake(Quick):
    def create_subscription(self, *arguments):
        def connect():
            late.cancel()
            Quick.create_subscription(self, *arguments)

        late = self.create_timer(0.4, connect)
"""
)


@tasks.add(limit_s=60)
def fix_the_flaky_test(workspace, tests):
    @cached
    def runs():
        versions = {
            'busy': BUSY.replace('0.4', '2'),
            'late': LATE,
            'wrong': planted(BRAKE, 'distance(message)', '9.0'),
        }
        return run_tests(workspace, PACKAGE, tests, 'brake_pkg.brake', versions, most_failures=9)

    def passes_nine_times():
        run = runs()['busy']
        count = run.passed + len(run.failed)
        return (run.passed == 9 and run.passes) or f'of {count} runs: {without_run(run.says)}'

    def passes_late():
        return runs()['late'].passes or without_run(runs()['late'].says)

    def passes_for_one():
        return runs()['busy'].passes or runs()['late'].passes or 'it passes for none'

    def fails_for_wrong():
        needs(passes_for_one, 'not judged: it passes for no right node')
        return runs()['wrong'].fails or f'pytest: {runs()["wrong"].says}'

    return [
        ('on the busy computer all nine runs pass', passes_nine_times, 'Wait for bench.speeds.'),
        ('it passes if the brake connects late', passes_late, 'Wait for a subscriber, then send.'),
        ('it fails for a node that drives on', fails_for_wrong, 'Keep the assert.'),
    ]


def without_run(text):
    """Leave out which of the nine runs it was: on a busy computer it is another one."""
    return re.sub(r'(test_\w+)\[.*?\]', r'\1', text)


# --- Task 5: colcon


@tasks.add(limit_s=90)
def run_them(workspace):
    def is_run():
        build(workspace, 'brake_pkg', anew=True)
        planted = 'def test_planted():\n    assert 1 == 2\n'
        with workspace.replaced({f'{PACKAGE}/test/test_planted.py': planted}):
            summary = workspace.terminal(
                'colcon test --packages-select brake_pkg'
                ' --pytest-args -k "not flake8 and not pep257"'
                ' > test.txt 2>&1; colcon test-result | tail -1'
            )
        counts = {word: int(n) for n, word in re.findall(r'(\d+) (\w+?)s?\b', summary)}
        right = counts['test'] > 2 and counts['failure'] == 1 and not counts['error']
        return right or f'it ran {counts["test"]} tests, of which {counts["failure"]} failed'

    def has_executable():
        printed = workspace.terminal("""source install/setup.bash
            python -c 'from importlib.metadata import distribution
for entry in distribution("brake_pkg").entry_points: print(entry.name, entry.value)' 2>&1 | tail -1
        """)
        if printed != 'brake brake_pkg.brake:main':
            return f'it has {printed or "no executable"}'
        if not workspace.file('install/brake_pkg/lib/brake_pkg/brake').exists():
            return 'ros2 run finds no program in it: is it one of the console_scripts?'
        return setup_fits(workspace, PACKAGE)

    return [
        ('colcon runs pytest', is_run, "extras_require={'test': [...]}"),
        ('it has the executable brake', has_executable, "'brake = brake_pkg.brake:main'"),
    ]
