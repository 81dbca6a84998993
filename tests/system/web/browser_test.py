#!/usr/bin/env python3
"""What a person does with the page, in a real browser against real programs: opens it, sees a robot move and the map grow,
unlocks commands, starts a job, sees the smoothed map, shows where a robot is, downloads the map, and lives through a crash of the server.

Usage: browser_test.py BIN_DIR [PICTURES]. BIN_DIR has cairnd, cairn and cairn-web. PICTURES is a folder for the pictures of the
documentation; without it none are made. It waits for conditions and never for a time. Exit code 77, with the line
`SKIPPED: why`: there is no Chromium."""
import math
import os
import re
import sys

from harness import TILES, TOKEN, Failed, check_what_it_asked, eventually, icon_of, run_in_browser, said_by, status_of_post

# How many pixels each robot is drawn from where it must be: a tile that is shown tells where the metres of the map are on the
# screen, and the list beside the map says where the robot is. Infinite where either is missing.
APART = """(() => {
  const tile = [...document.querySelectorAll('#map img.cell:not([hidden])')].find((one) => one.naturalWidth === 128);
  if (!tile) return [Infinity];
  const [level, column, row] = tile.dataset.key.split('/').map(Number), box = tile.getBoundingClientRect();
  const metres = 128 * 0.05 * 2 ** level, scale = box.width / metres;
  return [...document.querySelectorAll('#robots .robot')].map((robot) => {
    const icon = document.querySelector(`.robot-icon[data-robot=${robot.querySelector('.name').innerText}] svg`);
    const place = /(-?[0-9.]+), (-?[0-9.]+) m/.exec(robot.querySelector('.where').innerText);
    if (!icon || !place) return Infinity;
    const drawn = icon.getBoundingClientRect();
    return Math.hypot(box.left + (place[1] - column * metres) * scale - (drawn.left + drawn.right) / 2,
      box.bottom - (place[2] - row * metres) * scale - (drawn.top + drawn.bottom) / 2);
  });
})()"""


def make_pictures(page, folder):
    def shot(name, width, height, theme):
        page.look(width, height, theme)
        page.click("#fit")
        page.run("document.getElementById('panel').scrollTo(0, 0)")
        eventually(f"the map is drawn for {name}", lambda: page.run(
            "new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))).then(() => ((tiles) => tiles.length > 0"
            " && tiles.every((tile) => tile.complete && tile.naturalWidth === 128 && tile.classList.contains('leaflet-tile-loaded')"
            f" && tile.src.includes('theme={theme}')))([...document.querySelectorAll('#map img.cell:not([hidden])')]))"))
        page.picture(os.path.join(folder, name))

    eventually("nothing is said any more", lambda: page.text("#said") == "")
    shot("web.png", 920, 540, "light")
    shot("web-dark.png", 1180, 720, "dark")
    shot("web-phone.png", 390, 800, "light")


def begins_with(path, begins):
    if not os.path.exists(path):
        return False
    with open(path, "rb") as file:
        return file.read(len(begins)) == begins


def change_the_mode(page, address):
    """Of robot2, in the map that robot1 draws, with the keyboard."""
    robot = "#robots [data-key=robot2]"
    eventually("a robot maps", lambda: page.text(f"{robot} .mode") == "Draws the map" and not page.shows(f"{robot} .to-map"))
    for path, token, wanted in (("localise", "wrong", 401), ("map", "", 401), ("fly", TOKEN, 404)):
        if status_of_post(address, f"api/robots/robot2/{path}", token) != wanted:
            raise Failed(f"{path} with the token '{token}' is not answered {wanted}")
    page.run(f"document.querySelector('{robot} .to-localise').focus()")
    page.press_enter()
    eventually("it is only localised", lambda: page.text(f"{robot} .mode").startswith("Only localised"))
    eventually("it cannot be localised twice", lambda: not page.shows(f"{robot} .to-localise"))
    eventually("it is found in the map", lambda: page.text(f"{robot} .pill") == "Tracking")
    eventually("the keyboard stays where the other mode is",
               lambda: page.run(f"document.activeElement === document.querySelector('{robot} .to-map')"))
    page.press_enter()
    eventually("the page says something of the other mode", lambda: re.search("maps again|Not done", page.text("#said")))
    if "robot2 maps again" not in page.text("#said"):
        raise Failed(f"the page says '{page.text('#said')}'")
    try:
        eventually("it maps again", lambda: page.text(f"{robot} .mode") == "Draws the map")
    except Failed:
        raise Failed(f"robot2 does not map again, the page says of it: {page.text(robot)}")


def edit_the_map(page, pictures):
    """A wall by its numbers, and an area to keep out of, drawn with the mouse; then both are taken back."""
    page.click("#edit-tools summary")
    page.run("document.getElementById('edit-kind').value = 'keep_out'")
    page.click("#edit-note")
    page.type("stairs <b>down</b>")
    page.click("#edit-draw")
    eventually("the page says how to draw", lambda: "drag to the opposite corner" in page.text("#said"))
    x, y = page.run("(() => { const box = document.getElementById('map').getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2]; })()")
    page.drag((x, y), (x + 60, y + 40))
    eventually("what was drawn is in the list, its note as text",
               lambda: "Keep out" in page.text("#edits") and "stairs <b>down</b>" in page.text("#edits"))
    page.run("for (const name of ['x1', 'y1', 'x2', 'y2']) document.querySelector(`#edit-form [name=${name}]`).value = { x1: 1, y1: 1, x2: 2, y2: 1.5 }[name]")
    page.run("document.getElementById('edit-kind').value = 'occupied'")
    page.click("#edit-form button")
    eventually("what was typed is in the list", lambda: "Wall" in page.text("#edits"))
    drawn = "document.querySelectorAll('#map path[stroke-dasharray=\"4 4\"]').length"
    eventually("both are drawn on the map", lambda: page.run(drawn) == 2)
    if pictures:
        page.run("document.getElementById('edits-title').scrollIntoView()")
        page.picture(os.path.join(pictures, "web-edits.png"))
    for left in (1, 0):
        page.run("document.querySelector('#edits li button').click()")
        eventually("one fewer is in the list", lambda: page.run("document.querySelectorAll('#edits li').length") == left)
    eventually("none is drawn", lambda: page.run(drawn) == 0)


def use_the_page(programs, page, pictures):
    server = programs.start_server()
    address = programs.start_web(page)
    eventually("without a robot the page says what to do", lambda: "No site yet" in page.text("#map-empty"))

    # In the room both robots drive the same short circle, so a robot that is only localised always sees what the other has drawn.
    # In the building each robot drives a part of its own, and such a robot may stay lost; but its pictures show more.
    world = "building" if pictures else "room"
    programs.start("cairn", "sim", "--site", "hall", "--world", world, "--robots", "2", "--beams", "181", "--hz", "5",
                   "--window", "32", "--seconds", "3600", "--rate", "4")
    eventually("both robots are listed", lambda: page.run("document.querySelectorAll('#robots .robot').length") == 2)
    eventually("a robot is on the map", lambda: page.shows(".robot-icon[data-robot=robot1]"))
    place = "document.querySelector('.robot-icon[data-robot=robot1]').style.transform"
    where = "document.querySelector('#robots .robot .where').innerText.split(' · ')[0]"
    before_place, before_where = page.run(place), page.run(where)
    eventually("it moves on the map and in the list", lambda: page.run(place) != before_place and page.run(where) != before_where)
    eventually("tiles of the map are shown", lambda: page.run(TILES))
    before = page.run(TILES)
    eventually("the map grows", lambda: page.run(TILES) not in ([], before))
    # Longer than a robot: 50 pixels.
    eventually("the path is drawn", lambda: page.run(
        "[...document.querySelectorAll('#map path[fill=none]')].some((path) => path.getTotalLength() > 50)"))
    begins = page.run(where)
    eventually("a robot has driven on", lambda: page.run(where) != begins)
    apart = page.run(APART)
    if len(apart) != 2 or max(apart) > 3:
        raise Failed(f"the robots are drawn {apart} pixels from where they are on the map")
    if page.nameless():
        raise Failed(f"a screen reader has no name for: {page.nameless()}")

    page.click("#unlock")
    page.click("#token")
    page.type("wrong")
    page.click("#token-use")
    eventually("a wrong token is refused", lambda: page.shows("#token-wrong"))
    page.run("document.getElementById('token').value = ''")
    page.click("#token")
    page.type(TOKEN)
    page.press_enter()
    eventually("the right one unlocks commands", lambda: page.run("!document.getElementById('smooth').disabled"))

    if pictures:
        used = "Number(/([0-9]+) scans/.exec(document.querySelector('#robots .where').innerText)[1])"
        eventually("there is much to see", lambda: page.run(used) > 600, 120)
    before = page.run(TILES)
    page.click("#smooth")
    eventually("the page says that it has begun", lambda: "Smoothing has begun" in page.text("#said"))
    eventually("the job ends", lambda: "Done" in page.text("#jobs"), 120)
    eventually("its map version is enabled", lambda: re.search(r"Version 2[^V]*Enabled", page.text("#versions")))
    eventually("every tile of the map is a new one", lambda: page.run(TILES) and not set(page.run(TILES)) & set(before))
    eventually("the smoothed path is drawn", lambda: page.run(
        "[...document.querySelectorAll('#map path[stroke-dasharray]')].some((path) => path.getTotalLength() > 50)"))
    if pictures:
        make_pictures(page, pictures)
        page.look(1180, 720, "light")

    # The robot drives on while it is shown, so its place is a little off, as a person's would be.
    page.click("#robots [data-key=robot1] .relocalise summary")
    page.click("#robots [data-key=robot1] .on-map")
    eventually("the page says how to show a place", lambda: "robot1" in page.text("#said"))
    x, y, turn = icon_of(page, "robot1")
    page.drag((x, y), (x + 40 * math.cos(turn), y + 40 * math.sin(turn)))
    eventually("the robot is looked for there", lambda: "looked for there" in page.text("#said"))
    state = "document.querySelector('#robots [data-key=robot1] .pill').innerText"
    eventually("and found", lambda: page.run(state) == "Tracking")

    change_the_mode(page, address)
    edit_the_map(page, pictures)
    for name, begins in (("hall.yaml", b"image: \"hall.png\"\n"), ("hall.png", b"\x89PNG")):
        page.click(f"#download-{name.split('.')[1]}")
        path = os.path.join(page.downloads, name)
        eventually(f"{name} is downloaded", lambda: begins_with(path, begins))  # It is there before it is filled.

    check_what_it_asked(page, address, [(401, "/api/token")])  # That the wrong token is refused was wanted.
    server.kill()
    eventually("the page says that the server is lost", lambda: "Server lost" in page.text("#connection") and page.shows("#banner"))
    if not page.run(TILES):
        raise Failed("the last map does not stay")
    programs.start_server()
    eventually("it goes on when the server is back", lambda: "Live" in page.text("#connection") and not page.shows("#banner"))
    eventually("with the map", lambda: page.run(TILES))
    before_place = page.run(place)
    eventually("and the robots drive on", lambda: page.run(place) != before_place)
    told = [os.path.basename(process.said) for process in programs.all if TOKEN in said_by(process)]
    if told:
        raise Failed(f"the token is in what they said: {told}")
    page.refused.clear()  # A server that is gone answers nothing.
    check_what_it_asked(page, address)


if __name__ == "__main__":
    pictures_folder = sys.argv[2] if len(sys.argv) > 2 else None
    sys.exit(run_in_browser(lambda programs, page: use_the_page(programs, page, pictures_folder)))
