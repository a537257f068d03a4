"""A browser that opens the page of a real session."""

from __future__ import annotations

import os
import shutil
import time
from contextlib import contextmanager

import numpy as np
import pytest

import ssiam
from helpers.walking_clip import SIZE
from ssiam.web import Advance, Pause
from ssiam.web.feeds.opening import open_feed
from ssiam.web.recording import Recordings
from ssiam.web.server.serving import LiveServer
from ssiam.web.session import Session

SECONDS = 20  # timeout of a test
PHONE = {"width": 360, "height": 740}
_WATCH = """
() => ({
  step: window.ssiamLive?.step ?? null,
  boxes: window.ssiamLive?.boxes ?? [],
  frozen: window.ssiamLive?.frozen ?? false,
})
"""
_PIXELS = """
({view, xywh}) => {
  const canvas = document.querySelector(`[data-view=${view}] canvas`);
  const scale = canvas.width / window.ssiamSize[0];
  const [x, y, w, h] = xywh.map((value) => Math.round(value * scale));
  const {data} = canvas.getContext("2d").getImageData(x, y, Math.max(w, 1), Math.max(h, 1));
  return [...data];
}
"""


@contextmanager
def launched(*arguments):
    """A headless Chromium; skips the test if there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = os.environ.get("SSIAM_CHROMIUM") or shutil.which("chromium")
    if path is None:
        pytest.skip("no browser: install Debian's chromium, or set SSIAM_CHROMIUM")
    with playwright.sync_playwright() as driver:
        # The sandbox does not work for root, as in containers.
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox", *arguments])
        yield browser
        browser.close()


def feed_of(clip):
    """The feed of a clip, which is given as its path and its ground truth."""
    return open_feed(str(clip[0]), notify=lambda note: None)


@contextmanager
def served(feed, *, paused=False, **options):
    """A server with a session on `feed`; `options` are those of `LiveServer`.

    If `paused`, the session is paused on the first frame.
    """
    session = Session(feed, ssiam.load_tracker("csrt", stabilize="predict"), "csrt", Recordings())
    if paused:
        session.submit(Pause(True))
        session.submit(Advance())
    with session, LiveServer(session, **{"port": 0, **options}) as server:
        yield server


@contextmanager
def served_session(session):
    """A server with this session, started."""
    with session, LiveServer(session, port=0) as server:
        server.session = session
        yield server


class Visitor:
    """A user of the page, with mouse and keyboard."""

    def __init__(self, context, address):
        self.console_errors: list[str] = []
        self.page = context.new_page()
        self.page.set_default_timeout(1000 * SECONDS)
        self.page.on("console", self._listen)
        self.page.on("pageerror", lambda error: self.console_errors.append(str(error)))
        self.page.goto(address)

    def _listen(self, message):
        if message.type in ("error", "warning"):
            self.console_errors.append(message.text)

    def leave(self):
        """Close the page before its server ends."""
        self.page.close()

    def state(self):
        """What the page shows: the step, the boxes, and whether the frame is frozen for drawing."""
        return self.page.evaluate(_WATCH)

    def until(self, condition):
        """The state of the page as soon as it meets the condition."""
        deadline = time.monotonic() + SECONDS
        while time.monotonic() < deadline:
            state = self.state()
            if state["step"] is not None and condition(state):
                return state
            time.sleep(0.03)
        raise AssertionError(f"the condition was not met; last state: {state}")

    def until_step(self, condition):
        """The shown step as soon as it meets the condition."""
        return self.until(lambda state: condition(state["step"]))["step"]

    def pause(self):
        """Pause the session; returns the step that is shown then."""
        self.page.keyboard.press("Space")
        return self.until_step(lambda step: step["playing"] == "paused")

    def advance(self, condition):
        """Advance a paused session frame by frame until a state meets the condition."""
        while not condition(state := self.state()):
            shown = state["step"]["index"]
            self.page.get_by_role("button", name="Step").click()
            self.until_step(lambda step, shown=shown: step["index"] > shown)
        return state

    def resume(self):
        """Resume a paused session."""
        self.page.keyboard.press("Space")
        self.until_step(lambda step: step["playing"] == "playing")

    def to_client(self, point, view="raw"):
        """A point of the frame in the browser's pixels."""
        canvas = self.page.locator(f"[data-view={view}] canvas").bounding_box()
        scale = canvas["width"] / SIZE[0]
        return canvas["x"] + point[0] * scale, canvas["y"] + point[1] * scale

    def press(self, point, view="raw"):
        """Press the mouse button at a point of the frame."""
        self.page.mouse.move(*self.to_client(point, view))
        self.page.mouse.down()

    def release(self, point, view="raw"):
        """Drag the mouse to a point of the frame and release it."""
        self.page.mouse.move(*self.to_client(point, view), steps=3)
        self.page.mouse.up()

    def draw(self, box, view="raw"):
        """Draw a box."""
        x, y, w, h = box
        self.press((x, y), view)
        self.release((x + w, y + h), view)

    def draw_target(self, box, view="raw"):
        """Draw a box; returns the new target."""
        before = {target["id"] for target in self.state()["step"]["targets"]}
        self.draw(box, view)
        step = self.until_step(lambda step: len(step["targets"]) > len(before))
        return next(target for target in step["targets"] if target["id"] not in before)

    def has_color(self, color, xywh, view="raw"):
        """Whether a pixel of this `#rrggbb` is on the canvas within a box of the frame."""
        self.page.evaluate("size => { window.ssiamSize = size; }", list(SIZE))
        pixels = self.page.evaluate(_PIXELS, {"view": view, "xywh": [float(v) for v in xywh]})
        rgb = np.array(pixels).reshape(-1, 4)[:, :3]
        wanted = [int(color[at : at + 2], 16) for at in (1, 3, 5)]
        return bool((np.abs(rgb - wanted).max(axis=1) < 12).any())
