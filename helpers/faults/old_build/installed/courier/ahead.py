"""What a scan says of the way ahead."""

import math


def distance_ahead(scan):
    """Return how far the way ahead is free (m), or None if the scan does not say it."""
    distance = scan.ranges[90]  # straight ahead
    return None if math.isnan(distance) else distance
