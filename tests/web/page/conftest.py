from __future__ import annotations

import pytest

from helpers.browsing import Visitor, a_feed, launched, served
from helpers.walking_clip import FRAMES, HIDDEN, write_shaking_clip

CAMERA = ("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream")
DESK = {"width": 1280, "height": 800}
# Counts the decoded pictures that are still held.
COUNTING = """
window.heldPictures = 0;
const make = window.createImageBitmap, close = ImageBitmap.prototype.close;
window.createImageBitmap = async (...all) => {
  const made = await make(...all);
  window.heldPictures += 1;
  return made;
};
ImageBitmap.prototype.close = function () {
  if (this.width) window.heldPictures -= 1;
  return close.call(this);
};
"""


@pytest.fixture(scope="module")
def browser():
    with launched(*CAMERA) as browser:
        yield browser


@pytest.fixture(scope="session")
def clip(tmp_path_factory):
    """A clip, and the truth in it."""
    path = tmp_path_factory.mktemp("clips") / "shaking.mp4"
    return path, write_shaking_clip(path, FRAMES, HIDDEN)


@pytest.fixture
def truth(clip):
    return clip[1]


@pytest.fixture
def server(clip):
    """Of a session that stands still on the clip's first frame."""
    with served(a_feed(clip), still=True) as server:
        yield server


@pytest.fixture
def visit(browser):
    """Open a page as somebody new; nobody's browser may complain while the server is there."""
    contexts, visitors = [], []

    def open_page(address, viewport=DESK, may_complain=False, **options):
        context = browser.new_context(viewport=viewport, **options)
        context.add_init_script(COUNTING)
        contexts.append(context)
        visitor = Visitor(context, address)
        if not may_complain:
            visitors.append(visitor)
        return visitor

    yield open_page
    complaints = [visitor.complaints for visitor in visitors]
    for context in contexts:
        context.close()
    assert not any(complaints), complaints


@pytest.fixture
def visitor(server, visit):
    """Somebody who sees the clip's first frame."""
    visitor = visit(server.address)
    visitor.until_step(lambda step: step["playing"] == "paused")
    return visitor
