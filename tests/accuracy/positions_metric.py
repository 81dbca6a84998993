#!/usr/bin/env python3
"""How far a trajectory is from positions that somebody else measured, after the best shift, turn and scale.

For robots watched from outside (a camera over the arena): neither the camera's frame nor its scale is the robot's, so the
similarity that fits best is taken out first (Umeyama 1991, in the plane). What stays is an error of the shape of the way.

TRAJECTORY and POSITIONS are TUM text (`stamp x y z qx qy qz qw`); headings of POSITIONS are not read. A position
between two poses is compared with the interpolated one, unless they lie further apart than --max-gap.

Prints one line of key=value pairs (m). Exit code 1 when more than 5 % of the positions find no pose, the input cannot be
used, or the mean distance exceeds --max-mean.
"""
import argparse
import math
import sys

from relations_metric import Trajectory, mean, rows_of

ALLOWED_MISSING_SHARE = 0.05


def similarity_residuals(points, references):
    """(distances in the references' unit, scale) of the similarity that carries the points nearest to the references."""
    centre, reference_centre = mean(points), mean(references)
    spread = sum(abs(p - centre) ** 2 for p in points)
    if spread == 0:
        sys.exit("the trajectory stays where it is")
    turn_and_scale = sum((p - centre).conjugate() * (r - reference_centre) for p, r in zip(points, references)) / spread
    distances = [abs(r - reference_centre - turn_and_scale * (p - centre)) for p, r in zip(points, references)]
    return distances, abs(turn_and_scale)


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("trajectory")
    parser.add_argument("positions")
    parser.add_argument("--max-gap", type=float, default=2.0, metavar="S")
    parser.add_argument("--max-mean", type=float, default=math.inf, metavar="M")
    args = parser.parse_args()

    trajectory = Trajectory(args.trajectory)
    points, references, missing = [], [], 0
    for _, (stamp, x, y, *_rest) in rows_of(args.positions):
        pose = trajectory.at(stamp, args.max_gap)
        if pose is None:
            missing += 1
            continue
        points.append(complex(pose.x, pose.y))
        references.append(complex(x, y))
    if len(points) < 3:
        sys.exit(f"fewer than three positions of {args.positions} lie inside {args.trajectory}")
    distances, scale = similarity_residuals(points, references)
    print(f"n={len(distances)} missing={missing} mean={mean(distances):.4f} max={max(distances):.3f} scale={scale:.4f}")
    if missing > ALLOWED_MISSING_SHARE * (missing + len(distances)):
        sys.exit(f"{missing} of {missing + len(distances)} positions find no pose in {args.trajectory}")
    if mean(distances) > args.max_mean:
        sys.exit(f"mean distance {mean(distances):.4f} m exceeds {args.max_mean} m")


if __name__ == "__main__":
    main()
