"""What a scan says of the way ahead."""

import math

AHEAD_RAD = math.radians(10.0)  # to each side of straight ahead


def distance_ahead(scan):
    """Return how far the way ahead is free (m), or None if the scan does not say it."""
    known, beams = [], 0
    for i, distance in enumerate(scan.ranges):
        angle = math.remainder(scan.angle_min + i * scan.angle_increment, math.tau)
        if abs(angle) > AHEAD_RAD:
            continue
        beams += 1
        if distance == math.inf:  # nothing in range (REP 117)
            known.append(scan.range_max)
        elif distance == -math.inf:  # too near (REP 117)
            known.append(0.0)
        elif distance > 0.0 and scan.range_min <= distance <= scan.range_max:
            known.append(distance)
    return min(known) if known and 2 * len(known) >= beams else None
