#!/usr/bin/env python3
"""A robot of Cairn in Python: opens a session, streams scans and odometry, and prints the poses that it gets back.

It simulates a drive along a corridor. The rules that it follows are in idl/README.md. Run build.sh first.
"""
import argparse
import math
import os
import pathlib
import random
import sys
import time

import corridor
import dds
import messages

WINDOW = 32  # Scans beyond the last settled one that may be on their way, so that the server never has to drop one.
PATIENCE_S = 20.0  # Of each step.
UNAVAILABLE, RESOURCE_EXHAUSTED = 14, 8  # Codes of refusals after which the client asks again.
NETWORK = """<CycloneDDS><Domain Id="any"><General><AllowMulticast>true</AllowMulticast><Interfaces>
  <NetworkInterface address="{}" multicast="true"/></Interfaces></General></Domain></CycloneDDS>"""


def hash_of(name):
    """FNV-1a with 64 bits: the id of a robot, a sensor or a site."""
    value = 14695981039346656037
    for byte in name.encode():
        value = (value ^ byte) * 1099511628211 % 2**64
    return value


class Robot:
    def __init__(self, bus, types, name, site):
        self.bus, self.types, self.name, self.site = bus, types, name, site
        self.id, self.laser = hash_of(name), hash_of("laser")
        self.client = random.randrange(1, 2**64)  # Of this process.
        self.session = random.randrange(1, 2**64)  # Of this drive: sequence numbers count within it.
        self.started, self.phase, self.sent, self.settled = False, None, 0, 0
        self.poses = []  # Sequence number of the scan, x, y, theta, whether it is localized.
        self.scan_writer = bus.writer(types.Scan, "cairn/v1/scan", depth=64)
        self.odometry_writer = bus.writer(types.Odometry, "cairn/v1/odometry", depth=256)
        self.session_writer = bus.writer(types.SessionRequest, "cairn/v1/session", kept=True, lease_s=1.0)
        self.states = bus.reader(types.SessionState, "cairn/v1/session_state", kept=True, depth=4)
        self.refusals = bus.reader(types.SessionRefusal, "cairn/v1/session_refusal", depth=256)
        self.reports = bus.reader(types.PoseReport, "cairn/v1/pose", depth=16)
        self.ledgers = bus.reader(types.Ledger, "cairn/v1/ledger", kept=True)

    def _take_all(self):
        for state in self.bus.take(self.states):
            if state.robot_id == self.id and state.session == self.session:
                self.phase = state.phase
        for refusal in self.bus.take(self.refusals):
            state, again = refusal.state, (UNAVAILABLE, RESOURCE_EXHAUSTED)
            if state.client == self.client and state.session == self.session and state.status.code not in again:
                sys.exit(f"robot.py: the server refuses: {state.status.message.decode()}")
        for ledger in self.bus.take(self.ledgers):
            if (ledger.robot_id, ledger.sensor_id, ledger.session) == (self.id, self.laser, self.session):
                self.settled = ledger.settled_through
        for report in self.bus.take(self.reports):
            if report.robot_id == self.id and report.session == self.session:
                at, reason = report.T_map_robot, self.types.PoseReason(report.reason).name
                self.poses.append((report.scan_sequence, at.x, at.y, at.theta, report.localized))
                print(f"scan {report.scan_sequence:5d}  x {at.x:8.3f}  y {at.y:8.3f}  theta {at.theta:7.4f}  {reason}")

    def _wait(self, condition, what, each_second=lambda: None):
        began, next_s = time.monotonic(), 0.0
        self._take_all()
        while not condition():
            now = time.monotonic()
            if now > began + PATIENCE_S:
                sys.exit(f"robot.py: not within {PATIENCE_S:.0f} s: {what}")
            if now > next_s:
                each_second()
                next_s = now + 1.0
            time.sleep(0.001)
            self._take_all()

    def _request(self, end=False):
        # The start is the origin of the map: each drive of this robot begins at the same place. One that does not know
        # its place in the map sets no has_start.
        request = self.types.SessionRequest(
            robot_id=self.id, client=self.client, session=self.session, robot=self.name.encode(),
            site=self.site.encode(), has_start=True, started=self.started, end=end)
        messages.fill(request.sensors, [b"laser"])
        self.bus.write(self.session_writer, request)

    def open(self):
        # A busy server may drop a request, and a refusal is not kept for us: ask again until there is an answer.
        active = self.types.SessionPhase.SESSION_ACTIVE
        self._wait(lambda: self.phase == active, "an answer to the session", self._request)
        writers = (self.scan_writer, self.odometry_writer)
        self._wait(lambda: all(map(self.bus.matched, writers)), "a reader of scans and of odometry")
        # A server that is started later and does not know the session must not open it: the robot has moved on.
        self.started = True
        self._request()

    def send(self, stamp_ns, odometry, ranges):
        self._wait(lambda: self.sent < self.settled + WINDOW, "the server settles scans")
        self.sent += 1
        common = {"robot_id": self.id, "session": self.session, "seq": self.sent, "stamp_ns": stamp_ns}
        self.bus.write(self.odometry_writer, self.types.Odometry(
            sensor_id=hash_of("odometry"), T_odom_robot=self.types.Pose2(*odometry), **common))
        scan = self.types.Scan(sensor_id=self.laser, angle_first_rad=-math.pi / 2, range_max_m=corridor.RANGE_MAX_M,
                               angle_step_rad=math.pi / (corridor.BEAMS - 1), **common)
        messages.fill(scan.ranges_m, ranges)
        self.bus.write(self.scan_writer, scan)

    def end(self):
        self._wait(lambda: self.settled >= self.sent, "the server settles the last scan")
        ended = self.types.SessionPhase.SESSION_ENDED
        self._wait(lambda: self.phase == ended, "the session ends", lambda: self._request(end=True))


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--site", default="corridor")
    options.add_argument("--robot", default="python-1")
    options.add_argument("--domain", type=int, default=int(os.environ.get("CAIRN_DOMAIN", "0")))
    options.add_argument("--address", default="127.0.0.1", help="this machine's own, in the network of the server")
    options.add_argument("--built", type=pathlib.Path, help="the folder that build.sh has made",
                         default=pathlib.Path(__file__).resolve().parents[2] / "build/python")
    arguments = options.parse_args()
    os.environ.setdefault("CYCLONEDDS_URI", NETWORK.format(arguments.address))
    bus = dds.Dds(arguments.built / "libcairn_messages.so", arguments.domain)
    robot = Robot(bus, messages.Messages(arguments.built), arguments.robot, arguments.site)
    robot.open()
    truths = []
    for stamp_ns, odometry, ranges, truth in corridor.drive():
        robot.send(stamp_ns, odometry, ranges)
        truths.append(truth)
    robot.end()
    bus.close()
    errors = [math.dist((x, y), truths[number - 1][:2]) for number, x, y, _, localized in robot.poses if localized]
    print(f"{robot.sent} scans, {len(robot.poses)} poses, {len(errors)} of them localized, "
          f"at most {max(errors, default=0.0):.3f} m beside the truth")


if __name__ == "__main__":
    main()
