"""A page, and a browser that looks at it: Debian's Chromium without a screen, driven by Playwright."""

import io
import os
import shutil
import time

import numpy as np
import pytest
from PIL import Image

from sigmaik.teleop import Session
from sigmaik.teleop.page import Page

# No graphics card, no sandbox for root, and nothing that it would ask of the network.
FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
#: [s] machines are busy, and draw without a graphics card
PATIENCE = 60.0
POSE_TIMEOUT = 10.0  #: [s]


@pytest.fixture(scope="session")
def browser():
    from playwright.sync_api import sync_playwright

    path = os.environ.get("SIGMAIK_BROWSER") or shutil.which("chromium") or shutil.which("chromium-browser")
    assert path, "no Chromium: Debian's package chromium has it"
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield chromium
        chromium.close()


class Driven:
    """A page in a browser, and the session behind it."""

    def __init__(self, session, server, tab):
        self.session, self.server, self.tab = session, server, tab
        self.errors = []
        tab.set_default_timeout(1e3 * PATIENCE)
        tab.on("pageerror", lambda error: self.errors.append(str(error)))
        tab.on("console", lambda m: self.errors.append(m.text) if m.type == "error" else None)
        tab.goto(server.url)
        tab.wait_for_selector("#sk-status")

    def wait(self, condition, what):
        """Waits for a condition of the session, with the browser alive."""
        assert self._holds(condition, PATIENCE), f"not in time: {what}"

    def _holds(self, condition, seconds):
        """Whether a condition holds within some seconds."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            self.tab.wait_for_timeout(20)
        return True

    def picture(self):
        """(height, width, 3) what the tab shows, once it does not change any more."""
        last, end = self.shot(), time.monotonic() + PATIENCE
        while time.monotonic() < end:
            now = self.shot()
            beside = slice(0, 5 * now.shape[1] // 8)  # the panel, whose figures change, is on the right
            if np.abs(now - last)[:, beside].max() < 30.0:
                return now
            last = now
        raise AssertionError("the picture does not come to rest")

    def shot(self):
        """(height, width, 3) what the tab shows now."""
        return np.asarray(Image.open(io.BytesIO(self.tab.screenshot())).convert("RGB"), dtype=float)

    def control(self, label):
        """The control beside a label."""
        return self.tab.locator(f"xpath=//label[normalize-space(text())='{label}']/ancestor::div[3]//input")

    def go_to(self, x, y, z):
        """Types a target."""
        for box, value in enumerate((x, y, z)):
            self.control("target [m]").nth(box).fill(f"{value:.3f}")
            self.control("target [m]").nth(box).press("Enter")

    def go_until(self, position, condition, what):
        """Types a target until a condition holds: a target is stale after POSE_TIMEOUT, and the arm then stops."""
        for _ in range(int(PATIENCE / (0.5 * POSE_TIMEOUT))):
            self.go_to(*position)
            if self._holds(condition, 0.5 * POSE_TIMEOUT):
                return
        raise AssertionError(f"not in time: {what}")

    def choose(self, label, option):
        """Takes an option of a dropdown."""
        self.control(label).first.click()
        self.tab.get_by_role("option", name=option, exact=True).click()

    def press(self, name):
        self.tab.get_by_role("button", name=name, exact=True).click()

    def status(self, attribute="status"):
        return self.tab.locator("#sk-status").get_attribute(f"data-{attribute}")

    def guide(self):
        """What the page says of the guide."""
        return self.tab.locator("#sk-guide").inner_text()


@pytest.fixture
def drive(browser, tmp_path):
    """drive(robot): a session, its page, and a tab that shows it; drive(beside=page): another browser of a page.

    Without a graphics card a picture takes a processor: a tab is small, unless a test looks at the picture (large).
    """
    opened = []

    def drive(robot="ufactory_xarm7", beside=None, phone=False, large=False, **options):
        shape = {"viewport": {"width": 1400, "height": 1000} if large else {"width": 800, "height": 600}}
        if phone:
            shape = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True}
        tab = browser.new_page(**shape)
        if beside is not None:
            opened.append((None, None, tab))
            return Driven(beside.session, beside.server, tab)
        session = Session(robot, pose_timeout=POSE_TIMEOUT, **options)
        session.__enter__()
        server = Page(session, port=0, directory=tmp_path)
        opened.append((session, server, tab))
        return Driven(session, server, tab)

    yield drive
    for _, _, tab in opened:
        tab.close()
    for session, server, _ in opened:
        if session is not None:
            server.close()
            session.__exit__()
