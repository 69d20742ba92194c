#!/usr/bin/env python3
"""The page of `geoflow view` in a headless browser: end to end, with geoflowd on a recording.

Usage: page_test.py --geoflow PROGRAM --geoflowd PROGRAM --recording FOLDER [--screenshots FOLDER]

Needs Chromium and its driver (Debian: chromium, chromium-driver); ends with 77, the code of a test that was skipped, where they are
not there. The browser is driven over WebDriver (W3C) with the standard library alone.
"""
import argparse
import base64
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

SKIPPED = 77
PATIENCE_S = 60
MOST_PAGE_BYTES = 2 << 20
POINTS = 100_000


class Browser:
    """A session of Chromium."""

    def __init__(self, driver):
        self.process = subprocess.Popen([driver, "--port=0"], stdout=subprocess.PIPE, text=True)
        line = ""
        while "successfully on port" not in line:
            line = self.process.stdout.readline()
        self.base = f"http://127.0.0.1:{line.rstrip().rstrip('.').split()[-1]}"
        arguments = ["--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"]
        wanted = {"browserName": "chrome", "goog:chromeOptions": {"args": arguments}, "goog:loggingPrefs": {"browser": "ALL"}}
        session = self.call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
        self.base += f"/session/{session['sessionId']}"

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.base + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(json.load(error)["value"]["message"]) from None

    def open(self, url):
        self.call("POST", "/url", {"url": url})

    def run(self, script):
        return self.call("POST", "/execute/sync", {"script": script, "args": []})

    def text(self, selector):
        return self.run(f"return document.querySelector({json.dumps(selector)}).textContent")

    def devtools(self, command, **parameters):
        return self.call("POST", "/goog/cdp/execute", {"cmd": command, "params": parameters})

    def complaints(self):
        """What the console said since the last call, but for connections that were lost on purpose."""
        return [entry["message"] for entry in self.call("POST", "/se/log", {"type": "browser"}) if "net::ERR" not in entry["message"]]

    def screenshot(self, path, width, height, dark, phone=False):
        self.devtools("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=2 if phone else 1, mobile=phone)
        self.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])
        time.sleep(1)
        path.write_bytes(base64.b64decode(self.call("GET", "/screenshot")))

    def close(self):
        try:
            self.call("DELETE", "")
        finally:
            self.process.terminate()
            self.process.wait()


class Check:
    """Expectations that are all looked at before the test ends."""

    def __init__(self):
        self.failures = 0

    def that(self, holds, what):
        print(f"{'ok  ' if holds else 'FAIL'} {what}", flush=True)
        self.failures += not holds

    def soon(self, condition, what):
        deadline = time.monotonic() + PATIENCE_S
        found = condition()
        while not found and time.monotonic() < deadline:
            time.sleep(0.1)
            found = condition()
        self.that(bool(found), what)
        return found


class Programs:
    """geoflowd and geoflow view in a folder of their own."""

    def __init__(self, arguments, folder):
        self.arguments = arguments
        self.folder = Path(folder)
        self.sockets = ["--pose-socket", str(self.folder / "pose.sock")]
        self.control = str(self.folder / "ctl.sock")
        self.running = []

    def start(self, words, **options):
        log = open(self.folder / f"log{len(self.running)}.txt", "w", encoding="utf-8")
        process = subprocess.Popen(words, stderr=log, **options)
        self.running.append(process)
        return process

    def daemon(self, *more):
        return self.start([self.arguments.geoflowd, "--replay", self.arguments.recording, "--loop", *self.sockets, "--control-socket",
                           self.control, "--set", "map.save_interval_s=2", "--set", f'map.file="{self.folder}/test.map"', *more],
                          stdout=subprocess.DEVNULL)

    def view(self, *more):
        process = self.start([self.arguments.geoflow, "view", "--json", "--port", "0", *self.sockets, "--socket", self.control, *more],
                             stdout=subprocess.PIPE, text=True)
        return json.loads(process.stdout.readline())["url"]

    def stop_all(self):
        for process in self.running:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.terminate()
        for process in self.running:
            process.wait()


# Draws a cloud of so many points on a canvas of its own for a second; frames a second.
FRAMES_A_SECOND = """
const canvas = document.createElement("canvas");
canvas.style.cssText = "width: 1200px; height: 600px";
document.querySelector("main").append(canvas);
const scene = Scene.create(canvas);
const cloud = new Float32Array(6 * COUNT).map((_, i) => i % 6 < 3 ? 4 * Math.random() - 2 : 1);
scene.set("surfels", cloud, {kind: "POINTS", color: "--low", high: "--high", heights: [-2, 2], normals: true});
const pixel = new Uint8Array(4);
const begin = performance.now();
let frames = 0;
while (performance.now() - begin < 1000) {
  scene.draw();
  scene.gl.readPixels(0, 0, 1, 1, scene.gl.RGBA, scene.gl.UNSIGNED_BYTE, pixel);  // waits until it is drawn
  frames += 1;
}
canvas.remove();
return 1000 * frames / (performance.now() - begin);
"""

def position(browser):
    return browser.run("const t = [...document.querySelectorAll('.tile')].find((e) => e.textContent.startsWith('Position')); "
                       "return t ? t.querySelector('b').textContent : ''")


def check_live(check, browser, programs, url):
    browser.open(url)
    check.soon(lambda: "no daemon" in browser.text("#link"), "without a daemon the page says so")
    daemon = programs.daemon("--fast")  # in lock step: what it says does not depend on how busy the machine is
    check.soon(lambda: browser.text("#link") == "live", "it connects when the daemon is there")
    first = check.soon(lambda: position(browser), "a pose comes")
    check.soon(lambda: position(browser) != first, "the pose moves")
    check.soon(lambda: "TRACKING" in browser.text("#tiles"), "the status is shown")
    check.soon(lambda: "streaming" in browser.text("#health"), "the camera's health is shown")
    check.soon(lambda: "process" in browser.text("#times"), "times of the stages are shown")
    check.soon(lambda: browser.run("return document.querySelectorAll('#plots canvas').length") >= 7, "all plots are there")
    found = check.soon(lambda: "map as saved" in browser.text("#legend") and browser.text("#legend"), "the saved map appears")
    check.that(bool(found) and " 0 points" not in found, f"it has points: {found}")
    check.soon(lambda: int(browser.run("return document.getElementById('scene').dataset.vertices") or 0) > 1000, "it is drawn")
    return daemon


def check_restart(check, browser, programs, daemon, faults):
    daemon.kill()
    daemon.wait()
    check.soon(lambda: "no daemon" in browser.text("#link"), "a daemon that dies is missed")
    programs.daemon("--faults", str(faults))
    check.soon(lambda: browser.text("#link") == "live", "the page connects again by itself")
    check.soon(lambda: browser.run("return [...document.querySelectorAll('#health td.bad')].some(cell => /^silent [1-9]+ s$/.test(cell.textContent))"),
               "a silent camera turns its row and says for how long")


def check_run(check, browser, programs, screenshots):
    """A finished run, with a time line."""
    arguments, folder = programs.arguments, programs.folder
    subprocess.run([arguments.geoflow, "replay", arguments.recording, "-o", folder / "run", "--save-map", folder / "run.map"],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    browser.open(programs.view(str(folder / "run"), "--map", str(folder / "run.map")))
    check.soon(lambda: browser.text("#link") == "a finished run", "a finished run is shown")
    frames = int(browser.run("return document.getElementById('time').max"))
    check.that(frames > 100, f"its time line has its frames: {frames + 1}")
    first = position(browser)
    browser.run(f"const t = document.getElementById('time'); t.value = {frames // 2}; t.dispatchEvent(new Event('input'))")
    middle = position(browser)
    check.that(middle != first and f"{frames // 2 + 1} /" in browser.text("#tiles"), f"the time line seeks: {first} -> {middle}")
    browser.run("document.getElementById('play').click()")
    check.soon(lambda: position(browser) != middle, "it plays")
    check.soon(lambda: "map as saved" in browser.text("#legend"), "its map is shown")
    if screenshots:
        check_screens(browser, screenshots, "run-")


def check_screens(browser, folder, prefix=""):
    for name, width, height, phone in (("desktop", 1280, 900, False), ("phone", 390, 844, True)):
        for dark in (False, True):
            browser.screenshot(folder / f"{prefix}{name}-{'dark' if dark else 'light'}.png", width, height, dark, phone)
    browser.devtools("Emulation.clearDeviceMetricsOverride")


def check_hostile(check, browser, url):
    """Another site's page, as the browser itself sees it."""
    browser.open("data:text/html,<p>elsewhere</p>")
    script = """return new Promise((done) => { const s = new EventSource("URL"); s.onmessage = () => done("told");
                s.addEventListener("pose", () => done("told")); s.onerror = () => done("refused"); });"""
    check.that(browser.run(script.replace("URL", url + "events")) == "refused", "a page of another site is told nothing")
    script = """return fetch("URL").then((a) => a.text()).then(() => "told", () => "refused")"""
    check.that(browser.run(script.replace("URL", url)) == "refused", "nor does it get the page")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("geoflow", "geoflowd", "recording"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--screenshots", type=Path)
    arguments = parser.parse_args()
    driver = shutil.which("chromedriver")
    if not driver or not shutil.which("chromium"):
        print("skipped: chromium and chromium-driver are not installed")
        return SKIPPED
    check = Check()
    with tempfile.TemporaryDirectory() as folder:
        programs = Programs(arguments, folder)
        browser = Browser(driver)
        try:
            faults = Path(folder) / "faults.toml"
            faults.write_text('[[fault]]\nkind = "gap"\nstream = "camera"\nfrom_s = 1.0\nuntil_s = 8.0\n', encoding="ascii")
            url = programs.view()
            with urllib.request.urlopen(url) as answer:
                check.that(len(answer.read()) < MOST_PAGE_BYTES, "the page is small")
            daemon = check_live(check, browser, programs, url)
            if arguments.screenshots:
                arguments.screenshots.mkdir(parents=True, exist_ok=True)
                time.sleep(5)
                check_screens(browser, arguments.screenshots)
            check_restart(check, browser, programs, daemon, faults)
            # Last on this page, which software rendering of that many holds up.
            fps = browser.run(FRAMES_A_SECOND.replace("COUNT", str(POINTS)))
            print(f"     {POINTS} points: {fps:.1f} frames a second (software rendering; load {os.getloadavg()[0]:.1f})")
            check_run(check, browser, programs, arguments.screenshots)
            complaints = browser.complaints()
            check.that(not complaints, f"no error on the console {complaints or ''}")
            check_hostile(check, browser, url)
        finally:
            browser.close()
            programs.stop_all()
    return 1 if check.failures else 0


if __name__ == "__main__":
    sys.exit(main())
