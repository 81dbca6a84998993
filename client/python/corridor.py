"""A simulated robot that drives along a corridor. Poses are (x, y, theta) in metres and radians."""
import math

BEAMS, RANGE_MAX_M = 181, 10.0  # The beams are half a turn, from the right to the left of the robot.
SCANS, PERIOD_S, SPEED = 220, 0.2, 0.5  # Metres a second.


def _walls():
    """The ends of each wall. The niches are unequally far apart, so that no two places of the corridor look alike."""
    corners = [(-2.0, -1.2), (24.0, -1.2), (24.0, 1.2)]
    for x in (21.0, 18.5, 14.0, 10.5, 8.0, 3.0):
        corners += [(x + 1.0, 1.2), (x + 1.0, 2.0), (x, 2.0), (x, 1.2)]
    corners += [(-2.0, 1.2), (-2.0, -1.2)]
    return list(zip(corners, corners[1:]))


def _range(walls, x, y, direction):
    dx, dy, nearest = math.cos(direction), math.sin(direction), RANGE_MAX_M
    for (x0, y0), (x1, y1) in walls:
        wx, wy, ox, oy = x1 - x0, y1 - y0, x0 - x, y0 - y
        cross = dx * wy - dy * wx
        if abs(cross) > 1e-12 and 0 <= (ox * dy - oy * dx) / cross <= 1 and (ox * wy - oy * wx) / cross > 0:
            nearest = min(nearest, (ox * wy - oy * wx) / cross)
    return nearest


def _seen_from(a, b):
    """Pose b in the frame of pose a."""
    dx, dy, c, s = b[0] - a[0], b[1] - a[1], math.cos(a[2]), math.sin(a[2])
    return c * dx + s * dy, c * dy - s * dx, math.remainder(b[2] - a[2], 2 * math.pi)


def drive():
    """Yields the stamp in nanoseconds, the odometry, the ranges, and the true pose, seen from where the robot began.

    The robot swings from side to side, and its odometry says 2 % too much.
    """
    walls, begin = _walls(), None
    for number in range(SCANS):
        x = SPEED * PERIOD_S * number
        pose = (x, 0.3 * math.sin(x / 2), math.atan(0.15 * math.cos(x / 2)))
        begin = begin or pose
        truth = _seen_from(begin, pose)
        ranges = [_range(walls, x, pose[1], pose[2] + math.pi * (i / (BEAMS - 1) - 0.5)) for i in range(BEAMS)]
        yield round(number * PERIOD_S * 1e9), (1.02 * truth[0], 1.02 * truth[1], truth[2]), ranges, truth
