"""The live page in a real browser: keys, several clients, recordings, reconnection."""

from __future__ import annotations

from pathlib import Path

import pytest

from helpers.browsing import PHONE, feed_of, served
from helpers.walking_clip import RATE, SIZE
from ssiam.web.feeds.pushed import PushedFeed


def test_keys_control_the_session(visitor):
    press = visitor.page.keyboard.press
    visitor.resume()
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
    visitor.until(lambda state: visitor.page.evaluate("document.activeElement === document.body"))
    visitor.resume()
    assert visitor.state()["step"]["stabilize"] == "predict"


def test_the_space_bar_pauses_wherever_the_focus_is(visitor):
    visitor.resume()
    page = visitor.page
    side_by_side = page.get_by_label("Raw and stabilized side by side")
    for focused in (page.get_by_role("button", name="Record"), side_by_side):
        focused.focus()
        visitor.pause()
        visitor.resume()
    assert visitor.state()["step"]["recording"] is None
    assert not side_by_side.is_checked()
    visitor.pause()
    visitor.draw_target((50, 50, 40, 40))
    name = page.get_by_role("textbox")
    name.fill("a")
    name.press("End")
    name.press_sequentially(" b")
    name.press("Enter")
    step = visitor.until_step(lambda step: step["targets"][0]["name"] == "a b")
    assert step["playing"] == "paused"


def test_the_seek_bar_shows_any_frame_and_targets_wait_for_theirs(visitor, truth):
    page = visitor.page
    bar = page.get_by_role("slider", name="Frame")
    bar.fill("30")
    visitor.until_step(lambda step: step["index"] == 30)
    visitor.draw_target(truth["stander"][30])
    page.keyboard.press("r")
    step = visitor.until_step(lambda step: step["index"] == 0)
    assert [target["frame"] for target in step["waiting"]] == [30]
    page.get_by_text("waits for frame 30").wait_for()
    bar.fill("30")
    step = visitor.until_step(lambda step: step["index"] == 30)
    assert (len(step["targets"]), step["waiting"]) == (1, [])


PLOT_COLOR = """
() => {
  const canvas = document.querySelector("#plot-shift canvas");
  return [...canvas.getContext("2d").getImageData(2, canvas.height - 3, 1, 1).data];
}
"""


def test_plots_follow_the_theme(server, visit):
    colors = {}
    for scheme in ("dark", "light"):
        visitor = visit(server.address, color_scheme=scheme)
        visitor.until_step(lambda step: True)
        visitor.page.wait_for_timeout(500)
        colors[scheme] = sum(visitor.page.evaluate(PLOT_COLOR)[:3])
    assert colors["dark"] < 200
    assert colors["light"] > 700


def test_the_help_of_a_phone_shows_gestures(server, visit):
    phone = visit(server.address, PHONE, has_touch=True, is_mobile=True)
    phone.page.get_by_role("button", name="Help").tap()
    phone.page.get_by_role("dialog").get_by_text("Tap a box").wait_for()
    assert phone.page.get_by_text("Space", exact=True).is_hidden()


def test_two_clients_see_the_same(server, visitor, visit, truth):
    other = visit(server.address)
    other.until_step(lambda step: step["clients"] == 2)
    visitor.draw_target(truth["stander"][0])
    other.until(lambda state: state["boxes"])
    other.page.get_by_label("paper").check()
    visitor.until_step(lambda step: step["stabilize"] == "paper")
    visitor.page.locator("input[value=paper]:checked").wait_for()
    assert visitor.state()["boxes"] == other.state()["boxes"]
    visitor.resume()
    other.leave()
    visitor.until_step(lambda step: step["clients"] == 1)


def test_a_recording_plays_and_can_be_downloaded(visitor, truth, tmp_path):
    page = visitor.page
    visitor.resume()
    page.get_by_role("button", name="Record").click()
    name = visitor.until_step(lambda step: step["recording"])["recording"]
    start = visitor.state()["step"]["index"]
    visitor.until_step(lambda step: step["index"] >= start + RATE)
    page.get_by_role("button", name="Stop recording").click()
    page.get_by_role("button", name=f"Play {name}").click()
    visitor.until(lambda state: page.evaluate("document.querySelector('video').currentTime") > 0.3)
    assert page.evaluate("document.querySelector('video').videoWidth") == SIZE[0]
    with page.expect_download() as download:
        page.get_by_role("link", name="results.csv").click()
    assert name in download.value.suggested_filename
    assert len(Path(download.value.path()).read_text().splitlines()) >= 1
    page.get_by_role("button", name="Close").first.click()
    assert not page.locator("video").is_visible()


def test_the_page_works_on_a_phone(server, visit, truth):
    phone = visit(server.address, PHONE, has_touch=True, is_mobile=True, device_scale_factor=2)
    phone.page.get_by_role("button", name="Resume").tap()
    phone.until_step(lambda step: step["playing"] == "playing")
    phone.page.get_by_role("button", name="Pause").tap()
    index = phone.until_step(lambda step: step["playing"] == "paused")["index"]
    x, y, w, h = truth["stander"][index]
    finger = phone.page.context.new_cdp_session(phone.page)
    touches = [
        ("touchStart", (x, y)),
        ("touchMove", (x + w / 2, y + h)),
        ("touchMove", (x + w, y + h)),
    ]
    for kind, point in [*touches, ("touchEnd", None)]:
        points = [] if point is None else [dict(zip("xy", phone.to_client(point), strict=True))]
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    target = phone.until_step(lambda step: step["targets"])["targets"][0]
    assert target["box"] == pytest.approx(truth["stander"][index], abs=1.5)
    phone.page.get_by_label("Raw and stabilized side by side").tap()
    phone.until(lambda state: len(state["step"]["pictures"]) == 2)
    assert phone.page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]


def test_decoded_images_are_closed(visitor):
    visitor.resume()
    visitor.page.keyboard.press("s")
    visitor.until_step(lambda step: step["number"] >= 30)
    # Two views each of the shown step, the next one, and those being decoded.
    assert 1 <= visitor.page.evaluate("window.openBitmaps") <= 8


def test_the_view_is_described_for_screen_readers(visitor, truth):
    visitor.draw_target(truth["stander"][0])
    page = visitor.page
    page.wait_for_selector("[data-view=raw] canvas[aria-label*='target 1 at']")
    targets = page.get_by_role("region", name="Targets", exact=True).get_by_role("list")
    targets.get_by_role("listitem").get_by_role("meter", name="Score of target 1").wait_for()
    unnamed = (
        "[...document.querySelectorAll('button')].filter((b) => !(b.ariaLabel || b.innerText))"
    )
    assert page.evaluate(f"{unnamed}.length") == 0


def test_the_page_reconnects(visit, clip):
    with served(feed_of(clip), needs_token=False) as server:
        port = server.access.port
        visitor = visit(server.address, may_log_errors=True)
        visitor.until_step(lambda step: True)
    banner = visitor.page.get_by_role("alert")
    banner.wait_for()
    assert visitor.page.get_by_role("button", name="Pause").is_disabled()
    with served(feed_of(clip), port=port, needs_token=False):
        banner.wait_for(state="hidden")
        visitor.until_step(lambda step: step["playing"] == "playing")


def test_the_page_of_an_earlier_server_needs_the_new_address(visit, clip):
    with served(feed_of(clip)) as server:
        port = server.access.port
        visitor = visit(server.address, may_log_errors=True)
        visitor.until_step(lambda step: True)
    banner = visitor.page.get_by_role("alert")
    banner.wait_for()
    with served(feed_of(clip), port=port) as server:
        visitor.page.get_by_text("#token=").wait_for()
        visitor.page.goto(server.address)
        banner.wait_for(state="hidden")
        visitor.until_step(lambda step: step["playing"] == "playing")


def test_the_token_is_sent_with_requests(visit, clip):
    with served(feed_of(clip)) as server:
        address, token = server.address.split("#token=")
        visitor = visit(server.address)
        visitor.until_step(lambda step: True)
        visitor.page.keyboard.press("e")
        begun = visitor.until_step(lambda step: step["recording"])["index"]
        visitor.until_step(lambda step: abs(step["index"] - begun) > 10)
        visitor.page.keyboard.press("e")
        link = visitor.page.get_by_role("link", name="video.mp4").get_attribute("href")
        assert link.endswith(f"?token={token}")
        stranger = visit(address, may_log_errors=True)
        stranger.page.get_by_text("#token=").wait_for()
        assert stranger.state()["step"] is None
        visitor.leave()


def test_the_camera_of_the_device_is_the_source(visit):
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
