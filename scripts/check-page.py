#!/usr/bin/env python3
"""Opens pages of cullbench in a real Chromium and checks them.

usage: check-page.py PAGE.html.. [--shots DIR] [--most-mb N]

For each page but those of `view`, at 390, 1,400 and 1,800 px, light and dark: no error on the
console, nothing loaded from elsewhere, nothing wider than the window, every figure has marks, texts
of a figure stay on the page; first paint within a second, and no more than 2 MB. Filter, sorting
and the state in the hash of the address work. A page of `view` decodes its views, its keys work,
and the time of a frame of 20,000 boxes by software rendering on one core is printed (of processor
time, at most 33 ms on a free core); half as much again is a fault. --shots keeps pictures of each.
The program is `chromium`, or $CHROMIUM. Standard library only.
"""

import argparse
import base64
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import time

WIDTHS = [390, 1400, 1800]
SCHEMES = ["light", "dark"]
LONGEST_PAINT_MS = 1000
# Of a page of `view` with so many items, 30 frames per second of one core.
LONGEST_FRAME_MS, MOST_ITEMS = 1000 / 30, 20_000
# Shared machines are slower by up to this.
ALLOWANCE = 1.5

# Faults of a page as it is shown, as a list of sentences. A narrow window reports the width of
# what does not fit into it: innerWidth stands for the width asked for.
FAULTS = """(() => {
  const faults = [], all = (s, from = document) => [...from.querySelectorAll(s)];
  const width = document.scrollingElement.scrollWidth;
  if (width > innerWidth) faults.push(`${width} px wide in a window of ${innerWidth}`);
  for (const svg of all("svg.plot")) {
    const name = svg.getAttribute("aria-label");
    if (!svg.querySelector(".mark,.bar,.curve")) faults.push(`no mark: ${name}`);
    for (const text of all("text", svg)) {
      const box = text.getBoundingClientRect();
      if (box.left < 0 || box.right > innerWidth + 0.5) faults.push(`cut off: "${text.textContent}" in ${name}`);
    }
    const box = svg.parentElement.getBoundingClientRect();
    for (const mark of all(".mark,.bar", svg)) {
      const own = mark.getBoundingClientRect();
      if (own.left < box.left - 1 || own.right > box.right + 1) faults.push(`mark beyond its figure: ${name}`);
    }
  }
  for (const item of all("h1,h2,h3,p,figcaption,button,label")) {
    const box = item.getBoundingClientRect();
    // Tables scroll inside themselves.
    if (box.right > innerWidth + 0.5 && !item.closest(".t")) faults.push(`cut off: ${item.textContent.slice(0, 60)}`);
  }
  const shown = getComputedStyle(document.body);
  const light = (colour) => colour.match(/\\d+/g).slice(0, 3).reduce((sum, part) => sum + Number(part), 0);
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  if ((light(shown.color) > light(shown.backgroundColor)) !== dark) faults.push("colours of the other scheme");
  const outside = performance.getEntriesByType("resource").map((entry) => entry.name);
  if (outside.length) faults.push(`loads ${outside}`);
  return [...new Set(faults)];
})()"""

PAINT = """new Promise((done) => {
  const paint = () => performance.getEntriesByName("first-contentful-paint")[0]?.startTime;
  const look = (left) => (paint() || !left ? done(paint() ?? 1e9) : setTimeout(look, 20, left - 1));
  look(150);
})"""

# Filter, sorting and hash, each used as a reader does.
USE = """(() => {
  const faults = [], all = (s, from = document) => [...from.querySelectorAll(s)];
  const expect = (is, what) => is || faults.push(what);
  const box = document.querySelector("#filter input");
  if (document.querySelector("g[data-s]")) expect(box, "no filter");
  if (box) {
    const name = box.value;
    const own = all("[data-s]:not(label)").filter((item) => item.dataset.s === name);
    box.click();
    expect(own.length && own.every((item) => item.classList.contains("off")), "filter hides nothing");
    expect(location.hash.includes("off=" + encodeURIComponent(name)), "filter is not in the hash");
    const other = all("[data-s]:not(label)").find((item) => item.dataset.s !== name);
    expect(!other || !other.classList.contains("off"), "filter hides the others");
    box.click();
    expect(own.every((item) => !item.classList.contains("off")), "filter does not show again");
    own[0].dispatchEvent(new MouseEvent("mouseover", { bubbles: true }));
    expect(own[0].classList.contains("hot"), "no emphasis");
  }
  const table = all("table").find((table) => table.tBodies[0].rows.length > 2);
  if (table) {
    const column = [...table.tHead.rows[0].cells].length - 1;
    const texts = (column) => [...table.tBodies[0].rows].map((row) => row.cells[column].textContent);
    const before = texts(0).join();
    table.tHead.rows[0].cells[0].querySelector("button").click();
    const up = texts(0);
    table.tHead.rows[0].cells[0].querySelector("button").click();
    expect(up.join() !== texts(0).join() || new Set(up).size < 2, "sorting changes nothing");
    expect(location.hash.includes("sort="), "sorting is not in the hash");
    expect(table.querySelector("[aria-sort]"), "sorting is not announced");
  }
  for (const heat of all("table.heat")) {
    const shaded = all("td", heat).filter((cell) => Number(cell.style.getPropertyValue("--v")) === 1);
    expect(shaded.length, "no cell is shaded");
    for (const cell of shaded) expect(!/ [num]?s$/.test(cell.textContent), `shaded: ${cell.textContent}`);
    [...heat.tHead.rows[0].cells].slice(1).forEach((head, n) => {
      head.querySelector("button").click();
      const texts = [...heat.tBodies[0].rows].slice(0, -1).map((row) => row.cells[n + 1].textContent);
      const numbers = texts.filter(Boolean).map((text) => Number(text.replace(/[*,]/g, ""))).filter((x) => x === x);
      expect(numbers.every((x, k) => !k || x >= numbers[k - 1]), `sorted wrongly: ${head.textContent} ${numbers}`);
    });
  }
  return faults;
})()"""

# Keys of a page of `view`: what is shown after each.
KEYS = """(async () => {
  const now = () => document.getElementById("now").textContent;
  const press = (key) => document.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  const drawn = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  const first = now(), of = first.match(/^view 1 of (\\d+)/);
  if (!of) return [`the first view is "${first}"`];
  const faults = [];
  for (const [key, at] of [["End", of[1]], ["c", of[1]], ["f", of[1]], ["0", of[1]], ["Home", "1"]]) {
    press(key);
    await drawn();
    if (!now().startsWith(`view ${at} of`)) faults.push(`after ${key}: "${now()}"`);
    if (location.hash.includes("NaN")) faults.push(`after ${key}: ${location.hash}`);
  }
  for (const [key, name] of [["b", "boxes"], ["n", "nodes"]]) {
    press(key);
    await drawn();
    const { hidden } = document.getElementById(name);
    if (location.hash.includes(`${name}=1`) === hidden) faults.push(`after ${key}: ${location.hash}`);
    if (name === "nodes" && !hidden && !/: [1-9]/.test(document.getElementById("visited").textContent)) faults.push("no nodes");
    press(key);
  }
  return faults;
})()"""

# Draws frames one by one, from afar where the scene is turned in each, or through the cameras.
FRAMES = """(async (count) => {
  const stage = document.getElementById("stage"), slider = document.getElementById("frame");
  const isThrough = document.getElementById("through").ariaPressed === "true";
  for (let n = 0; n < count; n++) {
    const wheel = new WheelEvent("wheel", { deltaY: n % 40 < 20 ? 20 : -20, cancelable: true });
    if (isThrough || n % 2) slider.value = (Number(slider.value) + 1) % (Number(slider.max) + 1);
    slider.dispatchEvent(new Event("input"));
    if (!isThrough) stage.dispatchEvent(wheel);
    await new Promise(requestAnimationFrame);
  }
})"""

# Paper has no use for what is clicked.
PRINT = """[...document.querySelectorAll("#filter,.t+.copy")].some((item) => getComputedStyle(item).display !== "none")
  ? ["buttons are printed"] : []"""

# A page that is opened with a hash has its state.
STATE = """(() => {
  const boxes = [...document.querySelectorAll("#filter input")];
  const faults = [];
  if (boxes.length && boxes[0].checked) faults.push("the hash is not read: filter");
  if (document.querySelector("table") && !document.querySelector("[aria-sort]")) faults.push("the hash is not read: sorting");
  return faults;
})()"""


class Browser:
    """Chromium by its DevTools protocol over two pipes."""

    def __init__(self, profile, cores=None):
        (down, self.send), (self.receive, up) = os.pipe(), os.pipe()
        program = os.environ.get("CHROMIUM", "chromium")
        options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                   "--remote-debugging-pipe", f"--user-data-dir={profile}", "about:blank"]
        line = ["sh", "-c", f'exec "$@" 3<&{down} 4>&{up}', "sh", program, *options]
        pin = (lambda: os.sched_setaffinity(0, cores)) if cores else None
        self.process = subprocess.Popen(line, pass_fds=[down, up], stderr=subprocess.DEVNULL, preexec_fn=pin)
        os.close(down)
        os.close(up)
        self.rest, self.count, self.events, self.session = b"", 0, [], None

    def read(self):
        while b"\0" not in self.rest:
            part = os.read(self.receive, 1 << 20)
            if not part:
                sys.exit("check-page: Chromium ended; expected a program that --headless starts")
            self.rest += part
        text, self.rest = self.rest.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **params):
        self.count += 1
        message = {"id": self.count, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.send, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.read()
            if answer.get("id") == self.count:
                if "error" in answer:
                    sys.exit(f"check-page: {method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def open(self, url):
        if self.session:
            self.session, old = None, self.target
            self.call("Target.closeTarget", targetId=old)
        self.target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=self.target, flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Log"]:
            self.call(f"{domain}.enable")
        self.url = url

    def show(self, width, scheme, url):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=900,
                  deviceScaleFactor=1, mobile=width < 600)
        feature = {"name": "prefers-color-scheme", "value": scheme}
        self.call("Emulation.setEmulatedMedia", features=[feature])
        self.events.clear()
        self.call("Page.navigate", url=url)
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            self.events.append(self.read())

    def value(self, code):
        found = self.call("Runtime.evaluate", expression=code, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            return [json.dumps(found["exceptionDetails"])]
        return found["result"].get("value")

    def seconds(self):
        """Processor time of all processes, by their ids."""
        self.session, session = None, self.session
        found = self.call("SystemInfo.getProcessInfo")["processInfo"]
        self.session = session
        return {process["id"]: process["cpuTime"] for process in found}

    def frame_ms(self, count=40):
        """Processor time of a frame of `view` in motion, when its scale has settled.

        What else runs on the core takes its caches, so a slow try is repeated.
        """
        self.value(f"{FRAMES}({count})")
        least = math.inf
        for _ in range(4):
            before = self.seconds()
            self.value(f"{FRAMES}({count})")
            spent = sum(time - before.get(own, 0) for own, time in self.seconds().items())
            least = min(least, 1000 * spent / count)
            if least <= LONGEST_FRAME_MS:
                break
        return least

    def close(self):
        self.session = None
        self.call("Browser.close")
        self.process.wait(20)
        os.close(self.send)
        os.close(self.receive)

    def complaints(self):
        self.value("0")
        kinds = {"Runtime.exceptionThrown", "Log.entryAdded"}
        for event in self.events:
            method, params = event.get("method"), event.get("params", {})
            is_error = method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning")
            # WebGL by software speaks of its speed.
            if (method in kinds or is_error) and params.get("entry", {}).get("source") != "rendering":
                yield f"console: {json.dumps(params)[:300]}"

    def shot(self, file):
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"x": 0, "y": 0, "width": size["width"], "height": min(size["height"], 16000), "scale": 1}
        found = self.call("Page.captureScreenshot", format="png", clip=clip, captureBeyondViewport=True)
        file.write_bytes(base64.b64decode(found["data"]))


def frame_times(url):
    """Times per frame from afar and through the cameras, of a browser on one core."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(profile, [min(os.sched_getaffinity(0))])
        browser.open(url)
        browser.show(1400, "light", url)
        afar = browser.frame_ms()
        browser.value("document.getElementById('through').click()")
        through = browser.frame_ms()
        browser.close()
    return afar, through


def check(browser, page, shots, most_mb):
    faults = []
    size = page.stat().st_size / 1e6
    if size > most_mb:
        faults.append(f"{size:.2f} MB; expected at most {most_mb} MB")
    url = page.resolve().as_uri()
    browser.open(url)
    browser.show(1400, "light", url)
    if browser.value("!!document.getElementById('now')"):
        faults += browser.value(KEYS) + list(browser.complaints())
        items, (afar, through) = browser.value("scene.data.items"), frame_times(url)
        if max(afar, through) > ALLOWANCE * LONGEST_FRAME_MS and items <= MOST_ITEMS:
            faults.append(f"expected at most {ALLOWANCE * LONGEST_FRAME_MS:.0f} ms per frame")
        what = f"{items} boxes, {afar:.0f} ms per frame from afar, {through:.0f} ms through the camera"
        return said(page, size, faults, what)
    paints = []
    for width in WIDTHS:
        for scheme in SCHEMES:
            browser.open(url)
            browser.show(width, scheme, url)
            paints.append(browser.value(PAINT))
            found = list(browser.value(FAULTS.replace("innerWidth", str(width)))) + list(browser.complaints())
            faults += [f"{width} px, {scheme}: {fault}" for fault in found]
            if shots:
                browser.shot(shots / f"{page.stem}-{width}-{scheme}.png")
    # The first of a browser pays for its start.
    paint = sorted(paints)[len(paints) // 2]
    if paint > LONGEST_PAINT_MS:
        faults.append(f"first paint after {paint:.0f} ms; expected at most {LONGEST_PAINT_MS} ms")
    browser.open(url)
    browser.show(1400, "light", url)
    faults += browser.value(USE)
    first = browser.value("document.querySelector('#filter input')?.value ?? ''")
    off = browser.value(f"encodeURIComponent({json.dumps(first)})")
    browser.open(url)
    browser.show(1400, "light", f"{url}#off={off}&sort=0.0.1")
    faults += browser.value(STATE) + list(browser.complaints())
    browser.call("Emulation.setEmulatedMedia", media="print")
    faults += browser.value(PRINT)
    browser.value("setTimeout(() => (location.hash = ''), 0)")
    time.sleep(0.5)
    while browser.value("document.readyState") != "complete":
        time.sleep(0.1)
    if browser.value("!!document.querySelector('[aria-sort],tr.off')"):
        faults.append("state stays when the hash is emptied")
    figures = browser.value("document.querySelectorAll('svg.plot').length")
    return said(page, size, faults, f"{figures} figures, first paint {paint:.0f} ms")


def said(page, size, faults, what):
    print(f"{page}: {size:.2f} MB, {what}, {len(faults)} faults")
    for fault in faults[:40]:
        print(f"  {fault}")
    return not faults


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("pages", nargs="+", type=pathlib.Path)
    parser.add_argument("--shots", type=pathlib.Path)
    parser.add_argument("--most-mb", type=float, default=2.0)
    args = parser.parse_args()
    if args.shots:
        args.shots.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(profile)
        sound = [check(browser, page, args.shots, args.most_mb) for page in args.pages]
        browser.close()
    sys.exit(0 if all(sound) else 1)


if __name__ == "__main__":
    main()
