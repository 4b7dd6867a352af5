import math

from courier.ahead import distance_ahead
from sensor_msgs.msg import LaserScan


def scan(ranges):
    """Return a scan with these beams from 4 degrees to the right to 4 degrees to the left."""
    step = math.radians(2.0)
    return LaserScan(
        angle_min=-2 * step, angle_increment=step, range_min=0.1, range_max=8.0, ranges=ranges
    )


def test_the_nearest_counts():
    assert distance_ahead(scan([3.0, 2.0, 1.0, 2.0, math.inf])) == 1.0


def test_what_is_not_known_is_not_free():
    assert distance_ahead(scan([math.nan, math.nan, 0.0, 2.0, 2.0])) is None
