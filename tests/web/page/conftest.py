from __future__ import annotations

import pytest

from helpers.browsing import Visitor, feed_of, launched, served
from helpers.walking_clip import FRAMES, HIDDEN, write_shaking_clip

CAMERA = ("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream")
DESK = {"width": 1280, "height": 800}
# A script that counts the decoded images that are not closed.
COUNT_BITMAPS = """
window.openBitmaps = 0;
const make = window.createImageBitmap, close = ImageBitmap.prototype.close;
window.createImageBitmap = async (...all) => {
  const made = await make(...all);
  window.openBitmaps += 1;
  return made;
};
ImageBitmap.prototype.close = function () {
  if (this.width) window.openBitmaps -= 1;
  return close.call(this);
};
"""


@pytest.fixture(scope="module")
def browser():
    with launched(*CAMERA) as browser:
        yield browser


@pytest.fixture(scope="session")
def clip(tmp_path_factory):
    """A clip and its ground truth."""
    path = tmp_path_factory.mktemp("clips") / "shaking.mp4"
    return path, write_shaking_clip(path, FRAMES, HIDDEN)


@pytest.fixture
def truth(clip):
    return clip[1]


@pytest.fixture
def server(clip):
    """A server whose session is paused on the clip's first frame."""
    with served(feed_of(clip), paused=True) as server:
        yield server


@pytest.fixture
def visit(browser):
    """A function that opens the page as a new user; the console must stay free of errors."""
    contexts, visitors = [], []

    def open_page(address, viewport=DESK, may_log_errors=False, **options):
        context = browser.new_context(viewport=viewport, **options)
        context.add_init_script(COUNT_BITMAPS)
        contexts.append(context)
        visitor = Visitor(context, address)
        if not may_log_errors:
            visitors.append(visitor)
        return visitor

    yield open_page
    console_errors = [visitor.console_errors for visitor in visitors]
    for context in contexts:
        context.close()
    assert not any(console_errors), console_errors


@pytest.fixture
def visitor(server, visit):
    """A user who sees the clip's first frame."""
    visitor = visit(server.address)
    visitor.until_step(lambda step: step["playing"] == "paused")
    return visitor
