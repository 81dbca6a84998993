#!/usr/bin/env python3
"""Why a robot is not on the map, in a real browser: the panel appears only where the server has a door for ROS 2, says what
`cairn ros2 doctor` prints, shows foreign names as text, and can be read in light and dark and by a screen reader.

Usage: doctor_test.py BIN_DIR [ROS2_ROBOT [PICTURES]]. ROS2_ROBOT is the robot of tests/integration/cyclone; without it only an
empty network is looked at. Exit code 77, with the line `SKIPPED: why`: there is no Chromium."""
import json
import os
import subprocess
import sys

from harness import Failed, check_contrast, eventually, run_in_browser

CONFIG = os.path.join(os.path.dirname(__file__), "../../integration/cyclone/loopback.xml")

# Names as a hostile program in the robots' network may choose them; nothing of them may become an element or run.
HOSTILE = """import('/doctor.js').then(({ showDoctor }) => {
  const evil = '<img src=x onerror=alert(1)><b>r9</b>';
  showDoctor({ ros2: { where: evil, problems: [evil], advice: evil, namespaces: [{ name: evil, who: evil, on_map: false, problems: [evil], topics: [evil] }] },
    strays: [{ robot: evil, dropped: 1, why: evil }] });
  const panel = document.getElementById('doctor');
  return [panel.querySelectorAll('img, b').length, panel.innerText.split(evil).length - 1];
})"""


def doctor(programs):
    cairn = os.path.join(programs.binaries, "cairn")
    line = [cairn, "--domain", str(programs.domain), "ros2", "doctor"]
    said = subprocess.run([*line, "--json"], capture_output=True, text=True, timeout=30)
    return json.loads(said.stdout) if said.returncode == 0 else None


def look_at_robots(programs, page, robot, pictures):
    environment = {**os.environ, "CYCLONEDDS_URI": f"file://{os.path.abspath(CONFIG)}"}
    robots = [subprocess.Popen([robot, str(programs.domain), *words], env=environment, stdout=subprocess.DEVNULL)
              for words in (["r1", "lab", "300"], ["r4", "lab", "300", "no-tf"], ["fleet/hall/r3", "lab", "300"])]
    try:
        of = "[...document.querySelectorAll('#doctor-namespaces > li')].find((one) => one.dataset.key === '{}')"
        text = lambda name: page.run(f"{of.format(name)}?.innerText ?? ''")
        eventually("a good robot is on the map", lambda: "On the map" in text("/r1") and "robot r1 in site lab" in text("/r1"))
        eventually("one without transforms is not, and why", lambda: "Not on the map" in text("/r4") and "no transform connects" in text("/r4"))
        eventually("nor one that no rule fits", lambda: "no rule of ros2.namespaces fits it" in text("/fleet/hall/r3"))
        eventually("how many are missing is said", lambda: "2 of 3 seen here are not on the map." in page.text("#doctor-summary"))
        def agree():
            said = doctor(programs)
            return said is not None and len(said["namespaces"]) == 3 and all(
                problem in text(one["name"]) for one in said["namespaces"] for problem in one["problems"])
        eventually("the command line says the same", agree)
        # With the keyboard.
        page.run(f"{of.format('/r4')}.querySelector('summary').focus()")
        page.press_enter()
        eventually("its topics are shown", lambda: "/r4/scan (sensor_msgs/msg/LaserScan): 1 publisher" in text("/r4"))
        if page.nameless():
            raise Failed(f"a screen reader has no name for: {page.nameless()}")
        check_contrast(page, "#doctor")
        for theme in ("light", "dark") if pictures else ():
            page.look(1180, 1000, theme)
            page.run("document.getElementById('doctor').scrollIntoView()")
            page.picture(os.path.join(pictures, f"doctor-{theme}.png"))
        if pictures:
            page.look(390, 1200, "light")
            page.run("document.getElementById('doctor').scrollIntoView()")
            page.picture(os.path.join(pictures, "doctor-phone.png"))
    finally:
        for process in robots:
            process.kill()
            process.wait()


def use_the_page(programs, page, robot, pictures):
    server = programs.start_server()
    address = programs.start_web(page)
    eventually("the server answers", lambda: "Live" in page.text("#connection"))
    if page.run(f"fetch('{address}api/doctor').then((answer) => answer.json())") != {"ros2": None, "strays": []}:
        raise Failed("a server without a door for ROS 2 has something to say of it")
    if page.shows("#doctor"):
        raise Failed("the panel is shown without a door for ROS 2")
    server.kill()
    server.wait()
    programs.start_server("--set", "ros2.enabled=true", "--set", f"ros2.domain={programs.domain}")
    eventually("with one, the panel says what to look at", lambda: "is ROS_DOMAIN_ID the same" in page.text("#doctor"))
    if robot:
        look_at_robots(programs, page, robot, pictures)
    elements, told = page.run(HOSTILE)
    if elements != 0 or told != 8:
        raise Failed(f"names from the network became {elements} elements, and are shown {told} times instead of 8")
    if page.errors:
        raise Failed(f"errors of the page: {page.errors}")


if __name__ == "__main__":
    robot, pictures = (sys.argv[2:] + [None, None])[:2]
    sys.exit(run_in_browser(lambda programs, page: use_the_page(programs, page, robot, pictures)))
