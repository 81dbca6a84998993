#!/usr/bin/env python3
"""What several robots of a site have drawn apart, in a real browser against real programs: a robot that did not say where it starts
has a small map of its own until it is joined with the others, and where two runs differ is a picture over the map.

Usage: fragment_test.py BIN_DIR. Exit code 77, with the line `SKIPPED: why`: there is no Chromium."""
import re
import sys

from harness import TILES, TOKEN, UNFINISHED, UNLOCKED, Failed, begin_smoothing, check_what_it_asked, eventually, open_site, run_in_browser

SECOND = "#robots [data-key=second1]"
# Cells that are drawn as free in the small picture: the ground of the page shines through where nothing is known.
FREE = """(() => {
  const canvas = document.querySelector('#fragment-list [data-key=second1] canvas');
  if (!canvas) return 0;
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 0; i < pixels.length; i += 4) if (pixels[i] > 240 && pixels[i + 1] > 240 && pixels[i + 2] > 240 && pixels[i + 3] > 250) ++count;
  return count;
})()"""
# Cells about which two runs differ, in the picture over the map.
RED = """(() => {
  const image = document.querySelector('img.differs');
  if (!image?.complete || image.naturalWidth === 0) return 0;
  const canvas = Object.assign(document.createElement('canvas'), { width: image.naturalWidth, height: image.naturalHeight });
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0);
  const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 0; i < pixels.length; i += 4) if (pixels[i + 3] > 0 && pixels[i] > 150 && pixels[i + 1] < 100) ++count;
  return count;
})()"""


def drive(programs, *options):
    """A robot drives as fast as the server takes it, to its end."""
    process = programs.start("cairn", "sim", "--robots", "1", "--beams", "181", "--window", "32", "--fast", *options)
    eventually(f"a robot has driven in {options[1]}", lambda: process.poll() is not None, 240)
    if process.returncode != 0:
        raise Failed("the drive has failed")


def show_where_runs_differ(programs, page, address):
    """The furniture stands elsewhere in the second run."""
    for name, furniture in (("monday", "1"), ("tuesday", "2")):
        drive(programs, "--site", "office", "--world", "office", "--prefix", name, "--seconds", "30", "--furniture", "20", "--furniture-seed", furniture)
    open_site(page, address, "office")
    eventually("the office is shown", lambda: page.run(TILES))
    page.click("#legend summary")
    page.click("#show-disagreement")
    eventually("where the runs differ is drawn", lambda: page.run(RED) > 20)
    page.click("#show-disagreement")
    eventually("nothing is left of it", lambda: page.run("document.querySelectorAll('img.differs').length") == 0)


def show_a_robot_without_a_start(programs, page, address):
    building = ("--site", "joined", "--world", "building", "--unknown-starts", "--hz", "5")
    drive(programs, *building, "--prefix", "first", "--seconds", "150")
    programs.start("cairn", "sim", "--robots", "1", "--beams", "181", "--window", "32", *building, "--prefix", "second", "--seed", "2",
                   "--seconds", "3600", "--rate", "4")
    open_site(page, address, "joined", TOKEN)
    eventually("commands are unlocked", lambda: page.run(UNLOCKED))
    eventually("it is not joined", lambda: page.text(f"{SECOND} .pill") == "Not joined")
    eventually("it is listed on the map", lambda: page.text("#fragments summary") == "Not joined with the map yet (1)"
               and page.run("document.querySelectorAll('#fragment-list li').length") == 1)
    eventually("its own map is drawn", lambda: page.run(FREE) > 500)
    name = "document.querySelector('#fragment-list canvas').getAttribute('aria-label')"
    eventually("with its way", lambda: re.fullmatch(r"Own map of second1: \d+ × \d+ m, [1-9]\d* m of way", page.run(name)))
    if page.run("document.querySelector('.robot-icon[data-robot=second1]')?.checkVisibility() ?? false"):
        raise Failed("it is drawn at some place of the map")
    if page.nameless():
        raise Failed(f"a screen reader has no name for: {page.nameless()}")

    # What nobody looks at is not asked for.
    page.click("#fragments summary")
    def asked(what):
        page.run("1")  # Reads what the browser has told.
        return sum(url.endswith(what) or f"{what}?" in url for url in page.requests)
    eventually("the list is closed", lambda: page.run("!document.getElementById('fragments').open"))
    rounds = asked("/robots/first1/path")
    eventually("a question that had begun ends", lambda: asked("/robots/first1/path") > rounds)
    rounds, pictures = asked("/robots/first1/path"), asked("/robots/second1/map.png")
    eventually("paths are asked for two more times", lambda: asked("/robots/first1/path") >= rounds + 2)
    if asked("/robots/second1/map.png") != pictures:
        raise Failed("its map is asked for although nobody can see it")
    page.click("#fragments summary")

    used = "Number(/([0-9]+) scans/.exec(document.querySelector('#robots [data-key=second1] .where').innerText)[1])"
    eventually("it has seen much of what the first has drawn", lambda: page.run(used) > 400, 240)
    for _ in range(10):
        begin_smoothing(page)
        eventually("it ends", lambda: not page.run(UNFINISHED), 120)
        scans = page.run(used)
        eventually("it drives on", lambda: page.run(used) > scans + 10)
        if page.text(f"{SECOND} .pill") in ("Tracking", "Corridor"):
            break
    else:
        raise Failed(f"ten smoothing jobs have not joined it; the page says of it: {page.text(SECOND)}, and of the jobs: {page.text('#jobs')}")
    eventually("it is on the map", lambda: page.shows(".robot-icon[data-robot=second1]"))
    eventually("and not in the list any more", lambda: not page.shows("#fragments"))


def use_the_page(programs, page):
    # Only the page's own job joins robots, so that the test sees one that is not joined for as long as it looks.
    programs.start_server("--set", "jobs.join=false", "--set", "jobs.check_starts=false")
    address = programs.start_web(page)
    show_where_runs_differ(programs, page, address)
    show_a_robot_without_a_start(programs, page, address)
    check_what_it_asked(page, address, [(404, "/map.png")])  # Nothing was drawn yet.


if __name__ == "__main__":
    sys.exit(run_in_browser(use_the_page))
