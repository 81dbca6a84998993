#!/usr/bin/env python3
"""Commands of the page in a real browser against real programs, beside those of browser_test.py: a running job is cancelled, map
versions are enabled and rolled back, a site is saved, another site is shown, landmarks are, and a robot is looked for at a place
that somebody has typed.

Usage: commands_test.py BIN_DIR. Exit code 77, with the line `SKIPPED: why`: there is no Chromium."""
import json
import math
import os
import re
import sys

from chromium import BrowserError
from harness import TILES, TOKEN, UNFINISHED, UNLOCKED, Failed, begin_smoothing, check_what_it_asked, eventually, open_site, run_in_browser

RUNNING = "[...document.querySelectorAll('#jobs .job')].find((job) => job.querySelector('.pill').innerText.endsWith('%'))?.dataset.key ?? ''"
ENABLED = "[...document.querySelectorAll('#versions .version')].filter((one) => !one.querySelector('.pill').hidden).map((one) => Number(one.dataset.key))"
VERSIONS = "[...document.querySelectorAll('#versions .version')].map((one) => Number(one.dataset.key))"
# Landmarks are circles in the colour of warnings; edits have that colour too, and dashes.
LANDMARKS = """(() => {
  const colour = getComputedStyle(document.documentElement).getPropertyValue('--warn').trim();
  return [...document.querySelectorAll('#map path:not([stroke-dasharray])')].filter((one) => one.getAttribute('stroke')?.trim() === colour).length;
})()"""


def cancel_a_running_job(page):
    """A job may end before somebody has pressed the button; then the next one is cancelled."""
    for _ in range(10):
        begin_smoothing(page)
        eventually("it runs, or has ended", lambda: page.run(RUNNING) or not page.run(UNFINISHED))
        job = page.run(RUNNING)
        try:
            page.click(f"#jobs [data-key='{job}'] .cancel")
        except BrowserError:
            print("it has ended before it could be cancelled", flush=True)
        eventually("no job is left", lambda: not page.run(UNFINISHED), 120)
        if job and page.text(f"#jobs [data-key='{job}'] .pill") == "Cancelled":
            return
    raise Failed(f"no running job was cancelled, the page says: {page.text('#jobs')}")


def switch_versions(page):
    begin_smoothing(page)
    eventually("the job ends", lambda: not page.run(UNFINISHED), 120)
    eventually("its version is enabled", lambda: page.run(ENABLED) == [max(page.run(VERSIONS))] and max(page.run(VERSIONS)) > 1)
    newest = max(page.run(VERSIONS))
    tiles = page.run(TILES)
    page.click("#versions [data-key='1'] button")
    eventually("the first version is enabled", lambda: page.run(ENABLED) == [1])
    eventually("the map is another one", lambda: page.run(TILES) and not set(page.run(TILES)) & set(tiles))
    page.click(f"#versions [data-key='{newest}'] button")
    eventually("the newest one is enabled again", lambda: page.run(ENABLED) == [newest])
    before = max(version for version in page.run(VERSIONS) if version < newest)
    page.click("#rollback")
    eventually("it is rolled back", lambda: page.run(ENABLED) == [before])


def show_another_site(page, site):
    page.run(f"(() => {{ const choice = document.getElementById('site'); choice.value = '{site}'; choice.dispatchEvent(new Event('change')); }})()")
    eventually(f"the page shows {site}", lambda: page.run("document.title").startswith(f"{site} ")
               and page.run("new URLSearchParams(location.search).get('site')") == site)
    eventually("with its tiles and no others", lambda: page.run(TILES) and all(f"/sites/{site}/" in tile for tile in page.run(TILES)))


def say_where_it_is_in_numbers(page):
    """Where it is listed: it drives on meanwhile, so the place is a little off, as a person's would be."""
    robot = "#robots [data-key=robot1]"
    eventually("it is tracked", lambda: page.text(f"{robot} .pill") == "Tracking")
    page.click(f"{robot} .relocalise summary")
    x, y, heading = (float(number) for number in re.match(r"(\S+), (\S+) m, (\S+)°", page.text(f"{robot} .where")).groups())
    for name, value in (("x", x), ("y", y), ("theta", heading)):
        page.click(f"{robot} .relocalise [name={name}]")
        page.type(str(value))
    page.click(f"{robot} .relocalise form button")
    eventually("the robot is looked for there", lambda: "robot1 is looked for there" in page.text("#said"))
    sent = json.loads(next(body for url, body in reversed(page.posts) if url.endswith("/api/robots/robot1/relocalise")))
    if abs(sent["x"] - x) + abs(sent["y"] - y) + abs(sent["theta"] - math.radians(heading)) > 1e-6:
        raise Failed(f"{x}, {y}, {heading} degrees were typed, and {sent} was sent")
    eventually("and found", lambda: page.text(f"{robot} .pill") == "Tracking")
    where = page.text(f"{robot} .where")
    eventually("and drives on", lambda: page.text(f"{robot} .where") != where)


def show_landmarks(page):
    if page.run(LANDMARKS) != 0:
        raise Failed("landmarks are shown before somebody has asked for them")
    page.click("#legend summary")
    page.click("#show-landmarks")
    eventually("landmarks are shown", lambda: page.run(LANDMARKS) > 0)
    page.click("#show-landmarks")
    eventually("and none any more", lambda: page.run(LANDMARKS) == 0)


def use_commands(programs, page):
    programs.start_server()
    address = programs.start_web(page)
    # Much to smooth, so that a job takes long enough to be cancelled.
    drive = programs.start("cairn", "sim", "--site", "archive", "--prefix", "old", "--world", "building", "--robots", "2", "--beams", "181",
                           "--hz", "5", "--window", "32", "--seconds", "120", "--fast")
    eventually("two robots have driven", lambda: drive.poll() is not None, 240)
    if drive.returncode != 0:
        raise Failed("the drive has failed")
    programs.start("cairn", "sim", "--site", "hall", "--world", "room", "--robots", "1", "--beams", "181", "--hz", "5", "--window", "32",
                   "--seconds", "3600", "--rate", "1")
    open_site(page, address, "archive", TOKEN)
    eventually("the token of the address unlocks commands", lambda: page.run(UNLOCKED))
    if TOKEN in page.run("location.href"):
        raise Failed("the token stays in the address")
    eventually("both sites can be chosen", lambda: page.run("[...document.querySelectorAll('#site option')].map((one) => one.value)") == ["archive", "hall"])
    eventually("the map of the first is shown", lambda: page.run(TILES))

    cancel_a_running_job(page)
    switch_versions(page)
    page.click("#save")
    eventually("the page says that the site is saved", lambda: "The site is saved" in page.text("#said"))
    if not os.path.getsize(os.path.join(programs.work, "state", "saved", "archive.site")):
        raise Failed("the file of the saved site is empty")

    show_another_site(page, "hall")
    eventually("its robot is listed and no other", lambda: page.run("[...document.querySelectorAll('#robots .name')].map((one) => one.innerText)") == ["robot1"])
    say_where_it_is_in_numbers(page)
    show_landmarks(page)
    show_another_site(page, "archive")
    check_what_it_asked(page, address, [(404, "/cancel"), (409, "/cancel")])  # Of a job that had ended.


if __name__ == "__main__":
    sys.exit(run_in_browser(use_commands))
