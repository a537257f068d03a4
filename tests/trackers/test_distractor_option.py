"""Every Siamese tracker with the handling of distractors on and off, beside a look-alike."""

import copy

import numpy as np
import pytest

from helpers.lookalikes import CONFUSED, LEFT, RIGHT, SIDE, TRACKERS, confusing_frames, frame_with
from helpers.stub_networks import (
    Stub,
    kernels,
    marker_features,
    marker_maps,
    marker_refinement,
    marker_responses,
)
from helpers.tracker_loops import LoopTests, center_distance
from ssiam import FrameView
from ssiam.trackers import siammask, siamrpn
from ssiam.trackers.siamfc import SiamFc, SiamFcNetworks
from ssiam.trackers.siammask import SiamMask, SiamMaskNetworks
from ssiam.trackers.siamrpn import SiamRpn, SiamRpnNetworks

TARGET, LOOK_ALIKE = (*LEFT, SIDE, SIDE), (*RIGHT, SIDE, SIDE)


def boxes_of(tracker, frames):
    tracker.init(FrameView(frames[0]), TARGET)
    return [tracker.track(FrameView(frame)).box for frame in frames[1:]]


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
    expected = [tracker.track(FrameView(frame)).box for frame in frames[6:]]
    assert [copied.track(FrameView(frame)).box for frame in frames[6:]] == expected
    assert boxes_of(cloned, frames)[5:] == expected


class TestSiamFc(LoopTests):
    def tracker(self):
        networks = SiamFcNetworks(Stub(lambda t, crop: [crop]), marker_responses())
        return SiamFc(networks, distractors=True)


class TestSiamRpn(LoopTests):
    def tracker(self):
        parameters = siamrpn.PARAMETERS["siamrpn_r50_l234_dwxcorr"]
        return SiamRpn(SiamRpnNetworks(Stub(kernels), marker_maps()), parameters, distractors=True)


class TestSiamMask(LoopTests):
    def tracker(self):
        networks = SiamMaskNetworks(Stub(kernels), marker_features(), marker_refinement())
        parameters = siammask.PARAMETERS["siammask_r50_l3"]
        return SiamMask(networks, parameters, distractors=True)


def test_peaks_are_found_over_all_anchors():
    """A look-alike may match another anchor's shape than the target."""
    from ssiam.trackers.distractors import DistractorTracker
    from ssiam.trackers.siamese import TargetState

    x, y = (grid.ravel() for grid in np.meshgrid(*[np.arange(9) * 10.0] * 2))
    positions = np.tile(np.stack([x, y], axis=-1), (2, 1))
    target, other = 9 * 4 + 2, 81 + 9 * 4 + 7
    score = np.zeros(162)
    score[target], score[other] = 0.8, 0.4
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
