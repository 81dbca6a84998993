"""Chromium without a window, driven through the DevTools protocol over two pipes: no port, no package beside the browser.

One page, one thread. Every call waits for its answer; events that arrive meanwhile are kept for whoever asks.
Protocol: https://chromedevtools.github.io/devtools-protocol/
"""
import base64
import json
import os
import select
import subprocess
import time

ANSWER_TIMEOUT_S = 30.0
KEYS = {"Enter": (13, "\r"), "Tab": (9, "")}  # Their numbers, and what they write.


class BrowserError(Exception):
    """The browser ended, did not answer in time, or refused a call."""


class Page:
    def __init__(self, program, work):
        """Starts the browser with a profile and downloads in the folder `work`, and opens an empty page."""
        self.downloads = os.path.join(work, "downloads")
        os.makedirs(self.downloads, exist_ok=True)
        self.errors = []  # Exceptions of scripts, and what the browser refused to load or run.
        self.requests = []  # Addresses, in order.
        self.posts = []  # Address and body of those that are commands.
        self.refused = []  # Status and address of answers that are errors.
        self.bytes_received = 0  # Of all answers, as they came over the network.
        self._number = 0
        self._session = None
        self._text = b""
        to_browser, self._to = os.pipe()
        self._from, from_browser = os.pipe()
        # The browser expects its pipes as descriptors 3 and 4. In a container it has neither a sandbox nor much /dev/shm.
        self.process = subprocess.Popen(
            ["bash", "-c", f'exec "$0" "$@" 3<&{to_browser} 4>&{from_browser}', program, "--headless", "--no-sandbox",
             "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking", "--disable-component-update",
             "--no-first-run", "--no-default-browser-check", "--remote-debugging-pipe", "--hide-scrollbars",
             f"--user-data-dir={os.path.join(work, 'profile')}", "about:blank"],
            pass_fds=(to_browser, from_browser), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log", "Accessibility"):
            self.call(f"{domain}.enable")
        self.call("Page.setDownloadBehavior", behavior="allow", downloadPath=self.downloads)

    def close(self):
        self._session = None
        try:
            self.call("Browser.close")
            self.process.wait(ANSWER_TIMEOUT_S)
        except (BrowserError, OSError, subprocess.TimeoutExpired):
            self.process.kill()
            self.process.wait()
        os.close(self._to)
        os.close(self._from)

    def call(self, method, **parameters):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + ANSWER_TIMEOUT_S
        while True:
            answer = self._read(end)
            if answer.get("id") != self._number:
                self._keep(answer)
            elif "error" in answer:
                raise BrowserError(f"{method}: {answer['error']['message']}")
            else:
                return answer["result"]

    def _read(self, end):
        while b"\0" not in self._text:
            if not select.select([self._from], [], [], max(0.0, end - time.monotonic()))[0]:
                raise BrowserError(f"the browser does not answer within {ANSWER_TIMEOUT_S:.0f} s")
            piece = os.read(self._from, 1 << 16)
            if not piece:
                raise BrowserError("the browser has ended")
            self._text += piece
        message, self._text = self._text.split(b"\0", 1)
        return json.loads(message)

    def _keep(self, event):
        method, what = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            details = what["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Log.entryAdded" and what["entry"]["level"] == "error" and what["entry"]["source"] != "network":
            self.errors.append(what["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(what["request"]["url"])
            if what["request"]["method"] == "POST":
                self.posts.append((what["request"]["url"], what["request"].get("postData", "")))
        elif method == "Network.dataReceived":
            self.bytes_received += what["encodedDataLength"]
        elif method == "Network.responseReceived":
            self.bytes_received += what["response"]["encodedDataLength"]
            if what["response"]["status"] >= 400:
                self.refused.append((what["response"]["status"], what["response"]["url"]))

    def open(self, address):
        self.call("Page.navigate", url=address)

    def run(self, expression):
        """The value of a JavaScript expression."""
        result = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in result:
            raise BrowserError(f"{expression}: {result['exceptionDetails']['exception']['description']}")
        return result["result"].get("value")

    def text(self, selector):
        """What a person reads of the first such element; empty where there is none or where it is not shown."""
        return self.run(f"document.querySelector({json.dumps(selector)})?.innerText ?? ''")

    def shows(self, selector):
        return self.run(f"document.querySelector({json.dumps(selector)})?.checkVisibility() ?? false")

    def click(self, selector):
        """As a person does: with the mouse, on an element that is shown, enabled and not covered by another one. Where the text
        of a robot changes meanwhile, so that the element is not there any more when the button goes down or up, again."""
        def press(place):
            for what in ("mousePressed", "mouseReleased"):
                self.call("Input.dispatchMouseEvent", type=what, button="left", clickCount=1, **place)
        self._activate(selector, press)

    def tap(self, selector):
        """The same with a finger."""
        self._activate(selector, lambda place: self.touch((place["x"], place["y"])))

    def _activate(self, selector, press):
        chosen = f"document.querySelector({json.dumps(selector)})"
        for _ in range(20):
            place = self.run(f"""(() => {{
                const element = {chosen};
                if (!element || element.disabled || !element.checkVisibility()) return null;
                element.scrollIntoView({{ block: 'nearest' }});
                const box = element.getBoundingClientRect(), x = box.x + box.width / 2, y = box.y + box.height / 2;
                const hit = document.elementFromPoint(x, y);
                if (!hit || !element.contains(hit)) return null;
                window.clicked = false;
                element.addEventListener('click', () => {{ window.clicked = true; }}, {{ once: true, capture: true }});
                return {{ x, y }};
            }})()""")
            if place is None:
                time.sleep(0.1)
                continue
            press(place)
            if self.run("window.clicked"):
                return
        raise BrowserError(f"{selector} cannot be clicked: it is absent, hidden, disabled, covered, or never where the mouse is")

    def drag(self, begin, end):
        """With the mouse, from one point of the window to another: (x, y) in pixels."""
        for what, (x, y) in (("mouseMoved", begin), ("mousePressed", begin), ("mouseMoved", end), ("mouseReleased", end)):
            self.call("Input.dispatchMouseEvent", type=what, button="none" if what == "mouseMoved" and (x, y) == begin else "left",
                      buttons=0 if what == "mouseReleased" else 1, clickCount=1, x=x, y=y)

    def touch(self, *places):
        """A finger goes down at the first place, (x, y) in pixels of the window, moves over the others, and is lifted."""
        for place in places:
            self.call("Input.dispatchTouchEvent", type="touchStart" if place is places[0] else "touchMove",
                      touchPoints=[{"x": place[0], "y": place[1]}])
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def use_fingers(self, fingers):
        """Whether the screen can be touched."""
        self.call("Emulation.setTouchEmulationEnabled", enabled=fingers, maxTouchPoints=1)

    def type(self, text):
        self.call("Input.insertText", text=text)

    def press(self, key):
        """One of KEYS."""
        number, text = KEYS[key]
        for what in ("keyDown" if text else "rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=what, key=key, code=key, text=text, windowsVirtualKeyCode=number)

    def press_enter(self):
        self.press("Enter")

    def nameless(self):
        """Role and attributes of each control that a screen reader could not name."""
        roles = ("button", "link", "checkbox", "combobox", "textbox", "progressbar", "image")
        nodes = self.call("Accessibility.getFullAXTree")["nodes"]
        return [(node["role"]["value"], self.call("DOM.describeNode", backendNodeId=node["backendDOMNodeId"])["node"]["attributes"])
                for node in nodes if not node["ignored"] and node["role"]["value"] in roles and not node.get("name", {}).get("value")]

    def look(self, width, height, theme):
        """The size of the window, and `light` or `dark`. Nothing glides, so that a picture shows what is."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}, {"name": "prefers-reduced-motion", "value": "reduce"}])

    def picture(self, path, whole=False):
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        with open(path, "wb") as file:
            file.write(base64.b64decode(data))
