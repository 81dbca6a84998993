"""What the tests of the page share: real programs on a DDS domain of their own, and a browser. They wait for conditions and never
for a time."""
import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

from chromium import Page

TOKEN = "token-of-the-test"
TILES = "[...document.querySelectorAll('#map img.cell:not([hidden])')].filter((tile) => tile.complete && tile.naturalWidth === 128).map((tile) => tile.src)"
UNLOCKED = "document.getElementById('connection')?.innerText === 'Live' && !document.getElementById('smooth').disabled"
UNFINISHED = "[...document.querySelectorAll('#jobs progress')].some((one) => !one.hidden)"

# The lowest contrast of a text inside an element to the ground it stands on, and that text. Transparent colours and elements are
# laid over what is behind them.
LEAST_CONTRAST = """((root) => {
  const context = Object.assign(document.createElement('canvas'), { width: 1, height: 1 }).getContext('2d', { willReadFrequently: true });
  const rgba = (colour) => {
    context.clearRect(0, 0, 1, 1);
    context.fillStyle = colour;
    context.fillRect(0, 0, 1, 1);
    return [...context.getImageData(0, 0, 1, 1).data].map((value) => value / 255);
  };
  const over = (top, alpha, below) => top.slice(0, 3).map((value, i) => alpha * value + (1 - alpha) * below[i]);
  const ground = (element) => {
    if (!element) return [1, 1, 1];
    const colour = rgba(getComputedStyle(element).backgroundColor);
    return colour[3] === 1 ? colour : over(colour, colour[3], ground(element.parentElement));
  };
  const opacity = (element) => element ? Number(getComputedStyle(element).opacity) * opacity(element.parentElement) : 1;
  const light = (colour) => {
    const [r, g, b] = colour.map((value) => value <= 0.03928 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const texts = [...document.querySelectorAll(`${root} *`)].filter((one) => one.checkVisibility()
    && (one.matches('input, select') || [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim())));
  return texts.map((one) => {
    const style = getComputedStyle(one), behind = ground(one);
    const colour = rgba(one instanceof SVGElement ? style.fill : style.color);
    const [a, b] = [light(over(colour, colour[3] * opacity(one), behind)), light(behind)].sort((u, v) => u - v);
    return [(b + 0.05) / (a + 0.05), `${one.tagName} ${one.textContent.trim().slice(0, 60)}`];
  }).sort((a, b) => a[0] - b[0])[0];
})"""


class Failed(Exception):
    pass


def own_domain():
    """A DDS domain that no other test uses, and the lock that keeps it: those of tests/test_domain.h."""
    for i in range(200):
        domain = 1 + (os.getpid() + i) % 200
        lock = open(os.path.join(tempfile.gettempdir(), f"cairn-domain-{domain}"), "a")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return domain, lock
        except OSError:
            lock.close()
    raise Failed("all DDS test domains are in use")


class Programs:
    """The programs of one test, on one domain; what they say goes into files."""

    def __init__(self, binaries, work, domain):
        self.binaries, self.work, self.domain, self.all = binaries, work, domain, []

    def start(self, program, *options):
        said = os.path.join(self.work, f"{len(self.all)}-{program}.txt")
        with open(said, "w") as file:
            process = subprocess.Popen([os.path.join(self.binaries, program), *options], stdin=subprocess.DEVNULL, stdout=file,
                                       stderr=subprocess.STDOUT, env={**os.environ, "CAIRN_DOMAIN": str(self.domain)})
        process.said = said
        self.all.append(process)
        return process

    def start_server(self, *options):
        return self.start("cairnd", "--state", os.path.join(self.work, "state"), "--set", "slam.particles=20",
                          "--set", "jobs.nice=0", *options)

    def start_web(self, page):
        """The address of the page, which is opened."""
        web = self.start("cairn-web", "--port", "0", f"--token={TOKEN}")
        eventually("cairn-web prints its address", lambda: re.search(r"http://\S+", said_by(web)))
        address = re.search(r"http://[0-9.:]+/", said_by(web)).group()
        page.look(1180, 720, "light")
        page.open(address)
        return address

    def stop(self):
        for process in self.all:
            process.kill()
            process.wait()


def said_by(process):
    with open(process.said) as file:
        return file.read()


def eventually(what, condition, deadline_s=60.0):
    began = time.monotonic()
    while not condition():
        if time.monotonic() - began > deadline_s:
            raise Failed(f"not within {deadline_s:.0f} s: {what}")
        time.sleep(0.05)
    print(f"ok: {what} ({time.monotonic() - began:.1f} s)", flush=True)


def status_of_post(address, path, token):
    request = urllib.request.Request(address + path, data=b"{}", headers={
        "Authorization": f"Bearer {token}", "Content-Type": "application/json"})
    try:
        with urllib.request.urlopen(request, timeout=30) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def open_site(page, address, site, token=""):
    """Where cairn-web knows the site: it looks once a second which there are, and the page of one that is gone shows another."""
    def is_known():
        try:
            with urllib.request.urlopen(f"{address.rstrip('/')}/api/state?site={site}", timeout=30):
                return True
        except urllib.error.HTTPError:
            return False
    eventually(f"cairn-web knows {site}", is_known)
    page.open(f"{address}?site={site}" + (f"#token={token}" if token else ""))


def check_contrast(page, root):
    """That all texts inside an element that is shown can be read, in the light and in the dark."""
    for theme in ("light", "dark"):
        page.look(1180, 1000, theme)
        contrast, text = page.run(f"{LEAST_CONTRAST}({json.dumps(root)})")
        print(f"ok: in the {theme} the least contrast in {root} is {contrast:.1f} ({text})", flush=True)
        if contrast < 4.5:
            raise Failed(f"the contrast of '{text}' is {contrast:.1f} in the {theme}")


def icon_of(page, robot):
    """Where a robot is drawn: x and y in pixels of the window, and the clockwise angle to which it looks."""
    icon = f".robot-icon[data-robot={robot}]"
    return page.run(f"""(() => {{
        const box = document.querySelector('{icon} svg').getBoundingClientRect();
        const turn = /rotate\\((.*)\\)/.exec(document.querySelector('{icon} .body').getAttribute('transform'))[1];
        return [box.x + box.width / 2, box.y + box.height / 2, turn * Math.PI / 180];
    }})()""")


def begin_smoothing(page):
    """Presses the button, and returns once the page lists the new job."""
    jobs = "[...document.querySelectorAll('#jobs .job')].map((one) => one.dataset.key)"
    before = set(page.run(jobs))
    page.click("#smooth")
    eventually("a job is listed", lambda: set(page.run(jobs)) - before)


def check_what_it_asked(page, address, allowed=()):
    """That the page threw no error, asked nobody else, and was refused nothing but tiles that were just replaced, and `allowed`:
    pairs of a status and a part of an address."""
    if page.errors:
        raise Failed(f"errors of the page: {page.errors}")
    outside = [url for url in page.requests if not url.startswith((address, "data:", "about:", "blob:"))]
    if outside:
        raise Failed(f"the page asks others: {outside}")
    refused = [(status, url) for status, url in page.refused
               if not any(status == code and part in url for code, part in ((404, "/tiles/"), *allowed))]
    if refused:
        raise Failed(f"the page asks for what is refused: {refused}")


def run_in_browser(use):
    """Calls use(programs, page) with a browser and a domain of their own; the exit code of the test."""
    binaries = sys.argv[1]
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if not browser:
        print("SKIPPED: there is no Chromium on this machine (deploy/install-packages.sh test)")
        return 77
    domain, lock = own_domain()
    with lock, tempfile.TemporaryDirectory(prefix="cairn-browser-", ignore_cleanup_errors=True) as work:
        programs = Programs(binaries, work, domain)
        page = None
        try:
            page = Page(browser, work)
            use(programs, page)
            return 0
        except Exception as error:  # Whatever it is: what the programs said must be shown.
            print(f"FAILED: {error}")
            if page is not None and page.errors:
                print(f"--- errors of the page: {page.errors}")
            for process in programs.all:
                print(f"--- {os.path.basename(process.said)}:\n{said_by(process)[-1500:]}")
            return 1
        finally:
            if page is not None:
                page.close()
            programs.stop()
