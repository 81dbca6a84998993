#!/usr/bin/env python3
"""What viewers of the page cost: viewers.py BIN_DIR [--viewers N] [--seconds S]

Two simulated robots drive at real time, 10 scans a second each. Printed: how long a browser needs to its first map, what it
receives, and the processor time of the server and of cairn-web without a viewer, with the browser, and with N (50) viewers, who
read the events and fetch each tile that changes; each measured for S (20) seconds. Without Chromium there is no browser among them.
The last line is a JSON object with the figures: `cairn-study viewers` runs this and says whether they are as they must be."""
import argparse
import http.client
import json
import os
import re
import shutil
import sys
import tempfile
import threading
import time

from harness import TILES, Failed, Programs, eventually, own_domain, said_by
from chromium import Page


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


def measure(what, processes, seconds, during=lambda: None):
    """The shares of a core, in percent, that the processes use."""
    before = [processor_s(process) for process in processes]
    began = time.monotonic()
    during()
    # A rate needs a span of time.
    time.sleep(max(0.0, seconds - (time.monotonic() - began)))
    took = time.monotonic() - began
    shares = [100 * (processor_s(process) - start) / took for process, start in zip(processes, before)]
    print(f"{what}: cairnd {shares[0]:.1f} % of a core, cairn-web {shares[1]:.1f} %", flush=True)
    return {"server": shares[0], "web": shares[1]}


def look_with_a_browser(browser, work, address, processes, seconds):
    page = Page(browser, work)
    try:
        page.look(1180, 720, "light")
        began = time.monotonic()
        page.open(address)
        while not page.run(f"window.L ? {TILES}.length : 0"):
            if time.monotonic() - began > 60:
                raise Failed("the browser shows no map")
        first_s, first_kb = time.monotonic() - began, page.bytes_received / 1000
        print(f"first map in a browser: {first_s:.2f} s, {first_kb:.0f} kB with the page itself", flush=True)
        start, began = page.bytes_received, time.monotonic()
        figures = measure("1 browser", processes, seconds, lambda: [(page.run("1"), time.sleep(0.5)) for _ in range(int(2 * seconds))])
        page.run("1")
        kb_s = (page.bytes_received - start) / (time.monotonic() - began) / 1000
        print(f"one browser receives {kb_s:.1f} kB/s", flush=True)
        return {**figures, "first_s": first_s, "first_kb": first_kb, "kb_s": kb_s}
    finally:
        page.close()


def look_with_many(count, port, processes, seconds):
    viewers = [Viewer(port) for _ in range(count)]
    for viewer in viewers:
        viewer.start()
    eventually("all see the map", lambda: all(viewer.pictures or viewer.problem for viewer in viewers))
    start, began = sum(viewer.bytes for viewer in viewers), time.monotonic()
    figures = measure(f"{count} viewers", processes, seconds)
    kb_s = (sum(viewer.bytes for viewer in viewers) - start) / (time.monotonic() - began) / count / 1000
    problems = [viewer.problem for viewer in viewers if viewer.problem]
    if problems:
        raise Failed(f"{len(problems)} viewers were not served: {problems[0]}")
    print(f"one of {count} viewers receives {kb_s:.1f} kB/s", flush=True)
    for viewer in viewers:
        viewer.ending = True
    for viewer in viewers:
        viewer.join()
    return {**figures, "kb_s": kb_s}


def run(programs, browser, work, count, seconds):
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
        connection.close()
        return json.loads(text) if answer.status == 200 else {"robots": []}

    def scans(account):
        return sum(account(sensor) for robot in state()["robots"] for sensor in robot["sensors"] if sensor["sensor"] != "odometry")
    # At first a scan costs more, because all that it shows is new.
    eventually("there is a map", lambda: (state().get("map") or {}).get("tiles", 0) > 20 and scans(lambda one: one["used"]) > 300, 120)
    processes = (server, web)
    figures = {"viewers": count, "alone": measure("no viewer", processes, seconds)}
    figures["browser"] = look_with_a_browser(browser, work, address, processes, seconds) if browser else None
    figures["many"] = look_with_many(count, port, processes, seconds)
    figures["used"], figures["dropped"] = scans(lambda one: one["used"]), scans(lambda one: sum(one["dropped"].values()))
    print(f"scans dropped by the server: {figures['dropped']}")
    print(json.dumps(figures))


def main():
    parser = argparse.ArgumentParser(description="What viewers of the page cost.")
    parser.add_argument("binaries", help="folder of cairnd, cairn and cairn-web")
    parser.add_argument("--viewers", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=20)
    arguments = parser.parse_args()
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if not browser:
        print("there is no Chromium on this machine (deploy/install-packages.sh test), so none looks")
    domain, lock = own_domain()
    with lock, tempfile.TemporaryDirectory(prefix="cairn-viewers-", ignore_cleanup_errors=True) as work:
        programs = Programs(arguments.binaries, work, domain)
        try:
            run(programs, browser, work, arguments.viewers, arguments.seconds)
        finally:
            programs.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
