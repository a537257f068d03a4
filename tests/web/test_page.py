"""The live page in a real browser, on real sessions."""

from __future__ import annotations

from pathlib import Path

import pytest
from browsing import (
    RATE,
    SIZE,
    Visitor,
    distance,
    launched,
    served,
    write_shaking_clip,
)

from ssiam.web.feeds.feed import open_feed
from ssiam.web.feeds.pushed import PushedFeed

FRAMES = 300
HIDDEN = range(30, 45)  # 1.5 s
NEAR = 5  # pixels
CAMERA = ("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream")
DESK, PHONE = {"width": 1280, "height": 800}, {"width": 360, "height": 740}

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


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A clip, and the truth in it."""
    path = tmp_path_factory.mktemp("clips") / "shaking.mp4"
    return path, write_shaking_clip(path, FRAMES, HIDDEN)


def a_feed(clip):
    return open_feed(str(clip[0]), notes=lambda note: None)


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


def follow(visitor, who, truth, until):
    """Distances of the first box from the truth in the steps that are shown."""
    distances = {}

    def done(seen):
        index = seen["step"]["index"]
        if seen["boxes"] and (who != "walker" or index not in HIDDEN):
            distances[index] = distance(seen["boxes"][0]["box"], truth[who][index])
        return index >= until

    visitor.until(done)
    return distances


def test_a_drawn_box_follows_its_target(visitor, truth):
    target = visitor.draw_target(truth["walker"][0])
    visitor.go_on()
    distances = follow(visitor, "walker", truth, 25)
    assert len(distances) >= 5
    assert max(distances.values()) < NEAR
    x, y, _, h = truth["walker"][visitor.pause()["index"]]
    assert visitor.has_colour(target["colour"], (x - NEAR, y + h / 2, 2 * NEAR, 4))


def test_a_box_is_drawn_into_the_picture_that_stands_still(visitor, truth):
    visitor.go_on()
    x, y, _, _ = truth["stander"][visitor.seen()["step"]["index"]]
    visitor.press((x, y))
    frozen = visitor.until(lambda seen: seen["frozen"])["step"]
    x, y, w, h = truth["stander"][frozen["index"]]
    visitor.page.wait_for_timeout(1500)
    assert visitor.seen()["step"]["number"] == frozen["number"]
    visitor.release((x + w, y + h))
    step = visitor.until_step(lambda step: step["targets"])
    assert step["index"] > frozen["index"]
    # Late as it comes, the box is where the target is now.
    distances = follow(visitor, "stander", truth, step["index"] + 10)
    assert max(distances.values()) < 2 * NEAR


def test_a_target_is_lost_and_found_again(visitor, truth):
    visitor.draw_target(truth["walker"][0])
    visitor.go_on()
    lost = visitor.until(lambda seen: seen["step"]["targets"][0]["lost"])
    assert lost["boxes"] == []
    visitor.page.locator(".state", has_text="LOST").wait_for()
    found = visitor.until(lambda seen: seen["boxes"])["step"]["index"]
    assert found >= HIDDEN.start
    visitor.page.locator(".state", has_text="FOUND").wait_for()
    visitor.page.locator(".state", has_text="tracking").wait_for()
    distances = follow(visitor, "walker", truth, HIDDEN.stop + 20)
    assert distances[max(distances)] < NEAR


def test_two_targets_are_named_selected_and_removed(visitor, truth):
    for who in ("walker", "stander"):
        visitor.draw_target(truth[who][0])
    names = visitor.page.get_by_role("textbox")
    names.nth(1).wait_for()
    names.nth(1).press("Control+a")
    names.nth(1).press_sequentially("e 1 ?. r")
    names.nth(1).press("Enter")
    step = visitor.until_step(lambda step: step["targets"][1]["name"] == "e 1 ?. r")
    assert (step["stabilize"], step["recording"], step["index"]) == ("predict", None, 0)
    x, y, w, h = truth["walker"][0]
    visitor.press((x + w / 2, y + h / 2))
    visitor.release((x + w / 2, y + h / 2))
    visitor.page.wait_for_selector(".swatch[aria-label='Select target 1'][aria-pressed=true]")
    visitor.page.keyboard.press("Delete")
    visitor.until(lambda seen: [box["name"] for box in seen["boxes"]] == ["e 1 ?. r"])
    visitor.page.get_by_role("button", name="Remove e 1 ?. r").click()
    visitor.until(lambda seen: not seen["step"]["targets"])


def test_a_box_in_the_steadied_picture_is_taken_back_to_the_raw_one(visitor, truth):
    visitor.go_on()
    visitor.until_step(lambda step: step["index"] >= 12)
    step = visitor.pause()
    visitor.page.keyboard.press("s")
    visitor.until(lambda seen: len(seen["step"]["pictures"]) == 2)
    (a, b, c), (d, e, f) = step["stab_from_raw"]
    x, y, w, h = truth["stander"][step["index"]]
    assert abs(c) + abs(f) > 1, "the steadied picture is the raw one"
    x, y = (
        a * (x + w / 2) + b * (y + h / 2) + c - w / 2,
        d * (x + w / 2) + e * (y + h / 2) + f - h / 2,
    )
    target = visitor.draw_target((x, y, w, h), "steadied")
    assert target["box"] == pytest.approx(truth["stander"][step["index"]], abs=1.5)
    colour = target["colour"]
    assert visitor.has_colour(colour, (x - 3, y + h / 2, 6, 4), "steadied")


NO_BOXES = [
    # name, where the mouse goes from the place where it was pressed
    ("a click", [(0, 0)]),
    ("a line", [(40, 2)]),
    ("a box given up", [(40, 30), None]),
]


@pytest.mark.parametrize(("name", "way"), NO_BOXES, ids=lambda value: str(value)[:16])
def test_nothing_is_added_by(visitor, name, way):
    visitor.go_on()
    visitor.press((100, 100))
    for move in way:
        if move is None:
            visitor.page.keyboard.press("Escape")
            visitor.until(lambda seen: not seen["frozen"])
        else:
            visitor.page.mouse.move(*visitor.to_client((100 + move[0], 100 + move[1])))
    visitor.page.mouse.up()
    number = visitor.until(lambda seen: not seen["frozen"])["step"]["number"]
    assert visitor.until_step(lambda step: step["number"] > number + 3)["targets"] == []
    assert visitor.page.locator(".toast").count() == (None not in way)


def test_keys_steer_the_session(visitor):
    press = visitor.page.keyboard.press
    visitor.go_on()
    for key, method in (("1", "off"), ("2", "paper"), ("3", "predict")):
        press(key)
        visitor.until_step(lambda step, method=method: step["stabilize"] == method)
        visitor.page.locator(f"input[value={method}]:checked").wait_for()
    index = visitor.pause()["index"]
    press(".")
    visitor.until_step(lambda step: step["index"] == index + 1)
    press("r")
    visitor.until_step(lambda step: step["index"] < index)
    press("?")
    assert visitor.page.get_by_role("dialog").is_visible()
    press("1")
    press("Escape")
    visitor.until(lambda seen: visitor.page.evaluate("document.activeElement === document.body"))
    visitor.go_on()
    assert visitor.seen()["step"]["stabilize"] == "predict"


def test_two_clients_see_the_same(server, visitor, visit, truth):
    other = visit(server.address)
    other.until_step(lambda step: step["clients"] == 2)
    visitor.draw_target(truth["stander"][0])
    other.until(lambda seen: seen["boxes"])
    other.page.get_by_label("paper").check()
    visitor.until_step(lambda step: step["stabilize"] == "paper")
    visitor.page.locator("input[value=paper]:checked").wait_for()
    assert visitor.seen()["boxes"] == other.seen()["boxes"]
    visitor.go_on()
    other.leave()
    visitor.until_step(lambda step: step["clients"] == 1)


def test_a_recording_plays_and_can_be_fetched(visitor, truth, tmp_path):
    page = visitor.page
    visitor.go_on()
    page.get_by_role("button", name="Record").click()
    name = visitor.until_step(lambda step: step["recording"])["recording"]
    start = visitor.seen()["step"]["index"]
    visitor.until_step(lambda step: step["index"] >= start + RATE)
    page.get_by_role("button", name="Stop recording").click()
    page.get_by_role("button", name=f"Play {name}").click()
    visitor.until(lambda seen: page.evaluate("document.querySelector('video').currentTime") > 0.3)
    assert page.evaluate("document.querySelector('video').videoWidth") == SIZE[0]
    with page.expect_download() as download:
        page.get_by_role("link", name="results.csv").click()
    assert name in download.value.suggested_filename
    assert len(Path(download.value.path()).read_text().splitlines()) >= 1
    page.get_by_role("button", name="Close").first.click()
    assert not page.locator("video").is_visible()


def test_a_phone_shows_all_and_draws_with_a_finger(server, visit, truth):
    phone = visit(server.address, PHONE, has_touch=True, is_mobile=True, device_scale_factor=2)
    phone.page.get_by_role("button", name="Resume").tap()
    phone.until_step(lambda step: step["playing"] == "playing")
    phone.page.get_by_role("button", name="Pause").tap()
    index = phone.until_step(lambda step: step["playing"] == "paused")["index"]
    x, y, w, h = truth["stander"][index]
    finger = phone.page.context.new_cdp_session(phone.page)
    ways = [
        ("touchStart", (x, y)),
        ("touchMove", (x + w / 2, y + h)),
        ("touchMove", (x + w, y + h)),
    ]
    for kind, place in [*ways, ("touchEnd", None)]:
        points = [] if place is None else [dict(zip("xy", phone.to_client(place), strict=True))]
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    target = phone.until_step(lambda step: step["targets"])["targets"][0]
    assert target["box"] == pytest.approx(truth["stander"][index], abs=1.5)
    phone.page.get_by_label("raw and steadied side by side").tap()
    phone.until(lambda seen: len(seen["step"]["pictures"]) == 2)
    assert phone.page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]


def test_decoded_pictures_are_let_go(visitor):
    visitor.go_on()
    visitor.page.keyboard.press("s")
    visitor.until_step(lambda step: step["number"] >= 30)
    # Two views of what is shown, of what waits, and of what is being decoded.
    assert 1 <= visitor.page.evaluate("window.heldPictures") <= 8


def test_the_picture_is_told_in_words(visitor, truth):
    visitor.draw_target(truth["stander"][0])
    page = visitor.page
    page.wait_for_selector("[data-view=raw] canvas[aria-label*='target 1 at']")
    targets = page.get_by_role("region", name="Targets", exact=True).get_by_role("list")
    targets.get_by_role("listitem").get_by_role("meter", name="Score of target 1").wait_for()
    unnamed = (
        "[...document.querySelectorAll('button')].filter((b) => !(b.ariaLabel || b.innerText))"
    )
    assert page.evaluate(f"{unnamed}.length") == 0


def test_a_page_finds_its_session_again(visit, clip):
    with served(a_feed(clip)) as server:
        port = server.access.port
        visitor = visit(server.address, may_complain=True)
        visitor.until_step(lambda step: True)
    banner = visitor.page.get_by_role("alert")
    banner.wait_for()
    assert visitor.page.get_by_role("button", name="Pause").is_disabled()
    with served(a_feed(clip), port=port):
        banner.wait_for(state="hidden")
        visitor.until_step(lambda step: step["playing"] == "playing")


def test_a_token_is_carried_along(visit, clip):
    with served(a_feed(clip), needs_token=True) as server:
        address, token = server.address.split("#token=")
        visitor = visit(server.address)
        visitor.until_step(lambda step: True)
        visitor.page.keyboard.press("e")
        visitor.until_step(lambda step: step["recording"])
        visitor.page.keyboard.press("e")
        link = visitor.page.get_by_role("link", name="video.mp4").get_attribute("href")
        assert link.endswith(f"?token={token}")
        stranger = visit(address, may_complain=True)
        stranger.page.get_by_text("#token=").wait_for()
        assert stranger.seen()["step"] is None
        visitor.leave()


def test_this_devices_camera_is_the_source(visit):
    with served(PushedFeed()) as server:
        visitor = visit(server.address, permissions=["camera"])
        camera = visitor.page.get_by_role("button", name="Use this device's camera")
        camera.click()
        visitor.until_step(lambda step: step["index"] >= 10)
        target = visitor.draw_target((100, 80, 60, 50))
        assert target["box"][2] > 60, "not in the camera's own pixels"
        visitor.page.get_by_role("button", name="Stop this device's camera").click()
        camera.wait_for()
        visitor.leave()
