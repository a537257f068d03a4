"""Each step of the followers with a tracker that reports given tracks."""

import numpy as np
import pytest

from ssiam import FrameView, StabilizerConfig
from ssiam.errors import ArgumentError
from ssiam.geometry import map_box, rigid
from ssiam.motion import Motion
from ssiam.track import Track
from ssiam.trackers.followers import FrameStep, StabilizedFollower
from ssiam.trackers.lost import LossDetector
from ssiam.trackers.predictive_follower import PredictiveFollower

SIZE = (320, 240)
FRAME = np.zeros((240, 320, 3), np.uint8)
BOX = (100.0, 80.0, 40.0, 40.0)
FAR = (220.0, 160.0, 40.0, 40.0)
STILL = Motion.none(SIZE, reliable=True)
CUT = Motion.none(SIZE)
SHAKE = Motion.from_transform(rigid(9, -6, 0.02, (159.5, 119.5)), SIZE)


class GivenTracks:
    """`track` returns `found`; `seek` the first of `sought`, and notes where it searched."""

    can_seek, reseek_below = True, 0.0
    has_template_feature = has_responses = False

    def __init__(self, found=None, sought=()):
        self.found, self.sought = found or Track(BOX, 0.9), list(sought)
        self.views, self.searched = [], []

    def update(self, view):
        self.views.append(view)
        return self.found

    def seek(self, view, xywh):
        self.views.append(view)
        self.searched.append(xywh)
        return self.sought.pop(0)


def predictive(tracker, *, losses=0, find=True):
    """A follower; with `losses`, of a target that has been lost for so many frames."""
    loss = LossDetector()
    loss.frames_lost, loss.lost = losses, losses > 0
    if losses:
        loss._running = 0.0
    config = StabilizerConfig("predict").with_options(find=find)
    return PredictiveFollower(tracker, config, BOX, loss), loss


def shifted(sizes, box=BOX):
    x, y, w, h = box
    return x + sizes * w, y, w, h


def test_steps_tell_whether_their_motion_is_unknown():
    for motion, unknown in ((None, False), (STILL, False), (CUT, True)):
        assert FrameStep(motion, np.eye(3), BOX).is_motion_unknown is unknown
    assert FrameStep(None, np.eye(3), BOX).predicted_xywh is None


@pytest.mark.parametrize("method", ["off", "paper"])
def test_views_have_the_border_of_methods_that_move_frames(method):
    tracker = GivenTracks()
    config = StabilizerConfig(method).with_options(border=7)
    follower = StabilizedFollower(tracker, config, BOX, LossDetector())
    motion = None if method == "off" else STILL
    step = follower.advance(motion)
    assert step.search_xywh == BOX
    assert step.predicted_xywh is None
    follower.locate(FRAME, step)
    assert tracker.views[0].border == (0 if method == "off" else 7)


def test_stabilized_tracks_are_mapped_to_the_raw_frame():
    tracker = GivenTracks()
    config = StabilizerConfig("paper").with_options(gate=0)
    follower = StabilizedFollower(tracker, config, BOX, LossDetector())
    for _ in range(3):
        step = follower.advance(SHAKE)
        raw_from_stab = np.linalg.inv(step.stab_from_raw)
        assert step.motion is SHAKE
        assert step.search_xywh == pytest.approx(map_box(raw_from_stab, BOX))
        track = follower.locate(FRAME, step)
        assert track.box == pytest.approx(map_box(raw_from_stab, BOX))
        assert track.motion is SHAKE
        assert track.stab_from_raw is step.stab_from_raw
        assert not track.lost
    assert not np.allclose(step.stab_from_raw, np.eye(3), atol=1)
    tracker.found = Track(FAR, 0.0)
    for lost in (False, False, False, True):
        assert follower.locate(FRAME, step).lost is lost
    held = follower.hold(step)
    assert (held.box, held.score, held.lost) == (step.search_xywh, 0, True)
    assert (held.motion, held.stab_from_raw) == (SHAKE, step.stab_from_raw)
    moved = follower.advance(STILL)
    assert moved.search_xywh == pytest.approx(map_box(np.linalg.inv(moved.stab_from_raw), FAR))


def test_without_stabilization_tracks_have_no_motion():
    tracker = GivenTracks(Track(FAR, 0.0))
    follower = StabilizedFollower(tracker, StabilizerConfig("off"), BOX, LossDetector())
    for lost in (False, False, False, True):
        step = follower.advance(None)
        track = follower.locate(FRAME, step)
        assert (track.box, track.lost, track.motion, track.stab_from_raw) == (FAR, lost, None, None)
    held = follower.hold(follower.advance(None))
    assert (held.box, held.score, held.lost) == (FAR, 0, True)
    assert (held.motion, held.stab_from_raw) == (None, None)


def test_a_blank_frame_counts_for_the_loss():
    follower = StabilizedFollower(GivenTracks(), StabilizerConfig("off"), BOX, LossDetector())
    step = follower.advance(None)
    assert [follower.hold(step).lost for _ in range(3)] == [False, False, True]


def test_a_prediction_needs_the_motion():
    follower, _ = predictive(GivenTracks())
    with pytest.raises(ArgumentError, match="no motion given"):
        follower.advance(None)


def test_a_predicted_step_searches_around_the_prediction():
    tracker = GivenTracks()
    follower, _ = predictive(tracker)
    step = follower.advance(SHAKE)
    expected = map_box(SHAKE.cur_from_prev, BOX)
    assert step.motion is SHAKE
    assert step.predicted_xywh == step.search_xywh
    assert step.search_xywh[:2] == pytest.approx(expected[:2], abs=0.5)
    track = follower.locate(FRAME, step)
    assert tracker.searched == []
    assert track.box == pytest.approx(map_box(np.linalg.inv(step.stab_from_raw), BOX))
    assert track.score == 0.9
    assert track.motion is SHAKE
    assert track.stab_from_raw is step.stab_from_raw
    assert tracker.views[0].border == 20


def test_a_lost_target_is_shown_at_the_trackers_box_before_the_search():
    tracker = GivenTracks(Track(FAR, 0.1, corners=np.zeros((4, 2)), evidence=(1.0,)))
    follower, loss = predictive(tracker, losses=3)
    track = follower.locate(FRAME, follower.advance(STILL))
    assert track.lost
    assert (track.box, track.score, track.evidence) == (FAR, 0.1, (1.0,))
    assert track.corners is None
    assert track.motion is STILL
    assert loss.frames_lost == 4


@pytest.mark.parametrize(
    ("find", "score", "again"),
    [(True, 0.3, True), (True, 0.30001, False), (False, 0.1, False)],
)
def test_a_second_search_follows_a_score_that_is_not_above_the_limit(find, score, again):
    second = Track(FAR, 0.6)
    tracker = GivenTracks(Track(BOX, score), [second])
    tracker.reseek_below = 0.3
    follower, _ = predictive(tracker, find=find)
    track = follower.locate(FRAME, follower.advance(STILL))
    assert tracker.searched == ([BOX] if again else [])
    assert track.box == (FAR if again else BOX)


def test_a_tracker_that_cannot_seek_does_not_search_again():
    tracker = GivenTracks(Track(BOX, 0.0))
    tracker.can_seek, tracker.reseek_below = False, 1.0
    follower, _ = predictive(tracker)
    assert follower.locate(FRAME, follower.advance(STILL)).score == 0
    assert tracker.searched == []


@pytest.mark.parametrize(("second", "elsewhere"), [(0.1, True), (0.05, True), (0.11, False)])
def test_after_a_useless_second_search_the_next_one_is_at_the_prediction(second, elsewhere):
    tracker = GivenTracks(Track(BOX, 0.1), [Track(FAR, second), Track(BOX, 0.95)])
    tracker.reseek_below = 0.3
    follower, _ = predictive(tracker)
    first = follower.locate(FRAME, follower.advance(STILL))
    assert first.box == (BOX if elsewhere else FAR)
    tracker.found = Track(BOX, 0.94)
    step = follower.advance(STILL)
    track = follower.locate(FRAME, step)
    assert track.score == (0.95 if elsewhere else 0.94)
    assert tracker.searched[1:] == ([step.search_xywh] if elsewhere else [])
    count = len(tracker.searched)
    follower.locate(FRAME, follower.advance(STILL))  # once only
    assert len(tracker.searched) == count


@pytest.mark.parametrize(
    ("looks", "dx", "dy"),
    [
        (0, 0.0, 0.0),
        (1, 1.5, 0.0),
        (2, 0.0, 0.0),
        (3, -2.5, 0.0),
        (4, 0.0, 0.0),
        (5, 0.0, 3.5),
        (6, 0.0, 0.0),
        (7, 0.0, -4.0),
        (9, 4.0, 0.0),
    ],
)
def test_search_positions(looks, dx, dy):
    """Around the last box, at a distance that grows to four target sizes."""
    follower, _ = predictive(GivenTracks())
    follower._last_xywh = (10.0, 20.0, 20.0, 45.0)  # size 30
    follower._before_cut_xywh = (10.0, 20.0, 20.0, 45.0)
    expected = (10 + 30 * dx, 20 + 30 * dy, 20, 45)
    assert follower._search_box(looks) == pytest.approx(expected)


def test_every_fourth_search_is_in_the_scene_before_the_cut():
    follower, loss = predictive(GivenTracks())
    follower.advance(CUT)
    follower.advance(SHAKE)
    after = map_box(SHAKE.cur_from_prev, BOX)
    assert follower._last_xywh == pytest.approx(after)
    assert follower._search_box(26) == BOX
    assert follower._search_box(28) == pytest.approx(after)
    assert follower._search_box(30) == BOX
    loss.lost = True
    follower.advance(CUT)  # of a lost target: the scene before the first cut is kept
    assert follower._search_box(26) == BOX


def located(follower):
    return follower.locate(FRAME, follower.advance(STILL))


@pytest.mark.parametrize(("frames_lost", "sought"), [(24, False), (25, True)])
def test_the_search_starts_with_a_delay(frames_lost, sought):
    tracker = GivenTracks(Track(BOX, 0.1), [Track(BOX, 0.1), Track(FAR, 0.1)])
    follower, _ = predictive(tracker, losses=frames_lost)
    located(follower)
    assert bool(tracker.searched) is sought
    assert len(tracker.sought) == (1 if sought else 2)


def test_a_tracker_that_cannot_seek_is_not_searched_with():
    tracker = GivenTracks(Track(BOX, 0.1))
    tracker.can_seek = False
    follower, _ = predictive(tracker, losses=44)
    located(follower)
    assert tracker.searched == []


@pytest.mark.parametrize(
    ("first", "second", "chosen", "searches"),
    [
        pytest.param(0.26, 0.99, 0.26, 1, id="likely at the prediction"),
        pytest.param(0.25, 0.76, 0.76, 2, id="certain elsewhere"),
        pytest.param(0.25, 0.75, 0.25, 2, id="not certain elsewhere"),
        pytest.param(0.2, 0.1, 0.2, 2, id="neither"),
    ],
)
def test_a_lost_target_is_searched_at_two_positions(first, second, chosen, searches):
    tracker = GivenTracks(sought=[Track(BOX, first), Track(FAR, second)])
    follower, _ = predictive(tracker, losses=44)
    track = located(follower)
    assert len(tracker.searched) == searches
    assert track.score == chosen
    assert track.lost
    assert track.box == BOX  # that around the prediction, while the target is lost


def test_an_implausible_box_at_the_prediction_needs_a_high_score():
    for score, searches in ((0.75, 2), (0.76, 1)):
        tracker = GivenTracks(sought=[Track(FAR, score), Track(BOX, 0.8)])
        follower, _ = predictive(tracker, losses=44)
        for _ in range(2):
            follower._reachable.advance(STILL)
        located(follower)
        assert len(tracker.searched) == searches


def test_a_candidate_that_is_another_target_is_given_up():
    tracker = GivenTracks(sought=[Track(FAR, 0.9)])
    follower, _ = predictive(tracker, losses=44)
    follower._candidate_xywh = FAR
    follower._evidence.value = 0.5  # of the object that was compared last
    track = follower.locate(FRAME, follower.advance(STILL), [FAR])
    assert tracker.searched == [FAR]
    assert track.lost
    assert follower._candidate_xywh is None


@pytest.mark.parametrize(("score", "plausible"), [(0.75, False), (0.7501, True), (0.0, False)])
def test_certain_boxes_are_always_plausible(score, plausible):
    follower, _ = predictive(GivenTracks())
    for _ in range(2):
        follower._reachable.advance(STILL)
    assert follower._is_plausible(Track(FAR, score)) is plausible
    assert follower._is_plausible(Track(BOX, score))


def test_implausible_scores_do_not_redetect_a_target():
    tracker = GivenTracks(Track(FAR, 0.7))
    follower, loss = predictive(tracker, losses=1)
    for _ in range(2):
        follower._reachable.advance(STILL)
    for _ in range(10):
        assert located(follower).lost
    assert loss._running == 0
    tracker.found = Track(BOX, 0.7)
    assert [located(follower).lost for _ in range(3)] == [True, False, False]


def test_without_find_the_loss_is_not_decided():
    follower, loss = predictive(GivenTracks(Track(BOX, 0.0)), find=False)
    for _ in range(10):
        assert not located(follower).lost
    assert loss._running == 1
    follower.hold(follower.advance(STILL))
    assert loss._running == 1


@pytest.mark.parametrize(("score", "kept"), [(0.25, True), (0.2501, False)])
def test_only_likely_boxes_are_the_last_ones(score, kept):
    tracker = GivenTracks(Track(shifted(0.2), score))
    follower, _ = predictive(tracker)
    located(follower)
    assert follower._last_xywh == (BOX if kept else shifted(0.2))
    follower._reachable.advance(STILL)
    follower._reachable.advance(STILL)
    assert follower._reachable.contains(shifted(0.9)) is not kept


@pytest.mark.parametrize(("score", "moved"), [(0.5, False), (0.51, True)])
def test_a_search_moves_the_prediction_to_a_confident_box(score, moved):
    near = shifted(0.1)
    tracker = GivenTracks(sought=[Track(near, score), Track(near, score)])
    follower, _ = predictive(tracker, losses=44)
    assert located(follower).lost
    assert follower._is_redetected is moved
    assert follower._last_xywh == BOX
    assert follower.advance(STILL).search_xywh == pytest.approx(near)


def test_the_fallback_box_is_kept_if_the_other_is_not_confident():
    tracker = GivenTracks(sought=[Track(shifted(0.3), 0.1), Track(FAR, 0.2)])
    follower, _ = predictive(tracker, losses=44)
    assert located(follower).box == shifted(0.3)
    assert follower.advance(STILL).search_xywh == pytest.approx(shifted(0.3))


def test_a_redetected_target_is_tracked_and_not_searched():
    tracker = GivenTracks(Track(BOX, 0.9), [Track(BOX, 0.9)])
    follower, _ = predictive(tracker, losses=44)
    located(follower)
    assert len(tracker.searched) == 1
    assert located(follower).box == BOX
    assert len(tracker.searched) == 1


def held(follower, motion, count):
    """Tracks of blank frames."""
    return [follower.hold(follower.advance(motion)) for _ in range(count)]


def test_held_boxes_stay_in_the_scene():
    follower, _ = predictive(GivenTracks())
    located(follower)
    pan = Motion.from_transform(rigid(5, 3, 0), SIZE)
    tracks = held(follower, pan, 4)
    for count, track in enumerate(tracks, 1):
        assert track.box == pytest.approx((100 + 5 * count, 80 + 3 * count, 40, 40))
        assert track.score == 0
        assert track.motion is pan
        shown = map_box(track.stab_from_raw, track.box)
        assert shown[:2] == pytest.approx(BOX[:2], abs=1e-9)
    assert [track.lost for track in tracks] == [False, False, True, True]


def moving(score=0.9, step=10.0):
    """A follower of a target that moves to the right, and its tracker."""
    tracker = GivenTracks()
    follower, _ = predictive(tracker)
    for t in range(1, 16):
        tracker.found = Track((40.0 + step * t, 80.0, 40.0, 40.0), score)
        stepped = follower.advance(STILL)
        tracker.found = tracker.found.with_changes(
            box=map_box(stepped.stab_from_raw, tracker.found.box)
        )
        follower.locate(FRAME, stepped)
    return follower, tracker


def after_gap(sought, found_score=0.6, frames=6, found_box=(190.0, 80.0, 40.0, 40.0)):
    """The track after a gap, the boxes that were searched in raw pixels, and the follower."""
    follower, tracker = moving()
    held(follower, STILL, frames)
    step = follower.advance(STILL)
    to_view = step.stab_from_raw
    tracker.found = Track(map_box(to_view, found_box), found_score)
    tracker.sought = [Track(map_box(to_view, track.box), track.score) for track in sought]
    track = follower.locate(FRAME, step)
    raw_from_stab = np.linalg.inv(to_view)
    return track, [map_box(raw_from_stab, box) for box in tracker.searched], follower


AHEAD = (250.0, 80.0, 40.0, 40.0)


def test_after_a_gap_a_moving_target_is_also_searched_ahead():
    track, searched, follower = after_gap([Track(AHEAD, 0.9)], found_score=0.2)
    ((x, y, w, h),) = searched
    assert x == pytest.approx(200 + 10 * 6, abs=1)  # from the next predicted position
    assert (y, w, h) == pytest.approx((80, 40, 40))
    assert track.box == pytest.approx(AHEAD)
    assert not follower._tracker_is_elsewhere


@pytest.mark.parametrize(("found", "moved"), [(0.25, 0.25), (0.26, 0.25), (0.6, 0.2)])
def test_the_better_box_after_a_gap_is_chosen(found, moved):
    track, _, follower = after_gap([Track(AHEAD, moved)], found)
    if min(found, moved) < 0.25:
        assert track.box == pytest.approx((190, 80, 40, 40))
        assert track.score == max(found, moved)
        assert follower._tracker_is_elsewhere
    else:
        assert track.score == 0  # two similar objects


def test_two_boxes_of_one_object_are_not_ambiguous():
    """They are less than .7 target sizes apart."""
    near, apart = (190 + 27.9, 80.0, 40.0, 40.0), (190 + 28.1, 80.0, 40.0, 40.0)
    assert after_gap([Track(near, 0.9)])[0].score == 0.9
    assert after_gap([Track(near, 0.5)])[0].score == 0.6
    assert after_gap([Track(apart, 0.9)])[0].score == 0
    below = (190.0, 80 + 28.1, 40.0, 40.0)
    assert after_gap([Track(below, 0.9)])[0].score == 0


def test_after_a_short_gap_only_the_held_position_is_searched():
    track, searched, follower = after_gap([], frames=2)
    assert searched == []
    assert track.score == 0.6
    assert follower._gap_shift_xy is None


def test_a_slow_target_is_not_searched_ahead():
    """The distance is compared with .7 target sizes."""
    follower, tracker = moving()
    held(follower, STILL, 5)
    for shift, searches in (((27.9, 0.0), 0), ((28.1, 0.0), 1), ((0.0, -28.1), 1)):
        follower._gap_shift_xy = shift
        view = FrameView(FRAME)
        tracker.searched, tracker.sought = [], [Track(FAR, 0.1)]
        follower._after_gap(view, Track(BOX, 0.9), BOX, shift)
        assert len(tracker.searched) == searches
        x, y, w, h = BOX
        expected = [(x + shift[0], y + shift[1], w, h)] * searches
        np.testing.assert_allclose(
            np.reshape(tracker.searched, (-1, 4)), np.reshape(expected, (-1, 4))
        )


def test_a_tracker_that_cannot_seek_is_not_sent_ahead():
    follower, tracker = moving()
    tracker.can_seek = False
    held(follower, STILL, 6)
    located(follower)
    assert tracker.searched == []


def test_the_reach_is_that_of_the_targets_size():
    """The square root of the area, not a side."""
    follower, tracker = moving()
    held(follower, STILL, 5)
    tracker.sought = [Track(FAR, 0.1)] * 2
    wide = Track((100.0, 80.0, 160.0, 10.0), 0.9)  # size 40
    follower._after_gap(FrameView(FRAME), wide, BOX, (28.1, 0.0))
    assert len(tracker.searched) == 1
