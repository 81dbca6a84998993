#!/usr/bin/env python3
"""The page for those who use it otherwise than with a mouse on a large screen, in a real browser against real programs: with the
keyboard alone, with a finger on a phone, and with eyes that need contrast.

Usage: access_test.py BIN_DIR. Exit code 77, with the line `SKIPPED: why`: there is no Chromium."""
import json
import math
import sys

from harness import TILES, TOKEN, UNLOCKED, Failed, check_contrast, check_what_it_asked, eventually, icon_of, run_in_browser

ROBOT = "#robots [data-key=robot1]"


def tab_to(page, selector):
    """Presses Tab until the element has the focus. On the way each stop must be seen, and where the focus is must be, too."""
    stops = []
    for _ in range(100):
        page.press("Tab")
        stop, shown, outline = page.run("(() => { const one = document.activeElement, style = getComputedStyle(one);"
                                        " return [one.id || `${one.tagName} ${one.className}`, one.checkVisibility(), style.outlineStyle]; })()")
        stops.append(stop)
        if stop.startswith("BODY"):
            continue  # Behind the last one comes the first.
        if not shown or outline == "none":
            raise Failed(f"the focus is not seen at '{stop}'")
        if page.run(f"document.activeElement.matches({json.dumps(selector)})"):
            return
    raise Failed(f"Tab does not come to {selector}, but to {stops}")


def smooth_with_the_keyboard(page):
    """From the opened page on, with Tab, Enter and the letters of the token."""
    tab_to(page, ".skip")
    tab_to(page, "#unlock")
    page.press_enter()
    eventually("the dialog is open and waits for the token",
               lambda: page.shows("#token-dialog") and page.run("document.activeElement.id") == "token")
    page.type(TOKEN)
    page.press_enter()
    eventually("commands are unlocked", lambda: page.run(UNLOCKED) and not page.shows("#token-dialog"))
    tab_to(page, "#smooth")
    page.press_enter()
    eventually("the page says that it has begun", lambda: "Smoothing has begun" in page.text("#said"))
    eventually("the job ends", lambda: "Done" in page.text("#jobs"), 120)


def skip_the_map(page):
    """The first stop leads past the map."""
    page.run("document.activeElement.blur()")
    tab_to(page, ".skip")
    page.press_enter()
    eventually("the focus is in the lists", lambda: page.run("document.activeElement.id") == "panel")
    page.press("Tab")
    if not page.run("document.getElementById('panel').contains(document.activeElement)"):
        raise Failed("after the link past the map, Tab leads back to it")


def relocalise_with_a_finger(page):
    """On a phone, where the map is above the lists."""
    page.look(390, 800, "light")
    page.use_fingers(True)
    page.tap(f"{ROBOT} .relocalise summary")
    page.tap(f"{ROBOT} .on-map")
    eventually("the page says how to show a place", lambda: "Press where robot1 is" in page.text("#said"))
    eventually("the map is in view", lambda: page.run("(() => { const box = document.getElementById('map').getBoundingClientRect();"
                                                      " return box.top > -1 && box.bottom < innerHeight + 1; })()"))
    begins = page.run("scrollY")
    x, y, turn = icon_of(page, "robot1")
    ends = [(x + far * math.cos(turn), y + far * math.sin(turn)) for far in (10, 25, 40)]
    page.touch((x, y), *ends)
    eventually("the robot is looked for there", lambda: "robot1 is looked for there" in page.text("#said"))
    if page.run("scrollY") != begins:
        raise Failed("the finger has scrolled the page")
    sent = json.loads(next(body for url, body in reversed(page.posts) if url.endswith("/api/robots/robot1/relocalise")))
    off = abs(math.remainder(sent["theta"] + turn, 2 * math.pi))  # The screen's y points down.
    if off > 0.05:
        raise Failed(f"the finger moved {off:.2f} rad beside the heading {sent['theta']:.2f} that was sent")
    eventually("and found", lambda: page.text(f"{ROBOT} .pill") == "Tracking")
    page.use_fingers(False)


def read_everything(page):
    """All texts of the page, also those that are folded away, of the dialog, and of why a robot is not on the map."""
    page.run("[...document.querySelectorAll('details')].forEach((one) => { one.open = true; })")
    check_contrast(page, "body")
    page.run("document.getElementById('token-dialog').showModal()")
    check_contrast(page, "#token-dialog")
    page.run("document.getElementById('token-dialog').close()")
    page.run("import('/doctor.js').then(({ showDoctor }) => showDoctor({ ros2: { where: 'domain 5', problems: ['none'], advice: 'look', namespaces: ["
             "{ name: '/a', who: 'robot a', on_map: true, problems: [], topics: ['/scan'] }, { name: '/b', who: 'robot b', on_map: false, problems: ['no scan'],"
             " topics: [] }] }, strays: [{ robot: 'c', dropped: 1, why: 'no session' }] }))")
    check_contrast(page, "#doctor")


def use_the_page(programs, page):
    server = programs.start_server()
    address = programs.start_web(page)
    eventually("without a robot the page says what to do", lambda: "No site yet" in page.text("#map-empty"))
    check_contrast(page, "body")
    programs.start("cairn", "sim", "--site", "hall", "--world", "room", "--robots", "1", "--beams", "181", "--hz", "5", "--window", "32",
                   "--seconds", "3600", "--rate", "2")
    eventually("a robot is tracked on a map", lambda: page.run(TILES) and page.text(f"{ROBOT} .pill") == "Tracking"
               and page.shows(".robot-icon[data-robot=robot1]"))
    smooth_with_the_keyboard(page)
    skip_the_map(page)
    relocalise_with_a_finger(page)
    read_everything(page)
    check_what_it_asked(page, address)
    server.kill()
    eventually("the page says that the server is lost", lambda: page.shows("#banner"))
    check_contrast(page, "body")


if __name__ == "__main__":
    sys.exit(run_in_browser(use_the_page))
