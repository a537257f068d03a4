"""Errors of a session are shown on its page, in a real browser."""

from __future__ import annotations

import pytest

from helpers.browsing import PHONE, served_session
from helpers.failing_trackers import Hang, every_tenth, failing_tracker, leave
from helpers.live_server import SIZE, EndlessFeed
from ssiam.web import Add, Remove
from ssiam.web.recording import Recordings
from ssiam.web.session import Session

BOX = (50, 40, 40, 36)
DESK = {"width": 1280, "height": 800}


def failing_session(trouble, recordings=None, **options):
    tracker = failing_tracker(trouble)
    return Session(EndlessFeed(SIZE), tracker, "kcf", recordings or Recordings(), **options)


@pytest.mark.parametrize("viewport", [DESK, PHONE], ids=["desk", "phone"])
def test_a_tracker_that_fails_is_shown_and_the_session_goes_on(visit, viewport):
    with served_session(failing_session(every_tenth)) as server:
        visitor = visit(server.address, viewport)
        visitor.until_step(lambda step: True)
        server.session.submit(Add(BOX, name="boat")).result(10)
        visitor.page.locator(".target .problem", has_text="come apart").wait_for()
        visitor.page.get_by_role("log").get_by_text("tracker of boat").wait_for()
        number = visitor.state()["step"]["number"]
        visitor.until(lambda state: state["step"]["number"] > number + 25 and state["boxes"])
        assert not visitor.page.get_by_role("alert").is_visible()
        assert visitor.page.evaluate("document.documentElement.scrollWidth") == viewport["width"]
        server.session.submit(Remove()).result(10)
        visitor.until_step(lambda step: not step["targets"])
        visitor.leave()


@pytest.mark.parametrize("viewport", [DESK, PHONE], ids=["desk", "phone"])
def test_a_stall_is_shown_until_it_ends(visit, viewport):
    hang = Hang()
    with served_session(failing_session(hang, stall_seconds=0.5)) as server:
        visitor = visit(server.address, viewport)
        visitor.until_step(lambda step: True)
        server.session.submit(Add(BOX)).result(10)
        alert = visitor.page.get_by_role("alert")
        alert.get_by_text("Tracking has stalled").wait_for()
        visitor.page.locator("[data-playing=stalled]").wait_for()
        assert not visitor.page.get_by_role("button", name="Try now").is_visible()
        late = visit(server.address, viewport)
        late.page.get_by_role("alert").get_by_text("Tracking has stalled").wait_for()
        assert visitor.page.evaluate("document.documentElement.scrollWidth") == viewport["width"]
        hang.let_go.set()
        alert.wait_for(state="hidden")
        late.page.get_by_role("alert").wait_for(state="hidden")
        visitor.page.locator("[data-playing=playing]").wait_for()
        for each in (visitor, late):
            each.leave()


def test_a_failure_is_still_shown_after_the_server_has_ended(visit):
    with served_session(failing_session(leave)) as server:
        visitor = visit(server.address, may_log_errors=True)
        visitor.until_step(lambda step: True)
        server.session.submit(Add(BOX)).result(10)
        alert = visitor.page.get_by_role("alert")
        alert.get_by_text("Tracking has ended because of an error").wait_for()
        visitor.page.locator("[data-playing=failed]").wait_for()
    visitor.page.get_by_role("button", name="Try now").wait_for()
    assert "Tracking has ended because of an error" in alert.inner_text()
    assert "SystemExit: out of the thread" in alert.inner_text()


def test_a_recording_that_ends_early_is_shown_with_its_reason(visit, tmp_path):
    recordings = Recordings(tmp_path)
    with served_session(failing_session(lambda frame: None, recordings)) as server:
        visitor = visit(server.address)
        visitor.until_step(lambda step: True)
        server.session.submit(Add(BOX)).result(10)
        visitor.page.get_by_role("button", name="Record").click()
        visitor.until_step(lambda step: step["recording"])
        recorded = visitor.state()["step"]["number"]
        visitor.until_step(lambda step: step["number"] > recorded + 5)
        server.session._feed.resize((240, 180))
        visitor.until_step(lambda step: step["size"] == [240, 180] and not step["recording"])
        reason = "the frame size changed from 160x120 to 240x180 pixels"
        visitor.page.locator(".recordings .problem", has_text=reason).wait_for()
        visitor.page.get_by_role("log").get_by_text(reason).wait_for()
        visitor.page.get_by_role("link", name="cvat.xml").wait_for()
        visitor.page.get_by_role("button", name="Record", exact=True).wait_for()
        visitor.leave()
