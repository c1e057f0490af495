"""What the tests of pages share: the program, the browser, a page that is open in it."""

import base64
import json
import os
import pathlib
import subprocess
import time

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

ROOT = pathlib.Path(__file__).parents[2]
TERRANE = os.environ.get("TERRANE", str(ROOT / "target/debug/terrane"))
CHROMIUM = os.environ.get("CHROMIUM", "/usr/bin/chromium")
FLAGS = (
    "--headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--ignore-gpu-blocklist --disable-background-networking --disable-component-update --disable-sync --no-first-run"
).split()
SKY = np.array([226, 233, 239])


def terrane(*args):
    """Runs the program; its report."""
    ran = subprocess.run([TERRANE, *map(str, args), "--json"], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


@pytest.fixture(scope="session")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(scope="session")
def browser():
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield launched
        launched.close()


class Opened:
    """A page that is ready, and all that went wrong in it."""

    def __init__(self, browser, file, width=1100, height=720, phone=False):
        url = file if str(file).startswith("http") else pathlib.Path(file).as_uri()
        self.is_served = url.startswith("http")
        self.context = browser.new_context(
            viewport={"width": width, "height": height}, has_touch=phone, is_mobile=phone, offline=not self.is_served
        )
        self.page = self.context.new_page()
        self.faults, self.requests = [], []
        self.page.on("console", lambda told: self.faults.append(told.text) if told.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("dialog", lambda dialog: (self.faults.append("dialog"), dialog.dismiss()))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(url)
        self.wait(lambda: self("() => document.body?.dataset.state"))
        assert self("() => document.body.dataset.state") == "ready", self.page.inner_text("#wait")
        self.url = self.page.url

    def __call__(self, script, argument=None):
        return self.page.evaluate(script, argument)

    def wait(self, is_so):
        """Asks again and again: the page's policy does not let conditions be evaluated in it."""
        end = time.monotonic() + 120
        while not is_so():
            assert time.monotonic() < end, self.faults
            self.page.wait_for_timeout(30)

    def picture(self):
        """What is drawn, from the top: rows, columns, red, green, blue."""
        got = self("""() => { const p = terrane.picture();
            let s = ''; for (let i = 0; i < p.bytes.length; i += 8192) s += String.fromCharCode(...p.bytes.subarray(i, i + 8192));
            return [p.width, p.height, btoa(s)]; }""")
        pixels = np.frombuffer(base64.b64decode(got[2]), np.uint8)
        return pixels.reshape(got[1], got[0], 4)[::-1, :, :3].astype(int)

    def close(self):
        assert self.faults == [], self.faults
        loaded = [url for url in self.requests if not url.startswith("blob:")]
        if self.is_served:
            assert all(url.startswith(self.url) for url in loaded), "nothing is loaded from elsewhere"
        else:
            assert loaded == [self.url], "nothing else is loaded"
        self.context.close()


@pytest.fixture
def opened(browser):
    pages = []

    def open_page(*args, **options):
        pages.append(Opened(browser, *args, **options))
        return pages[-1]

    yield open_page
    for page in pages:
        page.close()
