"""A browser on the page of a real session."""

from __future__ import annotations

import os
import shutil
import time
from contextlib import contextmanager

import numpy as np
import pytest

import ssiam
from helpers.walking_clip import SIZE
from ssiam.web import commands
from ssiam.web.feeds.feed import open_feed
from ssiam.web.recording import Recordings
from ssiam.web.server.serving import LiveServer
from ssiam.web.session import Session

SECONDS = 20  # after which a test gives up
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


PHONE = {"width": 360, "height": 740}


@contextmanager
def launched(*arguments):
    """A headless Chromium; skips the test where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = os.environ.get("SSIAM_CHROMIUM") or shutil.which("chromium")
    if path is None:
        pytest.skip("no browser: install Debian's chromium, or set SSIAM_CHROMIUM")
    with playwright.sync_playwright() as driver:
        # Root, as in containers, has no sandbox.
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox", *arguments])
        yield browser
        browser.close()


def a_feed(clip):
    """Of a clip that is given as its path and the truth in it."""
    return open_feed(str(clip[0]), notes=lambda note: None)


@contextmanager
def served(feed, *, still=False, **options):
    """A server with a session on `feed`; `options` are those of `LiveServer`.

    If `still`, the session stands still on the first frame until somebody lets it go on.
    """
    session = Session(feed, ssiam.load_tracker("csrt", stabilize="predict"), "csrt", Recordings())
    if still:
        session.submit(commands.Pause(True))
        session.submit(commands.Advance())
    with session, LiveServer(session, **{"port": 0, **options}) as server:
        yield server


@contextmanager
def served_session(session):
    """A server with this session."""
    with session, LiveServer(session, port=0) as server:
        server.session = session
        yield server


class Visitor:
    """Somebody who looks at a page, with eyes, mouse and keyboard."""

    def __init__(self, context, address):
        self.complaints: list[str] = []
        self.page = context.new_page()
        self.page.set_default_timeout(1000 * SECONDS)
        self.page.on("console", self._listen)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.goto(address)

    def _listen(self, message):
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)

    def leave(self):
        """Close the page, before its server ends."""
        self.page.close()

    def seen(self):
        """What is on the screen: the step, the boxes, whether the picture stands for a stroke."""
        return self.page.evaluate(_WATCH)

    def until(self, wanted):
        """What is on the screen, as soon as it is as wanted."""
        until = time.monotonic() + SECONDS
        while time.monotonic() < until:
            seen = self.seen()
            if seen["step"] is not None and wanted(seen):
                return seen
            time.sleep(0.03)
        raise AssertionError(f"did not come about; at last there was {seen}")

    def until_step(self, wanted):
        """The step on the screen, as soon as it is as wanted."""
        return self.until(lambda seen: wanted(seen["step"]))["step"]

    def pause(self):
        """Let the session stand still; the step that is shown then."""
        self.page.keyboard.press("Space")
        return self.until_step(lambda step: step["playing"] == "paused")

    def go_on(self):
        """Let a session that stands still go on."""
        self.page.keyboard.press("Space")
        self.until_step(lambda step: step["playing"] == "playing")

    def to_client(self, point, view="raw"):
        """A point of the frame in the browser's pixels."""
        place = self.page.locator(f"[data-view={view}] canvas").bounding_box()
        scale = place["width"] / SIZE[0]
        return place["x"] + point[0] * scale, place["y"] + point[1] * scale

    def press(self, point, view="raw"):
        """Press the mouse there."""
        self.page.mouse.move(*self.to_client(point, view))
        self.page.mouse.down()

    def release(self, point, view="raw"):
        """Draw on to there and let go."""
        self.page.mouse.move(*self.to_client(point, view), steps=3)
        self.page.mouse.up()

    def draw(self, box, view="raw"):
        """Draw a box."""
        x, y, w, h = box
        self.press((x, y), view)
        self.release((x + w, y + h), view)

    def draw_target(self, box, view="raw"):
        """Draw a box; the target that comes of it."""
        before = {target["id"] for target in self.seen()["step"]["targets"]}
        self.draw(box, view)
        step = self.until_step(lambda step: len(step["targets"]) > len(before))
        return next(target for target in step["targets"] if target["id"] not in before)

    def has_colour(self, colour, xywh, view="raw"):
        """Whether this `#rrggbb` is on the canvas within a box of the frame."""
        self.page.evaluate("size => { window.ssiamSize = size; }", list(SIZE))
        pixels = self.page.evaluate(_PIXELS, {"view": view, "xywh": [float(v) for v in xywh]})
        rgb = np.array(pixels).reshape(-1, 4)[:, :3]
        wanted = [int(colour[at : at + 2], 16) for at in (1, 3, 5)]
        return bool((np.abs(rgb - wanted).max(axis=1) < 12).any())
