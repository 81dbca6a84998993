#!/usr/bin/env python3
"""What viewers of the page cost: viewers.py BIN_DIR [VIEWERS]

Two simulated robots drive at real time, 10 scans a second each. Printed: how long a browser needs to its first map, what one
viewer receives, and the processor time of the server and of cairn-web without a viewer and with VIEWERS (50) of them, who
read the events and fetch each tile that changes. Needs Chromium."""
import http.client
import json
import os
import re
import shutil
import sys
import tempfile
import threading
import time

from browser_test import TILES, Failed, Programs, eventually, own_domain, said_by
from chromium import Page

SECONDS = 20


def processor_s(process):
    with open(f"/proc/{process.pid}/stat") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Viewer(threading.Thread):
    """Reads the events of a site and fetches the tiles they name, as the page does."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.port, self.ending, self.bytes, self.pictures, self.unchanged, self.problem = port, False, 0, 0, 0, None

    def fetch_tiles(self, connection, changes, known):
        for level, x, y, version in changes["tiles"]:
            if level != 0 or version == 0:
                continue
            path = f"/api/sites/hall/tiles/{level}/{x}/{y}.png"
            connection.request("GET", path, headers={"If-None-Match": known.get(path, "")})
            answer = connection.getresponse()
            self.bytes += len(answer.read())
            if answer.status == 200:
                known[path] = answer.getheader("ETag")
                self.pictures += 1
            elif answer.status == 304:
                self.unchanged += 1

    def run(self):
        try:
            known = {}
            tiles = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
            events = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
            events.request("GET", "/api/events?site=hall")
            answer = events.getresponse()
            if answer.status != 200:
                raise Failed(f"events: {answer.status}")
            name = ""
            while not self.ending:
                line = answer.readline()
                if not line:
                    raise Failed("the stream of events has ended")
                self.bytes += len(line)
                if line.startswith(b"event: "):
                    name = line[7:].strip()
                elif line.startswith(b"data: ") and name == b"tiles":
                    self.fetch_tiles(tiles, json.loads(line[6:]), known)
                    tiles.close()  # Opened again by the next request.
        except Exception as error:
            self.problem = error


def measure(what, processes, during=lambda: None):
    before = [processor_s(process) for process in processes]
    began = time.monotonic()
    during()
    # A rate needs a span of time.
    time.sleep(max(0.0, SECONDS - (time.monotonic() - began)))
    took = time.monotonic() - began
    shares = [100 * (processor_s(process) - start) / took for process, start in zip(processes, before)]
    print(f"{what}: cairnd {shares[0]:.1f} % of a core, cairn-web {shares[1]:.1f} %", flush=True)


def run(programs, browser, work, count):
    server = programs.start_server()
    web = programs.start("cairn-web", "--port", "0")
    eventually("the page is there", lambda: re.search(r"http://\S+", said_by(web)))
    address = re.search(r"http://[0-9.:]+/", said_by(web)).group()
    port = int(address.rstrip("/").rsplit(":", 1)[1])
    programs.start("cairn", "sim", "--site", "hall", "--world", "building", "--robots", "2", "--beams", "360", "--hz", "10",
                   "--window", "32", "--seconds", "3600", "--rate", "1")

    def state():
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
        connection.request("GET", "/api/state?site=hall")
        answer = connection.getresponse()
        text = answer.read()
        return json.loads(text) if answer.status == 200 else {}
    eventually("there is a map", lambda: (state().get("map") or {}).get("tiles", 0) > 20, 120)
    measure("no viewer", (server, web))

    page = Page(browser, work)
    try:
        page.look(1180, 720, "light")
        began = time.monotonic()
        page.open(address)
        while not page.run(f"window.L ? {TILES}.length : 0"):
            pass
        print(f"first map in a browser: {time.monotonic() - began:.2f} s, {page.bytes_received / 1000:.0f} kB with the page itself", flush=True)
        start = page.bytes_received
        measure("1 browser", (server, web), lambda: [(page.run("1"), time.sleep(0.5)) for _ in range(2 * SECONDS)])
        print(f"one browser receives {(page.bytes_received - start) / SECONDS / 1000:.1f} kB/s", flush=True)
    finally:
        page.close()

    viewers = [Viewer(port) for _ in range(count)]
    for viewer in viewers:
        viewer.start()
    eventually("all see the map", lambda: all(viewer.pictures or viewer.problem for viewer in viewers))
    start = sum(viewer.bytes for viewer in viewers)
    measure(f"{count} viewers", (server, web))
    received = sum(viewer.bytes for viewer in viewers) - start
    problems = [viewer.problem for viewer in viewers if viewer.problem]
    if problems:
        raise Failed(f"{len(problems)} viewers were not served: {problems[0]}")
    print(f"one of {count} viewers receives {received / SECONDS / count / 1000:.1f} kB/s", flush=True)
    dropped = sum(sum(sensor["dropped"].values()) for robot in state()["robots"] for sensor in robot["sensors"])
    print(f"scans dropped by the server: {dropped}")
    for viewer in viewers:
        viewer.ending = True
    for viewer in viewers:
        viewer.join()


def main():
    binaries, count = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 50
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if not browser:
        print("SKIPPED: there is no Chromium on this machine (deploy/install-packages.sh test)")
        return 77
    domain, lock = own_domain()
    with lock, tempfile.TemporaryDirectory(prefix="cairn-viewers-", ignore_cleanup_errors=True) as work:
        programs = Programs(binaries, work, domain)
        try:
            run(programs, browser, work, count)
        finally:
            programs.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
