"""Trackers of other classes: what completes them, and how their errors are reported."""

import copy

import numpy as np
import pytest

import ssiam
from helpers.tracker_scenes import OPEN, SIZE, TARGET, distance, filmed, shaking_pan, target_box
from ssiam import FrameView, StabilizerConfig, Track
from ssiam.errors import ArgumentError, CopyError, TrackingError
from ssiam.track import Outline, PendingOutline
from ssiam.trackers.foreign import ForeignTracker, complete

FRAME = np.random.default_rng(1).integers(0, 256, (300, 400, 3)).astype(np.uint8)
VIEW = FrameView(FRAME)
BOX = (100.0, 80.0, 40.0, 30.0)


class Minimal:
    """Reports the first box; the two methods alone."""

    result = None

    def init(self, view, xywh):
        self.xywh = xywh

    def update(self, view):
        return Track(self.xywh, score=0.75) if self.result is None else self.result


class Seeking(Minimal):
    def seek(self, view, xywh):
        self.xywh = xywh
        return self.update(view)


class Correlating:
    """A real tracker of the two methods alone: normalized correlation around the last box."""

    def init(self, view, xywh):
        self.xywh, (_, _, w, h) = xywh, xywh
        self.template = view.crop(xywh, (round(w), round(h))).image

    def update(self, view):
        import cv2

        x, y, w, h = self.xywh
        width, height = round(w), round(h)
        crop = view.crop((x - w, y - h, 3 * w, 3 * h), (3 * width, 3 * height))
        scores = cv2.matchTemplate(crop.image, self.template, cv2.TM_CCOEFF_NORMED)
        _, score, _, (left, top) = cv2.minMaxLoc(scores)
        self.xywh = crop.box_in_view((left, top, width, height))
        return Track(self.xywh, score=min(max(score, 0.0), 1.0))


@pytest.mark.parametrize("stabilize", ["off", "paper", "predict"])
def test_two_methods_are_enough(stabilize):
    poses = shaking_pan(12)
    frames = [filmed(OPEN, pose) for pose in poses]
    tracker = ssiam.StabilizedTracker(Correlating(), StabilizerConfig(stabilize))
    tracker.init(frames[0], target_box(poses[0]))
    for frame, pose in zip(frames[1:], poses[1:], strict=True):
        assert distance(tracker.update(frame).box, target_box(pose)) < 0.2
    assert not tracker.score_is_calibrated


def test_without_seek_a_lost_target_is_not_searched():
    tracker = ssiam.StabilizedTracker(Minimal(), StabilizerConfig("predict"))
    frames = [filmed(OPEN, pose) for pose in shaking_pan(3)]
    tracker.init(frames[0], BOX)
    inner = tracker._tracker.tracker
    inner.result = Track(BOX, score=0.0)
    for _ in range(40):
        track = tracker.update(frames[1])
    assert track.lost
    assert not complete(Minimal()).can_seek
    assert complete(Seeking()).can_seek
    with pytest.raises(ArgumentError, match="Minimal cannot search around a given box"):
        ssiam.trackers.template_memory.TemplateMemoryTracker(Minimal())


def test_optional_members_have_defaults():
    class Declared(Seeking):
        can_seek, reseek_below, center_inset, score_is_calibrated = False, 0.3, 1.0, True

        def template_feature(self):
            return [[3, 4]]

    plain, declared = complete(Minimal()), complete(Declared())
    assert (plain.can_seek, plain.reseek_below, plain.center_inset) == (False, 0.0, 0.0)
    assert (declared.can_seek, declared.reseek_below, declared.center_inset) == (False, 0.3, 1.0)
    assert (plain.score_is_calibrated, declared.score_is_calibrated) == (False, True)
    assert (plain.has_template_feature, declared.has_template_feature) == (False, True)
    np.testing.assert_array_equal(declared.template_feature(), [3.0, 4.0])
    assert repr(ssiam.StabilizedTracker(Minimal(), StabilizerConfig("off"))).startswith(
        "StabilizedTracker(Minimal, "
    )


def test_the_packages_own_trackers_are_not_wrapped():
    tracker = ssiam.trackers.opencv.OpenCvTracker("kcf")
    assert complete(tracker) is tracker


def test_without_clone_the_class_is_called_again():
    tracker = ssiam.StabilizedTracker(Minimal(), StabilizerConfig("off"))
    group = ssiam.TrackerGroup(tracker)
    group.init(FRAME, [BOX, (10, 20, 30, 40)])
    assert [track.box for track in group.update(FRAME)] == [BOX, (10, 20, 30, 40)]


def test_a_class_that_cannot_be_called_again_says_so():
    class Needy(Minimal):
        def __init__(self, network):
            self.network = network

    tracker = ssiam.StabilizedTracker(Needy(1), StabilizerConfig("off"))
    tracker.init(FRAME, BOX)
    assert tracker.update(FRAME).box == BOX
    with pytest.raises(ArgumentError, match=r"a second Needy cannot be made.*no clone.*network"):
        tracker.clone()
    assert ForeignTracker(Needy(1), lambda: Needy(2)).clone().tracker.network == 2


def test_a_clone_must_be_another_tracker():
    class Same(Minimal):
        def clone(self):
            return self

    with pytest.raises(TrackingError, match=r"Same\.clone returned the tracker itself"):
        complete(Same()).clone()


@pytest.mark.parametrize("step", ["init", "update", "seek", "clone", "template_feature"])
@pytest.mark.parametrize(
    ("error", "kind"),
    [(ValueError("two\nlines"), TrackingError), (ArgumentError("too small"), ArgumentError)],
)
def test_what_a_tracker_raises_names_its_class(step, error, kind):
    class Failing(Seeking):
        def clone(self):
            return Failing()

        def template_feature(self):
            return [1.0]

    def fail(*arguments):
        raise error

    tracker = complete(Failing())
    tracker.init(VIEW, BOX)
    setattr(tracker.tracker, step, fail)
    arguments = {"init": (VIEW, BOX), "update": (VIEW,), "seek": (VIEW, BOX)}.get(step, ())
    with pytest.raises(kind, match=rf"^Failing\.{step} failed: .*(two lines|too small)$"):
        getattr(tracker, step)(*arguments)


def test_the_end_of_the_program_is_no_error_of_the_tracker():
    class Leaving(Minimal):
        def update(self, view):
            raise KeyboardInterrupt

    tracker = complete(Leaving())
    tracker.init(VIEW, BOX)
    with pytest.raises(KeyboardInterrupt):
        tracker.update(VIEW)


WRONG = {
    "nothing": ((), "returned None|returned \\(\\)"),
    "a box": (BOX, "return ssiam.Track"),
    "nan": (Track((1, 2, np.nan, 4), 0.5), "the box"),
    "three numbers": (Track((1, 2, 3), 0.5), "the box"),
    "text": (Track("abcd", 0.5), "the box 'abcd'"),
    "empty": (Track((1, 2, 0, 4), 0.5), "width and height above 0"),
    "score above 1": (Track(BOX, 1.5), "the score 1.5: return 0 to 1"),
    "score nan": (Track(BOX, float("nan")), "the score nan"),
    "score of two": (Track(BOX, (0.5, 0.5)), "the score"),
    "score None": (Track(BOX, None), "the score None"),
    "corners": (Track(BOX, 0.5, corners=np.zeros((3, 2))), "the corners"),
    "corners nan": (Track(BOX, 0.5, corners=np.full((4, 2), np.nan)), "four points"),
    "mask of another size": (Track(BOX, 0.5, mask=np.zeros((3, 4), bool)), r"bool \(300, 400\)"),
    "mask of bytes": (Track(BOX, 0.5, mask=np.zeros((300, 400), np.uint8)), "a mask of uint8"),
    "mask as a list": (Track(BOX, 0.5, mask=[[True]]), "a mask of list"),
}


@pytest.mark.parametrize(("result", "message"), WRONG.values(), ids=WRONG.keys())
def test_a_wrong_result_is_one_error_that_names_the_class(result, message):
    tracker = ssiam.StabilizedTracker(Minimal(), StabilizerConfig("off"))
    tracker.init(FRAME, BOX)
    tracker._tracker.tracker.result = result
    with pytest.raises(TrackingError, match=message) as raised:
        tracker.update(FRAME)
    assert "Minimal.update returned" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_numbers_of_numpy_become_floats():
    tracker = complete(Minimal())
    tracker.init(VIEW, BOX)
    tracker.tracker.result = Track(np.array([1, 2, 3, 4]), np.float32(0.5), evidence=(1.0,))
    track = tracker.update(VIEW)
    assert track.box == (1.0, 2.0, 3.0, 4.0)
    assert [type(number) for number in (*track.box, track.score)] == [float] * 5
    assert track.evidence == (1.0,)


def test_a_pending_mask_is_checked_when_it_is_read():
    calls = []

    def computed(mask):
        calls.append(mask)
        return Outline(None, mask)

    tracker = complete(Minimal())
    tracker.init(VIEW, BOX)
    for mask in (np.zeros((300, 400), bool), np.zeros((3, 4), bool)):
        outline = PendingOutline(lambda mask=mask: computed(mask))
        tracker.tracker.result = Track(BOX, 0.5, corners=outline, mask=outline)
        track = tracker.update(VIEW)
        assert not calls
        if mask.shape == (300, 400):
            assert track.mask is mask
            calls.clear()
        else:
            with pytest.raises(TrackingError, match=r"Minimal\.update returned a mask of bool"):
                _ = track.mask


def test_a_copy_is_independent_and_one_that_is_impossible_says_so():
    class Locked(Minimal):
        def __deepcopy__(self, memo):
            raise RuntimeError("holds a device")

    tracker = complete(Minimal())
    tracker.init(VIEW, BOX)
    copied = copy.deepcopy(tracker)
    tracker.init(VIEW, (1, 2, 3, 4))
    assert copied.update(VIEW).box == BOX
    with pytest.raises(CopyError, match="Locked cannot be copied: RuntimeError: holds a device"):
        copy.copy(complete(Locked()))


@pytest.mark.parametrize(
    ("tracker", "message"),
    [
        (Minimal, r"tracker is the class Minimal: give Minimal\(\)"),
        ("lite", "str is not a tracker: it has no init"),
        (None, "NoneType is not a tracker"),
    ],
)
def test_what_is_no_tracker_is_refused(tracker, message):
    with pytest.raises(ArgumentError, match=message):
        ssiam.StabilizedTracker(tracker, StabilizerConfig("off"))


def test_a_number_that_is_none_is_refused():
    class Odd(Seeking):
        reseek_below = "low"

    with pytest.raises(ArgumentError, match=r"Odd\.reseek_below is 'low': give a number"):
        _ = complete(Odd()).reseek_below


def test_a_memory_of_templates_works_around_any_tracker():
    class Cloned(Seeking):
        def clone(self):
            return Cloned()

    frame = filmed(OPEN, shaking_pan(1)[0])
    memory = ssiam.trackers.template_memory.TemplateMemoryTracker(Cloned())
    memory.init(FrameView(frame), TARGET)
    assert memory.update(FrameView(frame)).score == 0.75
    assert frame.shape[1::-1] == SIZE
