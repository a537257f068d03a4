"""Targets on the live page in a real browser, on real sessions."""

from __future__ import annotations

import pytest

from helpers.walking_clip import HIDDEN, distance

NEAR = 5  # pixels


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
