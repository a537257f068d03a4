"""Keyframes and tracker runs between them become one track."""

import numpy as np
import pytest

from ssiam.errors import ArgumentError
from ssiam.exchange import Keyframe, Run, Section, blend, doubtful_frames, sections

COUNT = 41


def box(frame, size=1.0):
    """A target that moves to the right, and up and down; its size times `size`."""
    w, h = 40.0 * size, 30.0 * size
    return (100 + 3.0 * frame - w / 2, 80 + 20 * np.sin(frame / 5) - h / 2, w, h)


def truth():
    return np.array([box(frame) for frame in range(COUNT)])


def run(boxes, scores=None, lost=None):
    size = len(boxes)
    scores = np.full(size, 0.9) if scores is None else scores
    return Run(np.asarray(boxes, float), scores, np.zeros(size, bool) if lost is None else lost)


def biased(frames, size=0.8, shift=(4.0, -2.0)):
    """What a tracker sees whose boxes are too small and off their center."""
    return run([np.add(box(frame, size), (*shift, 0, 0)) for frame in frames])


def runs(section, make):
    ahead = {start: make(range(start, end + 1)) for start, end in section.forward_ends().items()}
    back = {
        start: make(range(start, end - 1, -1)) for start, end in section.backward_ends().items()
    }
    return ahead, back


def whole(*frames):
    (section,) = sections([Keyframe(frame, box(frame)) for frame in frames], 0, COUNT - 1)
    return section


@pytest.mark.parametrize("frames", [(0,), (20,), (0, 40), (7, 19, 33)])
def test_offset_and_size_of_a_tracker_are_corrected_in_all_frames(frames):
    section = whole(*frames)
    track = blend(section, *runs(section, biased))
    error = np.abs(track.boxes - truth())
    assert error.max() < 3  # of an offset of 4 px, and 8 px in width
    for frame in frames:
        assert track.boxes[frame] == pytest.approx(box(frame), abs=0)
        assert (track.scores[frame], track.lost[frame]) == (1.0, False)


def test_a_perfect_tracker_is_not_changed():
    section = whole(5, 30)
    track = blend(section, *runs(section, lambda frames: run([box(f) for f in frames])))
    assert track.boxes == pytest.approx(truth())
    assert np.isnan(track.agreement[:5]).all()
    assert track.agreement[5:30] == pytest.approx(1)


def test_a_run_that_has_not_arrived_is_left_out():
    """Forward jumps to another object in frame 10; backward is right."""
    section = whole(0, 40)
    ahead, back = runs(section, lambda frames: run([box(f) for f in frames]))
    ahead[0].boxes[10:, 0] += 200
    track = blend(section, ahead, back)
    assert np.abs(track.boxes - truth()).max() < 1e-6
    assert (track.backward_share == 1).all()
    doubts = doubtful_frames(section, track)
    assert doubts[0].reason.startswith("forward and backward disagree")
    assert all(10 <= each.frame < 40 for each in doubts)


def test_where_both_fail_each_counts_up_to_where_they_cross():
    """Forward is right up to frame 22, backward down to frame 18."""
    section = whole(0, 40)
    ahead, back = runs(section, lambda frames: run([box(f) for f in frames]))
    ahead[0].boxes[23:, 0] += 200
    back[40].boxes[23:, 0] -= 200  # frames 17 and before
    track = blend(section, ahead, back)
    assert np.abs(track.boxes - truth()).max() < 1


def test_where_both_fail_and_never_meet_boxes_are_on_straight_lines():
    """Both follow other objects from the first frame on."""
    section = whole(0, 20, 40)
    ahead, back = runs(section, lambda frames: run([box(f) for f in frames]))
    ahead[20].boxes[1:, 0] += 200
    back[40].boxes[1:, 0] -= 200
    track = blend(section, ahead, back)
    lines = np.stack(
        [np.interp(range(20, 41), (20, 40), side) for side in zip(box(20), box(40), strict=True)]
    )
    assert track.boxes[20:] == pytest.approx(lines.T)
    assert track.boxes[:20] == pytest.approx(truth()[:20])
    assert track.straight_share.tolist() == [0] * 20 + [1] * 21


def test_low_scores_between_keyframes_give_straight_lines():
    section = whole(5, 30)
    scores = np.array([0.1 if 10 <= f < 15 or f > 35 else 0.9 for f in range(COUNT)])
    track = blend(section, *runs(section, lambda f: run([box(i) for i in f], scores[list(f)])))
    lines = np.stack(
        [np.interp(range(COUNT), (5, 30), side) for side in zip(box(5), box(30), strict=True)]
    )
    assert track.boxes[10:15] == pytest.approx(lines.T[10:15])
    assert np.delete(track.boxes, range(10, 15), 0) == pytest.approx(
        np.delete(truth(), range(10, 15), 0)
    )


def test_an_unusual_box_changes_its_neighbors_and_not_the_whole_track():
    section = whole(0, 20, 40)
    odd = np.add(box(20), (0, -15, 0, 15))  # arms up, in this frame
    keyframes = tuple(
        Keyframe(20, tuple(odd)) if each.frame == 20 else each for each in section.keyframes
    )
    section = Section(0, 40, keyframes)
    track = blend(section, *runs(section, lambda frames: run([box(f) for f in frames])))
    growth = track.boxes[:, 3] - 30
    assert growth[20] == pytest.approx(15)
    assert growth[19] > growth[17] > growth[12] > -0.5
    assert growth[12] < 15 * 0.4


def test_absence_splits_a_clip_into_sections():
    given = [
        Keyframe(3, box(3)),
        Keyframe(12, None),
        Keyframe(25, box(25)),
        Keyframe(30, box(30)),
        Keyframe(36, None),
    ]
    first, second = sections(given, 0, 40)
    assert (first.first, first.last) == (0, 11)
    assert (second.first, second.last) == (25, 35)
    assert first.forward_ends() == {3: 11}
    assert first.backward_ends() == {3: 0}
    assert second.forward_ends() == {25: 30, 30: 35}
    assert second.backward_ends() == {25: 25, 30: 25}


def test_a_target_that_is_absent_at_first_begins_with_its_first_box():
    (section,) = sections([Keyframe(0, None), Keyframe(9, box(9))], 0, 40)
    assert (section.first, section.last) == (9, 40)


@pytest.mark.parametrize(
    ("frames", "message"),
    [((3, 3), "frame 3 has two keyframes"), ((50,), "frame 50 is outside of the frames 0 to 40")],
)
def test_impossible_keyframes_are_refused(frames, message):
    with pytest.raises(ArgumentError, match=message):
        sections([Keyframe(frame, box(frame)) for frame in frames], 0, 40)


def test_doubts_are_apart_and_never_on_keyframes():
    section = whole(0, 40)
    scores = np.where(np.arange(COUNT) % 2, 0.3, 0.2)
    lost = np.arange(COUNT) == 30
    ahead = {0: run(truth(), scores, lost), 40: run(truth()[40:])}
    back = {40: run(truth()[::-1], scores[::-1], lost[::-1]), 0: run(truth()[:1])}
    doubts = doubtful_frames(section, blend(section, ahead, back), target=2)
    assert (doubts[0].frame, doubts[0].reason, doubts[0].target) == (30, "lost", 2)
    frames = sorted(each.frame for each in doubts)
    assert frames[0] > 0
    assert frames[-1] < 40
    assert np.diff(frames).min() >= 5
