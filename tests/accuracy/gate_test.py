#!/usr/bin/env python3
"""gate.sh, positions_metric.py and way_metric.py on small logs whose trajectories a stand-in for cairn-offline knows."""
import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
CSAIL = ("mit-csail.clf", "mit-csail.relations")
FURO = "lowcost/furo_lsc_corridor-degene.log"
LEGO = ("lowcost/lego_urg04lx_robot4.log", "lowcost/lego_urg04lx_robot4_positions.tum")

# Copies LOG.online and LOG.smoothed to where it is told, as cairn-offline would write what it computed.
STAND_IN = """#!/bin/sh
cp "$1.online" "$3" && cp "$1.smoothed" "$5"
"""


def way(error_m=0.0):
    """A robot on a circle of 1 m; every other pose lies `error_m` off it, outwards."""
    rows = []
    for i in range(40):
        radius, angle = 1.0 + (error_m if i % 2 else 0.0), 0.2 * i
        rows.append((float(i), radius * math.cos(angle), radius * math.sin(angle)))
    return rows


def tum(rows, scale=1.0):
    return "".join(f"{stamp} {scale * x} {scale * y} 0 0 0 0 1\n" for stamp, x, y in rows)


def relations(rows):
    return "".join(f"{a[0]} {b[0]} {b[1] - a[1]} {b[2] - a[2]} 0 0 0 0\n" for a, b in zip(rows, rows[2:]))


def carmen(rows):
    """ROBOTLASER1 lines with two ranges, one remission and the odometry."""
    return "".join(f"ROBOTLASER1 0 0 0 0 0 0 0 2 1.0 2.0 1 9.0 7 7 7 {x} {y} 0 0 0 0 0 0 {t} host {t}\n" for t, x, y in rows)


class Gate(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.write("bin/cairn-offline", STAND_IN)
        os.chmod(os.path.join(self.folder, "bin/cairn-offline"), 0o755)
        truth = way()
        self.write(f"data/{CSAIL[1]}", relations(truth))
        self.write(f"data/{LEGO[1]}", tum(truth, 1.13))
        self.write(f"data/{FURO}", carmen(truth))
        for log in (CSAIL[0], LEGO[0]):
            self.write(f"data/{log}", "")
        for log in (CSAIL[0], LEGO[0], FURO):
            self.answer(log)

    def write(self, name, text):
        path = os.path.join(self.folder, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="ascii") as out:
            out.write(text)

    def answer(self, log, online=None, smoothed=None):
        for form, rows in (("online", online), ("smoothed", smoothed)):
            self.write(f"data/{log}.{form}", tum(way() if rows is None else rows))

    def run_gate(self):
        return subprocess.run([os.path.join(HERE, "gate.sh"), os.path.join(self.folder, "bin"),
                               os.path.join(self.folder, "out")], capture_output=True, text=True, check=False,
                              env={**os.environ, "CAIRN_DATA": os.path.join(self.folder, "data")})

    def test_right_trajectories_pass(self):
        done = self.run_gate()
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual(done.stdout.count("at most"), 6)

    def test_each_of_the_figures_alone_fails_the_gate(self):
        # One pose in three is 0.1 m too far along x, the first one among them and not the last: more than is allowed.
        wrong = [(stamp, x + (0.1 if i % 3 == 0 and i < 39 else 0.0), y) for i, (stamp, x, y) in enumerate(way())]
        for log in (CSAIL[0], LEGO[0], FURO):
            for form in ("online", "smoothed"):
                self.answer(log, **{form: wrong})
                done = self.run_gate()
                self.assertEqual(done.returncode, 1, f"{log} {form}: {done.stdout}")
                self.assertEqual(done.stdout.count("FAILED"), 1, done.stdout)
                self.assertIn(form, done.stdout.partition("FAILED")[2])
            self.answer(log)

    def test_an_absent_log_is_said_and_the_other_one_is_still_held(self):
        os.remove(os.path.join(self.folder, "data", CSAIL[0]))
        done = self.run_gate()
        self.assertEqual(done.returncode, 77, done.stdout + done.stderr)
        self.assertIn("SKIPPED: no accuracy figure of mit-csail", done.stdout)
        self.assertEqual(done.stdout.count("at most"), 4)
        self.answer(LEGO[0], online=way(0.2))
        self.assertEqual(self.run_gate().returncode, 1)

    def test_a_program_that_fails_is_not_a_pass(self):
        self.write("bin/cairn-offline", "#!/bin/sh\nexit 3\n")
        self.assertEqual(self.run_gate().returncode, 1)


class PositionsMetric(unittest.TestCase):
    def run_metric(self, trajectory, positions, *options):
        with tempfile.TemporaryDirectory() as folder:
            paths = [os.path.join(folder, name) for name in ("t.tum", "p.tum")]
            for path, rows in zip(paths, (trajectory, positions)):
                with open(path, "w", encoding="ascii") as out:
                    out.write(tum(rows))
            done = subprocess.run([sys.executable, os.path.join(HERE, "positions_metric.py"), *paths, *options],
                                  capture_output=True, text=True, check=False)
        return done, dict(pair.split("=") for pair in done.stdout.split())

    def test_shift_turn_and_scale_are_no_error(self):
        seen = [(stamp, 3.0 - 1.5 * y, 4.0 + 1.5 * x) for stamp, x, y in way()]
        done, values = self.run_metric(way(), seen)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((values["mean"], values["scale"], values["missing"]), ("0.0000", "1.5000", "0"))

    def test_what_is_left_is_measured(self):
        # A square and the same square with one pair of opposite corners pulled out and the other pushed in by 0.1.
        square = [(0.0, 1, 0), (1.0, 0, 1), (2.0, -1, 0), (3.0, 0, -1)]
        bent = [(0.0, 1.1, 0), (1.0, 0, 0.9), (2.0, -1.1, 0), (3.0, 0, -0.9)]
        _, values = self.run_metric(square, bent)
        self.assertEqual((values["mean"], values["max"], values["scale"]), ("0.1000", "0.100", "1.0000"))
        self.assertEqual(self.run_metric(square, bent, "--max-mean", "0.11")[0].returncode, 0)
        self.assertEqual(self.run_metric(square, bent, "--max-mean", "0.09")[0].returncode, 1)

    def test_a_mirrored_way_is_an_error(self):
        mirrored = [(stamp, x, -y) for stamp, x, y in way()]
        self.assertGreater(float(self.run_metric(way(), mirrored)[1]["mean"]), 0.5)

    def test_missing_positions_fail(self):
        self.assertEqual(self.run_metric(way()[:20], way())[0].returncode, 1)


class WayMetric(unittest.TestCase):
    def run_metric(self, trajectory, odometry, *options):
        with tempfile.TemporaryDirectory() as folder:
            paths = [os.path.join(folder, name) for name in ("t.tum", "o.log")]
            for path, text in zip(paths, (tum(trajectory), carmen(odometry))):
                with open(path, "w", encoding="ascii") as out:
                    out.write(text)
            return subprocess.run([sys.executable, os.path.join(HERE, "way_metric.py"), *paths, *options],
                                  capture_output=True, text=True, check=False)

    def test_the_ends_are_compared_wherever_they_lie(self):
        odometry = [(0.0, 1.0, 1.0), (1.0, 9.0, 9.0), (2.0, 1.0, 11.0)]
        estimated = [(0.0, 0.0, 0.0), (2.0, 9.7, 0.0)]
        done = self.run_metric(estimated, odometry, "--max-share", "0.031")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout, "estimated=9.700 odometry=10.000 share=0.0300\n")
        self.assertEqual(self.run_metric(estimated, odometry, "--max-share", "0.029").returncode, 1)
        longer = [(0.0, 0.0, 0.0), (2.0, 10.4, 0.0)]
        self.assertEqual(self.run_metric(longer, odometry, "--max-share", "0.029").returncode, 1)

    def test_a_robot_that_returns_has_no_such_figure(self):
        done = self.run_metric([(0.0, 0, 0), (1.0, 1, 0)], [(0.0, 1, 1), (1.0, 1, 1)])
        self.assertEqual(done.returncode, 1)
        self.assertIn("ends where it began", done.stderr)


if __name__ == "__main__":
    unittest.main()
