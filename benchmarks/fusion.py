"""What does a step of the filter of lesson 09 cost?

A step is one row of the measurements: wheels, three values of the IMU and, once a second, a GPS.
"""

from benchmarks.table import Row, growth, seconds
from helpers.fusion import fuse, simulate

STEPS = (600, 6_000, 60_000)
RATE_HZ = 50
ROUNDS = 3


def measure() -> list[Row]:
    """Return the cost of a step in drives of different lengths."""
    costs = {}
    for steps in STEPS:
        measurements = simulate(seed=9, seconds=steps / RATE_HZ, rate=RATE_HZ).measurements
        took = seconds(lambda measurements=measurements: fuse(measurements), ROUNDS)
        costs[steps] = [each / len(measurements) for each in took]
    return growth('one of {} steps of the filter', costs)
