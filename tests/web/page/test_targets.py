"""Targets on the live page in a real browser, on real sessions."""

from __future__ import annotations

import pytest

from helpers.walking_clip import HIDDEN, distance

NEAR = 5  # pixels


def center_errors(visitor, who, truth, until):
    """Distances of the first box from the truth, by frame, until a frame is shown."""
    errors = {}

    def is_done(state):
        index = state["step"]["index"]
        if state["boxes"] and (who != "walker" or index not in HIDDEN):
            errors[index] = distance(state["boxes"][0]["box"], truth[who][index])
        return index >= until

    visitor.until(is_done)
    return errors


def test_a_drawn_target_is_tracked(visitor, truth):
    target = visitor.draw_target(truth["walker"][0])
    visitor.resume()
    errors = center_errors(visitor, "walker", truth, 25)
    assert len(errors) >= 5
    assert max(errors.values()) < NEAR
    x, y, _, h = truth["walker"][visitor.pause()["index"]]
    assert visitor.has_color(target["colour"], (x - NEAR, y + h / 2, 2 * NEAR, 4))


def test_the_frame_is_frozen_while_a_box_is_drawn(visitor, truth):
    visitor.resume()
    x, y, _, _ = truth["stander"][visitor.state()["step"]["index"]]
    visitor.press((x, y))
    frozen = visitor.until(lambda state: state["frozen"])["step"]
    x, y, w, h = truth["stander"][frozen["index"]]
    visitor.page.wait_for_timeout(1500)
    assert visitor.state()["step"]["number"] == frozen["number"]
    visitor.release((x + w, y + h))
    step = visitor.until_step(lambda step: step["targets"])
    assert step["index"] > frozen["index"]
    # The box is where the target is now, not where it was drawn.
    errors = center_errors(visitor, "stander", truth, step["index"] + 10)
    assert max(errors.values()) < 2 * NEAR


def test_a_target_is_lost_and_redetected(visitor, truth):
    visitor.draw_target(truth["walker"][0])
    visitor.resume()
    visitor.until_step(lambda step: step["index"] >= HIDDEN.start - 25)
    visitor.pause()
    lost = visitor.advance(lambda state: state["step"]["targets"][0]["lost"])
    assert lost["boxes"] == []
    visitor.page.locator(".state", has_text="LOST").wait_for()
    found = visitor.advance(lambda state: state["boxes"])["step"]["index"]
    assert found >= HIDDEN.start
    visitor.page.locator(".state", has_text="FOUND").wait_for()
    visitor.resume()
    visitor.page.locator(".state", has_text="tracking").wait_for()
    errors = center_errors(visitor, "walker", truth, HIDDEN.stop + 20)
    assert errors[max(errors)] < NEAR


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
    visitor.until(lambda state: [box["name"] for box in state["boxes"]] == ["e 1 ?. r"])
    visitor.page.get_by_role("button", name="Remove e 1 ?. r").click()
    visitor.until(lambda state: not state["step"]["targets"])


def test_a_box_in_the_stabilized_view_is_mapped_to_the_raw_frame(visitor, truth):
    visitor.resume()
    visitor.until_step(lambda step: step["index"] >= 12)
    step = visitor.pause()
    visitor.page.keyboard.press("s")
    visitor.until(lambda state: len(state["step"]["pictures"]) == 2)
    (a, b, c), (d, e, f) = step["stab_from_raw"]
    x, y, w, h = truth["stander"][step["index"]]
    assert abs(c) + abs(f) > 1, "the stabilized view equals the raw one"
    zoom = (a * e - b * d) ** 0.5
    x, y, w, h = (
        a * (x + w / 2) + b * (y + h / 2) + c - w * zoom / 2,
        d * (x + w / 2) + e * (y + h / 2) + f - h * zoom / 2,
        w * zoom,
        h * zoom,
    )
    target = visitor.draw_target((x, y, w, h), "steadied")
    assert target["box"] == pytest.approx(truth["stander"][step["index"]], abs=1.5)
    color = target["colour"]
    assert visitor.has_color(color, (x - 3, y + h / 2, 6, 4), "steadied")


def test_the_first_target_is_held_in_the_middle_of_the_second_view(visitor, truth):
    target = visitor.draw_target(truth["stander"][0])
    visitor.page.get_by_label("Hold the first target in the middle").check()
    visitor.resume()
    step = visitor.until_step(lambda step: step["camera"] == "locked" and step["index"] >= 20)
    assert visitor.page.get_by_label("Raw and stabilized side by side").is_checked()
    visitor.page.locator("figcaption", has_text="locked").wait_for()
    step = visitor.pause()
    (a, b, c), (d, e, f) = step["stab_from_raw"]
    x, y, w, h = step["targets"][0]["box"]
    held = a * (x + w / 2) + b * (y + h / 2) + c, d * (x + w / 2) + e * (y + h / 2) + f
    assert held == pytest.approx((160, 120), abs=30)
    assert step["targets"][0]["id"] == target["id"]
    visitor.page.keyboard.press("l")
    visitor.resume()
    visitor.until_step(lambda step: step["camera"] == "stabilized")


NO_BOXES = [
    # name, mouse moves relative to the press; None: Escape
    ("a click", [(0, 0)]),
    ("a line", [(40, 2)]),
    ("a cancelled box", [(40, 30), None]),
]


@pytest.mark.parametrize(("name", "moves"), NO_BOXES, ids=lambda value: str(value)[:16])
def test_nothing_is_added_by(visitor, name, moves):
    visitor.resume()
    visitor.press((100, 100))
    for move in moves:
        if move is None:
            visitor.page.keyboard.press("Escape")
            visitor.until(lambda state: not state["frozen"])
        else:
            visitor.page.mouse.move(*visitor.to_client((100 + move[0], 100 + move[1])))
    visitor.page.mouse.up()
    number = visitor.until(lambda state: not state["frozen"])["step"]["number"]
    assert visitor.until_step(lambda step: step["number"] > number + 3)["targets"] == []
    assert visitor.page.locator(".toast").count() == (None not in moves)
