"""The memory of further templates: which are kept, when they are used, and around every tracker."""

import copy

import numpy as np
import pytest

import ssiam
from helpers.lookalikes import nanotrack_tracker
from helpers.marker_trackers import siamfc_tracker, siammask_tracker, siamrpn_tracker
from helpers.synthetic import generator, world
from helpers.tracker_loops import BOX, LoopTests, marker_frame
from ssiam import FrameView
from ssiam.errors import ArgumentError
from ssiam.geometry import iou
from ssiam.trackers.opencv import OpenCvTracker
from ssiam.trackers.template_memory import (
    MemoryParameters,
    TemplateMemoryTracker,
    diversity,
    inner_product,
    selected_slot,
)

EAGER = MemoryParameters(interval=1, min_score=0.5, search_below=1.0, margin=0.0)


def unit(*values):
    return np.array(values) / np.linalg.norm(values)


class TestSelection:
    first, second, third = unit(1, 0, 0), unit(1, 1, 0), unit(1, 0, 1)

    def slot(self, feature, features=None, capacity=3):
        features = features or [self.first, self.second, self.third]
        return selected_slot(features, feature, capacity, min_novelty=0.1)

    def test_a_feature_that_raises_the_determinant_replaces_the_most_redundant_one(self):
        assert self.slot(unit(0, 1, 0)) == 1
        assert self.slot(unit(0, 0, 1)) == 2

    def test_a_feature_that_lowers_the_determinant_is_refused(self):
        assert self.slot(unit(1, 0.5, 0)) is None

    def test_the_same_features_are_refused(self):
        assert self.slot(self.second) is None

    def test_the_first_feature_is_never_replaced(self):
        features = [unit(1, 1, 1), unit(1, 0, 0), unit(0, 1, 0)]
        without_first = np.linalg.det(np.stack([unit(0, 0, 1), *features[1:]]))
        with_first = np.linalg.det(np.stack(features))
        assert abs(without_first) > abs(with_first)
        assert self.slot(unit(0, 0, 1), features) is None

    def test_a_memory_with_space_takes_what_is_new_and_nothing_else(self):
        assert self.slot(unit(0, 1, 0), [self.first], capacity=2) == 1
        assert self.slot(unit(1, 0.2, 0), [self.first], capacity=2) is None

    def test_a_memory_of_one_template_keeps_it(self):
        assert self.slot(unit(0, 1, 0), [self.first], capacity=1) is None


def test_features_of_any_length_have_an_inner_product():
    for length in (3, 40_000):
        one, other = np.random.default_rng(length).normal(size=(2, length))
        assert inner_product(one, other) == pytest.approx(float(one @ other), rel=1e-12)


def test_diversity_is_one_minus_the_mean_similarity():
    assert diversity([]) == diversity([unit(1, 0)]) == 0
    assert diversity([unit(1, 0), unit(0, 1)]) == pytest.approx(1)
    assert diversity([unit(1, 0), unit(1, 0), unit(0, 1)]) == pytest.approx(2 / 3)


def changing_target(last=(2, 2), before=10, change=40, after=30):
    """Frames (240, 320, 3) of a target whose texture changes gradually, and its boxes.

    `last` is the seed of the last texture, and the side of its blocks; the first has 1 and 8 px.
    """
    scene = world(5, (320, 240)) * 0.6 + 50
    first, last = (
        np.kron(
            generator(seed).integers(0, 256, (56 // side, -(-44 // side), 3)),
            np.ones((side, side, 1)),
        )[:, :44]
        for seed, side in ((1, 8), last)
    )
    frames, boxes = [], []
    for t in range(before + change + after):
        share = np.clip((t - before) / change, 0, 1)
        x, y = round(120 - 60 * np.cos(t / 20)), round(80 + 30 * np.sin(t / 15))
        frame = scene.copy()
        frame[y : y + 56, x : x + 44] = (1 - share) * first + share * last
        frames.append(np.clip(frame, 0, 255).astype(np.uint8))
        boxes.append((x, y, 44, 56))
    return frames, np.array(boxes, float)


def tracked(tracker, frames, box):
    tracker.init(frames[0], box)
    return [tracker.update(frame) for frame in frames[1:]]


@pytest.mark.parametrize("stabilize", ["off", "predict"])
def test_a_target_that_changes_its_appearance_keeps_a_high_score(stabilize):
    frames, boxes = changing_target()
    plain, memory = (
        tracked(ssiam.load_tracker(stabilize=stabilize, template_memory=on), frames, boxes[0])
        for on in (False, True)
    )
    last = slice(-20, None)
    assert np.mean([track.score for track in plain[last]]) < 0.8
    assert np.mean([track.score for track in memory[last]]) > 0.9
    overlap = iou(np.array([track.box for track in memory]), boxes[1:])
    assert overlap[last].min() > 0.6
    assert not any(track.lost for track in memory)


def test_templates_are_taken_while_the_appearance_changes():
    frames, boxes = changing_target()
    tracker = ssiam.load_tracker(stabilize="off", template_memory=True)._tracker
    tracker.init(FrameView(frames[0]), tuple(boxes[0]))
    counts = [tracker.template_count]
    for frame in frames[1:]:
        tracker.update(FrameView(frame))
        counts.append(tracker.template_count)
    assert counts[0] == (1, 0)
    assert counts[-1] == (5, 2)
    long_term = [count for count, _ in counts]
    assert long_term == sorted(long_term)
    assert max(count for _, count in counts) == 2


def test_a_confident_tracker_is_not_changed():
    """A second template searches only if the first one's score is low."""
    frames, boxes = changing_target(last=(1, 8))
    plain, memory = (
        tracked(ssiam.load_tracker(stabilize="off", template_memory=on), frames[:30], boxes[0])
        for on in (False, True)
    )
    assert min(track.score for track in plain) > 0.8
    assert [track.box for track in memory] == [track.box for track in plain]


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
@pytest.mark.parametrize("stabilize", ["off", "paper", "predict"])
def test_a_copy_is_independent_and_continues_equally(copied, stabilize):
    frames, boxes = changing_target(before=2, change=20, after=5)
    tracker = ssiam.load_tracker(stabilize=stabilize, template_memory=True)
    tracked(tracker, frames[:15], boxes[0])
    twin = copied(tracker)
    expected = [tracker.update(frame).box for frame in frames[15:]]
    assert [twin.update(frame).box for frame in frames[15:]] == expected


def test_results_repeat_and_a_clone_starts_empty():
    frames, boxes = changing_target(before=2, change=20, after=5)
    tracker = ssiam.load_tracker(template_memory=True)
    found = [track.box for track in tracked(tracker, frames, boxes[0])]
    cloned = tracker.clone()
    assert [track.box for track in tracked(cloned, frames, boxes[0])] == found
    assert [track.box for track in tracked(tracker, frames, boxes[0])] == found


def test_a_search_elsewhere_takes_no_template():
    frames, boxes = changing_target()
    memory = ssiam.load_tracker(stabilize="off", template_memory=True)._tracker
    memory.init(FrameView(frames[0]), tuple(boxes[0]))
    for frame, box in zip(frames[1:], boxes[1:], strict=True):
        memory.seek(FrameView(frame), tuple(box))
    assert memory.template_count == (1, 0)


def test_a_lost_target_drops_the_short_term_templates():
    frames, boxes = changing_target()
    memory = ssiam.load_tracker(stabilize="off", template_memory=True)._tracker
    memory.init(FrameView(frames[0]), tuple(boxes[0]))
    for frame in frames[1:25]:
        memory.update(FrameView(frame))
    assert memory.template_count[1] == 2
    empty = FrameView(np.full_like(frames[0], 127))
    assert memory.update(empty).score < 0.25
    assert memory.template_count[1] == 0


@pytest.mark.parametrize("name", ["csrt", "mil"])
def test_a_tracker_that_cannot_seek_is_refused(name):
    with pytest.raises(ArgumentError, match=f"^tracker {name} cannot search around"):
        ssiam.load_tracker(name, template_memory=True)
    with pytest.raises(ArgumentError, match="cannot search around a given box"):
        TemplateMemoryTracker(OpenCvTracker(name))


@pytest.mark.parametrize("name", ["csrt", "kcf", "mil"])
def test_trackers_without_a_score_map_have_no_distractors(name):
    with pytest.raises(ArgumentError, match=f"^tracker {name} has no score map"):
        ssiam.load_tracker(name, distractors=True)
    ssiam.load_tracker(name, distractors=False)


class MemoryLoopTests(LoopTests):
    """A loop in which a second template searches in every frame."""

    def plain(self):
        raise NotImplementedError

    def tracker(self):
        return TemplateMemoryTracker(self.plain(), EAGER)

    def test_templates_are_taken(self):
        tracker, frames = self.started()
        for frame in frames[1:]:
            tracker.update(FrameView(frame))
        assert tracker.template_count[1] == EAGER.short_term

    def test_its_similarity_is_highest_on_the_target(self):
        tracker, frames = self.started()
        view = FrameView(frames[0])
        assert tracker.similarity(view, BOX) == pytest.approx(1)
        assert tracker.similarity(view, (20.0, 20.0, 40.0, 40.0)) < 0.5

    def test_properties_are_those_of_the_tracker(self):
        plain, tracker = self.plain(), self.tracker()
        for name in ("can_seek", "reseek_below", "center_inset"):
            assert getattr(tracker, name) == getattr(plain, name)

    def test_nothing_is_known_without_a_target(self):
        with pytest.raises(ArgumentError, match="no target yet"):
            self.tracker().similarity(FrameView(marker_frame(BOX)), BOX)


class TestSiamFc(MemoryLoopTests):
    def plain(self):
        return siamfc_tracker()


class TestSiamRpn(MemoryLoopTests):
    def plain(self):
        return siamrpn_tracker()


class TestSiamMask(MemoryLoopTests):
    def plain(self):
        return siammask_tracker()


def test_nanotrack_has_features():
    frames = [marker_frame(BOX)] * 4
    memory = TemplateMemoryTracker(nanotrack_tracker(), EAGER)
    memory.init(FrameView(frames[0]), BOX)
    for frame in frames[1:]:
        memory.update(FrameView(frame))
    assert memory.similarity(FrameView(frames[0]), BOX) == pytest.approx(1)
