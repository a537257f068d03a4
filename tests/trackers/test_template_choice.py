"""The template memory around a tracker whose scores, boxes and features are given."""

from dataclasses import replace

import numpy as np
import pytest

from ssiam import FrameView
from ssiam.errors import ArgumentError
from ssiam.track import Track
from ssiam.trackers.template_memory import (
    PARAMETERS,
    MemoryParameters,
    TemplateMemoryTracker,
    beside,
    diversity,
    relative_feature,
    selected_slot,
)

VIEW = FrameView(np.zeros((240, 320, 3), np.uint8))
BOX = (100.0, 80.0, 40.0, 40.0)
FAR = (200.0, 80.0, 40.0, 40.0)


class Given:
    """A tracker of which everything is given; `log` has all calls of it and of its clones."""

    can_seek, reseek_below, center_inset = True, 0.2, 0.5

    def __init__(self, features, log=None):
        self.features, self.log = features, [] if log is None else log
        self.tracks, self.sought = [], []

    def clone(self):
        cloned = Given(self.features, self.log)
        cloned.sought = self.sought
        return cloned

    def init(self, view, xywh):
        self.box = xywh
        self.log.append(("init", xywh))

    def template_feature(self):
        return np.array(self.features.get(self.box, (0.0, 0, 0)), float)

    def update(self, view):
        self.log.append(("track",))
        return self.tracks.pop(0)

    def seek(self, view, xywh):
        self.log.append(("seek", self.box, xywh))
        return self.sought.pop(0)


def box(number):
    return 100.0 + number, 80.0, 40.0, 40.0


# The surroundings are 0, so these are the templates' features; number 1 is like the first one.
FEATURES = {
    BOX: (1.0, 0, 0),
    box(1): (1.0, 0, 0),
    box(2): (1.0, 1, 0),
    box(3): (1.0, 0, 1),
    box(4): (0.1, 1, 0),
    box(5): (0.0, 0, 1),
    FAR: (0.0, 1, 0),
}


def memory(tracks, sought=(), features=FEATURES, **parameters):
    """A memory after the given tracks, and its tracker."""
    tracker = Given(features)
    made = TemplateMemoryTracker(tracker, replace(PARAMETERS, **parameters))
    made.init(VIEW, BOX)
    tracker.tracks, tracker.sought = list(tracks), list(sought)
    tracker.log.clear()
    return made, tracker


def run(tracks, sought=(), **parameters):
    made, tracker = memory(tracks, sought, **parameters)
    found = [made.update(VIEW) for _ in tracks]
    return made, tracker, found


QUICK = {"interval": 1, "min_novelty": 0.0}


def test_the_default_parameters():
    assert MemoryParameters(5, 2, 10, 0.8, 0.8, 0.1, 0.3, 0.1, 0.6, 0.25, 0.5) == PARAMETERS


def test_the_surroundings_are_beside_the_target():
    assert beside((100.0, 80.0, 20.0, 30.0)) == [
        (130.0, 80.0, 20.0, 30.0),
        (70.0, 80.0, 20.0, 30.0),
        (100.0, 125.0, 20.0, 30.0),
        (100.0, 35.0, 20.0, 30.0),
    ]


def test_features_are_relative_to_the_surroundings():
    np.testing.assert_allclose(relative_feature(np.array([4.0, 5]), np.array([1.0, 1])), [0.6, 0.8])
    np.testing.assert_array_equal(relative_feature(np.ones(2), np.ones(2)), [0, 0])
    tiny = np.array([2e-9, 0])
    np.testing.assert_allclose(relative_feature(tiny, np.zeros(2)), [1, 0])
    np.testing.assert_array_equal(relative_feature(tiny / 3, np.zeros(2)), [0, 0])


def test_the_mean_of_the_surroundings_is_subtracted():
    features = {BOX: (5.0, 1, 0), (160.0, 80.0, 40.0, 40.0): (4.0, 0, 0)}
    made, _ = memory([], features=features)
    np.testing.assert_allclose(made._target.surroundings, [1, 0, 0])
    np.testing.assert_allclose(made._target.first, np.array([4, 1, 0]) / np.sqrt(17))
    assert made.similarity(VIEW, BOX) == pytest.approx(1)
    assert made.similarity(VIEW, (0.0, 0.0, 9.0, 9.0)) == pytest.approx(-4 / np.sqrt(17))


def test_the_first_template_is_not_taken_twice():
    tracker = Given(FEATURES)
    TemplateMemoryTracker(tracker).init(VIEW, BOX)
    assert tracker.log[0] == ("init", BOX)
    assert [entry[1] for entry in tracker.log[1:]] == beside(BOX)


def test_templates_are_taken_at_intervals():
    tracks = [Track(box(n % 3 + 1), 0.9) for n in range(9)]
    for interval, taken in ((1, 9), (3, 3), (4, 2), (10, 0)):
        _, tracker, _ = run(tracks, interval=interval)
        assert len([each for each in tracker.log if each[0] == "init"]) == taken


@pytest.mark.parametrize(("score", "taken"), [(0.8, True), (0.79, False)])
def test_templates_need_a_score(score, taken):
    made, _, _ = run([Track(box(2), score)], interval=1, search_below=0.0)
    assert made.template_count == ((2, 1) if taken else (1, 0))


def test_a_low_score_does_not_restart_the_interval():
    tracks = [Track(box(2), 0.5), Track(box(2), 0.5), Track(box(2), 0.9), Track(box(3), 0.9)]
    made, _, _ = run(tracks, interval=3, search_below=0.0)
    assert made.template_count == (2, 1)


def test_the_newest_short_term_templates_are_kept():
    tracks = [Track(box(n), 0.9) for n in (1, 2, 3)]
    made, _, _ = run(tracks, **QUICK)
    assert [each.tracker.tracker.box for each in made._target.short_term] == [box(2), box(3)]


@pytest.mark.parametrize(("limit", "count"), [(0.3, 2), (0.29, 1)])
def test_short_term_templates_that_differ_are_dropped(limit, count):
    """The features of 1 and 2 have a similarity of .707."""
    tracks = [Track(box(n), 0.9) for n in (1, 2)]
    made, _, _ = run(tracks, max_diversity=limit, **QUICK)
    assert [each.tracker.tracker.box for each in made._target.short_term][-count:] == [
        *([box(1)] * (count - 1)),
        box(2),
    ]
    assert made.template_count[1] == count


@pytest.mark.parametrize(("score", "count"), [(0.25, 1), (0.249, 0)])
def test_a_low_score_drops_the_short_term_templates(score, count):
    made, _, _ = run([Track(box(2), 0.9), Track(box(2), score)], search_below=0.0, **QUICK)
    assert made.template_count == (2, count)


@pytest.mark.parametrize(("minimum", "count"), [(0.099, 2), (0.1, 1)])
def test_long_term_templates_are_similar_to_the_first(minimum, count):
    """Number 4 has a similarity of .0995 to it."""
    made, _, _ = run([Track(box(4), 0.9)], min_similarity=minimum, **QUICK)
    assert made.template_count == (count, 1)


def test_the_similarity_is_lower_while_the_appearance_changes():
    """The diversity of the short-term templates 2 and 4 is .226, and 4 is similar by .0995."""
    tracks = [Track(box(2), 0.9), Track(box(4), 0.9)]
    for limit, count in ((0.12, 3), (0.14, 2)):
        made, _, _ = run(
            tracks, min_similarity=limit, max_diversity=1.0, min_novelty=-1.0, interval=1
        )
        assert made.template_count == (count, 2)


def test_a_long_term_template_is_replaced_in_its_place():
    tracks = [Track(box(n), 0.9) for n in (2, 3)]
    made, _, _ = run([*tracks, Track(box(5), 0.9)], long_term=3, min_similarity=-1.0, **QUICK)
    assert [each.tracker.tracker.box for each in made._target.long_term] == [box(2), box(5)]
    assert made.template_count[0] == 3
    assert made.similarity(VIEW, box(5)) == pytest.approx(1)


SAME = box(1), box(1)


def second(first, other, *, boxes=SAME, memory_of=(2,), **parameters):
    """The track if the first template and a further one have these scores, and the calls."""
    tracks = [Track(box(number), 0.95) for number in memory_of]
    made, tracker = memory([*tracks, Track(boxes[0], first)], **{**QUICK, **parameters})
    for _ in tracks:
        made.update(VIEW)
    tracker.log.clear()
    tracker.sought[:] = [Track(boxes[1], other)]
    return made.update(VIEW), tracker.log, made, tracker


@pytest.mark.parametrize(("first", "searched"), [(0.8, True), (0.81, False)])
def test_a_further_template_searches_if_the_score_is_not_high(first, searched):
    _, log, _, _ = second(first, 0.1)
    assert ("seek" in [each[0] for each in log]) is searched
    if searched:
        assert log[1] == ("seek", box(2), box(2))  # around the last box


@pytest.mark.parametrize(("other", "chosen"), [(0.625, True), (0.62, False)])
def test_a_further_box_needs_a_higher_score(other, chosen):
    track, _, made, _ = second(0.5, other, margin=0.125)
    assert track.score == (other if chosen else 0.5)
    assert made._target.tracker_is_elsewhere is chosen


def test_after_a_further_box_the_tracker_is_sent_to_it():
    _, _, made, tracker = second(0.5, 0.75, boxes=(box(1), box(3)))
    tracker.log.clear()
    tracker.sought[:] = [Track(box(1), 0.9)]
    assert made.update(VIEW).score == 0.9
    assert tracker.log[0] == ("seek", BOX, box(3))
    tracker.tracks = [Track(box(1), 0.9)]
    tracker.log.clear()
    made.update(VIEW)
    assert tracker.log[0] == ("track",)


def overlapping(share):
    """A box with this IoU with number 1."""
    x, y, w, h = box(1)
    return x + w * (1 - share) / (1 + share), y, w, h


@pytest.mark.parametrize(("share", "chosen"), [(0.51, True), (0.49, False)])
def test_a_box_on_another_object_must_be_similar(share, chosen):
    track, _, _, _ = second(0.5, 0.9, boxes=(box(1), overlapping(share)))
    assert (track.score == 0.9) is chosen


@pytest.mark.parametrize(
    ("feature", "first", "chosen"),
    [
        pytest.param((1.0, 0, 0), (0.0, 0, 1), True, id="similar"),
        pytest.param((0.31, 0, 0.95), (0.0, 0, 1), True, id="just similar"),
        pytest.param((0.28, 0, 0.96), (0.0, 0, 1), False, id="hardly similar"),
        pytest.param((0.6, 0, 0.8), (0.8, 0, 0.6), False, id="less similar than the first"),
        pytest.param((0.8, 0, 0.6), (0.6, 0, 0.8), True, id="more similar than the first"),
    ],
)
def test_the_similarity_of_another_object(feature, first, chosen):
    features = {**FEATURES, FAR: feature, box(9): first}
    track, _, _, _ = second(
        0.5, 0.9, boxes=(box(9), FAR), memory_of=(1,), features=features, min_novelty=-1.0
    )
    assert (track.score == 0.9) is chosen


def test_templates_search_in_turn():
    """The newest short-term template and the long-term ones."""
    tracks = [*[Track(box(n), 0.9) for n in (2, 3)], *[Track(box(1), 0.3)] * 4]
    made, tracker = memory(tracks, [Track(box(1), 0.0)] * 4, **QUICK)
    for _ in tracks:
        made.update(VIEW)
    searched = [each[1] for each in tracker.log if each[0] == "seek"]
    assert searched == [box(2), box(3), box(3), box(2)]


def test_seek_takes_no_template_and_remembers_its_box():
    made, tracker = memory([], [Track(box(3), 0.9)], **QUICK)
    assert made.seek(VIEW, FAR).box == box(3)
    assert tracker.log == [("seek", BOX, FAR)]
    assert made._target.xywh == box(3)
    assert made.template_count == (1, 0)


def test_a_template_that_cannot_be_started_is_left_out(monkeypatch):
    made, _ = memory([Track(box(2), 0.9), Track(box(3), 0.9)], **QUICK)
    started = Given.init

    def refusing(self, view, xywh):
        if xywh == box(2):
            raise ArgumentError("too thin")
        started(self, view, xywh)

    monkeypatch.setattr(Given, "init", refusing)
    made.update(VIEW)
    assert made.template_count == (1, 0)
    made.update(VIEW)
    assert made.template_count == (2, 1)


def test_a_clone_has_the_parameters_and_no_target():
    made, tracker = memory([])
    cloned = made.clone()
    assert cloned._parameters == made._parameters
    assert cloned._tracker is not tracker
    with pytest.raises(ArgumentError, match="no target yet"):
        cloned.update(VIEW)
    assert (made.can_seek, made.reseek_below, made.center_inset) == (True, 0.2, 0.5)


class WithoutFeatures:
    can_seek, reseek_below, center_inset = True, 0.0, 1.0

    def init(self, view, xywh):
        pass

    def update(self, view):
        raise NotImplementedError

    def seek(self, view, xywh):
        raise NotImplementedError

    def clone(self):
        return WithoutFeatures()


@pytest.mark.parametrize(
    ("xywh", "side"), [((40.0, 30.0, 16.0, 10.0), 16), ((40.0, 30.0, 9.4, 20.6), 21)]
)
def test_without_features_the_pixels_are_compared(xywh, side):
    frame = np.random.default_rng(1).integers(0, 256, (100, 120, 3)).astype(np.uint8)
    view = FrameView(frame)
    made = TemplateMemoryTracker(WithoutFeatures())
    x, y, w, h = xywh
    patch = view.crop_square((x + w / 2, y + h / 2), side, 16, np.zeros(3))
    found = made._feature(view, xywh)
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, patch.ravel())
    assert len(made._feature(view, (5.0, 5.0, 0.2, 0.3))) == 16 * 16 * 3


def test_the_slot_of_a_new_feature():
    first, same, other = np.eye(3)[0], np.array([0.8, 0.6, 0]), np.eye(3)[1]
    assert selected_slot([first], same, 2, 0.359) == 1
    assert selected_slot([first], same, 2, 0.361) is None
    assert selected_slot([first, same], other, 2, 0.0) == 1
    assert selected_slot([first, other], other, 2, 0.0) is None
    assert selected_slot([first, other], same, 3, -1.0) == 2
    assert selected_slot([first, other, same], np.eye(3)[2], 3, 0.0) in (1, 2)
    assert selected_slot([first], other, 1, 0.0) is None


def test_the_diversity_of_three_features():
    three = [np.eye(3)[0], np.array([0.8, 0.6, 0]), np.eye(3)[1]]
    assert diversity(three) == pytest.approx(1 - (0.8 + 0.6 + 0) / 3)
    assert diversity(three[:1]) == 0
