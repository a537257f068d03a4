"""The checks of `ssiam.testing`: the package's trackers pass, and each check finds its fault."""

import copy
import itertools
from dataclasses import replace
from typing import ClassVar

import cv2
import numpy as np
import pytest

import ssiam
from ssiam.cli import main
from ssiam.errors import ArgumentError, ContractError
from ssiam.testing import CHECKS, run_checks
from ssiam.trackers.base import CompleteTracker
from ssiam.trackers.opencv import OpenCvTracker
from ssiam.trackers.responses import Response

CANDIDATES = "the best candidate is the result of update"
SIDE = 40


class Sound:
    """Normalized cross-correlation."""

    def init(self, view, xywh):
        self.xywh = xywh
        self.template = view.crop(xywh, (SIDE, SIDE)).image

    def update(self, view):
        return self.seek(view, self.xywh)

    def seek(self, view, xywh):
        x, y, w, h = xywh
        crop = view.crop((x - w, y - h, 3 * w, 3 * h), (3 * SIDE, 3 * SIDE))
        scores = cv2.matchTemplate(crop.image, self.template, cv2.TM_CCOEFF_NORMED)
        scores[~np.isfinite(scores)] = 0
        _, score, _, (left, top) = cv2.minMaxLoc(scores)
        self.xywh = crop.box_in_view((left, top, SIDE, SIDE))
        return ssiam.Track(self.xywh, score=min(max(score, 0.0), 1.0))


class Lists(CompleteTracker):
    """Has the boxes around its last one as candidates; the pixels in one of them are its own."""

    has_responses = True

    def __init__(self):
        self.sound = Sound()

    def init(self, view, xywh):
        self.sound.init(view, xywh)

    def update(self, view):
        response = self.respond(view)
        return self.accept(view, response, response.best)

    def seek(self, view, xywh):
        self.move_to(xywh)
        return self.update(view)

    def clone(self):
        return type(self)()

    def respond(self, view):
        x, y, w, h = copy.deepcopy(self.sound).update(view).box
        boxes = np.array([[x + w / 2, y + h / 2, w, h], [x, y, w, h]]).T
        score = np.array([0.9, 0.1])
        return Response(boxes, score, score, lambda: [score > 0.5], None)

    def accept(self, view, response, index):
        self.sound.xywh = response.xywh(index)
        return ssiam.Track(self.sound.xywh, float(response.score[index]))

    def move_to(self, xywh):
        self.sound.xywh = xywh


class UpdatesOtherwise(Lists):
    def update(self, view):
        return self.sound.update(view)


class RespondsWithChanges(Lists):
    def respond(self, view):
        x, y, w, h = self.sound.xywh
        self.sound.xywh = x + w, y, w, h
        return super().respond(view)


class HasBoxesOfCorners(Lists):
    def respond(self, view):
        response = super().respond(view)
        w, h = response.boxes[2:]
        return replace(response, boxes=response.boxes - np.array([w / 2, h / 2, 0 * w, 0 * h]))

    def accept(self, view, response, index):
        x, y, w, h = response.xywh(index)
        self.sound.xywh = x + w / 2, y + h / 2, w, h
        return ssiam.Track(self.sound.xywh, float(response.score[index]))


class MovesNowhere(Lists):
    def move_to(self, xywh):
        self.sound.xywh = (0.0, 0.0, *xywh[2:])


class GivesNothing(Sound):
    def update(self, view):
        super().update(view)


class GivesAWrongMask(Sound):
    def update(self, view):
        return super().update(view).with_changes(mask=np.zeros((2, 2), bool))


class Stays(Sound):
    def update(self, view):
        return ssiam.Track(self.xywh)


class ReadsTheRawFrame(Sound):
    def init(self, view, xywh):
        super().init(ssiam.FrameView(view.raw), self.raw(view, xywh))

    def update(self, view):
        return super().update(ssiam.FrameView(view.raw))

    def seek(self, view, xywh):
        return super().seek(ssiam.FrameView(view.raw), xywh)

    def raw(self, view, xywh):
        return ssiam.geometry.map_box(view.raw_from_stab, xywh)


class WritesToTheFrame(Sound):
    def update(self, view):
        view.raw[:8, :8] = 255
        return super().update(view)


class IsRandom(Sound):
    counter = itertools.count()

    def update(self, view):
        track = super().update(view)
        return track.with_changes(score=track.score / (1 + next(self.counter) % 7))


class KeepsTheFirstTarget(Sound):
    def init(self, view, xywh):
        if not hasattr(self, "template"):
            super().init(view, xywh)
        self.xywh = xywh


class BreaksOutside(Sound):
    def update(self, view):
        track = super().update(view)
        assert max(track.box) < 400, "outside"
        return track


class NeedsSize(Sound):
    def init(self, view, xywh):
        self.side = 8 // int(xywh[2] // 4)
        super().init(view, xywh)


class NeedsLargeFrames(Sound):
    def init(self, view, xywh):
        assert view.size_wh[0] > 64
        super().init(view, xywh)


class NeedsContent(Sound):
    def update(self, view):
        track = super().update(view)
        return track if view.raw.std() else track.with_changes(score=float("nan"))


class SeeksNowhere(Sound):
    def seek(self, view, xywh):
        return super().seek(view, self.xywh)


class Shares(Sound):
    shared: ClassVar = {}

    def update(self, view):
        self.shared["xywh"] = super().update(view).box
        return ssiam.Track(self.shared["xywh"], 1 / (1 + len(self.shared)))

    def init(self, view, xywh):
        super().init(view, xywh)
        self.shared[xywh] = 1


class Swallows(Sound):
    def update(self, view):
        try:
            return super().update(view)
        except Exception:
            return ssiam.Track(self.xywh, 0.0)


FAULTS = {
    "init and update give a valid Track": (GivesNothing, GivesAWrongMask),
    "the target is followed": (Stays,),
    "boxes are in pixels of the stabilized view": (ReadsTheRawFrame,),
    "every stabilization runs": (GivesNothing,),
    "frames are not written to": (WritesToTheFrame,),
    "results repeat": (IsRandom,),
    "init drops the earlier target": (KeepsTheFirstTarget,),
    "targets at the border and beyond": (BreaksOutside,),
    "tiny targets": (NeedsSize,),
    "tiny frames": (NeedsLargeFrames,),
    "frames of one color": (NeedsContent,),
    "seek finds the target near a given box": (SeeksNowhere,),
    CANDIDATES: (UpdatesOtherwise, RespondsWithChanges, HasBoxesOfCorners, MovesNowhere),
    "several trackers are independent": (Shares,),
    "exceptions are not swallowed": (Swallows,),
}


@pytest.mark.parametrize("check", CHECKS, ids=str)
def test_a_sound_tracker_passes(check):
    assert check(Lists)
    assert check(Sound) == (check.name != CANDIDATES)


@pytest.mark.parametrize("check", CHECKS, ids=str)
def test_each_check_finds_its_fault(check):
    for faulty in FAULTS[check.name]:
        with pytest.raises(ContractError) as raised:
            check(faulty)
        assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["kcf", "csrt"])
@pytest.mark.parametrize("check", CHECKS, ids=str)
def test_the_packages_trackers_without_weights_pass(check, name):
    applies = check(lambda: OpenCvTracker(name))
    has_seek = name == "kcf"
    assert applies == (check.name != CANDIDATES and ("seek" not in check.name or has_seek))


@pytest.mark.parametrize("name", ["nanotrack_v1", "nanotrack_v2", "nanotrack_v3", "fear_xs"])
def test_the_networks_with_weights_list_their_candidates(name, shared):
    weights = shared(f"data/weights/{name.replace('nanotrack_', 'nanotrack')}")
    tracker = ssiam.load_tracker(name, weights=weights)
    (check,) = (each for each in CHECKS if each.name == CANDIDATES)
    assert check(tracker.view_tracker.clone)


def test_a_tracker_may_refuse_a_first_box():
    class Refuses(Sound):
        def init(self, view, xywh):
            if min(xywh[2:]) < 20:
                raise ArgumentError("too small")
            super().init(view, xywh)

    assert not any(outcome.problem for outcome in run_checks(Refuses))


def test_a_tracker_that_cannot_be_made_fails_every_check():
    outcomes = list(run_checks(lambda: 1 / 0))
    assert {outcome.problem for outcome in outcomes} == {
        "the tracker cannot be made: ZeroDivisionError: division by zero"
    }
    assert len(outcomes) == len(CHECKS)


def test_the_command_prints_a_line_for_each_check(capsys, tmp_path, monkeypatch):
    (tmp_path / "others_faulty.py").write_text(
        "import ssiam\n\n\nclass Still:\n"
        "    def init(self, view, xywh):\n        self.xywh = xywh\n\n"
        "    def update(self, view):\n        return ssiam.Track(self.xywh, 0.5)\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    assert main(["check-tracker", "others_faulty:Still"]) == 1
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    assert len(lines) == len(CHECKS)
    assert lines[0] == "ok     init and update give a valid Track"
    assert lines[1].startswith("failed the target is followed: in frame ")
    assert "none   seek finds the target near a given box" in lines
    assert "ssiam: others_faulty:Still failed 3 of 15 checks" in captured.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["magic"], "unknown tracker 'magic'"),
        (["no_such_package:A"], "there is no module no_such_package"),
        (["nanotrack_v2", "--weights", "missing"], "missing"),
        (["kcf", "--threads", "0"], "threads"),
    ],
)
def test_the_command_refuses_in_one_line(arguments, message, capsys):
    assert main(["check-tracker", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err
    assert captured.err.count("\n") == 1
