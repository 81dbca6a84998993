#!/usr/bin/env python3
"""How far from its start a robot ended, beside what its odometry says: for a corridor in which scans show no way along it.

Where only odometry shows how far the robot drives, the estimate must not be shorter or longer. That is no figure of accuracy:
odometry itself has no error here. TRAJECTORY is TUM text
(`stamp x y z qx qy qz qw`), LOG a CARMEN log whose ROBOTLASER1 lines carry the odometry.

Prints one line of key=value pairs (m). Exit code 1 when the input cannot be used, or the distance from start to end differs
by more than --max-share of that of the odometry.
"""
import argparse
import math
import sys

from relations_metric import rows_of


def ends_of_odometry(path):
    """The first and the last pose (x, y) of the robot by odometry."""
    poses = []
    with open(path, encoding="ascii", errors="replace") as lines:
        for line in lines:
            fields = line.split()
            if fields and fields[0] == "ROBOTLASER1":
                at = 9 + int(fields[8])  # Behind the ranges: remissions, then the pose of the laser, then that of the robot.
                at += 1 + int(fields[at])
                poses.append((float(fields[at + 3]), float(fields[at + 4])))
    if len(poses) < 2:
        sys.exit(f"{path} has no odometry")
    return poses[0], poses[-1]


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("trajectory")
    parser.add_argument("log")
    parser.add_argument("--max-share", type=float, default=math.inf, metavar="S")
    args = parser.parse_args()

    poses = [(x, y) for _, (_, x, y, *_rest) in rows_of(args.trajectory)]
    if len(poses) < 2:
        sys.exit(f"{args.trajectory} has no way")
    by_odometry = math.dist(*ends_of_odometry(args.log))
    if by_odometry == 0:
        sys.exit(f"by its odometry the robot of {args.log} ends where it began")
    estimated = math.dist(poses[0], poses[-1])
    share = abs(estimated / by_odometry - 1)
    print(f"estimated={estimated:.3f} odometry={by_odometry:.3f} share={share:.4f}")
    if share > args.max_share:
        sys.exit(f"the estimated way differs by {100 * share:.1f} % from that of the odometry")


if __name__ == "__main__":
    main()
