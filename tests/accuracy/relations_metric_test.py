#!/usr/bin/env python3
"""relations_metric.py on cases worked out by hand."""
import math
import os
import subprocess
import sys
import tempfile
import unittest

METRIC = os.path.join(os.path.dirname(os.path.abspath(__file__)), "relations_metric.py")


def tum(stamp, x, y, theta):
    return f"{stamp} {x} {y} 0 0 0 {math.sin(theta / 2)} {math.cos(theta / 2)}\n"


# A robot that goes 2 m east in 2 s, turns left on the spot in 1 s, then goes 1 m north.
WALK = tum(0, 0, 0, 0) + tum(2, 2, 0, 0) + tum(3, 2, 0, math.pi / 2) + tum(4, 2, 1, math.pi / 2)


class RelationsMetric(unittest.TestCase):
    def run_metric(self, trajectory, relations, *options):
        with tempfile.TemporaryDirectory() as folder:
            paths = [os.path.join(folder, name) for name in ("t.tum", "r.relations")]
            for path, text in zip(paths, (trajectory, relations)):
                with open(path, "w", encoding="ascii") as out:
                    out.write(text)
            done = subprocess.run([sys.executable, METRIC, *paths, *options], capture_output=True, text=True, check=False)
        return done, dict(pair.split("=") for pair in done.stdout.split())

    def test_a_trajectory_that_keeps_its_relations_has_no_error(self):
        done, values = self.run_metric(WALK, f"0 4 2 1 0 0 0 {math.pi / 2}\n2 3 0 0 0 0 0 {math.pi / 2}\n")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((values["n"], values["missing"]), ("2", "0"))
        self.assertEqual((values["trans_max"], values["rot_max"]), ("0.000", "0.00"))

    def test_errors_are_distance_and_absolute_angle_of_the_difference(self):
        # The relations are wrong by 3-4-5 and by 0; by 0 and by -10 degrees.
        wrong_yaw = math.pi / 2 + math.radians(10)
        _, values = self.run_metric(WALK, f"0 2 -1 4 0 0 0 0\n2 3 0 0 0 0 0 {wrong_yaw}\n")
        self.assertEqual((values["trans_mean"], values["trans_std"], values["trans_max"]), ("2.5000", "2.5000", "5.000"))
        self.assertEqual((values["rot_mean"], values["rot_std"], values["rot_max"]), ("5.000", "5.000", "10.00"))
        self.assertEqual((values["trans_sq_mean"], values["rot_sq_mean"]), ("12.50000", "50.0000"))

    def test_the_start_frame_does_not_matter(self):
        # WALK turned by 90 degrees and moved.
        moved = (tum(0, 5, 7, math.pi / 2) + tum(2, 5, 9, math.pi / 2) + tum(3, 5, 9, math.pi) + tum(4, 4, 9, math.pi))
        _, values = self.run_metric(moved, f"0 4 2 1 0 0 0 {math.pi / 2}\n")
        self.assertEqual((values["trans_mean"], values["rot_mean"]), ("0.0000", "0.000"))

    def test_a_stamp_between_two_poses_is_interpolated(self):
        _, values = self.run_metric(WALK, f"1 2.5 1 0 0 0 0 {math.pi / 4}\n")
        self.assertEqual((values["trans_mean"], values["rot_mean"]), ("0.0000", "0.000"))

    def test_angles_are_compared_across_pi(self):
        _, values = self.run_metric(tum(0, 0, 0, 0) + tum(1, 0, 0, math.radians(179)),
                                    f"0 1 0 0 0 0 0 {math.radians(-179)}\n")
        self.assertEqual(values["rot_mean"], "2.000")

    def test_relations_in_gaps_and_outside_are_missing_and_fail_the_run(self):
        done, values = self.run_metric(WALK, "0 2 2 0 0 0 0 0\n1 2 1 0 0 0 0 0\n0 9 0 0 0 0 0 0\n", "--max-gap", "1.5")
        self.assertEqual((values["n"], values["missing"]), ("1", "2"))
        self.assertEqual(done.returncode, 1)

    def test_a_mean_above_the_limit_fails_the_run(self):
        relation = "0 2 2.2 0 0 0 0 0\n"
        self.assertEqual(self.run_metric(WALK, relation, "--max-trans-mean", "0.25")[0].returncode, 0)
        self.assertEqual(self.run_metric(WALK, relation, "--max-trans-mean", "0.15")[0].returncode, 1)

    def test_input_that_cannot_be_used_names_file_and_line(self):
        for text in (WALK + "5 1 2 3\n", WALK + "5 nan 0 0 0 0 0 1\n", WALK + tum(3.5, 0, 0, 0), WALK + "5 x 0 0 0 0 0 1\n"):
            done, _ = self.run_metric(text, "0 2 2 0 0 0 0 0\n")
            self.assertEqual(done.returncode, 1)
            self.assertIn("t.tum:5:", done.stderr)


if __name__ == "__main__":
    unittest.main()
