"""Every Siamese tracker with the handling of distractors on and off, beside a look-alike."""

import copy

import numpy as np
import pytest

import ssiam
from helpers.lookalikes import CONFUSED, LEFT, RIGHT, SIDE, TRACKERS, confusing_frames, frame_with
from helpers.marker_trackers import siamfc_tracker, siammask_tracker, siamrpn_tracker
from helpers.stub_networks import Stub, kernels
from helpers.synthetic import golden_video
from helpers.tracker_loops import LoopTests, center_distance
from ssiam import FrameView
from ssiam.runtime import loading
from ssiam.trackers.distractors import DistractorTracker
from ssiam.trackers.siamese import TargetState
from ssiam.trackers.template_memory import TemplateMemoryTracker

TARGET, LOOK_ALIKE = (*LEFT, SIDE, SIDE), (*RIGHT, SIDE, SIDE)


def boxes_of(tracker, frames):
    tracker.init(FrameView(frames[0]), TARGET)
    return [tracker.update(FrameView(frame)).box for frame in frames[1:]]


@pytest.mark.parametrize("name", TRACKERS)
def test_a_look_alike_with_a_higher_score_for_a_moment_is_excluded(name):
    frames = confusing_frames()
    without = boxes_of(TRACKERS[name](), frames)
    assert center_distance(without[CONFUSED[-1] - 1], LOOK_ALIKE) < 15
    for box in boxes_of(TRACKERS[name](distractors=True), frames):
        assert center_distance(box, TARGET) < 15


@pytest.mark.parametrize("name", TRACKERS)
def test_without_a_look_alike_nothing_changes(name):
    frames = [frame_with((LEFT[0] + 3 * t, LEFT[1], 0.8)) for t in range(8)]
    without, with_distractors = (
        boxes_of(TRACKERS[name](distractors), frames) for distractors in (False, True)
    )
    assert without == with_distractors


@pytest.mark.parametrize("name", TRACKERS)
def test_a_search_elsewhere_forgets_the_distractors(name):
    frames = confusing_frames()
    tracker = TRACKERS[name](distractors=True)
    boxes_of(tracker, frames[: CONFUSED[0]])
    track = tracker.seek(FrameView(frames[CONFUSED[0]]), LOOK_ALIKE)
    assert center_distance(track.box, LOOK_ALIKE) < 15


@pytest.mark.parametrize("name", TRACKERS)
def test_clones_and_copies_do_not_share_distractors(name):
    frames = confusing_frames()
    tracker = TRACKERS[name](distractors=True)
    boxes_of(tracker, frames[:6])
    copied, cloned = copy.deepcopy(tracker), tracker.clone()
    expected = [tracker.update(FrameView(frame)).box for frame in frames[6:]]
    assert [copied.update(FrameView(frame)).box for frame in frames[6:]] == expected
    assert boxes_of(cloned, frames)[5:] == expected


@pytest.mark.parametrize("on", [False, True])
@pytest.mark.parametrize("name", ["siamfc", "siamrpn_alex_dwxcorr", "siammask_e", "siammask_vot"])
def test_the_option_reaches_trackers_from_checkpoints(monkeypatch, tmp_path, name, on):
    pieces = dict.fromkeys(("template", "search", "refine"), Stub(kernels))
    monkeypatch.setattr(loading, "load_pieces", lambda *arguments: pieces)
    tracker = ssiam.load_tracker(name, weights=tmp_path, distractors=on, template_memory=on)
    view_tracker = tracker._tracker
    assert isinstance(view_tracker, TemplateMemoryTracker) == on
    assert (view_tracker._tracker if on else view_tracker)._has_distractors == on


@pytest.mark.parametrize("version", ["v1", "v2", "v3"])
def test_nanotrack_with_all_options_repeats_and_can_be_copied(shared, version):
    weights = shared(f"data/weights/nanotrack{version}")
    frames, box = golden_video("A", 10)
    tracker = ssiam.load_tracker(
        f"nanotrack_{version}", weights=weights, template_memory=True, distractors=True
    )
    clone = tracker.clone()
    for each in (tracker, clone):
        each.init(frames[0], box)
        for frame in frames[1:6]:
            each.update(frame)
    tracks = [
        [each.update(frame) for frame in frames[6:]]
        for each in (copy.deepcopy(tracker), tracker, clone)
    ]
    expected, *others = ([track.box for track in found] for found in tracks)
    assert others == [expected, expected]
    assert not any(track.lost for track in tracks[0])


def test_lite_has_the_handling_of_distractors_unless_it_is_switched_off():
    assert ssiam.load_tracker()._tracker._has_distractors
    assert not ssiam.load_tracker(distractors=False)._tracker._has_distractors


class TestSiamFc(LoopTests):
    def tracker(self):
        return siamfc_tracker(distractors=True)


class TestSiamRpn(LoopTests):
    def tracker(self):
        return siamrpn_tracker(distractors=True)


class TestSiamMask(LoopTests):
    def tracker(self):
        return siammask_tracker(distractors=True)


def test_peaks_are_found_over_all_anchors():
    """A look-alike may match another anchor's shape than the target."""
    x, y = (grid.ravel() for grid in np.meshgrid(*[np.arange(9) * 10.0] * 2))
    positions = np.tile(np.stack([x, y], axis=-1), (2, 1))
    target, other = 9 * 4 + 2, 81 + 9 * 4 + 7
    score = np.zeros(162)
    score[target], score[other] = 0.8, 0.4
    score[other - 81 - 1] = 0.3  # beside the other object, in the first anchor
    last = TargetState((20.0, 40.0), (20.0, 20.0))
    tracker = DistractorTracker()
    for _ in range(4):
        candidates = tracker.detect(positions, score, last, anchors=2)
        assert candidates.peaks == [target, other]
        tracker.update(candidates, target)
    candidates = tracker.detect(positions, score, last, anchors=2)
    assert np.flatnonzero(candidates.is_distractor).tolist() == [other - 81, other]
    assert candidates.allowed_score[other] == -1
    assert candidates.allowed_score[target] == 0.8
