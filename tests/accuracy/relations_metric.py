#!/usr/bin/env python3
"""How well a trajectory keeps the true relations between its poses, without aligning it to anything.

Method: R. Kuemmerle, B. Steder, C. Dornhege, M. Ruhnke, G. Grisetti, C. Stachniss, A. Kleiner: "On Measuring the
Accuracy of SLAM Algorithms", Autonomous Robots 27(4), 2009, eq. (3) to (5): for each true relation T_1_2 between two
stamps the error is T_1_2^-1 * (T_map_1^-1 * T_map_2), split into a distance in metres and an angle in degrees.

TRAJECTORY is TUM text (`stamp x y z qx qy qz qw`, stamps not decreasing); RELATIONS has `stamp1 stamp2 x y z roll pitch
yaw` a line. A stamp between two poses is interpolated, unless they lie further apart than --max-gap; a relation that
finds no pose counts as missing.

Prints one line of key=value pairs (m, deg, m^2, deg^2). Exit code 1 when more than 1 % of the relations are missing, the
input cannot be used, or the mean translational error exceeds --max-trans-mean.
"""
import argparse
import bisect
import math
import sys
from typing import NamedTuple

SAME_STAMP_S = 1e-4
ALLOWED_MISSING_SHARE = 0.01


class Pose(NamedTuple):
    x: float
    y: float
    theta: float


def angle_diff(a, b):
    difference = a - b
    return math.atan2(math.sin(difference), math.cos(difference))


def relative(T_map_a, T_map_b):
    """T_a_b."""
    dx, dy = T_map_b.x - T_map_a.x, T_map_b.y - T_map_a.y
    cos, sin = math.cos(T_map_a.theta), math.sin(T_map_a.theta)
    return Pose(cos * dx + sin * dy, -sin * dx + cos * dy, angle_diff(T_map_b.theta, T_map_a.theta))


def rows_of(path):
    """Yields (line number, eight finite numbers); `#` starts a comment."""
    with open(path, encoding="ascii") as lines:
        for number, line in enumerate(lines, start=1):
            fields = line.partition("#")[0].split()
            if not fields:
                continue
            try:
                values = [float(field) for field in fields]
            except ValueError as error:
                sys.exit(f"{path}:{number}: {error}")
            if len(values) != 8 or not all(math.isfinite(value) for value in values):
                sys.exit(f"{path}:{number}: expected 8 finite numbers, found: {line.strip()}")
            yield number, values


class Trajectory:
    def __init__(self, path):
        self.stamps, self.poses = [], []
        for number, (stamp, x, y, _, qx, qy, qz, qw) in rows_of(path):
            if self.stamps and stamp < self.stamps[-1]:
                sys.exit(f"{path}:{number}: the stamp goes back")
            self.stamps.append(stamp)
            self.poses.append(Pose(x, y, math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))))
        if len(self.poses) < 2:
            sys.exit(f"{path}: a trajectory needs two poses")

    def at(self, stamp, max_gap_s):
        """The pose at a stamp; None outside the trajectory and in gaps."""
        after = bisect.bisect_left(self.stamps, stamp)
        for near in (after - 1, after):
            if 0 <= near < len(self.stamps) and abs(self.stamps[near] - stamp) < SAME_STAMP_S:
                return self.poses[near]
        if after in (0, len(self.stamps)) or self.stamps[after] - self.stamps[after - 1] > max_gap_s:
            return None
        a, b = self.poses[after - 1], self.poses[after]
        share = (stamp - self.stamps[after - 1]) / (self.stamps[after] - self.stamps[after - 1])
        return Pose(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.theta + share * angle_diff(b.theta, a.theta))


def relation_errors(trajectory, relations_path, max_gap_s):
    """(distances in m, angles in deg, number of relations without a pose)"""
    distances, angles, missing = [], [], 0
    for _, (stamp_1, stamp_2, x, y, _, _, _, yaw) in rows_of(relations_path):
        T_map_1, T_map_2 = trajectory.at(stamp_1, max_gap_s), trajectory.at(stamp_2, max_gap_s)
        if T_map_1 is None or T_map_2 is None:
            missing += 1
            continue
        error = relative(Pose(x, y, yaw), relative(T_map_1, T_map_2))
        distances.append(math.hypot(error.x, error.y))
        angles.append(abs(math.degrees(error.theta)))
    return distances, angles, missing


def mean(values):
    return sum(values) / len(values)


def deviation(values):
    centre = mean(values)
    return math.sqrt(mean([(value - centre) ** 2 for value in values]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("trajectory")
    parser.add_argument("relations")
    parser.add_argument("--max-gap", type=float, default=2.0, metavar="S")
    parser.add_argument("--max-trans-mean", type=float, default=math.inf, metavar="M")
    args = parser.parse_args()

    distances, angles, missing = relation_errors(Trajectory(args.trajectory), args.relations, args.max_gap)
    if not distances:
        sys.exit(f"no relation of {args.relations} lies inside {args.trajectory}")
    print(f"n={len(distances)} missing={missing} "
          f"trans_mean={mean(distances):.4f} trans_std={deviation(distances):.4f} trans_max={max(distances):.3f} "
          f"rot_mean={mean(angles):.3f} rot_std={deviation(angles):.3f} rot_max={max(angles):.2f} "
          f"trans_sq_mean={mean([d * d for d in distances]):.5f} "
          f"rot_sq_mean={mean([a * a for a in angles]):.4f}")
    if missing > ALLOWED_MISSING_SHARE * (missing + len(distances)):
        sys.exit(f"{missing} of {missing + len(distances)} relations find no pose in {args.trajectory}")
    if mean(distances) > args.max_trans_mean:
        sys.exit(f"mean translational error {mean(distances):.4f} m exceeds {args.max_trans_mean} m")


if __name__ == "__main__":
    main()
